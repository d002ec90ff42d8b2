//! Compiling for other systems: cargo-zigbuild links for all of them.

use crate::platform::Platform;
use anyhow::{Result, bail};
use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Stdio};

/// The program that is cargo with a linker for every system.
pub const ZIGBUILD: &str = "cargo-zigbuild";

/// The linker for Windows that Debian and others have.
const MINGW: &str = "x86_64-w64-mingw32-gcc";

/// What `--all-targets` compiles for.
pub const TARGETS: [&str; 5] = [
    "x86_64-unknown-linux-gnu",
    "aarch64-unknown-linux-gnu",
    "x86_64-pc-windows-gnu",
    "x86_64-apple-darwin",
    "aarch64-apple-darwin",
];

/// The oldest glibc that libraries for Linux ask for: that of Enterprise Linux 7 and of everything since.
pub const GLIBC: &str = "2.17";

/// Fails with all that is missing to compile for these targets, and where to get it; only `all` of them need
/// cargo-zigbuild, as cargo's configuration may have a linker for one.
pub fn check_targets(targets: &[String], all: bool) -> Result<()> {
    let mut missing = Vec::new();
    for target in targets.iter().filter(|target| !has_std(target)) {
        missing.push(format!("Rust's library for {target}: rustup target add {target}"));
    }
    if all && !runs(ZIGBUILD) {
        missing.push(
            "cargo-zigbuild, which links for other systems: pip install cargo-zigbuild (brings zig), or \
             cargo install cargo-zigbuild (and zig from ziglang.org)"
                .to_owned(),
        );
    }
    if !missing.is_empty() {
        bail!("to compile for other systems, there is still to be installed:\n  {}", missing.join("\n  "));
    }
    Ok(())
}

/// The cargo that compiles for this target, and how it writes the target.
///
/// What cargo can link by itself, as its configuration may say, is left to it where there is no cargo-zigbuild.
pub fn rustc_for(target: Option<&str>) -> (OsString, Option<String>) {
    match target.filter(|target| needs_zigbuild(target) && runs(ZIGBUILD)) {
        Some(target) if target.contains("-linux-gnu") => (ZIGBUILD.into(), Some(format!("{target}.{GLIBC}"))),
        Some(target) => (ZIGBUILD.into(), Some(target.to_owned())),
        // Inside `cargo run` this names the cargo that is running.
        None => (std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()), target.map(str::to_owned)),
    }
}

/// For another system or processor than this machine's, or for an old glibc; but for what every compiler can make, and
/// where MinGW is, whose libraries ask for less of Windows.
fn needs_zigbuild(target: &str) -> bool {
    match target {
        "x86_64-pc-windows-gnu" => !runs(MINGW),
        _ if target.starts_with("wasm") => false,
        _ if target.contains("-linux-gnu") => true,
        _ => Platform::host().ok() != Platform::of_target(target).ok(),
    }
}

/// Whether the compiler has the standard library of a target. Where that cannot be asked, cargo will say it.
pub fn has_std(target: &str) -> bool {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let asked = Command::new(rustc).args(["--print", "target-libdir", "--target", target]).output();
    let Ok(asked) = asked else { return true };
    let folder = String::from_utf8_lossy(&asked.stdout).trim().to_owned();
    asked.status.success()
        && Path::new(&folder).read_dir().is_ok_and(|files| {
            files.flatten().any(|file| file.file_name().to_string_lossy().starts_with("libstd-"))
        })
}

fn runs(program: &str) -> bool {
    let mut command = Command::new(program);
    let status = command.arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

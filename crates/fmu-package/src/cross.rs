//! Compiling for other systems: cargo-zigbuild links for all of them.

use crate::packages::cargo;
use crate::platform::Platform;
use anyhow::{Result, bail};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A wrapper for cargo that brings a linker for every system.
pub const ZIGBUILD: &str = "cargo-zigbuild";

/// The MinGW linker for Windows, which Linux distributions such as Debian offer.
const MINGW: &str = "x86_64-w64-mingw32-gcc";

/// The targets of `--all-targets`.
pub const TARGETS: [&str; 5] = [
    "x86_64-unknown-linux-gnu",
    "aarch64-unknown-linux-gnu",
    "x86_64-pc-windows-gnu",
    "x86_64-apple-darwin",
    "aarch64-apple-darwin",
];

/// The glibc version that libraries for Linux require if cargo-zigbuild links them. Enterprise Linux 7 has this version, and later systems
/// have newer ones.
pub const GLIBC: &str = "2.17";

/// Checks that the tools for these targets are installed; the error lists all missing tools and how to install them, before anything
/// is compiled. cargo-zigbuild is required only with `all`, because a single target may have another linker.
pub fn check_targets(targets: &[String], all: bool) -> Result<()> {
    let mut missing = Vec::new();
    for target in targets {
        if !has_std(target) {
            missing.push(format!("Rust's library for {target}: rustup target add {target}"));
        }
        if !all
            && target.ends_with("-windows-gnu")
            && needs_zigbuild(target)
            && !runs(ZIGBUILD)
            && !has_linker(target)
        {
            missing.push(format!(
                "a linker for {target}: pip install {ZIGBUILD} (brings zig), or MinGW (on Debian: apt install gcc-mingw-w64)"
            ));
        }
    }
    if all && !runs(ZIGBUILD) {
        missing.push(
            "cargo-zigbuild, which links for other systems: pip install cargo-zigbuild (brings zig), or \
             cargo install cargo-zigbuild (and zig from ziglang.org)"
                .to_owned(),
        );
    }
    if !missing.is_empty() {
        bail!("to compile for other systems, install:\n  {}", missing.join("\n  "));
    }
    Ok(())
}

/// Returns the program that compiles for this target, and the name by which it calls the target.
///
/// The program is cargo-zigbuild if the target needs it and it is installed. Otherwise it is cargo, whose configuration may have a
/// linker for the target.
pub fn rustc_for(target: Option<&str>) -> (OsString, Option<String>) {
    match target.filter(|target| needs_zigbuild(target) && runs(ZIGBUILD)) {
        Some(target) if target.contains("-linux-gnu") => (ZIGBUILD.into(), Some(format!("{target}.{GLIBC}"))),
        Some(target) => (ZIGBUILD.into(), Some(target.to_owned())),
        None => (cargo(), target.map(str::to_owned)),
    }
}

/// Whether a target needs cargo-zigbuild to link for another system or processor, or with an old glibc. WebAssembly does not need it.
/// `x86_64-pc-windows-gnu` needs it only if MinGW is missing, which is preferred because the libraries that it links need less of the
/// system.
fn needs_zigbuild(target: &str) -> bool {
    match target {
        "x86_64-pc-windows-gnu" => !runs(MINGW),
        _ if target.starts_with("wasm") => false,
        _ if target.contains("-linux-gnu") => true,
        _ => Platform::host().ok() != Platform::of_target(target).ok(),
    }
}

/// Whether the user has named a linker for a target, in an environment variable or in a configuration file of cargo.
fn has_linker(target: &str) -> bool {
    let variable = format!("CARGO_TARGET_{}_LINKER", target.to_uppercase().replace('-', "_"));
    let current = std::env::current_dir().unwrap_or_default();
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| std::env::home_dir().map(|home| home.join(".cargo")));
    let directories = current.ancestors().map(|directory| directory.join(".cargo")).chain(home);
    let mut files =
        directories.flat_map(|directory| ["config.toml", "config"].map(|name| directory.join(name)));
    std::env::var_os(variable).is_some()
        || files.any(|file| std::fs::read_to_string(file).is_ok_and(|text| text.contains(target)))
}

/// Whether the compiler has the standard library of a target. Returns true if the compiler cannot be started, because cargo then reports
/// why.
pub fn has_std(target: &str) -> bool {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc).args(["--print", "target-libdir", "--target", target]).output();
    let Ok(output) = output else { return true };
    let directory = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    output.status.success()
        && Path::new(&directory).read_dir().is_ok_and(|files| {
            files.flatten().any(|file| file.file_name().to_string_lossy().starts_with("libstd-"))
        })
}

fn runs(program: &str) -> bool {
    let mut command = Command::new(program);
    let status = command.arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

//! Compiles a model's library with cargo.

use crate::c_sources::WEBASSEMBLY;
use crate::cross::{ZIGBUILD, rustc_for};
use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The cargo profile of every library, so that users always get an optimized one.
pub const PROFILE: &str = "release";

/// The settings of a cargo run that compiles the shared library of a package.
#[derive(Clone, Debug)]
pub struct LibraryBuild<'a> {
    /// The directory with the `Cargo.toml` of the package or its workspace.
    pub directory: PathBuf,
    /// The package.
    pub package: &'a str,
    /// The target; `None` for this machine.
    pub target: Option<&'a str>,
    /// Values for cargo's option `--config`, such as `profile.release.lto=false`.
    pub settings: Vec<String>,
    /// Arguments for the compiler.
    pub arguments: &'a [&'a str],
}

impl LibraryBuild<'_> {
    /// Runs cargo, which shows its progress, and returns the path of the library.
    ///
    /// The package is built without its default features and with exactly the versions in `Cargo.lock`.
    ///
    /// # Errors
    /// When cargo cannot be started or fails, or the package has no shared library.
    pub fn run(&self) -> Result<PathBuf> {
        let (cargo, target) = rustc_for(self.target);
        let mut command = Command::new(&cargo);
        command
            // Only cdylib, because cargo skips link-time optimization for a package that also has the crate type rlib.
            .args(["rustc", "--lib", "--crate-type", "cdylib", "--locked", "--no-default-features"])
            .args(["--message-format", "json-render-diagnostics"])
            .args(["--profile", PROFILE, "--package", self.package])
            .current_dir(&self.directory)
            .stdin(Stdio::null())
            .stdout(Stdio::piped());
        if let Some(target) = &target {
            command.args(["--target", target]);
        }
        if self.target == Some(WEBASSEMBLY) {
            command.args(["--config", &remap_standard_library(&self.directory)?]);
        }
        // The library needs no debug information, but cargo-zigbuild cannot strip libraries for macOS.
        if cargo == ZIGBUILD {
            let strip = !target.is_some_and(|target| target.contains("-apple-"));
            command.env(format!("CARGO_PROFILE_{}_STRIP", PROFILE.to_uppercase()), strip.to_string());
        }
        for setting in &self.settings {
            command.args(["--config", setting]);
        }
        if !self.arguments.is_empty() {
            command.arg("--").args(self.arguments);
        }
        let mut child =
            command.spawn().with_context(|| format!("cannot start cargo ({})", cargo.to_string_lossy()))?;
        let stdout = child.stdout.take().context("cargo has no output")?;
        let mut library = None;
        for line in BufReader::new(stdout).lines() {
            let line = line.context("cannot read the output of cargo")?;
            // A dependency may be a shared library, too; the package itself comes last.
            library = library_in(&line).or(library);
        }
        let status = child.wait().context("cannot wait for cargo")?;
        if !status.success() {
            let Some(target) = self.target else {
                bail!("cargo could not build the library of {}; its messages are above", self.package)
            };
            bail!(
                "cargo could not build the library of {} for {target}; its messages are above (if the linker is \
                 missing, {ZIGBUILD} has one for every system: pip install {ZIGBUILD})",
                self.package
            );
        }
        library.with_context(|| {
            format!("{} has no shared library: crate-type must contain cdylib", self.package)
        })
    }
}

/// Returns the cargo configuration that gives the sources of the standard library the same paths on every machine. Without it, a
/// module contains the path of rustup's directory if the component rust-src is installed.
fn remap_standard_library(directory: &Path) -> Result<String> {
    let output = |arguments: &[&str]| {
        let done = Command::new("rustc").args(arguments).current_dir(directory).output();
        done.context("cannot start rustc").map(|done| String::from_utf8_lossy(&done.stdout).into_owned())
    };
    let version = output(&["-vV"])?;
    let hash = version.lines().find_map(|line| line.strip_prefix("commit-hash: ")).unwrap_or("unknown");
    let sysroot = output(&["--print", "sysroot"])?;
    let sources = Path::new(sysroot.trim()).join("lib/rustlib/src/rust");
    let flag = format!("--remap-path-prefix={}=/rustc/{hash}", sources.display());
    Ok(format!("target.{WEBASSEMBLY}.rustflags=[{}]", Value::from(flag)))
}

/// Returns the shared library that this line of cargo's JSON reports, if any.
fn library_in(line: &str) -> Option<PathBuf> {
    let message: Value = serde_json::from_str(line).ok()?;
    if message["reason"] != "compiler-artifact" {
        return None;
    }
    let is_library = |path: &PathBuf| {
        path.extension().is_some_and(|e| e == "so" || e == "dll" || e == "dylib" || e == "wasm")
    };
    message["target"]["crate_types"].as_array()?.iter().find(|kind| *kind == "cdylib")?;
    message["filenames"].as_array()?.iter().filter_map(Value::as_str).map(PathBuf::from).find(is_library)
}

#[cfg(test)]
mod tests {
    use super::library_in;

    #[test]
    fn the_library_is_found_in_the_output_of_cargo() {
        let line = |kind: &str| {
            format!(
                r#"{{"reason":"compiler-artifact","target":{{"name":"m","crate_types":["{kind}","rlib"]}},
                    "filenames":["/t/libm.rlib","/t/libm.so"]}}"#
            )
        };
        assert_eq!(library_in(&line("cdylib")), Some("/t/libm.so".into()));
        assert_eq!(library_in(&line("proc-macro")), None);
        assert_eq!(library_in("warning: no JSON"), None);
    }
}

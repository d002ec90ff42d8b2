//! Builds the FMUs of a model.

use crate::project::Project;
use anyhow::{Context, Result};
use fmu_package::{BuildOptions, Builder, cargo, pass_checker};
use std::env;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The purpose of an FMU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Purpose {
    /// For users: the library is compiled with the author's profile `release`.
    Release,
    /// For a check that follows, which finds more than the check of a build.
    Check,
    /// For the author: the library is compiled with settings for a short compile time.
    Development,
}

impl Purpose {
    /// Returns this program if it must check the FMUs before they get their names.
    fn checker(self) -> Result<Option<PathBuf>> {
        (self == Self::Release).then(env::current_exe).transpose().context("cannot find this program")
    }
}

/// Cargo settings for a short compile time, with errors for integers that overflow.
const FAST: [&str; 3] = [
    "profile.release.lto=\"off\"",
    "profile.release.incremental=true",
    "profile.release.overflow-checks=true",
];

/// Builds the FMUs in the directory `options.out`, by default in `target/fmu` of the workspace. If the package has its own build
/// program, starts it with `arguments` instead. If that program fails, returns false instead of an error, because the program has
/// printed the reason.
pub fn build(
    project: &Project,
    options: &BuildOptions,
    purpose: Purpose,
    arguments: &[OsString],
) -> Result<bool> {
    if let Some(name) = &project.own_builder {
        let mut command = Command::new(cargo());
        command.args(["run", "--quiet", "--package", &project.name, "--bin", name]);
        command.arg("--manifest-path").arg(project.directory.join("Cargo.toml")).arg("--").args(arguments);
        if let Some(checker) = purpose.checker()? {
            pass_checker(&mut command, &checker);
        }
        let status = command.status().context("cannot start cargo")?;
        return Ok(status.success());
    }
    let builder = Builder {
        command: "cargo fmu build",
        settings: if purpose == Purpose::Development { FAST.map(str::to_owned).to_vec() } else { Vec::new() },
        checker: purpose.checker()?,
        ..Builder::new(&project.name, &project.directory)
    };
    builder.run(options)?;
    Ok(true)
}

/// Returns the arguments after `fmu build`, except those that name the package.
pub fn arguments_of_build() -> Vec<OsString> {
    let mut arguments = env::args_os().skip_while(|argument| argument != "build").skip(1);
    let mut kept = Vec::new();
    while let Some(argument) = arguments.next() {
        match argument.to_str() {
            Some("--package" | "-p" | "--manifest-path") => drop(arguments.next()),
            Some(option)
                if ["--package=", "-p", "--manifest-path="].iter().any(|name| option.starts_with(name)) => {}
            // The options of the package's own build program follow.
            Some("--") => return kept.into_iter().chain(arguments).collect(),
            _ => kept.push(argument),
        }
    }
    kept
}

/// Returns the clone of this project that contains this program, or else the clone in which it was compiled, if that still exists. The
/// two differ if a clone was copied together with its directory `target`, and then the copy must not use the original.
pub fn own_clone() -> Option<PathBuf> {
    let program = env::current_exe().unwrap_or_default();
    let mut directories = program.ancestors().chain(Path::new(env!("CARGO_MANIFEST_DIR")).ancestors());
    directories.find(|directory| directory.join("crates/fmu-export/Cargo.toml").is_file()).map(Path::to_owned)
}

/// Returns the content of the `Cargo.lock` that this command was tested with. It is empty if there is no clone.
pub fn tested_lock() -> String {
    own_clone().and_then(|root| fs::read_to_string(root.join("Cargo.lock")).ok()).unwrap_or_default()
}

/// Writes a file unless it is up to date, so that cargo does not see a changed file.
pub fn write(path: &Path, text: &str) -> Result<()> {
    if fs::read_to_string(path).ok().as_deref() == Some(text) {
        return Ok(());
    }
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

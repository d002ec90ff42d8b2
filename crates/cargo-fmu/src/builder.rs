//! Makes the FMUs of a model.

use crate::project::Project;
use anyhow::{Context, Result};
use fmu_package::{BuildOptions, Builder};
use std::env;
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::Command;

/// The purpose of an FMU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Purpose {
    /// To be shipped: the library is compiled as the author's profile `release` says.
    Use,
    /// To be looked at, and changed again: the library is compiled soon.
    Trial,
}

/// Settings with which a library is soon compiled again.
const SOON: [&str; 2] = ["profile.release.lto=\"off\"", "profile.release.incremental=true"];

/// Makes the FMUs in the folder `target/fmu` of the workspace, or where the options say. A package with its own program for
/// it gets the `words` of the options instead; tells whether that succeeded. If not, it has said why.
pub fn build(
    project: &Project,
    options: &BuildOptions,
    purpose: Purpose,
    words: &[OsString],
) -> Result<bool> {
    if let Some(name) = &project.own_builder {
        let mut command = Command::new(cargo());
        command.args(["run", "--quiet", "--release", "--package", &project.name, "--bin", name]);
        command.arg("--manifest-path").arg(project.folder.join("Cargo.toml")).arg("--").args(words);
        let status = command.status().context("cannot start cargo")?;
        return Ok(status.success());
    }
    let builder = Builder {
        command: "cargo fmu build",
        settings: if purpose == Purpose::Trial { SOON.to_vec() } else { Vec::new() },
        ..Builder::new(&project.name, &project.folder)
    };
    builder.run(options)?;
    Ok(true)
}

/// The words that this program was started with behind `fmu build`, but for those that say where the package is.
pub fn words_of_build() -> Vec<OsString> {
    let mut words = env::args_os().skip_while(|word| word != "build").skip(1);
    let mut kept = Vec::new();
    while let Some(word) = words.next() {
        match word.to_str() {
            Some("--package" | "-p" | "--manifest-path") => drop(words.next()),
            Some(text)
                if ["--package=", "-p", "--manifest-path="].iter().any(|name| text.starts_with(name)) => {}
            // Options of its own stand behind it.
            Some("--") => return kept.into_iter().chain(words).collect(),
            _ => kept.push(word),
        }
    }
    kept
}

/// The cargo that has started this program.
pub fn cargo() -> OsString {
    env::var_os("CARGO").unwrap_or_else(|| "cargo".into())
}

/// The versions of other packages that this command was tested with, where it comes from a clone.
pub fn tested() -> String {
    let lock = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).map(|root| root.join("Cargo.lock"));
    lock.and_then(|lock| fs::read_to_string(lock).ok()).unwrap_or_default()
}

/// A file that is right already stays untouched, so that cargo sees no change.
pub fn write(path: &Path, text: &str) -> Result<()> {
    if fs::read_to_string(path).ok().as_deref() == Some(text) {
        return Ok(());
    }
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

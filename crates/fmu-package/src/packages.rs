//! Finds packages and their workspaces with `cargo metadata`.

use anyhow::{Context, Result, ensure};
use serde_json::Value;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Returns the directory of a package in the workspace of the current directory. If cargo has started this program with
/// `--manifest-path`, the workspace of that file is used.
///
/// The directory is not compiled into the program, because then a copy of a workspace would build in the original.
///
/// # Errors
/// When there is no such package, or cargo cannot be started.
pub fn directory_of(package: &str) -> Result<PathBuf> {
    let current = std::env::current_dir().context("there is no current directory")?;
    let directory = std::env::var_os("CARGO_MANIFEST_DIR").map_or(current, PathBuf::from);
    let manifest =
        directory.ancestors().map(|directory| directory.join("Cargo.toml")).find(|path| path.is_file());
    let outside =
        || format!("{} is not in the project of {package}; change to its directory", directory.display());
    let metadata = without_dependencies(&manifest.with_context(outside)?).with_context(outside)?;
    let packages = metadata["packages"].as_array().map_or(&[][..], Vec::as_slice);
    let manifest = packages
        .iter()
        .find(|other| other["name"] == package)
        .and_then(|found| found["manifest_path"].as_str());
    let directory = manifest.and_then(|manifest| Path::new(manifest).parent()).with_context(outside)?;
    Ok(directory.to_owned())
}

/// Returns the directory of the workspace to which the package in this directory belongs; the package's own directory if there is none.
///
/// # Errors
/// When there is no package, or cargo cannot be started.
pub fn workspace(directory: &Path) -> Result<PathBuf> {
    let failed = || format!("cannot find the workspace of {}", directory.display());
    let manifest = directory.join("Cargo.toml");
    let metadata = without_dependencies(&manifest).with_context(failed)?;
    metadata["workspace_root"].as_str().map(PathBuf::from).with_context(failed)
}

/// Returns the metadata of a workspace, without its dependencies.
fn without_dependencies(manifest: &Path) -> Result<Value> {
    let arguments = ["--no-deps", "--offline", "--manifest-path"].map(OsStr::new);
    metadata(arguments.into_iter().chain([manifest.as_os_str()]))
}

/// Returns the cargo that has started this program, or the cargo of the system.
pub fn cargo() -> OsString {
    std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())
}

/// Returns the output of `cargo metadata` with these arguments.
///
/// # Errors
/// When cargo cannot be started or fails; the message is one line.
pub fn metadata(arguments: impl IntoIterator<Item: AsRef<OsStr>>) -> Result<Value> {
    let cargo = cargo();
    let mut command = Command::new(&cargo);
    command.args(["metadata", "--format-version", "1"]).args(arguments).stdin(Stdio::null());
    let output = command.output().with_context(|| format!("cannot start {}", cargo.to_string_lossy()))?;
    let errors = String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
    ensure!(output.status.success(), "{}", errors.trim_start_matches("error: "));
    serde_json::from_slice(&output.stdout).context("cargo metadata returns no JSON")
}

#[cfg(test)]
mod tests {
    use super::workspace;
    use std::fs;

    /// The workspace of a package is its own directory, unless it is a member of a workspace above.
    #[test]
    fn the_workspace_of_a_member_is_found() {
        let directory = tempfile::tempdir().unwrap();
        let model = directory.path().join("models/model");
        fs::create_dir_all(model.join("src")).unwrap();
        fs::write(model.join("src/lib.rs"), "").unwrap();
        fs::write(model.join("Cargo.toml"), "[package]\nname = \"model\"\n").unwrap();
        let workspace = || workspace(&model).unwrap();
        assert_eq!(workspace(), model);
        fs::write(directory.path().join("Cargo.toml"), "[workspace]\nmembers = [\"models/*\"]\n").unwrap();
        assert_eq!(workspace(), directory.path());
    }
}

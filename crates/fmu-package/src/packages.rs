//! Finds the packages that a package uses by path, with `cargo metadata`.

use anyhow::{Context, Result, ensure};
use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A package that is used by path.
#[derive(Clone, Debug)]
pub(crate) struct LocalPackage {
    pub name: String,
    pub directory: PathBuf,
    /// The directory of the library's sources, and the build script.
    pub code: Vec<PathBuf>,
    dependencies: Vec<PathBuf>,
    workspace: PathBuf,
}

/// The workspace of a package, and the packages that it uses by path.
#[derive(Clone, Debug)]
pub(crate) struct Neighbourhood {
    /// The directory of the workspace, or of the package if there is none.
    pub workspace: PathBuf,
    /// The packages that this one uses by path, directly or indirectly, except development dependencies; sorted by name.
    pub used: Vec<LocalPackage>,
}

impl Neighbourhood {
    /// Returns the workspace of the package in this directory, and the packages that it uses by path.
    pub fn of(directory: &Path) -> Result<Self> {
        let mut known = BTreeMap::new();
        let own = find(&mut known, directory)?;
        let mut used: Vec<LocalPackage> = Vec::new();
        let mut pending = own.dependencies;
        while let Some(directory) = pending.pop() {
            if directory != own.directory && used.iter().all(|package| package.directory != directory) {
                let package = find(&mut known, &directory)?;
                pending.extend(package.dependencies.iter().cloned());
                used.push(package);
            }
        }
        used.sort_by(|a, b| (&a.name, &a.directory).cmp(&(&b.name, &b.directory)));
        Ok(Self { workspace: own.workspace, used })
    }
}

/// Returns the package in this directory. A call of cargo describes all packages of a workspace, so they are all added to `known`.
fn find(known: &mut BTreeMap<PathBuf, LocalPackage>, directory: &Path) -> Result<LocalPackage> {
    if !known.contains_key(directory) {
        let failed = || format!("cannot find the packages that {} uses", directory.display());
        let manifest = directory.join("Cargo.toml");
        let arguments = ["--no-deps", "--offline", "--manifest-path"].map(OsStr::new);
        let metadata = metadata(arguments.into_iter().chain([manifest.as_os_str()]));
        let packages = metadata.and_then(|metadata| packages(&metadata)).with_context(failed)?;
        known.extend(packages.into_iter().map(|package| (package.directory.clone(), package)));
    }
    known.get(directory).cloned().with_context(|| format!("{} is not a package", directory.display()))
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

fn packages(metadata: &Value) -> Result<Vec<LocalPackage>> {
    let path = |value: &Value| value.as_str().map(PathBuf::from);
    let workspace = path(&metadata["workspace_root"]).context("cargo names no workspace")?;
    let package = |package: &Value| {
        let directory = path(&package["manifest_path"])?.parent()?.to_owned();
        let mut code = Vec::new();
        for target in package["targets"].as_array()? {
            let source = path(&target["src_path"])?;
            match target["kind"].as_array()?.first()?.as_str()? {
                "custom-build" => code.push(source),
                "bin" | "test" | "bench" | "example" => {}
                _library => code.push(source.parent()?.to_owned()),
            }
        }
        let used = |dependency: &&Value| dependency["kind"] != "dev";
        let dependencies = package["dependencies"].as_array()?.iter().filter(used);
        Some(LocalPackage {
            name: package["name"].as_str()?.to_owned(),
            code,
            dependencies: dependencies.filter_map(|dependency| path(&dependency["path"])).collect(),
            workspace: workspace.clone(),
            directory,
        })
    };
    let packages = metadata["packages"].as_array().context("cargo names no packages")?;
    packages.iter().map(|value| package(value).context("cargo metadata has an unknown format")).collect()
}

#[cfg(test)]
mod tests {
    use super::Neighbourhood;
    use std::fs;

    /// The workspace of a package is its own directory, unless it is a member of a workspace above.
    #[test]
    fn the_workspace_of_a_member_is_found() {
        let directory = tempfile::tempdir().unwrap();
        let model = directory.path().join("models/model");
        fs::create_dir_all(model.join("src")).unwrap();
        fs::write(model.join("src/lib.rs"), "").unwrap();
        fs::write(model.join("Cargo.toml"), "[package]\nname = \"model\"\n").unwrap();
        let workspace = || Neighbourhood::of(&model).unwrap().workspace;
        assert_eq!(workspace(), model);
        fs::write(directory.path().join("Cargo.toml"), "[workspace]\nmembers = [\"models/*\"]\n").unwrap();
        assert_eq!(workspace(), directory.path());
    }
}

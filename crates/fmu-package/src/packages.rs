//! The packages that a package is made of by path, as cargo knows them.

use anyhow::{Context, Result, ensure};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A package on this machine, not from a registry.
#[derive(Clone, Debug)]
pub(crate) struct LocalPackage {
    pub name: String,
    pub folder: PathBuf,
    /// The folder of the library's sources, and the build script.
    pub code: Vec<PathBuf>,
    dependencies: Vec<PathBuf>,
    workspace: PathBuf,
}

/// A package with its workspace and what it uses by path.
#[derive(Clone, Debug)]
pub(crate) struct Neighbourhood {
    /// The folder of the workspace, or of the package if there is none.
    pub workspace: PathBuf,
    /// The packages that this one needs to be compiled, directly or through each other, and that are used by
    /// path; by name.
    pub used: Vec<LocalPackage>,
}

impl Neighbourhood {
    /// Of the package in this folder.
    pub fn of(folder: &Path) -> Result<Self> {
        let mut known = BTreeMap::new();
        let own = find(&mut known, folder)?;
        let mut used: Vec<LocalPackage> = Vec::new();
        let mut open = own.dependencies;
        while let Some(folder) = open.pop() {
            if folder != own.folder && used.iter().all(|package| package.folder != folder) {
                let package = find(&mut known, &folder)?;
                open.extend(package.dependencies.iter().cloned());
                used.push(package);
            }
        }
        used.sort_by(|a, b| (&a.name, &a.folder).cmp(&(&b.name, &b.folder)));
        Ok(Self { workspace: own.workspace, used })
    }
}

/// The package in this folder; one question to cargo tells all about a workspace.
fn find(known: &mut BTreeMap<PathBuf, LocalPackage>, folder: &Path) -> Result<LocalPackage> {
    if !known.contains_key(folder) {
        let of = || format!("cannot find out what {} is made of", folder.display());
        let packages = metadata(folder).and_then(|metadata| packages(&metadata)).with_context(of)?;
        known.extend(packages.into_iter().map(|package| (package.folder.clone(), package)));
    }
    known.get(folder).cloned().with_context(|| format!("{} is no package", folder.display()))
}

fn metadata(folder: &Path) -> Result<Value> {
    // Inside `cargo run` and a build script this names the cargo that is running.
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(&cargo)
        .args(["metadata", "--no-deps", "--offline", "--format-version", "1", "--manifest-path"])
        .arg(folder.join("Cargo.toml"))
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("cannot start cargo ({})", cargo.to_string_lossy()))?;
    let errors = String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
    ensure!(output.status.success(), "{errors}");
    serde_json::from_slice(&output.stdout).context("cargo metadata answers in a language of its own")
}

fn packages(metadata: &Value) -> Result<Vec<LocalPackage>> {
    let path = |value: &Value| value.as_str().map(PathBuf::from);
    let workspace = path(&metadata["workspace_root"]).context("cargo names no workspace")?;
    let package = |package: &Value| {
        let folder = path(&package["manifest_path"])?.parent()?.to_owned();
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
            folder,
        })
    };
    let packages = metadata["packages"].as_array().context("cargo names no packages")?;
    packages.iter().map(|value| package(value).context("cargo describes a package in another way")).collect()
}

#[cfg(test)]
mod tests {
    use super::Neighbourhood;
    use std::fs;

    /// Where `build_fmu` puts the FMU: beside what cargo makes, also for a member of a workspace.
    #[test]
    fn a_member_knows_its_workspace() {
        let folder = tempfile::tempdir().unwrap();
        let model = folder.path().join("models/model");
        fs::create_dir_all(model.join("src")).unwrap();
        fs::write(model.join("src/lib.rs"), "").unwrap();
        fs::write(model.join("Cargo.toml"), "[package]\nname = \"model\"\n").unwrap();
        let workspace = || Neighbourhood::of(&model).unwrap().workspace;
        assert_eq!(workspace(), model);
        fs::write(folder.path().join("Cargo.toml"), "[workspace]\nmembers = [\"models/*\"]\n").unwrap();
        assert_eq!(workspace(), folder.path());
    }
}

//! The metadata of the package that makes an FMU, from cargo.

use anyhow::{Context, Result, bail};
use fmu_package::metadata;
use serde_json::Value;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The options that name the package of the model.
#[derive(clap::Args, Clone, Debug)]
pub struct Package {
    /// Package of the model, in a workspace with several packages
    #[arg(short, long)]
    pub package: Option<String>,
    /// Cargo.toml of the package [default: in this directory or the nearest directory above]
    #[arg(long, value_name = "FILE")]
    pub manifest_path: Option<PathBuf>,
}

/// A package that makes an FMU.
pub struct Project {
    /// Its name.
    pub name: String,
    /// The directory of its `Cargo.toml`.
    pub directory: PathBuf,
    /// The directory of its workspace, with `Cargo.lock`.
    pub workspace: PathBuf,
    /// Its own program that builds the FMU, if it has one.
    pub own_builder: Option<String>,
}

impl Project {
    /// Finds the package with `cargo metadata`.
    pub fn find(options: &Package) -> Result<Self> {
        let manifest =
            options.manifest_path.iter().flat_map(|path| [OsStr::new("--manifest-path"), path.as_ref()]);
        let metadata = metadata(manifest)?;
        let package = chosen(&metadata, options.package.as_deref())?;
        let name = text(&package["name"]);
        let targets = list(&package["targets"]);
        if !targets.iter().any(|target| list(&target["crate_types"]).contains(&"cdylib".into())) {
            bail!(
                "{name} makes no shared library; its Cargo.toml needs\n\n  [lib]\n  crate-type = [\"cdylib\", \"rlib\"]\n"
            );
        }
        if !list(&package["dependencies"]).iter().any(|used| used["name"] == "fmu-export") {
            bail!("{name} does not use fmu-export: cargo fmu new creates a model that does");
        }
        let programs = targets.iter().filter(|target| list(&target["kind"]).contains(&"bin".into()));
        let mut programs = programs.map(|target| text(&target["name"]));
        let directory = Path::new(text(&package["manifest_path"])).parent();
        Ok(Self {
            name: name.to_owned(),
            directory: directory.context("cargo names no Cargo.toml")?.to_owned(),
            workspace: text(&metadata["workspace_root"]).into(),
            own_builder: programs
                .find(|name| *name == "build_fmu" || name.starts_with("build_fmu_"))
                .map(str::to_owned),
        })
    }
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

fn chosen<'a>(metadata: &'a Value, name: Option<&str>) -> Result<&'a Value> {
    let members = list(&metadata["workspace_members"]);
    let packages = list(&metadata["packages"]).iter().filter(|package| members.contains(&package["id"]));
    let packages: Vec<_> = packages.collect();
    if let Some(name) = name {
        let named = packages.iter().find(|package| package["name"] == name);
        return named.copied().with_context(|| format!("there is no package {name} here"));
    }
    let root = packages.iter().find(|package| package["id"] == metadata["resolve"]["root"]);
    match (root, &packages[..]) {
        (Some(package), _) | (None, [package]) => Ok(package),
        _ => {
            let names: Vec<_> = packages.iter().map(|package| text(&package["name"])).collect();
            bail!("there are several packages here; choose with --package: {}", names.join(", "))
        }
    }
}

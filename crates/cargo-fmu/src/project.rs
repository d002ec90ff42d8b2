//! What cargo knows of the package that is to be an FMU.

use anyhow::{Context, Result, bail};
use cargo_metadata::{CrateType, Metadata, MetadataCommand, Package};
use std::path::PathBuf;

/// Where the model is.
#[derive(clap::Args, Clone, Debug)]
pub struct Place {
    /// The model's package, in a workspace with several
    #[arg(short, long)]
    pub package: Option<String>,
    /// Its Cargo.toml [default: that of this folder, or of the next one around it]
    #[arg(long, value_name = "FILE")]
    pub manifest_path: Option<PathBuf>,
}

/// A package that makes an FMU.
pub struct Project {
    /// Its name.
    pub name: String,
    /// The folder of its `Cargo.toml`.
    pub folder: PathBuf,
    /// The folder of its workspace, with `Cargo.lock`.
    pub workspace: PathBuf,
    /// Its own program that builds the FMU, if it has one.
    pub own_builder: Option<String>,
}

impl Project {
    /// Asks cargo.
    pub fn find(place: &Place) -> Result<Self> {
        let mut command = MetadataCommand::new();
        if let Some(path) = &place.manifest_path {
            command.manifest_path(path);
        }
        let metadata = command.exec().map_err(|error| match error {
            cargo_metadata::Error::CargoMetadata { stderr } => {
                anyhow::anyhow!("{}", stderr.trim().trim_start_matches("error: "))
            }
            other => other.into(),
        })?;
        let package = chosen(&metadata, place.package.as_deref())?;
        if !package.targets.iter().any(|target| target.crate_types.contains(&CrateType::CDyLib)) {
            bail!(
                "{} makes no shared library; its Cargo.toml needs\n\n  [lib]\n  crate-type = [\"cdylib\", \"rlib\"]\n",
                package.name
            );
        }
        if !package.dependencies.iter().any(|of| of.name == "fmu-export") {
            bail!("{} does not use fmu-export: cargo fmu new begins a model that does", package.name);
        }
        let builders = package.targets.iter().filter(|target| {
            target.is_bin() && (target.name == "build_fmu" || target.name.starts_with("build_fmu_"))
        });
        Ok(Self {
            name: package.name.to_string(),
            folder: folder(package),
            workspace: metadata.workspace_root.clone().into(),
            own_builder: builders.map(|target| target.name.clone()).next(),
        })
    }
}

fn folder(package: &Package) -> PathBuf {
    package.manifest_path.parent().map(Into::into).unwrap_or_default()
}

fn chosen<'a>(metadata: &'a Metadata, name: Option<&str>) -> Result<&'a Package> {
    let members = metadata.workspace_packages();
    if let Some(name) = name {
        let named = members.iter().find(|package| package.name.as_str() == name);
        return named.copied().with_context(|| format!("there is no package {name} here"));
    }
    match (metadata.root_package(), &members[..]) {
        (Some(package), _) => Ok(package),
        (None, [package]) => Ok(*package),
        _ => {
            let names: Vec<_> = members.iter().map(|package| package.name.as_str()).collect();
            bail!("there are several packages here; choose with --package: {}", names.join(", "))
        }
    }
}

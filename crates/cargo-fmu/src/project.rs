//! What cargo knows of the package that is to be an FMU.

use anyhow::{Context, Result, bail};
use cargo_metadata::{CargoOpt, CrateType, DependencyKind, Metadata, MetadataCommand, Package, PackageId};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

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
    /// What Rust calls its library.
    pub crate_name: String,
    /// The folder of its `Cargo.toml`.
    pub folder: PathBuf,
    /// The folder of its workspace, with `Cargo.lock`.
    pub workspace: PathBuf,
    /// Where cargo puts what it makes.
    pub target: PathBuf,
    /// Its own program that builds the FMU, if it has one.
    pub own_builder: Option<String>,
    /// The packages that its library consists of, with itself.
    pub compiled: BTreeSet<String>,
    /// How fmu-package is asked for in `Cargo.toml`, of the same origin as its fmu-export.
    pub fmu_package: String,
}

impl Project {
    /// Asks cargo.
    pub fn find(place: &Place) -> Result<Self> {
        let mut command = MetadataCommand::new();
        command.features(CargoOpt::NoDefaultFeatures);
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
        let library = package.targets.iter().find(|target| target.crate_types.contains(&CrateType::CDyLib));
        let Some(library) = library else {
            bail!(
                "{} makes no shared library; its Cargo.toml needs\n\n  [lib]\n  crate-type = [\"cdylib\", \"rlib\"]\n",
                package.name
            );
        };
        let builders = package.targets.iter().filter(|target| {
            target.is_bin() && (target.name == "build_fmu" || target.name.starts_with("build_fmu_"))
        });
        let own_builder = builders.map(|target| target.name.clone()).next();
        let for_programs = [CrateType::Lib, CrateType::RLib];
        if own_builder.is_none() && !for_programs.iter().any(|kind| library.crate_types.contains(kind)) {
            bail!(
                "the library of {} must also be an rlib: crate-type = [\"cdylib\", \"rlib\"]",
                package.name
            );
        }
        let compiled = compiled(&metadata, &package.id);
        let export = metadata
            .packages
            .iter()
            .find(|other| other.name.as_str() == "fmu-export" && compiled.contains(&other.id));
        let export = export.with_context(|| {
            format!("{} does not use fmu-export: cargo fmu new begins a model that does", package.name)
        })?;
        Ok(Self {
            name: package.name.to_string(),
            crate_name: library.name.replace('-', "_"),
            folder: folder(package),
            workspace: metadata.workspace_root.clone().into(),
            target: metadata.target_directory.clone().into(),
            own_builder,
            fmu_package: beside(export)?,
            compiled: metadata
                .packages
                .iter()
                .filter(|other| compiled.contains(&other.id))
                .map(|other| other.name.to_string())
                .collect(),
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

/// The packages that are compiled for the library of this one.
fn compiled(metadata: &Metadata, package: &PackageId) -> BTreeSet<PackageId> {
    let nodes = metadata.resolve.iter().flat_map(|resolve| &resolve.nodes);
    let nodes: std::collections::BTreeMap<_, _> = nodes.map(|node| (&node.id, node)).collect();
    let mut found = BTreeSet::new();
    let mut open = vec![package.clone()];
    while let Some(id) = open.pop() {
        if let Some(node) = nodes.get(&id) {
            let used = node.deps.iter().filter(|dependency| {
                dependency.dep_kinds.iter().any(|kind| kind.kind == DependencyKind::Normal)
            });
            open.extend(used.map(|dependency| dependency.pkg.clone()).filter(|id| !found.contains(id)));
        }
        found.insert(id);
    }
    found
}

/// fmu-package of the same version and origin as this fmu-export.
fn beside(export: &Package) -> Result<String> {
    let version = &export.version;
    Ok(match &export.source {
        None => {
            let path = Path::new(export.manifest_path.as_str()).parent().and_then(Path::parent);
            let path = path.context("fmu-export is in no folder")?.join("fmu-package");
            format!("{{ path = {:?} }}", path.display().to_string())
        }
        Some(source) => match source.repr.strip_prefix("git+") {
            // The commit stands behind #, a branch or the like behind ?.
            Some(git) => {
                let (address, commit) = git.split_once('#').unwrap_or((git, "HEAD"));
                let address = address.split('?').next().unwrap_or(address);
                format!("{{ git = {address:?}, rev = {commit:?} }}")
            }
            None => format!("{:?}", format!("={version}")),
        },
    })
}

//! Gets the metadata of a package that makes an FMU from cargo.

use anyhow::{Context, Result, anyhow, bail};
use fmu_package::metadata;
use fmu_package::terminal::short;
use serde_json::Value;
use std::env;
use std::ffi::OsStr;
use std::fs;
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
    /// Finds the package with `cargo metadata`. Fails if it does not make a shared library or does not use fmu-export.
    pub fn find(options: &Package) -> Result<Self> {
        let manifest =
            options.manifest_path.iter().flat_map(|path| [OsStr::new("--manifest-path"), path.as_ref()]);
        let metadata = metadata(manifest).map_err(|error| {
            let of = options.manifest_path.clone().or_else(nearest_manifest);
            match of.and_then(|manifest| missing_path(&manifest)) {
                Some(explanation) => anyhow!("{explanation}"),
                None => error,
            }
        })?;
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
        let programs = programs.map(|target| text(&target["name"]));
        let directory = Path::new(text(&package["manifest_path"])).parent();
        Ok(Self {
            name: name.to_owned(),
            directory: directory.context("cargo names no Cargo.toml")?.to_owned(),
            workspace: text(&metadata["workspace_root"]).into(),
            own_builder: own_builder(programs)?.map(str::to_owned),
        })
    }
}

/// Returns the `Cargo.toml` in this directory or the nearest directory above.
fn nearest_manifest() -> Option<PathBuf> {
    let directory = env::current_dir().ok()?;
    directory.ancestors().map(|directory| directory.join("Cargo.toml")).find(|path| path.is_file())
}

/// Explains what to do if the path of fmu-export in a `Cargo.toml` does not exist; returns `None` if it exists or none is given. Cargo's
/// own message names only the file that it cannot read.
fn missing_path(manifest: &Path) -> Option<String> {
    let content = fs::read_to_string(manifest).ok()?;
    let mut lines = content.lines().filter(|line| line.trim_start().starts_with("fmu-export"));
    let path = lines.find_map(|line| line.split_once("path")?.1.split('"').nth(1))?;
    let is_missing = !manifest.parent()?.join(path).join("Cargo.toml").is_file();
    is_missing.then(|| {
        let version = env!("CARGO_PKG_VERSION");
        format!(
            "{} names {path} for fmu-export, which is not on this machine, because the model was made on another one or in \
             another directory; write fmu-export = {{ path = \"...\" }} with the directory crates/fmu-export of a clone \
             (version {version}), or {{ git = \"URL\", rev = \"...\" }} with a repository that others can read, too",
            short(manifest)
        )
    })
}

/// Returns the program that builds the FMU: `build_fmu`, or the only one whose name begins with `build_fmu_`.
fn own_builder<'a>(programs: impl Iterator<Item = &'a str>) -> Result<Option<&'a str>> {
    let is_builder = |name: &&str| *name == "build_fmu" || name.starts_with("build_fmu_");
    let builders: Vec<_> = programs.filter(is_builder).collect();
    match builders[..] {
        [] => Ok(None),
        [only] => Ok(Some(only)),
        _ if builders.contains(&"build_fmu") => Ok(Some("build_fmu")),
        _ => bail!(
            "the package has several programs that build FMUs ({}); call one build_fmu",
            builders.join(", ")
        ),
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

#[cfg(test)]
mod tests {
    use super::own_builder;

    #[test]
    fn one_program_builds_the_fmu() {
        for (programs, builder) in [
            (&["main", "build"][..], Ok(None)),
            (&["main", "build_fmu_tank"], Ok(Some("build_fmu_tank"))),
            (&["build_fmu_tank", "build_fmu"], Ok(Some("build_fmu"))),
            (&["build_fmu_tank", "build_fmu_lag"], Err(())),
        ] {
            assert_eq!(own_builder(programs.iter().copied()).map_err(|_| ()), builder, "{programs:?}");
        }
    }
}

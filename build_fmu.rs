//! Builds the FMU: compiles the library, describes the model, packs both. See `--help`.

use anyhow::{Context, Result, bail, ensure};
use clap::Parser;
use fmi2_export::Model;
use fmi2_package::{Changes, Library, LibraryBuild, Platform, Start, describe, pack, write_atomically};
use prw_testbed::TestbedFmu;
use prw_testbed::fingerprint::{self, DESCRIPTION, PARAMETERS};
use prw_testbed::parameter_file::{ParameterSet, Value};
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf, absolute};
use std::process::ExitCode;
use std::{env, fs};

/// The folder of `Cargo.toml`.
const PROJECT: &str = env!("CARGO_MANIFEST_DIR");

/// Builds the FMU of the pitch-roll wrist testbed, target/fmu/prw_testbed.fmu.
#[derive(Parser)]
#[command(
    override_usage = "cargo run --release --bin build_fmu [-- OPTIONS]",
    after_help = "Examples (after `cargo run --release --bin build_fmu --`):
  --parameters mine.json --out mine    an FMU with other start values, in mine/
  --tunable --out tunable              parameters can be changed while Simulink runs
  --describe                           after a change of the variables, before a commit
  --target x86_64-pc-windows-gnu       a Windows FMU, if rustup has that target
  --binary linux64=a.so --binary win64=b.dll
                                       one FMU from libraries that were compiled elsewhere"
)]
struct Options {
    /// Build in the parameters of this file [default: modelDescription/parameters.json, Table 1]
    #[arg(long, value_name = "FILE")]
    parameters: Option<PathBuf>,
    /// Declare the parameters tunable instead of fixed (OpenModelica does not let users change those)
    #[arg(long)]
    tunable: bool,
    /// Folder for what is made [default: target/fmu]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write only modelDescription.xml, into the folder modelDescription of the sources or DIR
    #[arg(long, conflicts_with_all = ["target", "binary"])]
    describe: bool,
    /// Compile for this Rust target instead of this machine; repeat it for several
    #[arg(long, value_name = "TRIPLE")]
    target: Vec<String>,
    /// Put in this compiled library, for example win64=prw_testbed.dll; repeat it for several
    #[arg(long, value_name = "PLATFORM=PATH", value_parser = binary)]
    binary: Vec<(String, PathBuf)>,
}

fn binary(text: &str) -> Result<(String, PathBuf), String> {
    text.split_once('=')
        .map(|(platform, path)| (platform.to_owned(), path.into()))
        .ok_or_else(|| "write PLATFORM=PATH, for example linux64=libprw_testbed.so".to_owned())
}

fn main() -> ExitCode {
    match run(&Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(options: &Options) -> Result<()> {
    let project = Path::new(PROJECT);
    let variant = Variant::new(project, options)?;
    let description = variant.describe()?;
    if options.describe {
        let path = match &options.out {
            Some(folder) => folder.join("modelDescription.xml"),
            None if variant.is_default() => project.join(DESCRIPTION),
            None => {
                bail!("{DESCRIPTION} is for Table 1 and fixed parameters; name another folder with --out")
            }
        };
        return write_description(&path, &description);
    }

    let mut libraries = Vec::new();
    for (platform, path) in &options.binary {
        libraries.push(Library { platform: Platform::of_folder(platform)?, path: path.clone() });
    }
    for target in &options.target {
        let platform = Platform::of_target(target)?;
        libraries.push(Library { platform, path: variant.compile(project, Some(target))? });
    }
    if libraries.is_empty() {
        libraries.push(Library { platform: Platform::host()?, path: variant.compile(project, None)? });
    }
    for Library { path, .. } in &libraries {
        variant.check_library(path)?;
    }

    let folder = options.out.clone().unwrap_or_else(|| project.join("target/fmu"));
    let identifier = TestbedFmu::INFO.identifier;
    let fmu = folder.join(format!("{identifier}.fmu"));
    let size = pack(&fmu, identifier, &description, &libraries, &fingerprint::fmu_content(project)?)?;

    let mut platforms: Vec<String> = libraries.iter().map(|library| library.platform.to_string()).collect();
    platforms.sort();
    let tunable = if options.tunable { ", tunable" } else { "" };
    println!("{}: {} kB, {}", short(&fmu), size.div_ceil(1000), platforms.join(", "));
    println!("guid {}, parameters from {}{tunable}", variant.guid, short(&variant.file));
    if variant.is_default()
        && fs::read(project.join(DESCRIPTION)).ok().as_deref() != Some(description.as_bytes())
    {
        eprintln!(
            "note: {DESCRIPTION} in the sources is out of date; write it anew with\n      \
             cargo run --release --bin build_fmu -- --describe"
        );
    }
    Ok(())
}

/// Which testbed is built.
struct Variant {
    file: PathBuf,
    other_file: bool,
    parameters: ParameterSet,
    tunable: bool,
    guid: String,
}

impl Variant {
    fn new(project: &Path, options: &Options) -> Result<Self> {
        let file = match &options.parameters {
            Some(file) => absolute(file).with_context(|| format!("{} is no file", file.display()))?,
            None => project.join(PARAMETERS),
        };
        let parameters = ParameterSet::read(&file)?;
        let sources = fingerprint::sources(project)?;
        ensure!(
            sources == env!("PRW_SOURCES"),
            "the sources have changed since this program was compiled; start it with `cargo run --release --bin \
             build_fmu`, and if that does not help, touch build.rs"
        );
        let guid = fingerprint::guid(&sources, &parameters, options.tunable);
        Ok(Self {
            file,
            other_file: options.parameters.is_some(),
            parameters,
            tunable: options.tunable,
            guid,
        })
    }

    fn is_default(&self) -> bool {
        !self.other_file && !self.tunable
    }

    fn describe(&self) -> Result<String> {
        let start = self.parameters.iter().map(|(name, value)| {
            let start = match value {
                Value::Real(value) => Start::Real(value),
                Value::Integer(value) => Start::Integer(value),
            };
            (name.to_owned(), start)
        });
        describe::<TestbedFmu>(&Changes {
            guid: Some(self.guid.clone()),
            start: start.collect(),
            tunable_parameters: self.tunable,
        })
    }

    fn compile(&self, project: &Path, target: Option<&str>) -> Result<PathBuf> {
        let build = LibraryBuild {
            folder: project.to_owned(),
            package: env!("CARGO_PKG_NAME"),
            profile: "library",
            target,
            environment: vec![
                ("PRW_PARAMETERS", self.other_file.then(|| self.file.clone().into())),
                ("PRW_TUNABLE", self.tunable.then(|| OsString::from("1"))),
            ],
        };
        build.run()
    }

    /// A library with another guid would refuse every instance.
    fn check_library(&self, path: &Path) -> Result<()> {
        let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        ensure!(
            bytes.windows(self.guid.len()).any(|window| window == self.guid.as_bytes()),
            "{} was not compiled from these sources and parameters (the guid {} is not in it); compile it again",
            path.display(),
            self.guid
        );
        Ok(())
    }
}

/// A file that is right already stays untouched, so that cargo sees no change.
fn write_description(path: &Path, description: &str) -> Result<()> {
    if fs::read(path).ok().as_deref() == Some(description.as_bytes()) {
        println!("{} is up to date", short(path));
        return Ok(());
    }
    write_atomically(path, |file| Ok(file.write_all(description.as_bytes())?))?;
    println!("{} written", short(path));
    Ok(())
}

/// The path as seen from where the user is.
fn short(path: &Path) -> String {
    let here = env::current_dir().unwrap_or_default();
    path.strip_prefix(here).unwrap_or(path).display().to_string()
}

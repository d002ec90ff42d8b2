//! The command `build_fmu`, which is the same for every model.

use crate::c_sources::{COMPILED, CSources, LINKING, WEBASSEMBLY, c_sources, check_tools};
use crate::cargo::LibraryBuild;
use crate::connectors::{Terminal, terminals};
use crate::cross::{GLIBC, TARGETS, ZIGBUILD, check_targets};
use crate::describe::{Changes, describe};
use crate::files::write_atomically;
use crate::library::{check_guid, check_platform, needed_glibc};
use crate::model::LoadedModel;
use crate::pack::{Library, Parts, pack};
use crate::packages::Neighbourhood;
use crate::page::Page;
use crate::platform::Platform;
use crate::sources::{DESCRIPTION, Sources};
use crate::terminal::{exit, fmi_version, short};
use crate::universal::join_for_macos;
use crate::variant::{NO_GUID, Variant};
use anyhow::{Context, Result, bail, ensure};
use clap::{CommandFactory, FromArgMatches};
use fmi_abi::Standard;
use std::ffi::OsString;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;
use zip::ZipArchive;

/// The options that every `build_fmu` has. A program with more options includes them with `#[command(flatten)]`.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct BuildOptions {
    /// Declare the parameters tunable instead of fixed (OpenModelica does not let users change tunable parameters)
    #[arg(long)]
    pub tunable: bool,
    /// Build only the FMU for FMI 2.0 or for FMI 3.0
    #[arg(long, value_parser = fmi_version, value_name = "2|3")]
    pub fmi: Option<Standard>,
    /// Directory for the FMU of FMI 2.0, with a directory fmi3 for the FMU of FMI 3.0 [default: target/fmu of the workspace]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write only modelDescription.xml, of FMI 2.0 or of the version --fmi, into the directory modelDescription of the sources or DIR
    #[arg(long, conflicts_with_all = ["target", "binary"])]
    pub describe: bool,
    /// Print only the guid; to compile a library elsewhere, set the environment variable FMU_GUID to it
    #[arg(long, conflicts_with = "describe")]
    pub guid: bool,
    /// Compile for this Rust target instead of this machine; repeat it for several
    #[arg(long, value_name = "TRIPLE")]
    pub target: Vec<String>,
    /// Compile for Linux and macOS on Intel and ARM, and for Windows on Intel (needs Rust's libraries for them and cargo-zigbuild)
    #[arg(long, conflicts_with_all = ["target", "describe", "c_sources"])]
    pub all_targets: bool,
    /// Add this compiled library, for example win64=model.dll, or the one in an FMU, x86_64-windows=model.fmu; repeat it for several
    #[arg(long, value_name = "PLATFORM=PATH", value_parser = binary)]
    pub binary: Vec<(String, PathBuf)>,
    /// Build an FMU of C sources instead, for targets without Rust (FMI 2.0, in the directory source; needs wasm2c)
    #[arg(long, conflicts_with_all = ["target", "binary", "describe"])]
    pub c_sources: bool,
    /// Leave out the page documentation/index.html that runs the FMU in a browser (as with --c-sources)
    #[arg(long)]
    pub no_page: bool,
    /// Time that the model may take for one call while the build checks it [default: 60]
    #[arg(long, value_name = "SECONDS")]
    pub time_limit: Option<u64>,
    /// Accept a library whose processor differs from its platform (in FMI 2.0, importers on ARM look in linux64)
    #[arg(long, requires = "binary")]
    pub any_processor: bool,
}

/// The default of [`BuildOptions::time_limit`].
const TIME_LIMIT: Duration = Duration::from_secs(60);

fn binary(text: &str) -> Result<(String, PathBuf), String> {
    text.split_once('=')
        .filter(|(platform, path)| !platform.is_empty() && !path.is_empty())
        .map(|(platform, path)| (platform.to_owned(), path.into()))
        .ok_or_else(|| "write PLATFORM=PATH, for example linux64=libmodel.so".to_owned())
}

/// The `main` of a `build_fmu`: reads the arguments of the program and builds the FMUs.
pub fn build(builder: &Builder) -> ExitCode {
    #[derive(clap::Parser)]
    struct Options {
        #[command(flatten)]
        build: BuildOptions,
    }
    let command = Options::command().override_usage(format!("{} [OPTIONS]", builder.command));
    let options = BuildOptions::from_arg_matches(&command.get_matches()).map_err(anyhow::Error::from);
    exit(options.and_then(|options| builder.run(&options)))
}

/// The settings for building a model's FMUs.
#[derive(Clone, Debug)]
pub struct Builder {
    /// The package of the model: `env!("CARGO_PKG_NAME")`.
    pub package: String,
    /// The command that starts this program, to which messages append options.
    pub command: &'static str,
    /// The files that the FMU is made from.
    pub sources: Sources,
    /// FMI versions of the FMUs that are built by default. The committed model description is for the first of them.
    pub fmi: Vec<Standard>,
    /// The terminals of the FMU for FMI 3.0.
    pub terminals: Vec<Terminal>,
    /// Settings of cargo for this build, such as `profile.release.lto=false`.
    pub settings: Vec<String>,
    /// Start values that are read from another file when the library is compiled, see [`Variant::start`].
    pub start: Vec<(String, String)>,
    /// Label in messages for a build with other parameter values than the default ones. `None` for the default values, whose
    /// description is kept with the sources.
    pub variant: Option<String>,
    /// Additions to the page that runs the FMU.
    pub page: Page,
    /// Environment variables for the compilation of the library; a variable whose value is `None` is removed.
    pub environment: Vec<(&'static str, Option<OsString>)>,
}

/// The directory of the files that the model reads.
const RESOURCES: &str = "modelDescription/resources";

impl Builder {
    /// Returns the settings for a package in the usual layout, whose program is started with `cargo run --bin build_fmu`.
    ///
    /// Pass `env!("CARGO_PKG_NAME")` and `env!("CARGO_MANIFEST_DIR")`.
    pub fn new(package: impl Into<String>, directory: impl Into<PathBuf>) -> Self {
        Self {
            package: package.into(),
            command: "cargo run --bin build_fmu --",
            sources: Sources::of_package(directory),
            fmi: vec![Standard::Fmi2, Standard::Fmi3],
            terminals: Vec::new(),
            settings: Vec::new(),
            start: Vec::new(),
            variant: None,
            page: Page::default(),
            environment: Vec::new(),
        }
    }

    /// Compiles the libraries, checks the model with the library for this machine, writes the descriptions, packs the FMUs, and reports
    /// them on stdout. With `options.guid`, only prints the guid; with `options.describe`, only writes a description.
    ///
    /// # Errors
    /// When the model contradicts itself, a library cannot be compiled or does not belong to the sources, or a file cannot
    /// be written.
    pub fn run(&self, options: &BuildOptions) -> Result<()> {
        let start = self.start.clone();
        let guid = Variant { sources: self.sources.fingerprint()?, start, tunable: options.tunable }.guid();
        if options.guid {
            println!("{guid}");
            return Ok(());
        }
        let is_default = self.variant.is_none() && !options.tunable;
        let kept = self.sources.directory.join(DESCRIPTION);
        let described_in = match &options.out {
            _ if !options.describe => None,
            Some(directory) => Some(directory.join("modelDescription.xml")),
            None if is_default => Some(kept.clone()),
            None => bail!("{DESCRIPTION} is for the defaults; name another directory with --out"),
        };
        self.check_versions(options)?;
        let content = self.sources.content_files()?;
        let workspace = Neighbourhood::of(&self.sources.directory)?.workspace;
        // Without the lock, another build could overwrite the library of this one.
        let _lock = lock(&workspace.join("target"));
        let mut libraries = self.libraries(options, &guid)?;
        let time_limit = options.time_limit.map_or(TIME_LIMIT, Duration::from_secs);
        let model = self.model(&libraries, &guid, time_limit)?;
        let sources = match options.c_sources {
            true => self.c_sources(&guid, model.identifier())?,
            false => CSources::new(),
        };
        let describe = |fmi: Standard, guid: &str| {
            let source_files = sources.iter().take(COMPILED).map(|(name, _)| name.clone()).collect();
            let guid = Some(guid.to_owned());
            self.describe(&model, fmi, &Changes { guid, tunable_parameters: options.tunable, source_files })
        };
        let terminals = terminals(&model, &self.terminals, &content)?;
        let versions = self.versions(options, &model);
        if let Some(path) = described_in {
            let fmi = versions.first().context("there is no version to describe it for")?;
            // The description that is kept with the sources has no guid, because the guid changes whenever they do.
            return write_description(&path, &describe(*fmi, NO_GUID)?);
        }
        let mut descriptions = Vec::new();
        for &fmi in &versions {
            descriptions.push((fmi, describe(fmi, &guid)?));
        }
        if versions.contains(&Standard::Fmi2) {
            join_for_macos(&mut libraries)?;
        }
        // The page runs the FMU for FMI 2.0, so all variables must have types of FMI 2.0.
        let can_have_page = model.table.variables.iter().all(|variable| variable.base().is_in_fmi2());
        let with_page = match options.no_page || options.c_sources || !can_have_page {
            true => None,
            false => {
                let description = describe(Standard::Fmi2, &guid)?;
                self.page.with_model(&self.build(&guid), &guid, &model.table.info, description, &content)?
            }
        };
        let content = with_page.as_ref().map_or(&content, |(_, content)| content);
        let out = options.out.clone().unwrap_or_else(|| workspace.join("target/fmu"));
        for (fmi, description) in &descriptions {
            // If an FMU for FMI 2.0 has terminals, FMI Library reports a fatal mismatch, although it continues.
            let terminals = terminals.as_deref().filter(|_| *fmi == Standard::Fmi3);
            let (identifier, libraries, sources) = (model.identifier(), &libraries[..], &sources[..]);
            let parts = Parts { fmi: *fmi, identifier, description, terminals, libraries, sources, content };
            pack_in(&out, &parts)?;
        }
        let variant = self.variant.iter().map(|label| format!(", {label}")).collect::<String>();
        let tunable = if options.tunable { ", tunable" } else { "" };
        println!("guid {guid}{variant}{tunable}");
        self.warn_of_glibc(options, &libraries);
        if is_default && !options.c_sources {
            self.compare_with_kept(&kept, &descriptions, &guid);
        }
        Ok(())
    }

    fn describe(&self, model: &LoadedModel, fmi: Standard, changes: &Changes) -> Result<String> {
        let label = self.variant.as_deref().unwrap_or(model.identifier());
        describe(model, fmi, changes).with_context(|| label.to_owned())
    }

    /// Prints a note if the library for this machine needs a newer glibc than a library that is compiled with `--target`.
    fn warn_of_glibc(&self, options: &BuildOptions, libraries: &[Library]) {
        // A library with additional cargo settings is only for development on this machine.
        let is_shipped = self.settings.is_empty() && options.target.is_empty() && options.binary.is_empty();
        let needed = |library: &Library| needed_glibc(&fs::read(&library.path).ok()?);
        if let Some((major, minor)) = libraries.first().filter(|_| is_shipped).and_then(needed)
            && format!("{major}.{minor}") != GLIBC
        {
            let target = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
            eprintln!(
                "note: the library needs glibc {major}.{minor} or later, so it does not load on older systems; for glibc {GLIBC}, add --target {target} \
                 (with {ZIGBUILD}: pip install {ZIGBUILD})"
            );
        }
    }

    /// Prints a note if the committed description is out of date.
    fn compare_with_kept(&self, kept: &Path, descriptions: &[(Standard, String)], guid: &str) {
        if let Some((fmi, description)) = descriptions.first()
            && self.fmi.first() == Some(fmi)
            && let Ok(text) = fs::read_to_string(kept)
            && text != description.replace(guid, NO_GUID)
        {
            eprintln!(
                "note: {DESCRIPTION} in the sources is out of date; update it with\n      {} --describe",
                self.command
            );
        }
    }

    /// Checks that the options are possible for the FMI versions of the FMUs.
    fn check_versions(&self, options: &BuildOptions) -> Result<()> {
        let only_fmi2 = options.fmi.map_or(self.fmi == [Standard::Fmi2], |fmi| fmi == Standard::Fmi2);
        ensure!(
            !options.c_sources || options.fmi != Some(Standard::Fmi3),
            "C sources are made for FMI 2.0 only"
        );
        ensure!(
            !options.any_processor || only_fmi2,
            "FMI 3.0 has a directory for every processor; --any-processor goes with --fmi 2 only"
        );
        Ok(())
    }

    /// Returns the FMI version in the options, or FMI 2.0 for C sources. Otherwise returns the default versions, without FMI 2.0 if it
    /// lacks the type of a variable and FMI 3.0 is also a default version.
    fn versions(&self, options: &BuildOptions, model: &LoadedModel) -> Vec<Standard> {
        if let Some(fmi) = options.fmi.or(options.c_sources.then_some(Standard::Fmi2)) {
            return vec![fmi];
        }
        let lacking = model.table.variables.iter().find(|variable| !variable.base().is_in_fmi2());
        let Some(variable) = lacking.filter(|_| self.fmi.contains(&Standard::Fmi3)) else {
            return self.fmi.clone();
        };
        println!("{} is {}, which FMI 2.0 lacks: for FMI 3.0 only", variable.name, variable.base());
        vec![Standard::Fmi3]
    }

    /// Returns the libraries to pack: the libraries of `--binary`, and one compiled for each target. If there are neither, compiles one for
    /// this machine, unless only a description or C sources are requested.
    fn libraries(&self, options: &BuildOptions, guid: &str) -> Result<Vec<Library>> {
        let mut libraries = Vec::new();
        for (platform, path) in &options.binary {
            let platform = Platform::of_directory(platform)?;
            let is_fmu = path.extension().is_some_and(|suffix| suffix == "fmu");
            let path = if is_fmu { self.unpack_library(path, platform)? } else { path.clone() };
            let library = Library { platform, path };
            check_library(&library, guid, options.any_processor)?;
            libraries.push(library);
        }
        let targets = match options.all_targets {
            true => TARGETS.map(str::to_owned).to_vec(),
            false => options.target.clone(),
        };
        // Wrong targets and missing tools are reported before anything is compiled.
        let platforms: Vec<_> =
            targets.iter().map(|target| Platform::of_target(target)).collect::<Result<_>>()?;
        check_targets(&targets, options.all_targets)?;
        if options.c_sources {
            check_tools(&wasm2c())?;
        }
        for (platform, target) in platforms.into_iter().zip(&targets) {
            let path = LibraryBuild { target: Some(target), ..self.build(guid) }.run()?;
            let library = Library { platform, path };
            check_library(&library, guid, options.any_processor)?;
            libraries.push(library);
        }
        if libraries.is_empty() && !options.describe && !options.c_sources {
            let path = self.build(guid).run()?;
            libraries.push(Library { platform: Platform::host()?, path });
        }
        Ok(libraries)
    }

    /// Loads the model from a library for this machine: one that is packed, or one that is compiled for this purpose.
    fn model(&self, libraries: &[Library], guid: &str, time_limit: Duration) -> Result<LoadedModel> {
        let host = Platform::host()?;
        let is_for_here = |library: &&Library| {
            fs::read(&library.path).is_ok_and(|bytes| check_platform(&bytes, host, false).is_ok())
        };
        let path = match libraries.iter().find(is_for_here) {
            Some(library) => library.path.clone(),
            None => self.build(guid).run()?,
        };
        let resources = self.sources.directory.join(RESOURCES);
        // SAFETY: cargo has just compiled it from the author's model, or it has the guid of these sources.
        #[allow(unsafe_code)]
        let model = unsafe { LoadedModel::load_within(&path, Some(&resources), Some(time_limit)) }?;
        check_guid(&fs::read(&path)?, guid, &path)?;
        Ok(model)
    }

    /// Extracts the library for a platform from an FMU and returns its path.
    fn unpack_library(&self, fmu: &Path, platform: Platform) -> Result<PathBuf> {
        let failed = || format!("cannot extract the library for {platform} from {}", fmu.display());
        let mut archive = ZipArchive::new(fs::File::open(fmu).with_context(failed)?).with_context(failed)?;
        let is_library = |name: &String| {
            let mut parts = name.split('/');
            parts.next() == Some("binaries")
                && parts.next().and_then(|part| Platform::of_directory(part).ok()) == Some(platform)
        };
        let name = archive.file_names().flatten().map(|name| name.into_owned()).find(is_library);
        let name = name.context("it has none").with_context(failed)?;
        let directory = Neighbourhood::of(&self.sources.directory)?.workspace.join("target/binaries");
        let path = directory.join(platform.to_string()).join(name.rsplit('/').next().unwrap_or_default());
        let mut entry = archive.by_name(&name).with_context(failed)?;
        write_atomically(&path, |file| Ok(std::io::copy(&mut entry, file).map(|_| ())?))?;
        Ok(path)
    }

    /// Generates the C sources, which an importer can compile for any platform.
    fn c_sources(&self, guid: &str, identifier: &str) -> Result<CSources> {
        let build = LibraryBuild { target: Some(WEBASSEMBLY), arguments: &LINKING, ..self.build(guid) };
        c_sources(&wasm2c(), &build.run()?, identifier)
    }

    /// Returns the settings for compiling a library with this guid for this machine.
    fn build(&self, guid: &str) -> LibraryBuild<'_> {
        let mut environment = self.environment.clone();
        environment.push(("FMU_GUID", Some(guid.into())));
        LibraryBuild {
            directory: self.sources.directory.clone(),
            package: &self.package,
            target: None,
            settings: self.settings.clone(),
            arguments: &[],
            environment,
        }
    }
}

/// Writes an FMU into the directory of its FMI version, and prints its path, size and platforms.
fn pack_in(out: &Path, parts: &Parts) -> Result<()> {
    let directory = match parts.fmi {
        Standard::Fmi2 if !parts.sources.is_empty() => out.join("source"),
        Standard::Fmi2 => out.to_owned(),
        Standard::Fmi3 => out.join("fmi3"),
    };
    let fmu = directory.join(format!("{}.fmu", parts.identifier));
    let size = pack(&fmu, parts)?;
    let mut platforms: Vec<_> =
        parts.libraries.iter().map(|library| library.platform.directory(parts.fmi)).collect();
    platforms.sort_unstable();
    if !parts.sources.is_empty() {
        platforms.push("C sources");
    }
    println!("{}: {} kB, {}", short(&fmu), size.div_ceil(1000), platforms.join(", "));
    Ok(())
}

/// Waits until no other build runs in the same workspace, and returns a lock that lasts until the file is closed. Returns `None` if the
/// lock file cannot be created or locked; the build then continues without a lock.
fn lock(directory: &Path) -> Option<fs::File> {
    fs::create_dir_all(directory).ok()?;
    let file = fs::File::create(directory.join(".fmu-package.lock")).ok()?;
    file.lock().ok()?;
    Some(file)
}

fn wasm2c() -> OsString {
    std::env::var_os("WASM2C").unwrap_or_else(|| "wasm2c".into())
}

/// Checks that a library is for its platform and was compiled from these sources, because any other library would fail to load or
/// would reject every instantiation.
fn check_library(library: &Library, guid: &str, any_processor: bool) -> Result<()> {
    let Library { platform, path } = library;
    let bytes = fs::read(path)
        .with_context(|| format!("cannot read {}, the library for {platform}", path.display()))?;
    check_platform(&bytes, *platform, any_processor).with_context(|| path.display().to_string())?;
    check_guid(&bytes, guid, path)
}

/// Writes a description unless the file is up to date, so that cargo does not see a changed file.
fn write_description(path: &Path, description: &str) -> Result<()> {
    if fs::read(path).ok().as_deref() == Some(description.as_bytes()) {
        println!("{} is up to date", short(path));
        return Ok(());
    }
    write_atomically(path, |file| Ok(file.write_all(description.as_bytes())?))?;
    println!("{} written", short(path));
    Ok(())
}

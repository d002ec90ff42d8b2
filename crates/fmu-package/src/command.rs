//! The command `build_fmu`, the same for every model.

use crate::c_sources::{COMPILED, CSources, LINKING, WEBASSEMBLY, c_sources, check_tools};
use crate::cargo::LibraryBuild;
use crate::changes::Changes;
use crate::connectors::{Terminal, terminals};
use crate::content::ContentFile;
use crate::cross::{GLIBC, TARGETS, ZIGBUILD, check_targets, has_std};
use crate::files::write_atomically;
use crate::library::{check_platform, needed_glibc};
use crate::live::{self, Runnable};
use crate::model::LoadedModel;
use crate::pack::{Library, Parts, pack};
use crate::packages::Neighbourhood;
use crate::platform::Platform;
use crate::sources::Sources;
use crate::terminal::{exit, short};
use crate::universal::join_for_macos;
use crate::variant::{NO_GUID, Variant};
use crate::version::Fmi;
use crate::{fmi2, fmi3};
use anyhow::{Context, Result, bail, ensure};
use clap::{CommandFactory, FromArgMatches};
use std::ffi::OsString;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tempfile::TempDir;
use zip::ZipArchive;

/// The options that every `build_fmu` has. A model with more flattens them into its own.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct BuildOptions {
    /// Declare the parameters tunable instead of fixed (OpenModelica does not let users change those)
    #[arg(long)]
    pub tunable: bool,
    /// Make the FMU for FMI 2.0 or for FMI 3.0 only
    #[arg(long, value_enum, value_name = "2|3", hide_possible_values = true)]
    pub fmi: Option<Fmi>,
    /// Folder for what is made, with a folder fmi3 for FMI 3.0 [default: target/fmu of the workspace]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write only modelDescription.xml of FMI 2.0, into the folder modelDescription of the sources or DIR
    #[arg(long, conflicts_with_all = ["target", "binary"])]
    pub describe: bool,
    /// Print only the guid, which libraries that are compiled elsewhere get from the environment variable FMU_GUID
    #[arg(long, conflicts_with = "describe")]
    pub guid: bool,
    /// Compile for this Rust target instead of this machine; repeat it for several
    #[arg(long, value_name = "TRIPLE")]
    pub target: Vec<String>,
    /// Compile for Linux, Windows and macOS, Intel and ARM (needs Rust's libraries for them and cargo-zigbuild)
    #[arg(long, conflicts_with_all = ["target", "describe", "c_sources"])]
    pub all_targets: bool,
    /// Put in this compiled library, for example win64=model.dll or x86_64-windows=model.fmu, which has it; repeat it for several
    #[arg(long, value_name = "PLATFORM=PATH", value_parser = binary)]
    pub binary: Vec<(String, PathBuf)>,
    /// Make the FMU of C sources instead, for targets with no Rust (FMI 2.0, in the folder source; needs wasm2c)
    #[arg(long, conflicts_with_all = ["target", "binary", "describe"])]
    pub c_sources: bool,
    /// Leave out what lets documentation/index.html run the FMU in a browser (as with --c-sources)
    #[arg(long)]
    pub no_page: bool,
    /// Accept a library for another processor than its platform names (with FMI 2.0, importers on ARM look in linux64)
    #[arg(long, requires = "binary")]
    pub any_processor: bool,
}

fn binary(text: &str) -> Result<(String, PathBuf), String> {
    text.split_once('=')
        .filter(|(platform, path)| !platform.is_empty() && !path.is_empty())
        .map(|(platform, path)| (platform.to_owned(), path.into()))
        .ok_or_else(|| "write PLATFORM=PATH, for example linux64=libmodel.so".to_owned())
}

/// The `main` of a `build_fmu`: does what the arguments of the program say.
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

/// How a model's FMU is built.
#[derive(Clone, Debug)]
pub struct Builder {
    /// The package of the model: `env!("CARGO_PKG_NAME")`.
    pub package: String,
    /// The command that starts this program, for messages; options come behind it.
    pub command: &'static str,
    /// What the FMU is made from.
    pub sources: Sources,
    /// The versions that FMUs are made for if nothing else is said. The description of the first is kept with the
    /// sources.
    pub fmi: Vec<Fmi>,
    /// The terminals of the FMU for FMI 3.0.
    pub terminals: Vec<Terminal>,
    /// The cargo profile of the library.
    pub profile: &'static str,
    /// Settings of cargo for this build, such as `profile.release.lto=false`.
    pub settings: Vec<&'static str>,
    /// Start values that the library is compiled with from elsewhere, see [`Variant::start`].
    pub start: Vec<(String, String)>,
    /// The file that those start values are from, for messages.
    pub start_from: Option<PathBuf>,
    /// Whether they are the ones of the description that is kept with the sources.
    pub is_default: bool,
    /// Scripts for the page that runs the FMU, besides those of every model (see the README in the folder `page`).
    pub page_scripts: Vec<&'static str>,
    /// FMUs that these scripts run beside the model's, each by its package and what it is made from. They are described as
    /// is kept with their sources.
    pub page_fmus: Vec<(&'static str, Sources)>,
    /// Environment variables for the compilation of the library; removed where the value is `None`.
    pub environment: Vec<(&'static str, Option<OsString>)>,
}

/// The profile of a library that is compiled only to be asked, and the usual one of those that are packed.
const DESCRIBED_IN: &str = "release";

/// The description of a model as it is built by default, where it is kept with the sources.
const DESCRIPTION: &str = "modelDescription/modelDescription.xml";

/// The files that the model reads.
const RESOURCES: &str = "modelDescription/resources";

impl Builder {
    /// For a package in the usual layout, started as `cargo run --release --bin build_fmu`.
    ///
    /// The arguments are `env!("CARGO_PKG_NAME")` and `env!("CARGO_MANIFEST_DIR")`.
    pub fn new(package: impl Into<String>, folder: impl Into<PathBuf>) -> Self {
        Self {
            package: package.into(),
            command: "cargo run --release --bin build_fmu --",
            sources: Sources::of_package(folder),
            fmi: vec![Fmi::V2, Fmi::V3],
            terminals: Vec::new(),
            profile: DESCRIBED_IN,
            settings: Vec::new(),
            start: Vec::new(),
            start_from: None,
            is_default: true,
            page_scripts: Vec::new(),
            page_fmus: Vec::new(),
            environment: Vec::new(),
        }
    }

    /// Does what the options say, and says on stdout what was made: compiles the libraries, asks the one for this machine
    /// what its model is, tries that, writes the descriptions, packs.
    ///
    /// # Errors
    /// When the model contradicts itself, a library cannot be compiled or does not belong to the sources, or a file cannot
    /// be written.
    pub fn run(&self, options: &BuildOptions) -> Result<()> {
        let guid = self.variant(options.tunable)?.guid();
        if options.guid {
            println!("{guid}");
            return Ok(());
        }
        let is_default = self.is_default && !options.tunable;
        let kept = self.sources.folder.join(DESCRIPTION);
        let described_in = match &options.out {
            _ if !options.describe => None,
            Some(folder) => Some(folder.join("modelDescription.xml")),
            None if is_default => Some(kept.clone()),
            None => bail!("{DESCRIPTION} is for the defaults; name another folder with --out"),
        };
        self.check_versions(options)?;
        let content = self.sources.content_files()?;
        let workspace = Neighbourhood::of(&self.sources.folder)?.workspace;
        // Another build would put its library in the place of this one's.
        let _alone = lock(&workspace.join("target"));
        let mut libraries = self.libraries(options, &guid)?;
        let model = self.model(options.tunable, &libraries, &guid)?;
        let sources = match options.c_sources {
            true => self.c_sources(options.tunable, model.identifier())?,
            false => CSources::new(),
        };
        let describe = |fmi: Fmi, guid: &str| {
            let source_files = sources.iter().take(COMPILED).map(|(name, _)| name.clone()).collect();
            let guid = Some(guid.to_owned());
            self.describe(&model, fmi, &Changes { guid, tunable_parameters: options.tunable, source_files })
        };
        let terminals = terminals(&model, &self.terminals, &content)?;
        let versions = self.versions(options, &model);
        if let Some(path) = described_in {
            let fmi = versions.first().context("there is no version to describe it for")?;
            // Kept with the sources, it must not change whenever they do.
            return write_description(&path, &describe(*fmi, NO_GUID)?);
        }
        let mut descriptions = Vec::new();
        for &fmi in &versions {
            descriptions.push((fmi, describe(fmi, &guid)?));
        }
        if versions.contains(&Fmi::V2) {
            join_for_macos(&mut libraries)?;
        }
        // The page runs the FMU for FMI 2.0.
        let can_have_page = model.table.variables.iter().all(|variable| variable.base().is_in_fmi2());
        let with_page = match options.no_page || options.c_sources || !can_have_page {
            true => None,
            false => self.live_page(options.tunable, &guid, &model, describe(Fmi::V2, &guid)?, &content)?,
        };
        let content = with_page.as_ref().map_or(&content, |(_, content)| content);
        let folder = options.out.clone().unwrap_or_else(|| workspace.join("target/fmu"));
        for (fmi, description) in &descriptions {
            // FMI Library calls those of FMI 2.0 a fatal mismatch (and goes on).
            let terminals = terminals.as_deref().filter(|_| *fmi == Fmi::V3);
            let (identifier, libraries, sources) = (model.identifier(), &libraries[..], &sources[..]);
            let parts = Parts { fmi: *fmi, identifier, description, terminals, libraries, sources, content };
            pack_in(&folder, &parts)?;
        }
        let start = match &self.start_from {
            Some(file) => format!(", parameters from {}", short(file)),
            None => String::new(),
        };
        let tunable = if options.tunable { ", tunable" } else { "" };
        println!("guid {guid}{start}{tunable}");
        self.warn_of_glibc(options, &libraries);
        if is_default && !options.c_sources {
            self.compare_with_kept(&kept, &descriptions, &guid);
        }
        Ok(())
    }

    fn describe(&self, model: &LoadedModel, fmi: Fmi, changes: &Changes) -> Result<String> {
        let text = match fmi {
            Fmi::V2 => fmi2::describe(model, changes),
            Fmi::V3 => fmi3::describe(model, changes),
        };
        text.with_context(|| match &self.start_from {
            Some(file) if !self.is_default => short(file),
            _ => model.identifier().to_owned(),
        })
    }

    /// Tells the user if the library, compiled for this machine, needs a newer glibc than those compiled for a target.
    fn warn_of_glibc(&self, options: &BuildOptions, libraries: &[Library]) {
        // A library that is compiled with other settings is only tried here.
        let is_shipped = self.settings.is_empty() && options.target.is_empty() && options.binary.is_empty();
        let needed = |library: &Library| needed_glibc(&fs::read(&library.path).ok()?);
        if let Some((major, minor)) = libraries.first().filter(|_| is_shipped).and_then(needed)
            && format!("{major}.{minor}") != GLIBC
        {
            let target = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
            eprintln!(
                "note: the library needs glibc {major}.{minor}, as this system has it; for glibc {GLIBC}, add --target {target} \
                 (with {ZIGBUILD}: pip install {ZIGBUILD})"
            );
        }
    }

    /// Tells the user if the description that is kept with the sources is another one.
    fn compare_with_kept(&self, kept: &Path, descriptions: &[(Fmi, String)], guid: &str) {
        if let Some((fmi, description)) = descriptions.first()
            && self.fmi.first() == Some(fmi)
            && let Ok(text) = fs::read_to_string(kept)
            && text != description.replace(guid, NO_GUID)
        {
            eprintln!(
                "note: {DESCRIPTION} in the sources is out of date; write it anew with\n      {} --describe",
                self.command
            );
        }
    }

    /// Whether the options go together with the versions that FMUs are made for.
    fn check_versions(&self, options: &BuildOptions) -> Result<()> {
        let only_fmi2 = options.fmi.map_or(self.fmi == [Fmi::V2], |fmi| fmi == Fmi::V2);
        ensure!(!options.c_sources || options.fmi != Some(Fmi::V3), "C sources are made for FMI 2.0 only");
        ensure!(
            !options.any_processor || only_fmi2,
            "FMI 3.0 has a folder for every processor; --any-processor goes with --fmi 2 only"
        );
        Ok(())
    }

    /// The versions that are asked for, or those that have all the types of the model's variables.
    fn versions(&self, options: &BuildOptions, model: &LoadedModel) -> Vec<Fmi> {
        if let Some(fmi) = options.fmi.or(options.c_sources.then_some(Fmi::V2)) {
            return vec![fmi];
        }
        let lacking = model.table.variables.iter().find(|variable| !variable.base().is_in_fmi2());
        let Some(variable) = lacking.filter(|_| self.fmi.contains(&Fmi::V3)) else { return self.fmi.clone() };
        println!("{} is {}, which FMI 2.0 lacks: for FMI 3.0 only", variable.name, variable.base());
        vec![Fmi::V3]
    }

    fn variant(&self, tunable: bool) -> Result<Variant> {
        Ok(Variant { sources: self.sources.fingerprint()?, start: self.start.clone(), tunable })
    }

    /// The libraries that are packed.
    fn libraries(&self, options: &BuildOptions, guid: &str) -> Result<Vec<Library>> {
        let mut libraries = Vec::new();
        for (platform, path) in &options.binary {
            let platform = Platform::of_folder(platform)?;
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
        // What cannot be meant or is missing is said before anything is compiled.
        let platforms: Vec<_> =
            targets.iter().map(|target| Platform::of_target(target)).collect::<Result<_>>()?;
        check_targets(&targets, options.all_targets)?;
        if options.c_sources {
            check_tools(&wasm2c())?;
        }
        for (platform, target) in platforms.into_iter().zip(&targets) {
            let path = self.compile(self.profile, options.tunable, Some(target), &[])?;
            let library = Library { platform, path };
            check_library(&library, guid, options.any_processor)?;
            libraries.push(library);
        }
        if libraries.is_empty() && !options.describe && !options.c_sources {
            let path = self.compile(self.profile, options.tunable, None, &[])?;
            libraries.push(Library { platform: Platform::host()?, path });
        }
        Ok(libraries)
    }

    /// The model of a library for this machine: of one that is packed, or of one that is compiled for this.
    fn model(&self, tunable: bool, libraries: &[Library], guid: &str) -> Result<LoadedModel> {
        let host = Platform::host()?;
        let is_for_here = |library: &&Library| {
            fs::read(&library.path).is_ok_and(|bytes| check_platform(&bytes, host, false).is_ok())
        };
        let path = match libraries.iter().find(is_for_here) {
            Some(library) => library.path.clone(),
            None => self.compile(DESCRIBED_IN, tunable, None, &[])?,
        };
        // SAFETY: cargo has made it of the author's model just now, or it has the guid of its sources.
        #[allow(unsafe_code)]
        let model = unsafe { LoadedModel::load(&path, Some(&self.sources.folder.join(RESOURCES))) }?;
        check_guid(&fs::read(&path)?, guid, &path)?;
        Ok(model)
    }

    /// The library for a platform that is in an FMU, as another machine has made it.
    fn unpack_library(&self, fmu: &Path, platform: Platform) -> Result<PathBuf> {
        let of = || format!("cannot take the library for {platform} out of {}", fmu.display());
        let mut archive = ZipArchive::new(fs::File::open(fmu).with_context(of)?).with_context(of)?;
        let in_folder = |name: &String| {
            let mut parts = name.split('/');
            parts.next() == Some("binaries")
                && parts.next().and_then(|folder| Platform::of_folder(folder).ok()) == Some(platform)
        };
        let name = archive.file_names().flatten().map(|name| name.into_owned()).find(in_folder);
        let name = name.context("it has none").with_context(of)?;
        let folder = Neighbourhood::of(&self.sources.folder)?.workspace.join("target/binaries");
        let path = folder.join(platform.to_string()).join(name.rsplit('/').next().unwrap_or_default());
        let mut entry = archive.by_name(&name).with_context(of)?;
        write_atomically(&path, |file| Ok(std::io::copy(&mut entry, file).map(|_| ())?))?;
        Ok(path)
    }

    /// The sources in C, for every platform.
    fn c_sources(&self, tunable: bool, identifier: &str) -> Result<CSources> {
        let module = self.compile(self.profile, tunable, Some(WEBASSEMBLY), &LINKING)?;
        c_sources(&wasm2c(), &module, identifier)
    }

    /// The content with the page that runs the FMU, and the directory of that page. `None`, with a note, if the model cannot be
    /// compiled for WebAssembly.
    fn live_page(
        &self,
        tunable: bool,
        guid: &str,
        model: &LoadedModel,
        description: String,
        content: &[ContentFile],
    ) -> Result<Option<(TempDir, Vec<ContentFile>)>> {
        if !has_std(WEBASSEMBLY) {
            eprintln!("note: no page runs the FMU in a browser; that needs: rustup target add {WEBASSEMBLY}");
            return Ok(None);
        }
        let small = format!("profile.{}.opt-level=\"z\"", self.profile);
        let settings: Vec<_> = self.settings.iter().copied().chain([small.as_str()]).collect();
        let runnable = |description, path: PathBuf, guid: &str| {
            let module = fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
            check_guid(&module, guid, &path)?;
            anyhow::Ok(Runnable { description, module })
        };
        let path = match self.build(self.profile, tunable, Some(WEBASSEMBLY), &settings, &LINKING) {
            Ok(path) => path,
            Err(error) => {
                eprintln!("note: no page runs the FMU in a browser (--no-page does not try that): {error:#}");
                return Ok(None);
            }
        };
        let mut runnables = vec![runnable(description, path, guid)?];
        for (package, sources) in &self.page_fmus {
            let guid = Variant { sources: sources.fingerprint()?, start: Vec::new(), tunable: false }.guid();
            let kept = sources.folder.join(DESCRIPTION);
            let kept =
                fs::read_to_string(&kept).with_context(|| format!("cannot read {}", kept.display()))?;
            let build = LibraryBuild {
                folder: sources.folder.clone(),
                package,
                profile: self.profile,
                target: Some(WEBASSEMBLY),
                settings: &settings,
                arguments: &LINKING,
                environment: vec![("FMU_GUID", Some(guid.clone().into()))],
            };
            runnables.push(runnable(kept.replace(NO_GUID, &guid), build.run()?, &guid)?);
        }
        let info = &model.table.info;
        live::with_page(content, (&info.name, &info.description), &runnables, &self.page_scripts).map(Some)
    }

    fn compile(
        &self,
        profile: &str,
        tunable: bool,
        target: Option<&str>,
        arguments: &[&str],
    ) -> Result<PathBuf> {
        self.build(profile, tunable, target, &self.settings, arguments)
    }

    fn build(
        &self,
        profile: &str,
        tunable: bool,
        target: Option<&str>,
        settings: &[&str],
        arguments: &[&str],
    ) -> Result<PathBuf> {
        let mut environment = self.environment.clone();
        environment.push(("FMU_GUID", Some(self.variant(tunable)?.guid().into())));
        let build = LibraryBuild {
            folder: self.sources.folder.clone(),
            package: &self.package,
            profile,
            target,
            settings,
            arguments,
            environment,
        };
        build.run()
    }
}

/// Writes an FMU into the folder of its version, and says so.
fn pack_in(folder: &Path, parts: &Parts) -> Result<()> {
    let folder = match parts.fmi {
        Fmi::V2 if !parts.sources.is_empty() => folder.join("source"),
        Fmi::V2 => folder.to_owned(),
        Fmi::V3 => folder.join("fmi3"),
    };
    let fmu = folder.join(format!("{}.fmu", parts.identifier));
    let size = pack(&fmu, parts)?;
    let mut platforms: Vec<_> =
        parts.libraries.iter().map(|library| library.platform.folder(parts.fmi)).collect();
    platforms.sort_unstable();
    if !parts.sources.is_empty() {
        platforms.push("C sources");
    }
    println!("{}: {} kB, {}", short(&fmu), size.div_ceil(1000), platforms.join(", "));
    Ok(())
}

/// Waits until no other build of the same workspace runs. Without a place for the lock there is none.
fn lock(folder: &Path) -> Option<fs::File> {
    fs::create_dir_all(folder).ok()?;
    let file = fs::File::create(folder.join(".fmu-package.lock")).ok()?;
    file.lock().ok()?;
    Some(file)
}

fn wasm2c() -> OsString {
    std::env::var_os("WASM2C").unwrap_or_else(|| "wasm2c".into())
}

/// A library for another machine would not load, one with another guid refuse every instance.
fn check_library(library: &Library, guid: &str, any_processor: bool) -> Result<()> {
    let Library { platform, path } = library;
    let bytes = fs::read(path)
        .with_context(|| format!("cannot read {}, the library for {platform}", path.display()))?;
    check_platform(&bytes, *platform, any_processor).with_context(|| path.display().to_string())?;
    check_guid(&bytes, guid, path)
}

fn check_guid(library: &[u8], guid: &str, path: &Path) -> Result<()> {
    let has = |text: &str| library.windows(text.len()).any(|window| window == text.as_bytes());
    let path = path.display();
    ensure!(
        has(guid) || has("fmi2Instantiate"),
        "{path} has no functions of FMI; its crate needs `export_fmu!(...)` in src/lib.rs (`offer!` makes none)",
    );
    ensure!(
        has(guid) || !has(NO_GUID),
        "{path} has no guid: compile it with FMU_GUID={guid} in the environment, and let INFO begin with info!",
    );
    ensure!(
        has(guid),
        "{path} was not compiled from these sources and parameters (the guid {guid} is not in it); compile it again",
    );
    Ok(())
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

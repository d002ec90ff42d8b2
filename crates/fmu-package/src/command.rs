//! The command `build_fmu`, which is the same for every model.

use crate::c_sources::{LINKING, WEBASSEMBLY, c_sources, check_tools, compiled_files};
use crate::cargo::LibraryBuild;
use crate::checker::{Check, passed_checker};
use crate::connectors::{Terminal, terminals};
use crate::cross::{GLIBC, TARGETS, ZIGBUILD, check_targets};
use crate::describe::{Changes, describe};
use crate::library::{Library, check_platform, stamp, with_stamp};
use crate::model::LoadedModel;
use crate::options::BuildOptions;
use crate::pack::{Files, Packed, Parts, pack};
use crate::packages::workspace;
use crate::page::Page;
use crate::page_html::PAGE;
use crate::platform::Platform;
use crate::sources::{DESCRIPTION, Sources};
use crate::starts::indexed_starts;
use crate::terminal::{exit, short};
use crate::universal::join_for_macos;
use anyhow::{Context, Error, Result, bail, ensure};
use clap::FromArgMatches;
use fmi_abi::Standard;
use fmi_abi::files::binaries::Binary;
use fmi_abi::stamp::NO_GUID;
use fmi_abi::write::write_atomically;
use std::ffi::OsString;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;
use tempfile::TempDir;

/// The default of [`BuildOptions::time_limit`].
const TIME_LIMIT: Duration = Duration::from_secs(60);

/// The `main` of a `build_fmu`: reads the arguments of the program and builds the FMUs.
pub fn build(builder: Result<Builder>) -> ExitCode {
    exit(builder.and_then(|builder| {
        let usage = format!("{} [OPTIONS]", builder.command);
        let matches = BuildOptions::command("build_fmu", "Builds the FMUs of a model", &usage).get_matches();
        builder.run(&BuildOptions::from_arg_matches(&matches)?)
    }))
}

/// The settings for building a model's FMUs.
#[derive(Clone, Debug)]
pub struct Builder {
    /// The package of the model: `env!("CARGO_PKG_NAME")`.
    pub package: String,
    /// The command that starts this program, to which messages append options.
    pub command: &'static str,
    /// The package of the model, and the files that the FMU contains unchanged.
    pub sources: Sources,
    /// FMI versions of the FMUs that are built by default. The committed model description is for the first of them.
    pub fmi: Vec<Standard>,
    /// The terminals of the FMU for FMI 3.0.
    pub terminals: Vec<Terminal>,
    /// Settings of cargo for this build, such as `profile.release.lto=false`.
    pub settings: Vec<String>,
    /// Start values that replace the start values of the compiled model: the variable's name and the value, for example `0.5`, `true`, or
    /// the number of an item. They are written into the compiled library, so the library need not be compiled again.
    pub start: Vec<(String, String)>,
    /// Label in messages for a build with other parameter values than the default ones. `None` for the default values, whose
    /// description is kept with the sources.
    pub variant: Option<String>,
    /// Additions to the page that runs the FMU.
    pub page: Page,
    /// The program cargo-fmu, which checks each FMU before it gets its name. `None` packs without this check. `cargo fmu build` passes its
    /// own path, also to the build program of a package.
    pub checker: Option<PathBuf>,
}

/// The directory of the files that the model reads.
const RESOURCES: &str = "modelDescription/resources";

impl Builder {
    /// Returns the settings for a package in the usual layout, whose program is started with `cargo run --bin build_fmu`.
    ///
    /// Pass `env!("CARGO_PKG_NAME")` and its [directory](crate::directory_of).
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
            checker: passed_checker(),
        }
    }

    /// Compiles the libraries, checks the model with the library for this machine, writes the descriptions, packs the FMUs, and reports
    /// them on stdout. With `options.describe`, only writes a description.
    ///
    /// # Errors
    /// When the model contradicts itself, a library cannot be compiled or is of another model, or a file cannot be written.
    pub fn run(&self, options: &BuildOptions) -> Result<()> {
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
        let workspace = workspace(&self.sources.directory)?;
        let target = workspace.join("target");
        // Without the lock, another build could overwrite the library of this one.
        let _lock = lock(&target);
        let mut libraries = self.libraries(options)?;
        let time_limit = options.time_limit.map_or(TIME_LIMIT, Duration::from_secs);
        let Variant { model, starts, library, directory } =
            self.variant_of(&mut libraries, &target, time_limit)?;
        let module = if options.c_sources { Some(self.module()?) } else { None };
        let c_sources = |guid: &str| self.c_sources(module.as_deref(), guid, &starts, model.identifier());
        let source_files = module.as_ref().map_or(Vec::new(), |_| compiled_files(model.identifier()).into());
        let changes = Changes { tunable_parameters: options.tunable, source_files };
        let terminals = terminals(&model, &self.terminals, &content)?;
        let versions = self.versions(options, &model);
        if let Some(path) = described_in {
            let fmi = versions.first().context("there is no version to describe it for")?;
            return write_description(&path, &self.describe(&model, *fmi, &changes)?);
        }
        let mut descriptions = Vec::new();
        for &fmi in &versions {
            descriptions.push((fmi, self.describe(&model, fmi, &changes)?));
        }
        let content_without_page: Vec<_> = content.iter().filter(|file| file.name != PAGE).cloned().collect();
        if let Some(checker) = &self.checker {
            // Both versions have the same model, so one is checked: FMI 3.0, whose description states more dependencies. If there are
            // arrays, both are, because FMI 2.0 has their elements as variables.
            let unchecked = if model.table.arrays { 0 } else { descriptions.len() - 1 };
            let mut printed: Vec<String> = Vec::new();
            for (fmi, description) in &descriptions[unchecked..] {
                let parts = Parts {
                    fmi: *fmi,
                    identifier: model.identifier(),
                    description,
                    terminals: None,
                    libraries: std::slice::from_ref(&library),
                    with_guid: &|_| Ok(Files::new()),
                    content: &content_without_page,
                };
                let fmu = directory.path().join(format!("{}.fmu", model.identifier()));
                let Packed { guid, .. } = pack(&fmu, &parts)?;
                let record = target.join(format!(".{}-fmi{}-checked", model.identifier(), *fmi as u32 + 2));
                let check = Check { checker, fmu: &fmu, guid: &guid, limit: time_limit, record: &record };
                // Usually the warnings of both versions are the same.
                for line in check.run()?.lines() {
                    if !printed.iter().any(|before| before == line) {
                        eprintln!("{line}");
                        printed.push(line.to_owned());
                    }
                }
            }
        }
        if versions.contains(&Standard::Fmi2) {
            join_for_macos(&mut libraries)?;
        }
        // The page runs the FMU for FMI 2.0, so all variables must have types of FMI 2.0.
        let can_run_in_page = model.table.variables.iter().all(|variable| variable.base().is_in_fmi2());
        let of_page = match can_run_in_page {
            true => self.describe(&model, Standard::Fmi2, &changes)?,
            false => descriptions[0].1.clone(),
        };
        let written = self.page.written(&of_page, &content)?;
        let page = match options.no_page || options.c_sources || !can_run_in_page {
            true => None,
            false => self.page.compile(&self.build(), of_page)?,
        };
        let html = |guid: &str| -> Result<Option<Vec<u8>>> {
            match &page {
                Some(page) => {
                    page.html(written.as_deref(), guid, &starts, &model.table.info, &content).map(Some)
                }
                None => Ok(written.clone().map(String::into_bytes)),
            }
        };
        let with_guid = |guid: &str| -> Result<Files> {
            let mut files = c_sources(guid)?;
            files.iter_mut().for_each(|(name, _)| name.insert_str(0, "sources/"));
            files.extend(html(guid)?.map(|html| (PAGE.to_owned(), html)));
            Ok(files)
        };
        let out = options.out.clone().unwrap_or_else(|| target.join("fmu"));
        for (fmi, description) in &descriptions {
            // If an FMU for FMI 2.0 has terminals, FMI Library reports a fatal mismatch, although it continues.
            let terminals = terminals.as_deref().filter(|_| *fmi == Standard::Fmi3);
            let (identifier, libraries) = (model.identifier(), &libraries[..]);
            let content = &content_without_page[..];
            let with_guid = &with_guid;
            self.pack_in(
                &out,
                options,
                &Parts { fmi: *fmi, identifier, description, terminals, libraries, with_guid, content },
            )?;
        }
        self.warn_of_glibc(options, &libraries);
        if is_default && !options.c_sources {
            self.compare_with_kept(&kept, &descriptions);
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
        let needed = |library: &Library| Binary::all(&library.bytes).ok()?.first()?.needed_glibc();
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
    fn compare_with_kept(&self, kept: &Path, descriptions: &[(Standard, String)]) {
        if let Some((fmi, description)) = descriptions.first()
            && self.fmi.first() == Some(fmi)
            && let Ok(text) = fs::read_to_string(kept)
            && text != *description
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
    fn libraries(&self, options: &BuildOptions) -> Result<Vec<Library>> {
        let mut libraries = Vec::new();
        for (platform, path) in &options.binary {
            libraries.push(Library::read(Platform::of_directory(platform)?, path, options.any_processor)?);
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
            let path = LibraryBuild { target: Some(target), ..self.build() }.run()?;
            libraries.push(Library::read(platform, &path, options.any_processor)?);
        }
        if libraries.is_empty() && !options.describe && !options.c_sources {
            libraries.push(self.library()?);
        }
        Ok(libraries)
    }

    /// Compiles the library for this machine.
    fn library(&self) -> Result<Library> {
        Library::read(Platform::host()?, &self.build().run()?, false)
    }

    /// Loads the model from a library for this machine: one that is packed, or one that is compiled for this purpose. Writes the start
    /// values into all libraries, and checks that they are of one model.
    fn variant_of(&self, libraries: &mut [Library], target: &Path, limit: Duration) -> Result<Variant> {
        let host = Platform::host()?;
        let own =
            libraries.iter().find(|library| check_platform(&library.bytes, host, false).is_ok()).cloned();
        let own = own.map_or_else(|| self.library(), Ok)?;
        let directory = tempfile::tempdir_in(target).context("cannot make a temporary directory")?;
        let load = |starts: &[(u32, f64)]| {
            let path = own.file(starts, directory.path())?;
            let resources = self.sources.directory.join(RESOURCES);
            // SAFETY: the library contains a stamp of fmu-export. Cargo has just compiled it from the author's model, or the author names
            // it as the library of that model.
            #[allow(unsafe_code)]
            unsafe {
                LoadedModel::load_within(&path, Some(&resources), Some(limit))
            }
        };
        let mut model = load(&[])?;
        let starts = indexed_starts(&model.table, &self.start)?;
        if !starts.is_empty() {
            model = load(&starts)?;
        }
        let own_stamp = stamp(&own.bytes)?;
        for library in libraries {
            ensure!(
                stamp(&library.bytes)?.interface() == own_stamp.interface(),
                "the library for {} has other variables than the model: it was compiled from other sources; compile it again",
                library.platform
            );
            library.bytes = with_stamp(&library.bytes, NO_GUID, Some(&starts))?;
        }
        let bytes = with_stamp(&own.bytes, NO_GUID, Some(&starts))?;
        Ok(Variant { model, starts, library: Library::new(host, bytes), directory })
    }

    /// Compiles the model to the WebAssembly module from which C sources are made.
    fn module(&self) -> Result<Vec<u8>> {
        let path = LibraryBuild { target: Some(WEBASSEMBLY), arguments: &LINKING, ..self.build() }.run()?;
        fs::read(&path).with_context(|| format!("cannot read {}", path.display()))
    }

    /// Returns the C sources, which an importer can compile for any platform; none without a module.
    fn c_sources(
        &self,
        module: Option<&[u8]>,
        guid: &str,
        starts: &[(u32, f64)],
        identifier: &str,
    ) -> Result<Files> {
        let Some(module) = module else { return Ok(Files::new()) };
        c_sources(&wasm2c(), &with_stamp(module, guid, Some(starts))?, identifier)
    }

    /// Returns the settings for compiling a library for this machine.
    fn build(&self) -> LibraryBuild<'_> {
        LibraryBuild {
            directory: self.sources.directory.clone(),
            package: &self.package,
            target: None,
            settings: self.settings.clone(),
            arguments: &[],
        }
    }

    /// Writes an FMU into the directory of its FMI version, and prints its path, size, platforms, guid and variant.
    fn pack_in(&self, out: &Path, options: &BuildOptions, parts: &Parts) -> Result<()> {
        let directory = match parts.fmi {
            Standard::Fmi2 if options.c_sources => out.join("source"),
            Standard::Fmi2 => out.to_owned(),
            Standard::Fmi3 => out.join("fmi3"),
        };
        let fmu = directory.join(format!("{}.fmu", parts.identifier));
        let Packed { guid, size } = pack(&fmu, parts)?;
        let mut platforms: Vec<_> =
            parts.libraries.iter().map(|library| library.platform.directory(parts.fmi)).collect();
        platforms.sort_unstable();
        if options.c_sources {
            platforms.push("C sources");
        }
        let variant = self.variant.iter().map(|label| format!(", {label}")).collect::<String>();
        let tunable = if options.tunable { ", tunable" } else { "" };
        let size = size.div_ceil(1000);
        println!("{}: {size} kB, {}{variant}{tunable}, guid {guid}", short(&fmu), platforms.join(", "));
        Ok(())
    }
}

/// The model of a library, and the start values that the library does not have from its compilation.
struct Variant {
    model: LoadedModel,
    /// Index in the table and value.
    starts: Vec<(u32, f64)>,
    /// The library for this machine, with the start values.
    library: Library,
    /// Contains the loaded library.
    directory: TempDir,
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

/// Writes a description unless the file is up to date, so that cargo does not see a changed file.
fn write_description(path: &Path, description: &str) -> Result<()> {
    if fs::read(path).ok().as_deref() == Some(description.as_bytes()) {
        println!("{} is up to date", short(path));
        return Ok(());
    }
    write_atomically(path, |file| file.write_all(description.as_bytes())).map_err(Error::msg)?;
    println!("{} written", short(path));
    Ok(())
}

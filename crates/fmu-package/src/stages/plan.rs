//! Decides what a build makes, so that wrong options and missing tools are reported before anything is compiled.

use crate::builder::Builder;
use crate::c_sources::check_tools;
use crate::cargo::LibraryBuild;
use crate::content::ContentFile;
use crate::cross::{TARGETS, check_targets};
use crate::options::BuildOptions;
use crate::packages::workspace;
use crate::page_html::PAGE;
use crate::platform::Platform;
use crate::sources::DESCRIPTION;
use anyhow::{Result, bail, ensure};
use fmi_abi::Standard;
use std::env;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The default of [`BuildOptions::time_limit`].
const TIME_LIMIT: Duration = Duration::from_secs(60);

/// What a build makes.
pub(crate) struct Plan<'a> {
    pub builder: &'a Builder,
    /// The file of the description, if nothing else is written.
    pub description: Option<PathBuf>,
    /// The description that is kept with the sources, if the FMUs should contain the same.
    pub kept: Option<PathBuf>,
    /// The page and the files that the FMU contains unchanged.
    pub content: Vec<ContentFile>,
    /// The directory of cargo's output.
    pub target: PathBuf,
    /// The directory of the FMUs.
    pub out: PathBuf,
    /// The only FMI version to build; `None` for the versions in [`Builder::fmi`].
    pub fmi: Option<Standard>,
    /// Libraries that are compiled already.
    pub binaries: Vec<(Platform, &'a Path)>,
    /// Whether these may be for another processor than their platform.
    pub any_processor: bool,
    /// Targets to compile for; for this machine if there are neither targets nor `binaries`.
    pub targets: Vec<(Platform, String)>,
    /// The program that translates the library to C, if the FMU contains C sources instead of libraries.
    pub wasm2c: Option<OsString>,
    /// Whether the FMU gets a page that runs it.
    pub with_page: bool,
    /// Whether the parameters are tunable.
    pub tunable: bool,
    /// Maximum duration of one call of the model.
    pub time_limit: Duration,
}

impl<'a> Plan<'a> {
    /// Decides what these options of a program that builds FMUs mean.
    ///
    /// # Errors
    /// When options exclude each other, or when a tool or a file is missing.
    pub fn of(builder: &'a Builder, options: &'a BuildOptions) -> Result<Self> {
        let is_default = builder.variant.is_none() && !options.tunable;
        let kept = builder.sources.directory.join(DESCRIPTION);
        let description = match &options.out {
            _ if !options.describe => None,
            Some(directory) => Some(directory.join("modelDescription.xml")),
            None if is_default => Some(kept.clone()),
            None => bail!("{DESCRIPTION} is for the defaults; name another directory with --out"),
        };
        check_versions(builder, options)?;
        let content = builder.sources.content_files()?;
        let target = workspace(&builder.sources.directory)?.join("target");
        let binaries = options.binary.iter().map(|(name, path)| Ok((Platform::of_directory(name)?, &**path)));
        let binaries = binaries.collect::<Result<_>>()?;
        let targets = match options.all_targets {
            true => TARGETS.map(str::to_owned).to_vec(),
            false => options.target.clone(),
        };
        let platforms: Vec<_> =
            targets.iter().map(|target| Platform::of_target(target)).collect::<Result<_>>()?;
        check_targets(&targets, options.all_targets)?;
        let wasm2c = || env::var_os("WASM2C").unwrap_or_else(|| "wasm2c".into());
        let wasm2c = options.c_sources.then(wasm2c);
        wasm2c.as_deref().map_or(Ok(()), check_tools)?;
        Ok(Self {
            builder,
            description,
            kept: (is_default && !options.c_sources).then_some(kept),
            content,
            out: options.out.clone().unwrap_or_else(|| target.join("fmu")),
            target,
            fmi: options.fmi.or(options.c_sources.then_some(Standard::Fmi2)),
            binaries,
            any_processor: options.any_processor,
            targets: platforms.into_iter().zip(targets).collect(),
            wasm2c,
            with_page: !options.no_page && !options.c_sources,
            tunable: options.tunable,
            time_limit: options.time_limit.map_or(TIME_LIMIT, Duration::from_secs),
        })
    }

    /// Returns the settings for compiling a library for this machine.
    pub fn build(&self) -> LibraryBuild<'a> {
        LibraryBuild {
            directory: self.builder.sources.directory.clone(),
            package: &self.builder.package,
            target: None,
            settings: self.builder.settings.clone(),
            arguments: &[],
        }
    }

    /// Returns the files that the FMU contains unchanged.
    pub fn content_without_page(&self) -> Vec<ContentFile> {
        self.content.iter().filter(|file| file.name != PAGE).cloned().collect()
    }
}

/// Checks that the options are possible for the FMI versions of the FMUs.
fn check_versions(builder: &Builder, options: &BuildOptions) -> Result<()> {
    let only_fmi2 = options.fmi.map_or(builder.fmi == [Standard::Fmi2], |fmi| fmi == Standard::Fmi2);
    ensure!(!options.c_sources || options.fmi != Some(Standard::Fmi3), "C sources are made for FMI 2.0 only");
    ensure!(
        !options.any_processor || only_fmi2,
        "FMI 3.0 has a directory for every processor; --any-processor goes with --fmi 2 only"
    );
    Ok(())
}

//! The options of a program that builds FMUs. They are declared without clap's derive macros, because these take a sixth of the time in
//! which a new clone compiles that program.

use crate::terminal::fmi_version;
use clap::error::Error;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches, value_parser};
use fmi_abi::Standard;
use std::path::PathBuf;

/// The options that every `build_fmu` has. A program with more options adds them to a [`command`](Self::command), or includes this struct
/// with `#[command(flatten)]`.
#[derive(Clone, Debug, Default)]
pub struct BuildOptions {
    /// Declare the parameters tunable instead of fixed.
    pub tunable: bool,
    /// Build only the FMU for FMI 2.0 or for FMI 3.0.
    pub fmi: Option<Standard>,
    /// Directory for the FMU of FMI 2.0, with a directory fmi3 for the FMU of FMI 3.0; by default `target/fmu` of the workspace.
    pub out: Option<PathBuf>,
    /// Write only modelDescription.xml.
    pub describe: bool,
    /// Rust targets to compile for, instead of this machine.
    pub target: Vec<String>,
    /// Compile for Linux and macOS on Intel and ARM, and for Windows on Intel.
    pub all_targets: bool,
    /// Platforms and compiled libraries to add.
    pub binary: Vec<(String, PathBuf)>,
    /// Build an FMU of C sources.
    pub c_sources: bool,
    /// Leave out the page that runs the FMU in a browser.
    pub no_page: bool,
    /// Maximum duration in seconds of one call of the model while the build checks it; 60 if it is `None`.
    pub time_limit: Option<u64>,
    /// Accept a library whose processor differs from its platform.
    pub any_processor: bool,
}

impl BuildOptions {
    /// Returns a command with these options.
    pub fn command(name: &'static str, about: &'static str, usage: &str) -> Command {
        Self::augment_args(Command::new(name).about(about).override_usage(usage.to_owned()))
    }
}

fn flag(name: &'static str, help: &'static str) -> Arg {
    Arg::new(name).long(name).help(help).action(ArgAction::SetTrue)
}

fn option(name: &'static str, value: &'static str, help: &'static str) -> Arg {
    Arg::new(name).long(name).value_name(value).help(help)
}

impl Args for BuildOptions {
    fn augment_args(command: Command) -> Command {
        command.args([
            flag(
                "tunable",
                "Declare the parameters tunable instead of fixed (OpenModelica does not let users change tunable parameters)",
            ),
            option("fmi", "2|3", "Build only the FMU for FMI 2.0 or for FMI 3.0").value_parser(fmi_version),
            option(
                "out",
                "DIR",
                "Directory for the FMU of FMI 2.0, with a directory fmi3 for the FMU of FMI 3.0 [default: target/fmu of the workspace]",
            )
            .value_parser(value_parser!(PathBuf)),
            flag(
                "describe",
                "Write only modelDescription.xml, of FMI 2.0 or of the version --fmi, into the directory modelDescription of the sources or DIR",
            )
            .conflicts_with_all(["target", "binary"]),
            option("target", "TRIPLE", "Compile for this Rust target instead of this machine; repeat it for several")
                .action(ArgAction::Append),
            flag(
                "all-targets",
                "Compile for Linux and macOS on Intel and ARM, and for Windows on Intel (needs Rust's libraries for them and cargo-zigbuild)",
            )
            .conflicts_with_all(["target", "describe", "c-sources"]),
            option(
                "binary",
                "PLATFORM=PATH",
                "Add this compiled library, for example win64=model.dll, or the one in an FMU, x86_64-windows=model.fmu; repeat it for several",
            )
            .action(ArgAction::Append)
            .value_parser(binary),
            flag(
                "c-sources",
                "Build an FMU of C sources instead, for targets without Rust (FMI 2.0, in the directory source; needs wasm2c)",
            )
            .conflicts_with_all(["target", "binary", "describe"]),
            flag("no-page", "Leave out the page documentation/index.html that runs the FMU in a browser (as with --c-sources)"),
            option("time-limit", "SECONDS", "Time that the model may take for one call while the build checks it [default: 60]")
                .value_parser(value_parser!(u64)),
            flag(
                "any-processor",
                "Accept a library whose processor differs from its platform (in FMI 2.0, importers on ARM look in linux64)",
            )
            .requires("binary"),
        ])
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for BuildOptions {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        Ok(Self {
            tunable: matches.get_flag("tunable"),
            fmi: matches.get_one("fmi").copied(),
            out: matches.get_one("out").cloned(),
            describe: matches.get_flag("describe"),
            target: matches.get_many("target").into_iter().flatten().cloned().collect(),
            all_targets: matches.get_flag("all-targets"),
            binary: matches.get_many("binary").into_iter().flatten().cloned().collect(),
            c_sources: matches.get_flag("c-sources"),
            no_page: matches.get_flag("no-page"),
            time_limit: matches.get_one("time-limit").copied(),
            any_processor: matches.get_flag("any-processor"),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

fn binary(text: &str) -> Result<(String, PathBuf), String> {
    text.split_once('=')
        .filter(|(platform, path)| !platform.is_empty() && !path.is_empty())
        .map(|(platform, path)| (platform.to_owned(), path.into()))
        .ok_or_else(|| "write PLATFORM=PATH, for example linux64=libmodel.so".to_owned())
}

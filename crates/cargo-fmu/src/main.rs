#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! `new` writes a model to grow, `project` asks cargo about the package, `builder` compiles, describes and packs it, `run`
//! simulates what came of it, `plot` draws that.

mod builder;
mod new;
mod plot;
mod project;
mod run;

use anyhow::Result;
use builder::Purpose;
use clap::Parser;
use fmu_package::{BuildOptions, terminal};
use project::{Place, Project};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

/// What cargo starts with `fmu` as its first argument.
#[derive(Parser)]
#[command(name = "cargo", bin_name = "cargo", disable_help_subcommand = true)]
enum Cargo {
    #[command(version, subcommand)]
    Fmu(Command),
}

/// Begin, build and run an FMU that is written in Rust
#[derive(clap::Subcommand)]
enum Command {
    /// Begin a model: a crate with equations to change, and tests
    New(new::Options),
    /// Make the FMUs, for FMI 2.0 and for FMI 3.0
    Build {
        #[command(flatten)]
        place: Place,
        #[command(flatten)]
        build: BuildOptions,
        /// Behind `--`: options that only the package's own build_fmu has
        #[arg(last = true, value_name = "OPTIONS")]
        _own: Vec<OsString>,
    },
    /// Make the FMUs and simulate one: a table (CSV) and a picture (SVG) of the outputs
    Run(run::Options),
    /// Make the FMUs and attack them: which promises of the standard do they break?
    Check {
        #[command(flatten)]
        place: Place,
        /// Check this FMU, of whatever origin, instead of making any; repeat it for several
        #[arg(long)]
        fmu: Vec<PathBuf>,
        #[command(flatten)]
        check: fmu_check::Options,
    },
}

fn main() -> ExitCode {
    fmu_check::work_if_asked();
    let Cargo::Fmu(command) = Cargo::parse();
    match carry_out(&command) {
        Ok(true) => ExitCode::SUCCESS,
        // It has been said why.
        Ok(false) => ExitCode::FAILURE,
        Err(error) => terminal::exit(Err(error)),
    }
}

/// Tells whether all went well.
fn carry_out(command: &Command) -> Result<bool> {
    match command {
        Command::New(options) => new::new(options).map(|()| true),
        Command::Build { place, build, .. } => {
            builder::build(&Project::find(place)?, build, Purpose::Use, &builder::words_of_build())
        }
        Command::Run(options) => run::run(options),
        Command::Check { place, fmu, check } => run::check(place, fmu, check),
    }
}

#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! `new` writes a new model, `project` gets the metadata of the package from cargo, `builder` compiles, describes and packs it, `run`
//! simulates the FMU, `plot` draws the results.

mod builder;
mod new;
mod plot;
mod project;
mod run;

use anyhow::Result;
use builder::Purpose;
use clap::Parser;
use fmu_package::{BuildOptions, terminal};
use project::{Package, Project};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

/// The command line, with `fmu` as the first argument of cargo.
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
        package: Package,
        #[command(flatten)]
        build: BuildOptions,
        /// After `--`: options of the package's own build_fmu
        #[arg(last = true, value_name = "OPTIONS")]
        _own: Vec<OsString>,
    },
    /// Make the FMUs and simulate one: a table (CSV) and a plot (SVG) of the outputs
    Run(run::Options),
    /// Make the FMUs and attack them: which requirements of the standard do they violate?
    Check {
        #[command(flatten)]
        package: Package,
        /// Check this FMU, of any origin, instead of making FMUs; repeat it for several
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
        // The reason has been printed.
        Ok(false) => ExitCode::FAILURE,
        Err(error) => terminal::exit(Err(error)),
    }
}

/// Carries out a command. Returns false if it failed and has printed the reason.
fn carry_out(command: &Command) -> Result<bool> {
    match command {
        Command::New(options) => new::new(options).map(|()| true),
        Command::Build { package, build, .. } => {
            builder::build(&Project::find(package)?, build, Purpose::Use, &builder::arguments_of_build())
        }
        Command::Run(options) => run::run(options),
        Command::Check { package, fmu, check } => run::check(package, fmu, check),
    }
}

//! The program behind `cargo fmu`, which the README of the crate describes.
//!
//! `new` creates a model, `project` gets the metadata of a package from cargo, and `builder` builds the FMUs, which
//! `judge` accepts or rejects. `run` simulates an FMU with the inputs that `inputs` reads, for which `motion` compares the interface types and looks for other mistakes,
//! `results` writes the table of results, and `plot` draws it.

mod builder;
mod inputs;
mod judge;
mod motion;
mod new;
mod plot;
mod project;
mod results;
mod run;

use anyhow::{Result, ensure};
use builder::Purpose;
use clap::Parser;
use fmu_package::{BuildOptions, terminal};
use project::{Package, Project};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The command line, with `fmu` as the first argument of cargo.
#[derive(Parser)]
#[command(name = "cargo", bin_name = "cargo")]
enum Cargo {
    #[command(version, subcommand)]
    Fmu(Command),
}

/// Create, build, run and check FMUs that are written in Rust
#[derive(clap::Subcommand)]
enum Command {
    /// Create a model: a crate with equations to change, and tests
    New(new::Options),
    /// Build the FMUs for FMI 2.0 and FMI 3.0
    Build {
        #[command(flatten)]
        package: Package,
        #[command(flatten)]
        build: BuildOptions,
        /// After `--`: options of the package's own build_fmu
        #[arg(last = true, value_name = "OPTIONS")]
        own: Vec<OsString>,
    },
    /// Build the FMUs and simulate one: writes a table (CSV) and a plot (SVG) of the outputs
    Run(run::Options),
    /// Build the FMUs and check them with valid and invalid calls: reports violated requirements of the standard
    Check {
        #[command(flatten)]
        package: Package,
        /// Check this FMU from any tool instead of building FMUs; repeat the option for several FMUs
        #[arg(long, conflicts_with_all = ["package", "manifest_path"])]
        fmu: Vec<PathBuf>,
        /// Also compare Co-Simulation with Model Exchange for these inputs over time: a CSV file as for `run --input`
        #[arg(long, value_name = "FILE")]
        input: Option<PathBuf>,
        #[command(flatten)]
        check: fmu_check::Options,
    },
    /// Check an FMU that is being built
    #[command(hide = true)]
    Judge(judge::Options),
    /// Execute the calls of a finding in a report of `check --out` again; the exit status is 1 if the finding shows
    Replay(fmu_check::ReplayOptions),
}

fn main() -> ExitCode {
    fmu_check::run_worker_if_requested();
    let Cargo::Fmu(command) = Cargo::parse();
    match carry_out(&command) {
        Ok(status) => status,
        Err(error) => terminal::exit(Err(error)),
    }
}

/// Carries out a command, and returns the exit status. If a command failed and has printed the reason, the status is 1.
fn carry_out(command: &Command) -> Result<ExitCode> {
    let succeeds = match command {
        Command::New(options) => new::new(options).map(|()| true),
        Command::Build { package, build, own } => {
            let project = Project::find(package)?;
            ensure!(
                own.is_empty() || project.own_builder.is_some(),
                "{} has no program build_fmu, whose options follow --; put options of this command before --",
                project.name
            );
            builder::build(&project, build, Purpose::Release, &builder::arguments_of_build())
        }
        Command::Run(options) => run::run(options),
        Command::Check { check, .. } if check.explain.is_some() => {
            return Ok(fmu_check::command(Path::new(""), check));
        }
        Command::Check { package, fmu, input, check } => run::check(package, fmu, input.as_deref(), check),
        Command::Judge(options) => judge::judge(options),
        Command::Replay(options) => return Ok(fmu_check::replay(options)),
    };
    succeeds.map(|succeeds| if succeeds { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

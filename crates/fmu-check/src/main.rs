//! `fmu-check model.fmu`: reports the rules that an FMU breaks, most of which are rules of the standard.

use clap::Parser as _;
use std::process::ExitCode;

#[derive(clap::Parser)]
#[command(name = "fmu-check", version, about, long_about = None)]
struct Arguments {
    /// The FMU
    #[arg(required_unless_present = "explain")]
    fmu: Option<std::path::PathBuf>,
    #[command(flatten)]
    options: fmu_check::Options,
}

fn main() -> ExitCode {
    fmu_check::run_worker_if_requested();
    let Arguments { fmu, options } = Arguments::parse();
    fmu_check::command(&fmu.unwrap_or_default(), &options)
}

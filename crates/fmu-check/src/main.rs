//! `fmu-check model.fmu`: reports the rules that an FMU breaks, most of which are rules of the standard. `fmu-check replay
//! report.json 4`: executes the calls of a finding again.

use clap::Parser as _;
use std::process::ExitCode;

#[derive(clap::Parser)]
#[command(name = "fmu-check", version, about, long_about = None)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
struct Arguments {
    /// The FMU
    #[arg(required_unless_present = "explain", conflicts_with = "explain")]
    fmu: Option<std::path::PathBuf>,
    #[command(flatten)]
    options: fmu_check::Options,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Executes the calls of a finding in a report again; the exit status is 1 if the finding shows, 0 if it does not
    Replay(fmu_check::ReplayOptions),
}

fn main() -> ExitCode {
    fmu_check::run_worker_if_requested();
    let Arguments { fmu, options, command } = Arguments::parse();
    match command {
        Some(Command::Replay(options)) => fmu_check::replay(&options),
        None => fmu_check::command(&fmu.unwrap_or_default(), &options),
    }
}

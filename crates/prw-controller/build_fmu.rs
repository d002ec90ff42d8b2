//! Builds the FMU of the controller. See `--help`.

use clap::Parser;
use fmi2_package::{BuildOptions, Builder};
use prw_controller::{ControllerFmu, sources::sources};
use std::path::Path;
use std::process::ExitCode;

const FOLDER: &str = env!("CARGO_MANIFEST_DIR");

/// Builds the FMU of the wrist's controller, target/fmu/prw_controller.fmu.
#[derive(Parser)]
#[command(override_usage = "cargo run --release -p prw_controller --bin build_controller [-- OPTIONS]")]
struct Options {
    #[command(flatten)]
    build: BuildOptions,
}

fn main() -> ExitCode {
    let builder = Builder {
        command: "cargo run --release -p prw_controller --bin build_controller",
        sources: sources(),
        profile: "library",
        workspace: Path::new(FOLDER).ancestors().nth(2).expect("it is in crates/ of a workspace").to_owned(),
        ..Builder::new(env!("CARGO_PKG_NAME"), FOLDER, env!("FMU_SOURCES"))
    };
    fmi2_package::exit(builder.run::<ControllerFmu>(&Options::parse().build))
}

//! Builds the FMU of the controller. See `--help`.

use clap::Parser;
use fmu_package::terminal::exit;
use fmu_package::{BuildOptions, Builder};
use prw_controller::{Controller, sources::sources};
use std::process::ExitCode;

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
        ..Builder::new(env!("CARGO_PKG_NAME"), env!("CARGO_MANIFEST_DIR"), env!("FMU_SOURCES"))
    };
    exit(builder.run::<Controller>(&Options::parse().build))
}

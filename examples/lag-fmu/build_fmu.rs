//! Builds target/fmu/lag.fmu for FMI 2.0 and target/fmu/fmi3/lag.fmu for FMI 3.0. See `--help`.

use clap::Parser;
use fmu_package::{BuildOptions, Builder, terminal};
use std::process::ExitCode;

/// Builds the FMU of a first-order lag.
#[derive(Parser)]
struct Options {
    #[command(flatten)]
    build: BuildOptions,
}

fn main() -> ExitCode {
    let builder = Builder {
        command: "cargo run --release -p lag_fmu",
        ..Builder::new(env!("CARGO_PKG_NAME"), env!("CARGO_MANIFEST_DIR"), env!("FMU_SOURCES"))
    };
    terminal::exit(builder.run::<lag_fmu::Lag>(&Options::parse().build))
}

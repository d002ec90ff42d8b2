//! Builds the FMU: compiles the library, describes the model, packs both. See `--help`.

use anyhow::{Context, Error, Result};
use clap::Parser;
use fmu_package::{BuildOptions, Builder, Sources, Terminal};
use prw_testbed::fingerprint::{self, PARAMETERS};
use prw_testbed::parameter_file;
use std::path::{Path, PathBuf, absolute};
use std::process::ExitCode;

/// The folder of `Cargo.toml`.
const PROJECT: &str = env!("CARGO_MANIFEST_DIR");

/// Builds the FMU of the pitch-roll wrist testbed: target/fmu/prw_testbed.fmu for FMI 2.0 and
/// target/fmu/fmi3/prw_testbed.fmu for FMI 3.0.
#[derive(Parser)]
#[command(
    override_usage = "cargo run --release --bin build_fmu [-- OPTIONS]",
    after_help = "Examples (after `cargo run --release --bin build_fmu --`):
  --parameters mine.json --out mine    an FMU with other start values, in mine/
  --tunable --out tunable              parameters can be changed while Simulink runs
  --describe                           after a change of the variables, before a commit
  --fmi 3                              for FMI 3.0 only
  --target x86_64-pc-windows-gnu       a Windows FMU, if rustup has that target
  --binary linux64=a.so --binary win64=b.dll
                                       one FMU from libraries that were compiled elsewhere"
)]
struct Options {
    /// Build in the parameters of this file [default: modelDescription/parameters.json, Table 1]
    #[arg(long, value_name = "FILE")]
    parameters: Option<PathBuf>,
    #[command(flatten)]
    build: BuildOptions,
}

fn main() -> ExitCode {
    fmu_package::terminal::exit(run(&Options::parse()))
}

fn run(options: &Options) -> Result<()> {
    let other = match &options.parameters {
        Some(file) => Some(absolute(file).with_context(|| format!("{} is no file", file.display()))?),
        None => None,
    };
    let file = other.clone().unwrap_or_else(|| Path::new(PROJECT).join(PARAMETERS));
    let builder = Builder {
        sources: fingerprint::sources(PROJECT),
        profile: "library",
        terminals: terminals(),
        start: fingerprint::start(&parameter_file::read(&file).map_err(Error::msg)?),
        is_default: other.is_none(),
        start_from: Some(file),
        page_scripts: vec![
            include_str!("docs/fmu-page/wrist/wrist.js"),
            concat!("WRIST = ", include_str!("docs/fmu-page/wrist/wrist.json"), ";\n"),
            include_str!("docs/fmu-page/wrist/testbed.js"),
        ],
        page_fmus: vec![(
            "prw_controller",
            Sources {
                licenses: vec!["../../LICENSE-APACHE", "../../LICENSE-MIT"],
                ..Sources::of_package(concat!(env!("CARGO_MANIFEST_DIR"), "/crates/prw-controller"))
            },
        )],
        environment: vec![("PRW_PARAMETERS", other.map(Into::into))],
        ..Builder::new(env!("CARGO_PKG_NAME"), PROJECT)
    };
    builder.run(&options.build)
}

/// Where the testbed is connected.
fn terminals() -> Vec<Terminal> {
    vec![
        Terminal::plug("motor1")
            .description("Shaft of motor 1, with sensor 1")
            .signal("theta", "theta1")
            .signal("omega", "omega1")
            .signal("tau", "tau1"),
        Terminal::plug("motor2")
            .description("Shaft of motor 2, with sensor 2")
            .signal("theta", "theta2")
            .signal("omega", "omega2")
            .signal("tau", "tau2"),
        Terminal::bus("output_shaft")
            .description("Output shaft of the wrist")
            .signal("pitch", "pitch")
            .signal("roll", "roll")
            .signal("pitch_rate", "pitch_rate")
            .signal("roll_rate", "roll_rate"),
    ]
}

//! Builds the FMU: compiles the library, describes the model, packs both. See `--help`.

use anyhow::{Context, Error, Result};
use clap::Parser;
use fmu_package::terminal::{exit, short};
use fmu_package::{BuildOptions, Builder, Companion, Page, Sources, Terminal};
use std::path::{Path, PathBuf, absolute};
use std::process::ExitCode;

/// Table 1 of the paper.
const PARAMETERS: &str = "modelDescription/parameters.json";

/// Builds the FMU of the pitch-roll wrist testbed: target/fmu/prw_testbed.fmu for FMI 2.0 and
/// target/fmu/fmi3/prw_testbed.fmu for FMI 3.0.
#[derive(Parser)]
#[command(
    override_usage = "cargo run --bin build_fmu [-- OPTIONS]",
    after_help = "Examples (after `cargo run --bin build_fmu --`):
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
    exit(run(&Options::parse()))
}

fn run(options: &Options) -> Result<()> {
    let other = match &options.parameters {
        Some(file) => Some(absolute(file).with_context(|| format!("{} is not a file", file.display()))?),
        None => None,
    };
    let project = project();
    let file = other.clone().unwrap_or_else(|| project.join(PARAMETERS));
    let builder = Builder {
        sources: sources(project),
        terminals: terminals(),
        start: prw_parameters::file::read(&file).map_err(Error::msg)?.start_values(),
        variant: other.as_deref().map(|file| format!("parameters from {}", short(file))),
        page: page(project),
        environment: vec![("PRW_PARAMETERS", other.map(Into::into))],
        ..Builder::new("prw_testbed", project)
    };
    builder.run(&options.build)
}

/// Returns the directory of the project.
fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .nth(2)
        .expect("crates/build-fmu must be two levels below the project")
}

/// Returns the files of this package from which the library and its description are built. The guid depends on them.
fn sources(project: &Path) -> Sources {
    Sources {
        directory: project.to_owned(),
        code: vec!["Cargo.toml", "build.rs", "build_fmu.rs", "src"],
        content: Some("modelDescription"),
        // The description is generated, and the parameters are compiled in.
        not_content: vec!["modelDescription.xml", "parameters.json"],
        licenses: vec!["LICENSE-APACHE", "LICENSE-MIT"],
    }
}

/// Returns the scripts that draw the wrist on the page of the FMU, and the controller FMU that closes the loop there.
fn page(project: &Path) -> Page {
    let controller = Sources {
        licenses: vec!["../../LICENSE-APACHE", "../../LICENSE-MIT"],
        ..Sources::of_package(project.join("crates/prw-controller"))
    };
    Page {
        scripts: vec![
            include_str!("docs/fmu-page/wrist/wrist.js"),
            concat!("WRIST = ", include_str!("docs/fmu-page/wrist/wrist.json"), ";\n"),
            include_str!("docs/fmu-page/wrist/view.js"),
            include_str!("docs/fmu-page/wrist/testbed.js"),
            include_str!("docs/fmu-page/wrist/steps.js"),
        ],
        companions: vec![Companion { package: "prw_controller", sources: controller }],
    }
}

/// Returns the terminals of the testbed.
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

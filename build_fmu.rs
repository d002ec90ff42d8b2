//! Builds the FMU: compiles the library, describes the model, packs both. See `--help`.

use anyhow::{Context, Error, Result};
use clap::{Arg, ArgMatches, FromArgMatches, value_parser};
use fmu_package::terminal::{exit, short};
use fmu_package::{BuildOptions, Builder, Page, Sources, Terminal, directory_of};
use std::path::{PathBuf, absolute};
use std::process::ExitCode;

// The module that the library contains, and the reader of parameter files, which it does not contain.
#[allow(dead_code)]
#[macro_use]
#[path = "src/parameters/mod.rs"]
mod parameters;

#[allow(dead_code)]
#[path = "src/parameters/file.rs"]
mod file;

const ABOUT: &str = "Builds the FMU of the pitch-roll wrist testbed: target/fmu/prw_testbed.fmu for FMI 2.0 and \
                     target/fmu/fmi3/prw_testbed.fmu for FMI 3.0";
const EXAMPLES: &str = "Examples (after `cargo run --bin build_fmu --`):
  --parameters mine.json --out mine    an FMU with other start values, in mine/
  --tunable --out tunable              parameters can be changed while Simulink runs
  --describe                           after a change of the variables, before a commit
  --fmi 3                              for FMI 3.0 only
  --target x86_64-pc-windows-gnu       a Windows FMU, if rustup has that target
  --binary linux64=a.so --binary win64=b.dll
                                       one FMU from libraries that were compiled elsewhere";

fn main() -> ExitCode {
    let parameters = Arg::new("parameters")
        .long("parameters")
        .value_name("FILE")
        .value_parser(value_parser!(PathBuf))
        .help(
            "Build in the parameters of this file, and use_omega and start_at_rest if it has them [default: \
             modelDescription/parameters.json, Table 1]",
        )
        .display_order(0);
    let command = BuildOptions::command("build_fmu", ABOUT, "cargo run --bin build_fmu [-- OPTIONS]");
    exit(run(&command.arg(parameters).after_help(EXAMPLES).get_matches()))
}

fn run(matches: &ArgMatches) -> Result<()> {
    let other = match matches.get_one::<PathBuf>("parameters") {
        Some(file) => Some(absolute(file).with_context(|| format!("{} is not a file", file.display()))?),
        None => None,
    };
    let start = match &other {
        Some(path) => file::read_start_values(path).map_err(Error::msg)?,
        // The library is compiled with Table 1.
        None => Vec::new(),
    };
    let project = directory_of("prw_testbed")?;
    let builder = Builder {
        sources: Sources {
            // The description is generated, and the parameters are compiled in.
            not_content: vec!["modelDescription.xml", "parameters.json"],
            licenses: vec!["LICENSE-APACHE", "LICENSE-MIT"],
            ..Sources::of_package(&project)
        },
        terminals: terminals(),
        start,
        variant: other.as_deref().map(|file| format!("parameters from {}", short(file))),
        page: page(),
        ..Builder::new("prw_testbed", project)
    };
    builder.run(&BuildOptions::from_arg_matches(matches)?)
}

/// Returns the pages of the FMU, the scripts that draw the wrist there, and the controller FMU that closes the loop.
fn page() -> Page {
    let own = [include_str!("docs/fmu-page/wrist/testbed.js"), include_str!("docs/fmu-page/wrist/steps.js")];
    Page {
        html: Some(prw_page::testbed),
        others: vec![("manual.html", prw_page::manual)],
        scripts: [&prw_page::WRIST[..], &own].concat(),
        companions: vec!["prw_controller"],
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

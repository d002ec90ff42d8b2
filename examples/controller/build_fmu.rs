//! Builds the FMU of the controller. See `--help`.

use clap::Parser;
use fmu_package::terminal::exit;
use fmu_package::{BuildOptions, Builder, Page, Sources, Terminal, directory_of};
use std::path::PathBuf;
use std::process::ExitCode;

/// Builds the FMU of the wrist's controller, target/fmu/prw_controller.fmu.
#[derive(Parser)]
#[command(override_usage = "cargo fmu build -p prw_controller [OPTIONS]")]
struct Options {
    #[command(flatten)]
    build: BuildOptions,
}

fn main() -> ExitCode {
    let options = Options::parse();
    exit(directory_of("prw_controller").and_then(|directory| builder(directory).run(&options.build)))
}

fn builder(directory: PathBuf) -> Builder {
    Builder {
        command: "cargo fmu build -p prw_controller",
        sources: Sources {
            licenses: vec!["../../LICENSE-APACHE", "../../LICENSE-MIT"],
            ..Sources::of_package(&directory)
        },
        terminals: terminals(),
        page: Page {
            html: Some(prw_page::controller),
            scripts: [&prw_page::WRIST[..], &[include_str!("../../docs/fmu-page/wrist/controller.js")]]
                .concat(),
            companions: vec!["prw_testbed"],
            ..Page::default()
        },
        ..Builder::new("prw_controller", directory)
    }
}

/// Returns the terminals. Motors and sensors are connected to the terminals of the testbed with the same names.
fn terminals() -> Vec<Terminal> {
    let motor = |name, theta, omega, tau| {
        Terminal::plug(name).signal("theta", theta).signal("omega", omega).signal("tau", tau)
    };
    vec![
        motor("motor1", "theta1", "omega1", "tau1").description("Motor 1 and its torque sensor"),
        motor("motor2", "theta2", "omega2", "tau2").description("Motor 2 and its torque sensor"),
        Terminal::bus("output_shaft")
            .description("Measured motion of the wrist")
            .signal("pitch", "pitch")
            .signal("roll", "roll")
            .signal("pitch_rate", "pitch_rate")
            .signal("roll_rate", "roll_rate"),
        Terminal::bus("reference")
            .description("Where the wrist is to go")
            .signal("pitch", "pitch_ref")
            .signal("roll", "roll_ref"),
    ]
}

//! Builds the FMU of the controller. See `--help`.

use clap::Parser;
use fmu_package::terminal::exit;
use fmu_package::{BuildOptions, Builder, Companion, Page, Sources, Terminal};
use std::path::Path;
use std::process::ExitCode;

/// Builds the FMU of the wrist's controller, target/fmu/prw_controller.fmu.
#[derive(Parser)]
#[command(override_usage = "cargo run -p prw_controller --bin build_controller [-- OPTIONS]")]
struct Options {
    #[command(flatten)]
    build: BuildOptions,
}

fn main() -> ExitCode {
    let builder = Builder {
        command: "cargo run -p prw_controller --bin build_controller --",
        sources: Sources {
            licenses: vec!["../../LICENSE-APACHE", "../../LICENSE-MIT"],
            ..Sources::of_package(env!("CARGO_MANIFEST_DIR"))
        },
        terminals: terminals(),
        page: Page {
            scripts: vec![
                include_str!("../../docs/fmu-page/wrist/wrist.js"),
                concat!("WRIST = ", include_str!("../../docs/fmu-page/wrist/wrist.json"), ";\n"),
                include_str!("../../docs/fmu-page/wrist/view.js"),
                include_str!("../../docs/fmu-page/wrist/controller.js"),
            ],
            companions: vec![Companion { package: "prw_testbed", sources: testbed() }],
        },
        ..Builder::new(env!("CARGO_PKG_NAME"), env!("CARGO_MANIFEST_DIR"))
    };
    exit(builder.run(&Options::parse().build))
}

/// Returns the sources of the testbed, whose FMU runs with the controller on the controller's page.
fn testbed() -> Sources {
    let project = Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .nth(2)
        .expect("this package must be in the project");
    Sources {
        not_content: vec!["modelDescription.xml", "parameters.json"],
        licenses: vec!["LICENSE-APACHE", "LICENSE-MIT"],
        ..Sources::of_package(project)
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

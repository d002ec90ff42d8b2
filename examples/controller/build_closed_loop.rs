//! Connects controller and testbed to a closed loop, as SSP and for libcosim. See `--help`.

use anyhow::{Result, ensure};
use clap::Parser;
use fmu_package::directory_of;
use fmu_package::terminal::{exit, short};
use fmu_run::SystemStructure;
use std::f64::consts::PI;
use std::path::PathBuf;
use std::process::ExitCode;

/// Connects the FMUs of controller and testbed to a closed loop: prw_closed_loop.ssp, and the directory
/// prw_closed_loop with OspSystemStructure.xml.
#[derive(Parser)]
#[command(override_usage = "cargo run -p prw_controller --bin build_closed_loop [-- OPTIONS]")]
struct Options {
    /// The testbed [default: target/fmu/prw_testbed.fmu]
    #[arg(long, value_name = "FMU")]
    testbed: Option<PathBuf>,
    /// The controller: any FMU with the variables of prw_controller.fmu
    /// [default: target/fmu/prw_controller.fmu]
    #[arg(long, value_name = "FMU")]
    controller: Option<PathBuf>,
    /// The reference angles, in degrees
    #[arg(long, value_names = ["PITCH", "ROLL"], num_args = 2, default_values_t = [30.0, 60.0],
          allow_negative_numbers = true)]
    go_to: Vec<f64>,
    /// Communication step size in s
    #[arg(long, value_name = "S", default_value_t = 1e-3)]
    step_size: f64,
    /// End of the experiment in s
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    stop_time: f64,
    /// Folder for the files [default: target/fmu]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

fn main() -> ExitCode {
    exit(run(&Options::parse()))
}

fn run(options: &Options) -> Result<()> {
    for (name, value) in [("step-size", options.step_size), ("stop-time", options.stop_time)] {
        ensure!(value.is_finite() && value > 0.0, "--{name} must be finite and > 0, it is {value}");
    }
    for angle in &options.go_to {
        ensure!(angle.is_finite(), "--go-to must have finite numbers, not {angle}");
    }
    let directory = directory_of("prw_testbed")?.join("target/fmu");
    let fmu = |option: &Option<PathBuf>, name: &str| option.clone().unwrap_or_else(|| directory.join(name));
    let [pitch, roll] = [0, 1].map(|axis| options.go_to[axis] * PI / 180.0);
    let system = SystemStructure {
        name: "prw_closed_loop",
        description: "The pitch-roll wrist testbed with its controller",
        components: vec![
            ("controller", fmu(&options.controller, "prw_controller.fmu")),
            ("testbed", fmu(&options.testbed, "prw_testbed.fmu")),
        ],
        inputs: vec![
            ("pitch_ref", "controller.pitch_ref", pitch.to_string()),
            ("roll_ref", "controller.roll_ref", roll.to_string()),
        ],
        outputs: vec![("pitch", "testbed.pitch"), ("roll", "testbed.roll")],
        connections: vec![
            ("controller.theta1", "testbed.theta1"),
            ("controller.theta2", "testbed.theta2"),
            ("controller.omega1", "testbed.omega1"),
            ("controller.omega2", "testbed.omega2"),
            ("testbed.pitch", "controller.pitch"),
            ("testbed.roll", "controller.roll"),
            ("testbed.pitch_rate", "controller.pitch_rate"),
            ("testbed.roll_rate", "controller.roll_rate"),
            ("testbed.tau1", "controller.tau1"),
            ("testbed.tau2", "controller.tau2"),
        ],
        // The controller provides the motors' rates, so the testbed does not estimate them.
        start: vec![("testbed.use_omega", "true".to_owned())],
        stop_time: options.stop_time,
        step_size: options.step_size,
    };
    let checked = system.check()?;
    let out = options.out.clone().unwrap_or(directory);
    let ssp = out.join("prw_closed_loop.ssp");
    let size = checked.write_ssp(&ssp)?;
    println!("{}: {} kB", short(&ssp), size.div_ceil(1000));
    let osp = out.join("prw_closed_loop");
    checked.write_osp(&osp)?;
    println!("{}", short(&osp.join("OspSystemStructure.xml")));
    Ok(())
}

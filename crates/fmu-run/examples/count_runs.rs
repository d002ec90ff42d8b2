//! Repeats a use of this crate, so that callgrind can count its instructions. `make instructions` runs it.
//!
//! ```text
//! count_runs FMU USE REPETITIONS
//! ```

use fmu_run::{Batch, Fmu, Measure, Setup, Start, System, Trajectory, Watch};
use std::env;
use std::path::Path;

const MOTORS: [&str; 2] = ["theta1", "theta2"];
const OUTPUTS: [&str; 4] = ["tau1", "pitch", "roll", "roll_rate"];

fn main() -> Result<(), fmu_run::Error> {
    let arguments: Vec<String> = env::args().collect();
    let [_, path, name, count] = &arguments[..] else {
        panic!("expected the arguments FMU, USE and REPETITIONS");
    };
    let count: usize = count.parse().expect("REPETITIONS must be a number");
    let open = || {
        // SAFETY: the FMU of this repository.
        unsafe { Fmu::open(Path::new(path)) }.map(|fmu| fmu.system().clone())
    };
    let fmu = open()?;
    match name.as_str() {
        "load" => {
            for _ in 0..count {
                open()?;
            }
        }
        "one step" => {
            for _ in 0..count {
                run(&fmu, 2, 1, Vec::new())?;
            }
        }
        "outputs" => run(&fmu, 201, count, Vec::new())?,
        "statistics" => run(&fmu, 201, count, vec![Measure::Peak, Measure::Rms, Measure::End])?,
        "instances" => instances(&fmu, count)?,
        other => panic!("{other} is not a use"),
    }
    Ok(())
}

/// Runs a batch in one thread, with `samples` communication points at intervals of 1 ms.
fn run(fmu: &System, samples: u32, runs: usize, measures: Vec<Measure>) -> Result<(), fmu_run::Error> {
    let time: Vec<f64> = (0..samples).map(|k| f64::from(k) * 1e-3).collect();
    let wave: Vec<f64> = time.iter().map(|t| 0.1 * (30.0 * t).sin()).collect();
    let stiffness: Vec<f64> = (0..runs).map(|run| 60.0 + run as f64).collect();
    let batch = Batch {
        time: &time,
        inputs: MOTORS.map(|motor| (motor, Trajectory::Shared(&wave))).to_vec(),
        start: vec![("k1", Start::Each(&stiffness))],
        every: measures.is_empty().then_some(1),
        outputs: OUTPUTS.to_vec(),
        measures,
        threads: Some(1),
        ..Batch::default()
    };
    let runs = fmu.run(&batch, &Watch::default())?;
    std::hint::black_box(runs);
    Ok(())
}

/// Advances 64 stateful instances by this number of steps, in one thread.
fn instances(fmu: &System, steps: usize) -> Result<(), fmu_run::Error> {
    let mut wrists = fmu.instances(&Setup { count: 64, ..Setup::default() })?;
    let (motors, outputs) = (fmu.select(&MOTORS)?, fmu.select(&OUTPUTS)?);
    let (mut angles, mut read) = ([0.0; 128], [0.0; 256]);
    for step in 0..steps {
        angles.fill(0.1 * (0.03 * step as f64).sin());
        wrists.advance((&motors, &angles), 1e-3, (&outputs, &mut read))?;
    }
    Ok(())
}

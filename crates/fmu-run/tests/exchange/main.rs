//! Tests of Model Exchange with models that have known solutions, and with faulty models. `equations.c` of the test kit describes
//! each.
#![allow(unsafe_code, reason = "FMUs are opened")]
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

mod built;
mod clocks;
mod events;
mod faults;
mod inputs;

use built::{opened, opened_with};
use fmu_run::{Batch, Integration, Runs, Solver, Standard, Start, System, Trajectory, Watch};

const VERSIONS: [Standard; 2] = [Standard::Fmi2, Standard::Fmi3];
const SOLVERS: [Solver; 4] = [Solver::Auto, Solver::Dopri5, Solver::Dop853, Solver::Bdf];

fn times(end: f64, count: usize) -> Vec<f64> {
    (0..=count).map(|k| end * k as f64 / count as f64).collect()
}

fn tight(solver: Solver) -> Integration {
    Integration { solver, rtol: (solver != Solver::Rk4).then_some(1e-9), ..Integration::default() }
}

/// Runs an FMU and stores y at all times.
fn run(fmu: &System, time: &[f64], batch: Batch) -> Runs {
    let batch = Batch { time, outputs: vec!["y"], every: Some(1), ..batch };
    fmu.run(&batch, &Watch::default()).unwrap()
}

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} is not {expected} +- {tolerance}");
}

#[test]
fn linear_decay() {
    let time = times(2.0, 20);
    let rates = [0.5, 3.0, 40.0];
    for standard in VERSIONS {
        let fmu = opened("dahlquist", standard);
        for solver in SOLVERS {
            let batch = Batch {
                start: vec![("p", Start::Each(&rates))],
                integration: tight(solver),
                ..Batch::default()
            };
            let runs = run(&fmu, &time, batch);
            assert_eq!(runs.errors, []);
            for (run, rate) in rates.iter().enumerate() {
                for (k, time) in time.iter().enumerate() {
                    close(runs.trajectories[run * runs.size.kept + k], (-rate * time).exp(), 2e-8);
                }
            }
        }
    }
}

#[test]
fn stiff_and_not_stiff_oscillations() {
    for standard in VERSIONS {
        let derivatives = match standard {
            Standard::Fmi2 => "providesDirectionalDerivative=\"true\"",
            Standard::Fmi3 => "providesDirectionalDerivatives=\"true\"",
        };
        for attributes in ["", derivatives] {
            let fmu = opened_with("vanderpol", standard, attributes);
            for solver in [Solver::Auto, Solver::Bdf] {
                let batch = Batch { integration: tight(solver), ..Batch::default() };
                let runs = run(&fmu, &[0.0, 20.0], batch);
                close(runs.trajectories[1], VANDERPOL[0], 1e-6);
                let batch = Batch {
                    start: vec![("p", Start::Same(1000.0))],
                    integration: tight(solver),
                    ..Batch::default()
                };
                let runs = run(&fmu, &[0.0, 2000.0], batch);
                assert_eq!(runs.errors, []);
                close(runs.trajectories[1], VANDERPOL[1], 1e-6);
            }
        }
    }
}

/// x0 at 20 s for p = 1, and at 2000 s for p = 1000, calculated by `scipy.integrate.solve_ivp` with Radau and rtol 1e-12.
const VANDERPOL: [f64; 2] = [2.008149762, 1.706167732];

#[test]
fn fixed_steps() {
    let fmu = opened("dahlquist", Standard::Fmi2);
    let end = |count: usize, max_step| {
        let integration = Integration { solver: Solver::Rk4, max_step, ..Integration::default() };
        let time = times(1.0, count);
        let runs = run(&fmu, &time, Batch { integration, ..Batch::default() });
        runs.trajectories[count]
    };
    // Factor of x' = -x in one step of the classical Runge-Kutta method.
    let factor = |h: f64| 1.0 - h + h * h / 2.0 - h.powi(3) / 6.0 + h.powi(4) / 24.0;
    close(end(10, None), factor(0.1).powi(10), 1e-15);
    close(end(2, Some(0.1)), factor(0.1).powi(10), 1e-15);
    close(end(10, Some(0.03)), factor(0.025).powi(40), 1e-15);
}

#[test]
fn results_do_not_depend_on_threads_or_communication_points() {
    let fmu = opened("vanderpol", Standard::Fmi3);
    let starts: Vec<_> = (0..20).map(|k| 0.2 * f64::from(k)).collect();
    let of = |threads, count| {
        let time = times(10.0, count);
        let batch = Batch {
            start: vec![("p", Start::Each(&starts))],
            threads: Some(threads),
            integration: tight(Solver::Auto),
            ..Batch::default()
        };
        let runs = run(&fmu, &time, batch);
        (0..20).map(|run| runs.trajectories[run * (count + 1) + count]).collect::<Vec<_>>()
    };
    assert_eq!(of(1, 10), of(4, 10));
    of(1, 1).iter().zip(of(1, 1000)).for_each(|(one, other)| close(*one, other, 1e-7));
}

#[test]
fn settings_are_checked() {
    let fmu = opened("lag", Standard::Fmi3);
    let why = |batch: Batch| {
        let batch = Batch { time: &[0.0, 1.0], outputs: vec!["y"], every: Some(1), ..batch };
        fmu.run(&batch, &Watch::default()).unwrap_err().to_string()
    };
    let integration = |of: Integration| why(Batch { integration: of, ..Batch::default() });
    let default = Integration::default();
    assert_eq!(
        integration(Integration { rtol: Some(0.0), ..default }),
        "rtol is 0; it must be above 0 and finite"
    );
    assert_eq!(
        integration(Integration { rtol: Some(1e-16), ..default }),
        "rtol is 1e-16; it must be at least 1e-13 and below 1"
    );
    assert_eq!(
        integration(Integration { atol: Some(-1.0), ..default }),
        "atol is -1; it must be above 0 and finite"
    );
    assert!(integration(Integration { max_step: Some(f64::NAN), ..default }).starts_with("max_step is NaN"));
    let fixed = Integration { solver: Solver::Rk4, rtol: Some(1e-6), ..default };
    assert!(integration(fixed).starts_with("rtol and atol have no effect with rk4, whose steps are fixed"));
    assert_eq!(
        why(Batch { read_before_set: true, ..Batch::default() }),
        "read_before_set is for Co-Simulation"
    );
    assert_eq!(
        why(Batch { inputs: vec![("w", Trajectory::RateOf("u"))], ..Batch::default() }),
        "w is the derivative of u, which is not among the continuous inputs that have values"
    );
    assert_eq!(
        why(Batch { input_derivatives: vec![("u", Trajectory::Constant(1.0))], ..Batch::default() }),
        "u has a derivative, but no values of a continuous input"
    );
    assert_eq!(
        why(Batch {
            inputs: vec![("u", Trajectory::Shared(&[0.0, 1.0]))],
            input_derivatives: vec![("u", Trajectory::Sampled { times: &[0.0, 0.5], values: &[1.0, 1.0] })],
            ..Batch::default()
        }),
        "the derivatives of u must have the same times as its values"
    );
    assert_eq!(
        "euler".parse::<Solver>().unwrap_err(),
        "there is no solver \"euler\"; there are auto, dopri5, dop853, bdf, rk4"
    );
}

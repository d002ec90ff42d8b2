//! Model Exchange (section 3.2 of FMI 2.0): eq. (11), integrated by the importer.

use crate::exact::{INPUTS, LINEAR, STATES, distance, jacobian, parameters, set_parameters};
use crate::{new, vr};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_test_kit::{Either, Random};
use nalgebra::SVector;
use prw_testbed::variables::Name;
use prw_testbed::{BUILT_IN, Parameters};

/// Checks derivatives and outputs at random states and inputs with random parameters. `use_omega` must have no effect.
#[test]
fn equations() {
    let mut random = Random(3);
    for seed in 0..20 {
        let p = parameters(seed);
        let fmu = new(ModelExchange);
        set_parameters(&fmu, &p);
        fmu.ok(fmu.fmi2SetBoolean(&vr(Name::use_omega), 1, &i32::from(seed % 2 == 0)));
        fmu.initialize(0.0);
        fmu.enter_continuous_time();
        for _ in 0..5 {
            let point = SVector::<f64, 10>::from_fn(|_, _| random.between(-1.0, 1.0));
            fmu.ok(fmu.set_states(point.as_ptr(), 6));
            fmu.set(&INPUTS, &point.as_slice()[6..]);
            let jacobian = jacobian(&p);
            let expected = jacobian * point;
            let found = fmu.get(LINEAR);
            for row in 0..14 {
                let tolerance = 1e-13 * jacobian.row(row).abs().sum();
                assert!((found[row] - expected[row]).abs() < tolerance, "row {row}: {found:?} {expected:?}");
            }
            assert_eq!(fmu.derivatives::<6>(), found[..6]);
            assert_eq!(fmu.states::<6>(), fmu.get(STATES));
        }
    }
}

/// Returns the angles and the rates of motors that start from rest.
fn motors(t: f64) -> ([f64; 2], [f64; 2]) {
    ([(2.0 * t).cos() - 1.0, 0.5 * t * t], [-2.0 * (2.0 * t).sin(), t])
}

const END: f64 = 0.5;

/// Integrates in Model Exchange with the classical Runge-Kutta method.
fn integrated(p: &Parameters, steps: i32) -> [f64; 14] {
    let fmu = new(ModelExchange);
    set_parameters(&fmu, p);
    fmu.initialize(0.0);
    fmu.enter_continuous_time();
    let h = END / f64::from(steps);
    let slope = |t: f64, x: [f64; 6]| {
        let (theta, omega) = motors(t);
        fmu.ok(fmu.fmi2SetTime(t));
        fmu.set(&INPUTS, &[theta, omega].concat());
        fmu.ok(fmu.set_states(x.as_ptr(), 6));
        fmu.derivatives::<6>()
    };
    let add = |x: [f64; 6], h: f64, k: [f64; 6]| std::array::from_fn(|i| x[i] + h * k[i]);
    for step in 0..steps {
        let (t, x) = (f64::from(step) * h, fmu.states::<6>());
        let k1 = slope(t, x);
        let k2 = slope(t + 0.5 * h, add(x, 0.5 * h, k1));
        let k3 = slope(t + 0.5 * h, add(x, 0.5 * h, k2));
        let k4 = slope(t + h, add(x, h, k3));
        let next = std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        slope(t + h, next);
        fmu.ok(fmu.fmi2CompletedIntegratorStep(1, &mut 0, &mut 0));
    }
    fmu.get(LINEAR)
}

/// Simulates the same motion in Co-Simulation, with rates from omega or estimated from samples.
fn simulated(p: &Parameters, steps: i32, use_omega: bool) -> [f64; 14] {
    let fmu = new(CoSimulation);
    set_parameters(&fmu, p);
    fmu.ok(fmu.fmi2SetBoolean(&vr(Name::use_omega), 1, &use_omega.into()));
    fmu.initialize(0.0);
    let h = END / f64::from(steps);
    for step in 0..=steps {
        let (theta, omega) = motors(f64::from(step) * h);
        fmu.set(&INPUTS, &[theta, omega].concat());
        if step < steps {
            fmu.step(f64::from(step) * h, h);
        }
    }
    fmu.get(LINEAR)
}

/// Checks that both interface types give the same motion, within an error of second order in the step size. One such error
/// in Co-Simulation is that the states follow the last sample only in the next step.
#[test]
fn same_motion_as_co_simulation() {
    for p in [BUILT_IN, parameters(4)] {
        let reference = integrated(&p, 4000);
        let scale = 1.0 + distance(&reference, &[0.0; 14]);
        assert!(
            distance(&integrated(&p, 2000), &reference) < 1e-8 * scale,
            "the integrator has not converged"
        );
        for use_omega in [false, true] {
            let [coarse, fine] =
                [1000, 4000].map(|steps| distance(&simulated(&p, steps, use_omega), &reference));
            assert!(fine < 1e-5 * scale, "{fine:e} with {scale}");
            assert!((10.0..24.0).contains(&(coarse / fine)), "not second order: {coarse:e}, {fine:e}");
        }
    }
}

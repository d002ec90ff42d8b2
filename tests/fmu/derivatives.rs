//! Derivatives that the FMU offers: with respect to variables (section 2.1.9) and to time (4.2.1).

use crate::exact::{
    INPUTS, STATES, UNKNOWNS, jacobian, parameters, real_parameters, set_parameters, start_at,
};
use crate::in_mode;
use crate::{TABLE, new, vr};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_test_kit::checks::output_derivatives_fit_steps;
use fmu_test_kit::serialized::with_mode;
use fmu_test_kit::{Either, Random};
use prw_testbed::Parameters;
use prw_testbed::TestbedFmu;
use prw_testbed::variables::Name;

fn knowns() -> Vec<u32> {
    [&STATES[..], &INPUTS].concat()
}

/// Pair by pair A, B, C and D, in every mode after the initialization that has directional derivatives, at whatever point
/// and wherever the motor rates come from. (While initializing: `tests/fmpy/test_initial_derivatives.py`.)
#[test]
fn pair_by_pair() {
    for seed in 0..20 {
        let p = if seed == 0 { Parameters::BUILT_IN } else { parameters(seed) };
        let expected = jacobian(&p);
        for (interface, mode) in [
            (CoSimulation, StepComplete),
            (CoSimulation, Terminated),
            (ModelExchange, Event),
            (ModelExchange, ContinuousTime),
        ] {
            let fmu = new(interface);
            set_parameters(&fmu, &p);
            fmu.set(&[vr(Name::theta1), vr(Name::omega2)], &[0.3, -2.0]);
            start_at(&fmu, [0.1, 0.0, 0.0, 0.0, 0.0, 0.0]);
            fmu.ok(fmu.fmi2SetBoolean(&vr(Name::use_omega), 1, &i32::from(seed % 2 == 1)));
            fmu.restore(&with_mode(fmu.bytes(), mode));
            for (row, unknown) in UNKNOWNS.into_iter().enumerate() {
                for (column, known) in knowns().into_iter().enumerate() {
                    let found = fmu.directional(&[unknown], &[known], &[1.0])[0];
                    let expected = expected[(row, column)];
                    let names = [unknown, known].map(|vr| TABLE[vr as usize].name());
                    let error = (found - expected).abs();
                    assert!(
                        error <= 1e-13 * expected.abs(),
                        "{names:?} in {mode}: {found} is not {expected}"
                    );
                }
            }
        }
    }
}

/// Real parameters are knowns too, while initializing and, for CasADi, later: their derivatives against differences of
/// the values, with the error of a central difference of this width.
#[test]
fn with_respect_to_parameters() {
    const WIDTH: f64 = 1e-4;
    for seed in 1..10 {
        let mut random = Random(seed);
        let mode = if seed % 3 == 0 { ContinuousTime } else { Initialization };
        let fmu = in_mode(if seed % 3 == 1 { CoSimulation } else { ModelExchange }, mode);
        if mode == Initialization {
            set_parameters(&fmu, &parameters(seed));
            fmu.ok(fmu.fmi2SetBoolean(&vr(Name::use_omega), 1, &1));
            start_at(&fmu, std::array::from_fn(|_| random.between(-1.0, 1.0)));
        }
        fmu.set(&INPUTS, &[(); 4].map(|()| random.between(-1.0, 1.0)));
        for known in real_parameters() {
            // What is 0 is tried elsewhere.
            let [start] = fmu.get([known]).map(|start| if start == 0.0 { 0.1 } else { start });
            let values = |value: f64| {
                fmu.set(&[known], &[value]);
                fmu.get(UNKNOWNS)
            };
            let (above, below) = (values(start * (1.0 + WIDTH)), values(start * (1.0 - WIDTH)));
            let now = values(start);
            let found = fmu.directional(&UNKNOWNS, &[known], &[1.0]);
            for (i, unknown) in UNKNOWNS.into_iter().enumerate() {
                let expected = (above[i] - below[i]) / (2.0 * WIDTH * start);
                let tolerance = 1e-6 * (expected.abs() + now[i].abs() / start.abs());
                let names = [unknown, known].map(|vr| TABLE[vr as usize].name());
                assert!((found[i] - expected).abs() <= tolerance, "{names:?}: {} {expected}", found[i]);
            }
        }
    }
}

const THETA: [u32; 2] = [vr(Name::theta1), vr(Name::theta2)];
const OMEGA: [u32; 2] = [vr(Name::omega1), vr(Name::omega2)];

/// Where the motors' rates come from.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Rates {
    Samples,
    Omega,
    Derivatives,
}

/// Right after the initialization and after each step; the samples lie where the motors are expected,
/// so that no jump is in between.
#[test]
fn output_derivatives_are_exact() {
    for rates in [Rates::Samples, Rates::Omega, Rates::Derivatives] {
        let p = parameters(9);
        let fmu = new(CoSimulation);
        set_parameters(&fmu, &p);
        fmu.ok(fmu.fmi2SetBoolean(&vr(Name::use_omega), 1, &i32::from(rates == Rates::Omega)));
        start_at(&fmu, [0.1, -0.2, 0.3, 0.4, -1.0, 2.0]);
        fmu.initialize(0.0);
        let mut random = Random(10);
        let (mut time, mut theta) = (0.0, [0.2, -0.1]);
        for step in 0..8 {
            fmu.set(&THETA, &theta);
            let given = [random.between(-2.0, 2.0), random.between(-2.0, 2.0)];
            fmu.set(&OMEGA, &given);
            if rates == Rates::Derivatives {
                fmu.set_rates(THETA, given);
            }
            if rates == Rates::Samples && step == 2 {
                // A corner, for the samples to lie on a curve from here on.
                theta[0] += 0.01;
                fmu.set(&THETA, &theta);
            } else {
                output_derivatives_fit_steps::<TestbedFmu>(
                    &fmu,
                    time,
                    &format!("{rates:?}, step {step}"),
                    |_| (),
                );
            }
            let slopes = fmu.rates(THETA);
            if rates != Rates::Samples {
                assert_eq!(slopes, given);
                assert_eq!(fmu.rates(OMEGA), [0.0; 2]);
            }
            let h = random.between(0.005, 0.03);
            fmu.step(time, h);
            time += h;
            theta = std::array::from_fn(|motor| theta[motor] + slopes[motor] * h);
        }
    }
}

/// With samples, omega' is the bend of the parabola through the last three.
#[test]
fn acceleration_of_samples() {
    let fmu = in_mode(CoSimulation, StepComplete);
    for i in 0..6 {
        let t = f64::from(i) * 0.02;
        fmu.set(&THETA, &[3.0 * t * t, 1.0 - t * t]);
        if i >= 2 {
            let [one, two] = fmu.rates(OMEGA);
            assert!((one - 6.0).abs() < 1e-9 && (two + 2.0).abs() < 1e-9, "{one}, {two}");
        }
        fmu.step(t, 0.02);
    }
}

//! Derivatives that the FMU offers: with respect to variables (section 2.1.9) and to time (4.2.1).

use crate::exact::{
    INPUTS, Random, STATES, UNKNOWNS, jacobian, parameters, real_parameters, set_parameters, start_at,
};
use crate::modes::in_mode;
use crate::{TABLE, new, vr};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::{BaseType, Causality, Variable};
use fmu_test_kit::Importer as Fmu;
use fmu_test_kit::serialized::with_mode;
use nalgebra::SVector;
use prw_testbed::Parameters;
use prw_testbed::TestbedFmu;
use prw_testbed::variables::Name;

fn knowns() -> Vec<u32> {
    [&STATES[..], &INPUTS].concat()
}

fn directional(fmu: &Fmu, unknown: &[u32], known: &[u32], seed: &[f64]) -> Vec<f64> {
    let mut result = vec![f64::NAN; unknown.len()];
    let (unknowns, knowns) = (unknown.len(), known.len());
    assert_eq!(seed.len(), knowns);
    fmu.ok(fmu.fmi2GetDirectionalDerivative(
        unknown.as_ptr(),
        unknowns,
        known.as_ptr(),
        knowns,
        seed.as_ptr(),
        result.as_mut_ptr(),
    ));
    result
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
                    let found = directional(&fmu, &[unknown], &[known], &[1.0])[0];
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
            let found = directional(&fmu, &UNKNOWNS, &[known], &[1.0]);
            for (i, unknown) in UNKNOWNS.into_iter().enumerate() {
                let expected = (above[i] - below[i]) / (2.0 * WIDTH * start);
                let tolerance = 1e-6 * (expected.abs() + now[i].abs() / start.abs());
                let names = [unknown, known].map(|vr| TABLE[vr as usize].name());
                assert!((found[i] - expected).abs() <= tolerance, "{names:?}: {} {expected}", found[i]);
            }
        }
    }
}

/// Several unknowns and knowns at once, in any order and repeated: a matrix product.
#[test]
fn several_at_once() {
    let mut random = Random(1);
    let expected = jacobian(&Parameters::BUILT_IN);
    let fmu = in_mode(ModelExchange, ContinuousTime);
    for _ in 0..50 {
        let seed = SVector::<f64, 10>::from_fn(|_, _| random.between(-1.0, 1.0));
        let found = directional(&fmu, &UNKNOWNS, &knowns(), seed.as_slice());
        let expected = expected * seed;
        for (row, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let scale = 1.0 + jacobian(&Parameters::BUILT_IN).row(row).abs().sum();
            assert!((found - expected).abs() < 1e-14 * scale, "row {row}: {found} is not {expected}");
        }
    }
    let unknown = [vr(Name::tau1), vr(Name::der_omega6), vr(Name::tau1)];
    let found = directional(
        &fmu,
        &unknown,
        &[vr(Name::omega1), vr(Name::theta5), vr(Name::omega1)],
        &[2.0, 0.0, -1.0],
    );
    let once = directional(&fmu, &unknown, &[vr(Name::omega1)], &[1.0]);
    assert_eq!(found, once);
    assert_eq!(found[0], found[2]);
}

/// Without knowns the sum is empty.
#[test]
fn no_knowns() {
    assert_eq!(directional(&in_mode(CoSimulation, StepComplete), &UNKNOWNS, &[], &[]), [0.0; 14]);
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

/// All that moves while the FMU steps.
fn moving() -> Vec<u32> {
    let moves = |v: &Variable<TestbedFmu>| matches!(v.causality(), Causality::Output | Causality::Local);
    (0..).zip(TABLE).filter(|(_, variable)| moves(variable)).map(|(vr, _)| vr).collect()
}

fn values(fmu: &Fmu, vr: &[u32]) -> Vec<f64> {
    let mut values = vec![f64::NAN; vr.len()];
    fmu.ok(fmu.fmi2GetReal(vr.as_ptr(), vr.len(), values.as_mut_ptr()));
    values
}

/// Compares the derivatives of order 1 with differences of the values after short steps.
#[track_caller]
fn check_against_steps(fmu: &Fmu, time: f64, label: &str) {
    const H: f64 = 2e-5;
    let vr = moving();
    let mut found = vec![f64::NAN; vr.len()];
    let orders = vec![1; vr.len()];
    fmu.ok(fmu.fmi2GetRealOutputDerivatives(vr.as_ptr(), vr.len(), orders.as_ptr(), found.as_mut_ptr()));

    let state = fmu.save();
    let y: Vec<_> = (0..5)
        .map(|steps| {
            fmu.ok(fmu.fmi2SetFMUstate(state));
            if steps > 0 {
                fmu.step(time, H * f64::from(steps));
            }
            values(fmu, &vr)
        })
        .collect();
    fmu.ok(fmu.fmi2SetFMUstate(state));
    fmu.forget(state);
    for (i, vr) in vr.iter().enumerate() {
        let expected =
            (-25.0 * y[0][i] + 48.0 * y[1][i] - 36.0 * y[2][i] + 16.0 * y[3][i] - 3.0 * y[4][i]) / (12.0 * H);
        // What rounding does to the difference, and what is left of the series.
        let tolerance = 1e-7 * (1.0 + y[0][i].abs() + expected.abs());
        let name = TABLE[*vr as usize].name();
        assert!((found[i] - expected).abs() < tolerance, "{label}: {name}' is {expected}, not {}", found[i]);
    }
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
                check_against_steps(&fmu, time, &format!("{rates:?}, step {step}"));
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

/// Any Real variable has a derivative, 0 for parameters, and none of a higher order.
#[test]
fn derivatives_of_every_variable_and_order() {
    let fmu = in_mode(CoSimulation, StepComplete);
    fmu.set(&[vr(Name::theta1), vr(Name::omega1)], &[0.4, 1.0]);
    fmu.step(0.0, 0.05);
    for (place, variable) in (0..).zip(TABLE).filter(|(_, variable)| variable.base() == BaseType::Real) {
        let [rate] = fmu.rates([place]);
        assert!(rate.is_finite() && (rate == 0.0 || variable.causality() != Causality::Parameter));
        for order in [0, 2, i32::MAX] {
            fmu.refused("the order", |fmu| fmu.fmi2GetRealOutputDerivatives(&place, 1, &order, &mut 0.0));
        }
    }
}

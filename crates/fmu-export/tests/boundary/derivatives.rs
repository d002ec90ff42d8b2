//! Derivatives with respect to variables and with respect to time (sections 2.1.9 and 4.2.1 of FMI 2.0), in both FMI
//! versions. [`Either::try_directional`] also compares the adjoint with the directional derivatives.

use crate::models::{Meter, Oscillator, meter, oscillator::Name};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::Variables;
use fmu_export::fmi3::reference;
use fmu_test_kit::checks::output_derivatives_fit_steps;
use fmu_test_kit::serialized::with_mode;
use fmu_test_kit::{Either, Importer, fmi3};

const UNKNOWNS: [u32; 5] = [
    Name::position as u32,
    Name::der_position as u32,
    Name::der_velocity as u32,
    Name::spring_force as u32,
    Name::energy as u32,
];
const KNOWNS: [u32; 3] = [Name::force as u32, Name::position as u32, Name::velocity as u32];
const PARAMETERS: [u32; 3] = [Name::mass as u32, Name::stiffness as u32, Name::damping as u32];

/// Returns central differences of all unknowns with respect to `known`. They have no truncation error, because the
/// unknowns are quadratic functions of all knowns except the mass, for which the error is negligible.
fn differences(fmu: &impl Either, known: u32) -> [f64; 5] {
    let [start] = fmu.get([known]);
    let width = 1e-5 * start.abs().max(1.0);
    let [above, below] = [start + width, start - width].map(|value| {
        fmu.set(&[known], &[value]);
        fmu.get(UNKNOWNS)
    });
    fmu.set(&[known], &[start]);
    std::array::from_fn(|i| (above[i] - below[i]) / (2.0 * width))
}

/// Checks directional derivatives in six modes: of single pairs, and of several unknowns and knowns in any order and with
/// repetitions. In Initialization Mode, parameters are knowns, too.
fn fit_differences<F: Either>() {
    for (interface, mode) in [
        (CoSimulation, Initialization),
        (CoSimulation, StepComplete),
        (CoSimulation, Terminated),
        (ModelExchange, Initialization),
        (ModelExchange, Event),
        (ModelExchange, ContinuousTime),
    ] {
        let fmu = F::in_mode::<Oscillator>(interface, Initialization);
        fmu.set(&[KNOWNS, PARAMETERS].concat(), &[0.3, -0.2, 0.7, 3.0, 40.0, 0.4]);
        let parameters = if mode == Initialization { &PARAMETERS[..] } else { &[] };
        let expected: Vec<_> =
            KNOWNS.iter().chain(parameters).map(|known| (*known, differences(&fmu, *known))).collect();
        fmu.restore(&with_mode(fmu.bytes(), mode));
        for (known, expected) in &expected {
            for (unknown, expected) in UNKNOWNS.into_iter().zip(expected) {
                if unknown == Name::energy as u32 && PARAMETERS.contains(known) {
                    fmu.rejected_with(&["energy", "is not provided"], |fmu| {
                        fmu.try_directional(&[unknown], &[*known], &[1.0], &mut [0.0])
                    });
                    continue;
                }
                let found = fmu.partial(unknown, *known);
                let names = [unknown, *known].map(|vr| Oscillator::TABLE[vr as usize].name());
                let fits = (found - expected).abs() <= 1e-8 * (1.0 + expected.abs());
                assert!(fits, "{names:?}: {found} {expected}");
            }
        }
        let [one, _, other] = KNOWNS;
        let found =
            fmu.directional(&[UNKNOWNS[2], UNKNOWNS[0], UNKNOWNS[2]], &[one, other, one], &[2.0, 3.0, -1.0]);
        let sum = fmu.partial(UNKNOWNS[2], one) + 3.0 * fmu.partial(UNKNOWNS[2], other);
        assert!((found[0] - sum).abs() < 1e-14 && found[0] == found[2] && found[1] == 0.0, "{found:?} {sum}");
        assert_eq!(fmu.directional(&UNKNOWNS, &[], &[]), [0.0; 5], "without knowns, each sum must be 0");
    }
}

/// Checks that a calculated state is an unknown in Initialization Mode, so that variables that depend on it are
/// differentiated with the chain rule. After the initialization, it is a known.
fn calculated_states<F: Either>() {
    use meter::Name::{der_level, level, plain, stiffness};
    for interface in [CoSimulation, ModelExchange] {
        let fmu = F::in_mode::<Meter>(interface, Initialization);
        fmu.set(&[plain as u32, stiffness as u32], &[6.0, 4.0]);
        let rows = [level, der_level]
            .map(|unknown| [plain, stiffness].map(|known| fmu.partial(unknown as u32, known as u32)));
        assert_eq!(rows, [[0.25, -0.375], [0.0, 0.0]]);
        fmu.rejected_with(&["level is not a known in initialization mode"], |fmu| {
            fmu.try_directional(&[der_level as u32], &[level as u32], &[1.0], &mut [0.0])
        });
        fmu.ok(fmu.exit_initialization_mode());
        assert_eq!(fmu.partial(der_level as u32, level as u32), -4.0);
        assert_eq!(fmu.partial(der_level as u32, plain as u32), 1.0);
    }
}

/// Checks that the time derivatives of Real outputs and local variables agree with steps, and that parameters have the
/// derivative 0. Orders other than 1 are rejected, because 1 is the highest order of the test models.
fn output_derivatives<F: Either>() {
    let fmu = F::in_mode::<Oscillator>(CoSimulation, Instantiated);
    fmu.set(&KNOWNS[1..], &[0.25, -3.0]);
    fmu.initialize(0.0);
    let mut time = 0.0;
    for size in [0.02, 0.005, 0.03] {
        fmu.set(&KNOWNS[..1], &[0.5 - time]);
        fmu.set_input_derivatives(&KNOWNS[..1], &[-2.0]);
        let slope = fmu.rate(KNOWNS[0]);
        output_derivatives_fit_steps::<Oscillator>(&fmu, time, "a step", |h| {
            fmu.set(&KNOWNS[..1], &[0.5 - time + slope * h]);
            fmu.set_input_derivatives(&KNOWNS[..1], &[-2.0]);
        });
        fmu.step(time, size);
        time += size;
    }
    assert_eq!(fmu.rates(PARAMETERS), [0.0; 3]);
    for order in [2, 3, i32::MAX, 0, -1, i32::MIN] {
        let limit = if order > 0 { "at most 1 (maxOutputDerivativeOrder)" } else { "at least 1" };
        let expected = format!("the derivative of position must be {limit}, it is {order}");
        fmu.rejected_with(&[&expected], |fmu| fmu.try_rate(KNOWNS[1], order, &mut 0.0));
    }
}

#[test]
fn in_both_versions() {
    fn check<F: Either>() {
        fit_differences::<F>();
        calculated_states::<F>();
        output_derivatives::<F>();
    }
    check::<Importer>();
    check::<fmi3::Importer>();
}

/// Checks the differences in FMI 3.0: time is a variable and has a derivative, and parameters are knowns in every mode,
/// because the FMU accepts new values for them at any time. Also checks rejected calls of functions of FMI 3.0.
#[test]
fn only_in_fmi3() {
    let fmu = fmi3::Importer::new::<Oscillator>(CoSimulation);
    fmu.set(&KNOWNS[1..], &[0.25, -3.0]);
    fmu.initialize(0.0);
    assert_eq!(fmu.rates([Name::position as u32, Oscillator::TABLE.len() as u32]), [-3.0, 1.0]);
    let (mut one, mut two) = ([f64::NAN], [f64::NAN; 2]);
    let [force, stiffness] = [Name::spring_force, Name::stiffness].map(|name| name as u32);
    fmu.ok(fmu.try_directional(&[force], &[stiffness], &[2.0], &mut one));
    assert_eq!(one, [-0.5], "force = -stiffness springs position");
    let springs = [Name::springs as u32];
    fmu.rejected("Int32", |fmu| fmu.try_directional(&[force], &springs, &[1.0], &mut [0.0]));
    let (vr, orders) = ([reference(KNOWNS[1]), reference(KNOWNS[2])], [1, 2]);
    fmu.rejected_with(&["must be at most 1 (maxOutputDerivativeOrder)"], |fmu| {
        fmu.fmi3GetOutputDerivatives(vr.as_ptr(), 2, orders.as_ptr(), two.as_mut_ptr(), 2)
    });
    let (u, k, mut out) = (reference(force), reference(KNOWNS[1]), 0.0);
    fmu.rejected("seeds", |fmu| fmu.fmi3GetDirectionalDerivative(&u, 1, &k, 1, &1.0, 0, &mut out, 1));
    fmu.rejected("results", |fmu| fmu.fmi3GetDirectionalDerivative(&u, 1, &k, 1, &1.0, 1, &mut out, 0));
    fmu.rejected("seeds", |fmu| fmu.fmi3GetAdjointDerivative(&u, 1, &k, 0, &1.0, 0, &mut out, 0));
    fmu.rejected("not a known", |fmu| fmu.fmi3GetAdjointDerivative(&u, 1, &u, 1, &1.0, 1, &mut out, 1));
    fmu.rejected("no seed", |fmu| fmu.fmi3GetAdjointDerivative(&u, 1, &k, 1, &f64::NAN, 1, &mut out, 1));
}

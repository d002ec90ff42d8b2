//! Derivatives that the FMU offers: with respect to variables (section 2.1.9) and to time (4.2.1).

use crate::modes::in_mode;
use crate::random::Random;
use crate::toys::{Oscillator, oscillator::Name};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::{BaseType, Causality, Variables};
use fmu_test_kit::Importer;
use fmu_test_kit::serialized::with_mode;

const UNKNOWNS: [u32; 5] = [
    Name::position as u32,
    Name::der_position as u32,
    Name::der_velocity as u32,
    Name::spring_force as u32,
    Name::energy as u32,
];
const KNOWNS: [u32; 3] = [Name::force as u32, Name::position as u32, Name::velocity as u32];
const PARAMETERS: [u32; 3] = [Name::mass as u32, Name::stiffness as u32, Name::damping as u32];

fn name(vr: u32) -> &'static str {
    Oscillator::TABLE[vr as usize].name()
}

fn directional(fmu: &Importer, unknown: &[u32], known: &[u32], seed: &[f64]) -> Vec<f64> {
    let mut result = vec![f64::NAN; unknown.len()];
    assert_eq!(seed.len(), known.len());
    fmu.ok(fmu.fmi2GetDirectionalDerivative(
        unknown.as_ptr(),
        unknown.len(),
        known.as_ptr(),
        known.len(),
        seed.as_ptr(),
        result.as_mut_ptr(),
    ));
    result
}

/// The central difference of all unknowns, quadratic functions of what is varied here.
fn differences(fmu: &Importer, known: u32) -> [f64; 5] {
    let [start] = fmu.get([known]);
    let width = 1e-5 * start.abs().max(1.0);
    let [above, below] = [start + width, start - width].map(|value| {
        fmu.set(&[known], &[value]);
        fmu.get(UNKNOWNS)
    });
    fmu.set(&[known], &[start]);
    std::array::from_fn(|i| (above[i] - below[i]) / (2.0 * width))
}

/// Pair by pair, in every mode that has directional derivatives; parameters are knowns while initializing.
#[test]
fn pair_by_pair() {
    for (interface, mode) in [
        (CoSimulation, Initialization),
        (CoSimulation, StepComplete),
        (CoSimulation, Terminated),
        (ModelExchange, Initialization),
        (ModelExchange, Event),
        (ModelExchange, ContinuousTime),
    ] {
        let fmu = in_mode::<Oscillator>(interface, Initialization);
        fmu.set(&[KNOWNS, PARAMETERS].concat(), &[0.3, -0.2, 0.7, 3.0, 40.0, 0.4]);
        let parameters = if mode == Initialization { &PARAMETERS[..] } else { &[] };
        let expected: Vec<_> =
            KNOWNS.iter().chain(parameters).map(|known| (*known, differences(&fmu, *known))).collect();
        fmu.restore(&with_mode(fmu.bytes(), mode));
        for (known, expected) in expected {
            for (unknown, expected) in UNKNOWNS.into_iter().zip(expected) {
                if unknown == Name::energy as u32 && PARAMETERS.contains(&known) {
                    let message = fmu.refused("energy", |fmu| {
                        fmu.fmi2GetDirectionalDerivative(&unknown, 1, &known, 1, &1.0, &mut 0.0)
                    });
                    assert!(message.contains("energy") && message.contains("is not provided"), "{message}");
                    continue;
                }
                let found = directional(&fmu, &[unknown], &[known], &[1.0])[0];
                let names = [unknown, known].map(name);
                assert!(
                    (found - expected).abs() <= 1e-8 * (1.0 + expected.abs()),
                    "{names:?}: {found} {expected}"
                );
            }
        }
    }
}

/// A state that is calculated is an unknown while initializing, and what follows from it goes by the chain rule; later it
/// is a known.
#[test]
fn calculated_states() {
    use crate::toys::balance::{Balance, Name::*};
    let derivative = |fmu: &Importer, unknown: u32, known: u32, value: &mut f64| {
        fmu.fmi2GetDirectionalDerivative(&unknown, 1, &known, 1, &1.0, value)
    };
    for interface in [CoSimulation, ModelExchange] {
        let fmu = in_mode::<Balance>(interface, Initialization);
        fmu.set(&[load as u32, stiffness as u32], &[6.0, 4.0]);
        let rows = [stretch, der_stretch].map(|unknown| {
            [load, stiffness].map(|known| directional(&fmu, &[unknown as u32], &[known as u32], &[1.0])[0])
        });
        assert_eq!(rows, [[0.25, -0.375], [0.0, 0.0]]);
        let message = fmu.refused("a state that is calculated", |fmu| {
            derivative(fmu, der_stretch as u32, stretch as u32, &mut 0.0)
        });
        assert!(message.contains("stretch is no known in initialization mode"), "{message}");
        fmu.ok(fmu.fmi2ExitInitializationMode());
        assert_eq!(directional(&fmu, &[der_stretch as u32], &[stretch as u32], &[1.0]), [-4.0]);
        assert_eq!(directional(&fmu, &[der_stretch as u32], &[load as u32], &[1.0]), [1.0]);
    }
}

/// Several unknowns and knowns at once, in any order and repeated: a matrix product.
#[test]
fn several_at_once() {
    let mut random = Random(1);
    let fmu = in_mode::<Oscillator>(ModelExchange, ContinuousTime);
    fmu.set(&KNOWNS, &[0.3, -0.2, 0.7]);
    let columns = KNOWNS.map(|known| directional(&fmu, &UNKNOWNS, &[known], &[1.0]));
    for _ in 0..50 {
        let seed = [(); 3].map(|()| random.between(-1.0, 1.0));
        let found = directional(&fmu, &UNKNOWNS, &KNOWNS, &seed);
        for (i, found) in found.iter().enumerate() {
            let expected: f64 = (0..3).map(|known| columns[known][i] * seed[known]).sum();
            assert!((found - expected).abs() < 1e-13, "{}: {found} is not {expected}", name(UNKNOWNS[i]));
        }
    }
    let [force, position, _] = KNOWNS;
    let unknown = [Name::der_velocity as u32, Name::energy as u32, Name::der_velocity as u32];
    let found = directional(&fmu, &unknown, &[force, position, force], &[2.0, 0.0, -1.0]);
    assert_eq!(found, directional(&fmu, &unknown, &[force], &[1.0]));
    assert_eq!(found[0], found[2]);
    assert_eq!(directional(&fmu, &UNKNOWNS, &[], &[]), [0.0; 5], "without knowns the sum is empty");
}

/// All that moves while the FMU steps.
fn moving() -> Vec<u32> {
    let moves = |causality| matches!(causality, Causality::Output | Causality::Local);
    (0..)
        .zip(Oscillator::TABLE)
        .filter(|(_, variable)| moves(variable.causality()))
        .map(|(vr, _)| vr)
        .collect()
}

fn values(fmu: &Importer, vr: &[u32]) -> Vec<f64> {
    let mut values = vec![f64::NAN; vr.len()];
    fmu.ok(fmu.fmi2GetReal(vr.as_ptr(), vr.len(), values.as_mut_ptr()));
    values
}

/// Right after the initialization and after each step, compared with differences of the values after short steps.
#[test]
fn output_derivatives_are_exact() {
    const H: f64 = 1e-4;
    let fmu = Importer::of::<Oscillator>(CoSimulation);
    fmu.set(&KNOWNS, &[0.3, 0.1, -0.2]);
    fmu.initialize(0.0);
    let (mut random, mut time, vr) = (Random(10), 0.0, moving());
    for step in 0..8 {
        let slope = random.between(-2.0, 2.0);
        let set = |fmu: &Importer| {
            fmu.set(&[KNOWNS[0]], &[0.3 + f64::from(step)]);
            fmu.set_rates([KNOWNS[0]], [slope]);
        };
        set(&fmu);
        let mut found = vec![f64::NAN; vr.len()];
        let orders = vec![1; vr.len()];
        fmu.ok(fmu.fmi2GetRealOutputDerivatives(vr.as_ptr(), vr.len(), orders.as_ptr(), found.as_mut_ptr()));
        assert_eq!(fmu.rates([KNOWNS[0]]), [slope]);

        let state = fmu.save();
        let y: Vec<_> = (0..5)
            .map(|steps| {
                let h = H * f64::from(steps);
                fmu.ok(fmu.fmi2SetFMUstate(state));
                if steps > 0 {
                    fmu.step(time, h);
                    fmu.set(&[KNOWNS[0]], &[0.3 + f64::from(step) + slope * h]);
                }
                values(&fmu, &vr)
            })
            .collect();
        fmu.ok(fmu.fmi2SetFMUstate(state));
        fmu.forget(state);
        for (i, vr) in vr.iter().enumerate() {
            let expected = (-25.0 * y[0][i] + 48.0 * y[1][i] - 36.0 * y[2][i] + 16.0 * y[3][i]
                - 3.0 * y[4][i])
                / (12.0 * H);
            let tolerance = 1e-7 * (1.0 + y[0][i].abs() + expected.abs());
            assert!(
                (found[i] - expected).abs() < tolerance,
                "step {step}: {}' is {expected}, not {}",
                name(*vr),
                found[i]
            );
        }
        let h = random.between(0.005, 0.03);
        fmu.step(time, h);
        time += h;
    }
}

/// Any Real variable has a derivative, 0 for parameters; the model's highest order is 1, and others are refused (section
/// 4.3.1).
#[test]
fn derivatives_of_every_variable_and_order() {
    let fmu = in_mode::<Oscillator>(CoSimulation, StepComplete);
    fmu.set(&[KNOWNS[0]], &[0.4]);
    fmu.step(0.0, 0.05);
    for (vr, variable) in
        (0..).zip(Oscillator::TABLE).filter(|(_, variable)| variable.base() == BaseType::Real)
    {
        let [rate] = fmu.rates([vr]);
        assert!(rate.is_finite() && (variable.causality() != Causality::Parameter || rate == 0.0));
        for order in [2, 3, i32::MAX, 0, -1, i32::MIN] {
            let mut value = f64::NAN;
            let message =
                fmu.refused("the order", |fmu| fmu.fmi2GetRealOutputDerivatives(&vr, 1, &order, &mut value));
            let limit = if order > 0 { "at most 1 (maxOutputDerivativeOrder)" } else { "at least 1" };
            let expected = format!("the derivative of {} must be {limit}, it is {order}", variable.name());
            assert!(message.contains(&expected), "{message}");
        }
    }
}

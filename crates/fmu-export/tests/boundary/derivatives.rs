//! Derivatives with respect to variables (section 2.1.9) and to time (4.2.1).

use crate::models::{Oscillator, oscillator::Name};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::Variables;
use fmu_test_kit::serialized::with_mode;
use fmu_test_kit::{Either, Importer};

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

/// Returns the central differences of all unknowns, which are quadratic functions of the knowns.
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

/// Checks single pairs in every mode that has directional derivatives; parameters are knowns in
/// Initialization Mode.
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
        let fmu = Importer::in_mode::<Oscillator>(interface, Initialization);
        fmu.set(&[KNOWNS, PARAMETERS].concat(), &[0.3, -0.2, 0.7, 3.0, 40.0, 0.4]);
        let parameters = if mode == Initialization { &PARAMETERS[..] } else { &[] };
        let expected: Vec<_> =
            KNOWNS.iter().chain(parameters).map(|known| (*known, differences(&fmu, *known))).collect();
        fmu.restore(&with_mode(fmu.bytes(), mode));
        for (known, expected) in expected {
            for (unknown, expected) in UNKNOWNS.into_iter().zip(expected) {
                if unknown == Name::energy as u32 && PARAMETERS.contains(&known) {
                    fmu.refused_with(&["energy", "is not provided"], |fmu| {
                        fmu.fmi2GetDirectionalDerivative(&unknown, 1, &known, 1, &1.0, &mut 0.0)
                    });
                    continue;
                }
                let found = fmu.directional(&[unknown], &[known], &[1.0])[0];
                let names = [unknown, known].map(name);
                assert!(
                    (found - expected).abs() <= 1e-8 * (1.0 + expected.abs()),
                    "{names:?}: {found} {expected}"
                );
            }
        }
    }
}

/// Checks that a calculated state is an unknown in Initialization Mode, where the chain rule applies to
/// variables that depend on it. Later it is a known.
#[test]
fn calculated_states() {
    use crate::models::balance::{Balance, Name::*};
    let derivative = |fmu: &Importer, unknown: u32, known: u32, value: &mut f64| {
        fmu.fmi2GetDirectionalDerivative(&unknown, 1, &known, 1, &1.0, value)
    };
    for interface in [CoSimulation, ModelExchange] {
        let fmu = Importer::in_mode::<Balance>(interface, Initialization);
        fmu.set(&[load as u32, stiffness as u32], &[6.0, 4.0]);
        let rows = [stretch, der_stretch].map(|unknown| {
            [load, stiffness].map(|known| fmu.directional(&[unknown as u32], &[known as u32], &[1.0])[0])
        });
        assert_eq!(rows, [[0.25, -0.375], [0.0, 0.0]]);
        fmu.refused_with(&["stretch is no known in initialization mode"], |fmu| {
            derivative(fmu, der_stretch as u32, stretch as u32, &mut 0.0)
        });
        fmu.ok(fmu.fmi2ExitInitializationMode());
        assert_eq!(fmu.directional(&[der_stretch as u32], &[stretch as u32], &[1.0]), [-4.0]);
        assert_eq!(fmu.directional(&[der_stretch as u32], &[load as u32], &[1.0]), [1.0]);
    }
}

//! Runs of test models: equal inputs and steps give bit-identical results in both FMI versions, and input derivatives and
//! start values take effect.

use crate::INTERFACES;
use crate::models::{oscillator::Name, *};
use fmu_export::Exported;
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_test_kit::checks::inputs;
use fmu_test_kit::{Either, Importer, fmi3, serialized};

const FORCE: u32 = Name::force as u32;
const STATES: [u32; 2] = [Name::position as u32, Name::velocity as u32];

/// Returns the serialized state without its first bytes and its checksum, because the interface type, the mode and the
/// checksum differ between FMI versions.
fn content(fmu: &impl Either) -> Vec<u8> {
    let bytes = fmu.bytes();
    bytes[serialized::ENDED..bytes.len() - serialized::CHECKSUM].to_vec()
}

fn steps<F: Either, M: Exported>() -> Vec<Vec<u8>> {
    let fmu = F::initialized_at::<M>(0.5);
    let inputs = inputs::<M>();
    let mut time = 0.5;
    let step = |step: i32| {
        let value = |index: &u32| 0.1 * (f64::from(step + *index as i32)).sin();
        fmu.set(&inputs, &inputs.iter().map(value).collect::<Vec<_>>());
        let size = 0.01 * f64::from(1 + step % 3);
        fmu.step(time, size);
        time += size;
        content(&fmu)
    };
    (0..20).map(step).collect()
}

#[test]
fn steps_in_both_versions() {
    fn same<M: Exported>() {
        assert_eq!(steps::<Importer, M>(), steps::<fmi3::Importer, M>());
    }
    same::<Oscillator>();
    same::<Counter>();
    same::<Talker>();
    same::<Palette>();
}

#[test]
fn integration_in_both_versions() {
    fn run<F: Either>() -> Vec<u8> {
        let fmu = F::in_mode::<Oscillator>(ModelExchange, ContinuousTime);
        let mut x = [0.1, 0.0];
        for step in 0..50 {
            fmu.ok(fmu.set_time(0.01 * f64::from(step)));
            fmu.ok(fmu.set_states(x.as_ptr(), 2));
            let rates = fmu.derivatives::<2>();
            x = [0, 1].map(|index| x[index] + 0.01 * rates[index]);
        }
        content(&fmu)
    }
    assert_eq!(run::<Importer>(), run::<fmi3::Importer>());
}

/// Checks that a first derivative of an input applies only to the next step, and that higher orders have no effect.
#[test]
fn input_derivatives() {
    let [once, never, rich] = [(); 3].map(|()| Importer::in_mode::<Oscillator>(CoSimulation, StepComplete));
    once.set_input_derivatives(&[FORCE], &[5.0]);
    rich.set_input_derivatives(&[FORCE], &[5.0]);
    let orders = [2, 7, i32::MAX];
    rich.ok(rich.fmi2SetRealInputDerivatives([FORCE; 3].as_ptr(), 3, orders.as_ptr(), [9.0; 3].as_ptr()));
    [&once, &never, &rich].iter().for_each(|fmu| fmu.step(0.0, 0.1));
    assert_eq!(once.get(STATES), rich.get(STATES));
    assert!(once.get(STATES)[0] > 0.0 && never.get(STATES) == [0.0; 2]);
    // The second step equals a step of an instance whose input has no derivative.
    let state = once.get(STATES);
    once.step(0.1, 0.1);
    let other = Importer::new::<Oscillator>(CoSimulation);
    other.set(&STATES, &state);
    other.initialize(0.1);
    other.step(0.1, 0.1);
    assert_eq!(once.get(STATES), other.get(STATES));
}

/// Checks start values and nominal values of states. The types of the variables define the nominal values. A state has the
/// same effect whether it is set as a variable or in the array of states.
#[test]
fn states() {
    fn check<F: Either>() {
        for interface in INTERFACES {
            let fmu = F::in_mode::<Oscillator>(interface, Instantiated);
            fmu.set(&STATES, &[0.1, 0.2]);
            fmu.initialize(0.0);
            assert_eq!(fmu.get(STATES), [0.1, 0.2]);
        }
        let fmu = F::in_mode::<Oscillator>(ModelExchange, Instantiated);
        let mut nominals = [f64::NAN; 2];
        fmu.ok(fmu.get_nominals(nominals.as_mut_ptr(), 2));
        assert_eq!(nominals, [0.1, 0.5]);
        fmu.set(&STATES, &[0.1, 0.2]);
        fmu.initialize(0.0);
        fmu.enter_continuous_time();
        assert_eq!(fmu.states(), [0.1, 0.2]);
        fmu.ok(fmu.set_states([0.0, 0.25].as_ptr(), 2));
        let by_array = (fmu.states::<2>(), fmu.derivatives::<2>());
        fmu.ok(fmu.set_states([0.0; 2].as_ptr(), 2));
        fmu.set(&STATES[1..], &[0.25]);
        assert_eq!((fmu.states(), fmu.derivatives()), by_array);
    }
    check::<Importer>();
    check::<fmi3::Importer>();
}

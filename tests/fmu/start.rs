//! Start of the testbed: either at rest at the motor angles, regardless of the order of the importer's calls, or in a given
//! state.

use crate::exact::{INPUTS, STATES, distance, start_at};
use crate::{INTERFACES, in_mode, new, vr};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::Status;
use fmu_test_kit::{Either, Importer as Fmu, fmi3};
use prw_testbed::TestbedFmu;
use prw_testbed::variables::Name;

const THETA: [u32; 2] = [vr(Name::theta1), vr(Name::theta2)];
const ANGLES: [f64; 2] = [0.7, -0.4];
const REST: [f64; 6] = [0.7, -0.4, 0.7, -0.4, 0.0, 0.0];
const GIVEN: [f64; 6] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6];

/// A stage of the calls before the first step.
type Stage = usize;
const INSTANTIATED: Stage = 0;
const INITIALIZING: Stage = 1;
const INITIALIZED: Stage = 2;
const STAGES: [Stage; 3] = [INSTANTIATED, INITIALIZING, INITIALIZED];

/// Makes the importer's calls up to the first step, and calls `act` in each stage.
fn initialize<F: Either>(fmu: &F, act: impl Fn(Stage)) {
    act(INSTANTIATED);
    fmu.enter_initialization(0.0, None);
    act(INITIALIZING);
    fmu.ok(fmu.exit_initialization_mode());
    act(INITIALIZED);
}

/// Asserts that the testbed is at rest at `ANGLES`.
#[track_caller]
fn rests(fmu: &impl Either) {
    assert_eq!(fmu.get(STATES), REST);
    assert_eq!(fmu.get([vr(Name::tau1), vr(Name::tau2), vr(Name::der_theta3)]), [0.0; 3]);
}

/// Checks in Co-Simulation that the testbed stays exactly at rest, because its couplings are not twisted.
fn rest_in_co_simulation<F: Either>() {
    for (stage, use_omega) in STAGES.into_iter().flat_map(|stage| [(stage, 0), (stage, 1)]) {
        let fmu = F::new::<TestbedFmu>(CoSimulation);
        fmu.ok(fmu.set_boolean(vr(Name::use_omega), use_omega));
        initialize(&fmu, |now| {
            if now == stage {
                fmu.set(&THETA, &ANGLES);
            }
        });
        rests(&fmu);
        let mut time = 0.0;
        for i in 0..50 {
            let size = 1e-3 * f64::from(1 + i % 7);
            fmu.set(&THETA, &ANGLES);
            fmu.step(time, size);
            rests(&fmu);
            time += size;
        }
        fmu.set(&THETA, &[0.0; 2]);
        assert_eq!(fmu.get(STATES), REST, "after the start, angles must not set the states");
    }
}

/// Checks that the last angles before the first step determine the start.
#[test]
fn the_last_angles_before_the_first_step_count() {
    let fmu = new(CoSimulation);
    initialize(&fmu, |stage| {
        fmu.set(&THETA, &[stage as f64, 1.0]);
        if stage >= INITIALIZING {
            assert_eq!(fmu.get(STATES), [stage as f64, 1.0, stage as f64, 1.0, 0.0, 0.0]);
        }
    });
    fmu.set(&THETA, &ANGLES);
    fmu.step(0.0, 0.01);
    rests(&fmu);
    // After the first step, the motor angles act on the states only through later steps.
    fmu.set(&THETA, &[0.0; 2]);
    assert_eq!(fmu.get(STATES), REST);
}

/// Checks that a rejected first step does not start the simulation.
#[test]
fn a_rejected_step_starts_nothing() {
    let fmu = in_mode(CoSimulation, StepComplete);
    fmu.set(&THETA, &[f64::MAX, 0.0]);
    fmu.set_input_derivatives(&THETA, &[f64::MAX; 2]);
    assert_eq!(fmu.try_step(0.0, 10.0), Status::Error);
    fmu.set(&THETA, &ANGLES);
    fmu.set_input_derivatives(&THETA, &[0.0; 2]);
    rests(&fmu);
}

fn rest_in_model_exchange<F: Either>() {
    for stage in STAGES {
        let fmu = F::new::<TestbedFmu>(ModelExchange);
        initialize(&fmu, |now| {
            if now == stage {
                fmu.set(&THETA, &ANGLES);
            }
        });
        rests(&fmu);
        fmu.enter_continuous_time();
        rests(&fmu);
        assert_eq!(fmu.derivatives::<6>(), [0.0; 6]);
        // In Continuous-Time Mode the importer integrates the states, so the angles no longer set them.
        fmu.set(&THETA, &[0.0; 2]);
        assert_eq!(fmu.get(STATES), REST);
        fmu.ok(fmu.enter_event_mode());
        fmu.set(&THETA, &[1.0; 2]);
        assert_eq!(fmu.get(STATES), REST, "in a later event mode");
    }
}

#[test]
fn rest_in_both_versions() {
    rest_in_co_simulation::<Fmu>();
    rest_in_co_simulation::<fmi3::Importer>();
    rest_in_model_exchange::<Fmu>();
    rest_in_model_exchange::<fmi3::Importer>();
}

/// Checks the calls of OpenModelica, which sets parameters after the initialization and, in Event Mode, sets states that it
/// has just read.
#[test]
fn late_parameters_and_states_in_event_mode() {
    for given in [false, true] {
        let fmu = new(ModelExchange);
        fmu.set(&INPUTS, &[ANGLES[0], ANGLES[1], 3.0, -2.0]);
        initialize(&fmu, |_| {});
        if given {
            start_at(&fmu, GIVEN);
        } else {
            fmu.set(&[vr(Name::k1)], &[60.0]);
        }
        let expected = if given { GIVEN } else { REST };
        let mut x = fmu.states::<6>();
        assert_eq!(x, expected);
        x[4] += 0.25;
        fmu.ok(fmu.fmi2SetContinuousStates(x.as_ptr(), 6));
        fmu.set(&THETA, &[5.0; 2]);
        assert_eq!(fmu.get(STATES), x, "states that the importer has set must be kept");
        fmu.enter_continuous_time();
        assert_eq!(fmu.get(STATES), x);
    }
}

/// Checks that the start state can be given in any stage before the first step, but not later.
#[test]
fn a_given_start() {
    for interface in INTERFACES {
        for stage in STAGES {
            let fmu = new(interface);
            initialize(&fmu, |now| {
                if now == stage {
                    start_at(&fmu, GIVEN);
                }
            });
            fmu.set(&THETA, &ANGLES);
            assert_eq!(fmu.get(STATES), GIVEN, "{interface}, {stage}");
        }
    }
    let fmu = new(CoSimulation);
    initialize(&fmu, |_| {});
    fmu.step(0.0, 0.01);
    start_at(&fmu, GIVEN);
    assert_eq!(fmu.get(STATES), [0.0; 6], "after the first step");
}

/// Checks that after restoring a state that was saved before the first step, and after a reset, the states again follow the
/// motor angles.
#[test]
fn saved_and_reset() {
    for interface in INTERFACES {
        let fmu = new(interface);
        initialize(&fmu, |_| fmu.set(&THETA, &[0.1, 0.2]));
        let (state, bytes) = (fmu.save(), fmu.bytes());
        let start = || match interface {
            CoSimulation => fmu.step(0.0, 0.01),
            ModelExchange => _ = fmu.enter_continuous_time(),
        };
        start();
        let started = fmu.bytes();
        let restores: [&dyn Fn(); 2] = [&|| fmu.ok(fmu.fmi2SetFMUstate(state)), &|| fmu.restore(&bytes)];
        for restore in restores {
            restore();
            fmu.set(&THETA, &ANGLES);
            rests(&fmu);
            fmu.restore(&started);
            fmu.set(&THETA, &ANGLES);
            assert!(distance(&fmu.get(STATES), &REST) > 0.1, "{interface}");
        }
        fmu.ok(fmu.fmi2Reset());
        initialize(&fmu, |_| fmu.set(&THETA, &ANGLES));
        rests(&fmu);
        fmu.forget(state);
    }
}

#[test]
fn states_in_event_mode_of_fmi3() {
    // In Event Mode, FMI 3.0 allows setting one state; the other states keep their values.
    let fmu = fmi3::Importer::new::<TestbedFmu>(ModelExchange);
    fmu.set(&THETA, &ANGLES);
    initialize(&fmu, |_| {});
    fmu.set(&[vr(Name::theta5)], &[9.0]);
    fmu.set(&THETA, &[0.0; 2]);
    assert_eq!(fmu.get(STATES), [0.7, -0.4, 9.0, -0.4, 0.0, 0.0]);
    // A given start state applies even if it is set after the initialization.
    let fmu = fmi3::Importer::new::<TestbedFmu>(ModelExchange);
    initialize(&fmu, |_| {});
    start_at(&fmu, GIVEN);
    assert_eq!(fmu.get(STATES), GIVEN);
}

//! The motion of the oscillator in both interface types, compared with its formula.

use crate::INTERFACES;
use crate::models::{Oscillator, oscillator::Name};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_test_kit::{Either, Importer};

const FORCE: u32 = Name::force as u32;
const STATES: [u32; 2] = [Name::position as u32, Name::velocity as u32];
const DERIVATIVES: [u32; 2] = [Name::der_position as u32, Name::der_velocity as u32];

fn states(fmu: &Importer) -> [f64; 2] {
    let mut x = [f64::NAN; 2];
    fmu.ok(fmu.fmi2GetContinuousStates(x.as_mut_ptr(), 2));
    x
}

fn rates(fmu: &Importer) -> [f64; 2] {
    let mut rates = [f64::NAN; 2];
    fmu.ok(fmu.fmi2GetDerivatives(rates.as_mut_ptr(), 2));
    rates
}

fn set_states(fmu: &Importer, x: [f64; 2]) {
    fmu.ok(fmu.fmi2SetContinuousStates(x.as_ptr(), 2));
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).abs().max((a[1] - b[1]).abs())
}

/// Checks that the motion without damper and force is a cosine.
#[test]
fn free_oscillation() {
    let fmu = Importer::of::<Oscillator>(CoSimulation);
    fmu.ok(fmu.fmi2SetBoolean(&(Name::damped as u32), 1, &0));
    fmu.set(&STATES, &[0.1, 0.0]);
    fmu.initialize(0.0);
    for i in 0..100 {
        let t = f64::from(i) * 0.1;
        assert!(distance(fmu.get(STATES), [0.1 * (5.0 * t).cos(), -0.5 * (5.0 * t).sin()]) < 1e-12, "at {t}");
        fmu.step(t, 0.1);
    }
}

/// Checks a force that is linear between the communication points. With the slope given, steps of any size
/// agree with an integrator with tiny steps.
#[test]
fn co_simulation_is_model_exchange_integrated() {
    let force = |t: f64| 3.0 - 2.0 * t;
    let model = Importer::of::<Oscillator>(ModelExchange);
    model.initialize(0.0);
    model.enter_continuous_time();
    let slope = |t: f64, x: [f64; 2]| {
        model.ok(model.fmi2SetTime(t));
        model.set(&[FORCE], &[force(t)]);
        set_states(&model, x);
        assert_eq!(rates(&model), model.get(DERIVATIVES));
        rates(&model)
    };
    let (mut x, h) = ([0.0; 2], 1e-3);
    for step in 0..1000 {
        let t = f64::from(step) * h;
        let add = |k: [f64; 2], h: f64| [x[0] + h * k[0], x[1] + h * k[1]];
        let k1 = slope(t, x);
        let k2 = slope(t + 0.5 * h, add(k1, 0.5 * h));
        let k3 = slope(t + 0.5 * h, add(k2, 0.5 * h));
        let k4 = slope(t + h, add(k3, h));
        x = std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    }
    for steps in [1, 7, 100] {
        let slave = Importer::of::<Oscillator>(CoSimulation);
        slave.initialize(0.0);
        let h = 1.0 / f64::from(steps);
        for step in 0..steps {
            let t = f64::from(step) * h;
            slave.set(&[FORCE], &[force(t)]);
            slave.set_rates([FORCE], [-2.0]);
            slave.step(t, h);
        }
        assert!(distance(slave.get(STATES), x) < 1e-11, "{steps} steps");
    }
}

/// Checks that a slope applies only to the next step, and that higher orders have no effect.
#[test]
fn input_derivatives() {
    let [once, never, rich] = [(); 3].map(|()| Importer::in_mode::<Oscillator>(CoSimulation, StepComplete));
    once.set_rates([FORCE], [5.0]);
    rich.set_rates([FORCE], [5.0]);
    let orders = [2, 7, i32::MAX];
    rich.ok(rich.fmi2SetRealInputDerivatives([FORCE; 3].as_ptr(), 3, orders.as_ptr(), [9.0; 3].as_ptr()));
    [&once, &never, &rich].iter().for_each(|fmu| fmu.step(0.0, 0.1));
    assert_eq!(once.get(STATES), rich.get(STATES));
    assert!(once.get(STATES)[0] > 0.0 && never.get(STATES) == [0.0; 2]);
    // The second step equals a step of an instance without slope.
    let state = once.get(STATES);
    once.step(0.1, 0.1);
    let other = Importer::of::<Oscillator>(CoSimulation);
    other.set(&STATES, &state);
    other.initialize(0.1);
    other.step(0.1, 0.1);
    assert_eq!(once.get(STATES), other.get(STATES));
}

#[test]
fn derivatives_of_the_initialization_are_used() {
    let [with, without] = [true, false].map(|given| {
        let fmu = Importer::in_mode::<Oscillator>(CoSimulation, Initialization);
        if given {
            fmu.set_rates([FORCE], [2.0]);
        }
        fmu.ok(fmu.fmi2ExitInitializationMode());
        fmu.step(0.0, 0.01);
        fmu.get([STATES[0]])
    });
    assert!(with[0] > 0.0 && without[0] == 0.0);
}

/// Checks that the oscillator stays exactly at rest while its input is constant.
#[test]
fn waiting_at_rest() {
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, StepComplete);
    let mut time = 0.0;
    for i in 1..100 {
        fmu.step(time, 1e-3 * f64::from(i));
        time += 1e-3 * f64::from(i);
    }
    assert_eq!(fmu.get(STATES), [0.0; 2]);
}

#[test]
fn start_values_are_the_first_states() {
    for interface in INTERFACES {
        let fmu = Importer::in_mode::<Oscillator>(interface, Instantiated);
        fmu.set(&STATES, &[0.1, 0.2]);
        fmu.initialize(0.0);
        assert_eq!(fmu.get(STATES), [0.1, 0.2]);
        if interface == ModelExchange {
            fmu.enter_continuous_time();
            assert_eq!(states(&fmu), [0.1, 0.2]);
        }
    }
}

/// Checks that nominal values come from the types, right after instantiation.
#[test]
fn nominals() {
    let fmu = Importer::in_mode::<Oscillator>(ModelExchange, Instantiated);
    let mut nominals = [f64::NAN; 2];
    fmu.ok(fmu.fmi2GetNominalsOfContinuousStates(nominals.as_mut_ptr(), 2));
    assert_eq!(nominals, [0.1, 0.5]);
}

/// Checks that a state set as a variable and a state set in the array of states have equal effects.
#[test]
fn both_ways_to_set_a_state() {
    let fmu = Importer::in_mode::<Oscillator>(ModelExchange, ContinuousTime);
    set_states(&fmu, [0.0, 0.25]);
    let by_array = (states(&fmu), rates(&fmu));
    set_states(&fmu, [0.0; 2]);
    fmu.set(&[STATES[1]], &[0.25]);
    assert_eq!((states(&fmu), rates(&fmu)), by_array);
}

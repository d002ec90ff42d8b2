//! The sequences of calls that real importers were seen to make, odd ones included. What is in their
//! sources or traces is replayed here call by call; every answer must be `fmi2OK` unless said otherwise.

use crate::exact::{INPUTS, STATES, distance, parameters, set_parameters, start_at};
use crate::modes::{enter_continuous_time, in_mode};
use crate::{TABLE, new, vr};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::Status;
use fmu_export::{BaseType, Causality};
use fmu_test_kit::{Arguments, Importer as Fmu, Message, functions_of};
use prw_testbed::TestbedFmu;
use prw_testbed::variables::Name;
use std::ptr::null_mut;

fn instantiate(arguments: &Arguments) -> Result<Fmu, Vec<Message>> {
    Fmu::instantiate(functions_of::<TestbedFmu>(), arguments)
}

const OUTPUTS: [u32; 4] = [vr(Name::tau1), vr(Name::tau2), vr(Name::pitch), vr(Name::roll)];

fn motors(t: f64) -> [f64; 4] {
    [(3.0 * t).sin(), (4.0 * t).cos() - 1.0, 3.0 * (3.0 * t).cos(), -4.0 * (4.0 * t).sin()]
}

/// What OpenModelica reads at the end of a step: all outputs and locals in one call.
fn outputs_and_locals() -> Vec<u32> {
    let exposed = |causality| matches!(causality, Causality::Output | Causality::Local);
    (0..).zip(TABLE).filter(|(_, variable)| exposed(variable.causality())).map(|(vr, _)| vr).collect()
}

/// Model Exchange only; fixed parameters after the initialization, states while in event mode.
#[test]
fn openmodelica() {
    let arguments = Arguments {
        logging_on: true,
        resource_location: Some(c"file:///tmp/not/there/resources"),
        ..Arguments::of::<TestbedFmu>(ModelExchange)
    };
    let fmu = instantiate(&arguments).unwrap();
    fmu.set(&INPUTS, &motors(0.0));
    fmu.ok(fmu.fmi2SetupExperiment(0, 0.0, 0.0, 0, 1.0));
    fmu.ok(fmu.fmi2EnterInitializationMode());
    fmu.ok(fmu.fmi2ExitInitializationMode());
    set_parameters(&fmu, &parameters(5));
    fmu.ok(fmu.fmi2SetBoolean(&vr(Name::use_omega), 1, &0));
    let mut x = [f64::NAN; 6];
    let mut rates = [f64::NAN; 6];
    fmu.ok(fmu.fmi2GetContinuousStates(x.as_mut_ptr(), 6));
    fmu.ok(fmu.fmi2SetContinuousStates(x.as_ptr(), 6)); // still in event mode
    enter_continuous_time(&fmu);
    let all = outputs_and_locals();
    let mut values = vec![f64::NAN; all.len()];
    for i in 0..200 {
        let t = f64::from(i) * 1e-3;
        fmu.ok(fmu.fmi2SetTime(t));
        fmu.set(&INPUTS, &motors(t));
        fmu.ok(fmu.fmi2SetContinuousStates(x.as_ptr(), 6));
        fmu.ok(fmu.fmi2GetDerivatives(rates.as_mut_ptr(), 6));
        fmu.ok(fmu.fmi2CompletedIntegratorStep(1, &mut 0, &mut 0));
        fmu.ok(fmu.fmi2GetReal(all.as_ptr(), all.len(), values.as_mut_ptr()));
        x = std::array::from_fn(|i| x[i] + 1e-3 * rates[i]);
    }
    assert!(values.iter().all(|value| value.is_finite()) && values.iter().any(|value| *value != 0.0));
    fmu.ok(fmu.fmi2Terminate());
}

/// OMSimulator reads and writes one variable per call, all that are exposed, at every step.
fn read_all_one_by_one(fmu: &Fmu) -> Vec<f64> {
    (0..)
        .zip(TABLE)
        .map(|(vr, variable)| {
            let (mut real, mut integer) = (f64::NAN, -1);
            match variable.base() {
                BaseType::Real => fmu.ok(fmu.fmi2GetReal(&vr, 1, &mut real)),
                BaseType::Integer => fmu.ok(fmu.fmi2GetInteger(&vr, 1, &mut integer)),
                _ => fmu.ok(fmu.fmi2GetBoolean(&vr, 1, &mut integer)),
            }
            if real.is_nan() { f64::from(integer) } else { real }
        })
        .collect()
}

/// With input extrapolation: derivatives of the declared order between slaves, and every step done
/// twice around a saved state in a handle that is used again.
#[test]
fn omsimulator() {
    let arguments = Arguments {
        visible: true,
        logging_on: true,
        environment: false,
        resource_location: Some(c"file:////tmp/oms-123/temp/0001_wrist/resources"),
        ..Arguments::of::<TestbedFmu>(CoSimulation)
    };
    let fmu = instantiate(&arguments).unwrap();
    fmu.ok(fmu.fmi2SetupExperiment(1, 1e-4, 0.0, 0, 0.0));
    fmu.ok(fmu.fmi2EnterInitializationMode());
    for (vr, value) in INPUTS.into_iter().zip(motors(0.0)) {
        fmu.set(&[vr], &[value]);
    }
    read_all_one_by_one(&fmu);
    fmu.ok(fmu.fmi2ExitInitializationMode());
    let mut state = null_mut();
    for i in 0..100 {
        let t = f64::from(i) * 0.01;
        fmu.ok(fmu.fmi2GetFMUstate(&mut state));
        let runs = [(); 2].map(|()| {
            fmu.ok(fmu.fmi2SetFMUstate(state));
            for (vr, value) in INPUTS.into_iter().zip(motors(t)) {
                fmu.set(&[vr], &[value]);
            }
            let [rate1, rate2] = [2, 3].map(|i| motors(t)[i]);
            fmu.set_rates([vr(Name::theta1)], [rate1]);
            fmu.set_rates([vr(Name::theta2)], [rate2]);
            fmu.step(t, 0.01);
            for vr in OUTPUTS {
                assert!(fmu.rates([vr])[0].is_finite());
            }
            read_all_one_by_one(&fmu)
        });
        assert_eq!(runs[0], runs[1], "step {i}");
    }
    fmu.forget(state);
    fmu.ok(fmu.fmi2Terminate());
}

/// It ignores a NULL from fmi2Instantiate and goes on with it: errors, no crash.
#[test]
fn omsimulator_without_instance() {
    let arguments = Arguments { guid: Some(c"{stale}".into()), ..Arguments::of::<TestbedFmu>(CoSimulation) };
    assert!(instantiate(&arguments).is_err());
    let fmu = Fmu::null(functions_of::<TestbedFmu>());
    for (function, status) in fmu.call_all() {
        assert_eq!(status, Status::Error, "{function}");
    }
}

/// Variables before SetupExperiment, time in whole nanoseconds, instances stepped side by side, each
/// time by another thread.
#[test]
fn libcosim() {
    const STEP: i64 = 16_666_667;
    const SLAVES: usize = 6;
    let start = |number: usize| {
        let fmu = new(CoSimulation);
        fmu.set(&[vr(Name::theta1), vr(Name::k1)], &[0.1 * number as f64, 100.0 + number as f64]);
        fmu.ok(fmu.fmi2SetupExperiment(0, 0.0, 0.0, 0, 0.0));
        fmu.ok(fmu.fmi2EnterInitializationMode());
        fmu.ok(fmu.fmi2ExitInitializationMode());
        fmu
    };
    let step = |fmu: &Fmu, i: i64| {
        let time = (i * STEP) as f64 * 1e-9;
        fmu.set(&INPUTS, &motors(time));
        fmu.step(time, STEP as f64 * 1e-9);
        fmu.get(OUTPUTS)
    };
    let mut slaves: Vec<_> = (0..SLAVES).map(start).collect();
    let mut last = Vec::new();
    for i in 0..120 {
        last = std::thread::scope(|scope| {
            let step = &step;
            let threads: Vec<_> = slaves.iter_mut().map(|fmu| scope.spawn(move || step(fmu, i))).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
    }
    for (number, last) in (0..SLAVES).zip(last) {
        let alone = start(number);
        let expected = (0..120).fold([f64::NAN; 4], |_, i| step(&alone, i));
        assert_eq!(last, expected, "slave {number}");
    }
    // The destructor terminates, whatever went wrong before; the log category is streamed, so never NULL.
    let broken = slaves.pop().unwrap();
    assert_eq!(broken.try_step(0.0, f64::NAN), Status::Error);
    assert!(broken.take_log().iter().all(|message| !message.category.is_empty()));
    broken.ok(broken.fmi2Terminate());
}

/// FMPy with set_input_derivatives: derivatives while initializing, outputs right after it.
#[test]
fn fmpy() {
    let fmu = new(CoSimulation);
    fmu.ok(fmu.fmi2SetupExperiment(0, 0.0, 0.0, 1, 0.1));
    fmu.set(&[vr(Name::k1)], &[110.0]);
    start_at(&fmu, [0.05, 0.0, 0.0, 0.0, 0.0, 0.0]);
    fmu.ok(fmu.fmi2EnterInitializationMode());
    let [theta1, theta2, rate1, rate2] = motors(0.0);
    fmu.set(&[vr(Name::theta1), vr(Name::theta2)], &[theta1, theta2]);
    fmu.set_rates([vr(Name::theta1), vr(Name::theta2)], [rate1, rate2]);
    fmu.ok(fmu.fmi2ExitInitializationMode());
    assert!(fmu.get(OUTPUTS)[0] != 0.0, "the sensors feel theta3 and the rate");
    let mut time = 0.0;
    while time < 0.1 - 1e-9 {
        let [theta1, theta2, rate1, rate2] = motors(time);
        fmu.set(&[vr(Name::theta1), vr(Name::theta2)], &[theta1, theta2]);
        fmu.set_rates([vr(Name::theta1), vr(Name::theta2)], [rate1, rate2]);
        fmu.step(time, 0.01);
        time += 0.01;
        fmu.get(OUTPUTS);
    }
    fmu.ok(fmu.fmi2Terminate());
}

/// Derivatives given while initializing are those of the first step.
#[test]
fn derivatives_of_the_initialization_are_used() {
    let [with, without] = [true, false].map(|given| {
        let fmu = in_mode(CoSimulation, Initialization);
        if given {
            fmu.set_rates([vr(Name::theta1), vr(Name::theta2)], [2.0, 0.0]);
        }
        fmu.ok(fmu.fmi2ExitInitializationMode());
        fmu.step(0.0, 0.01);
        fmu.get([vr(Name::theta3)])
    });
    assert!(with[0] > 0.0 && without[0] == 0.0);
}

/// Maestro (INTO-CPS) asks for the derivative of an output by the value reference of the derivative
/// variable; PyFMI extrapolates inputs with orders 1 and 2, asks for those that the description has, and
/// raises on anything but `fmi2OK`.
#[test]
fn maestro_and_pyfmi() {
    let fmu = in_mode(CoSimulation, StepComplete);
    for i in 0..20 {
        let t = f64::from(i) * 0.01;
        let [theta1, theta2, rate1, rate2] = motors(t);
        fmu.set(&[vr(Name::theta1), vr(Name::theta2)], &[theta1, theta2]);
        for (order, given) in [(1, [rate1, rate2]), (2, [-9.0 * theta1, -16.0 * theta2])] {
            let vr = [vr(Name::theta1), vr(Name::theta2)];
            fmu.ok(fmu.fmi2SetRealInputDerivatives(vr.as_ptr(), 2, [order; 2].as_ptr(), given.as_ptr()));
        }
        fmu.step(t, 0.01);
        let asked =
            [Name::der_theta3, Name::der_omega5, Name::pitch_rate, Name::roll_rate, Name::tau1, Name::roll];
        assert!(fmu.rates(asked.map(vr)).iter().all(|rate| rate.is_finite()));
    }
}

/// FMIKit (Simulink) sets no input before the end of the initialization, reads before it sets, and has
/// communication points that are off by 3e-12; its fast restart begins again with a reset.
#[test]
fn fmikit() {
    let fmu = new(CoSimulation);
    let run = || {
        fmu.ok(fmu.fmi2SetupExperiment(0, 0.0, 0.0, 1, 1.0));
        fmu.ok(fmu.fmi2EnterInitializationMode());
        fmu.ok(fmu.fmi2ExitInitializationMode());
        assert_eq!(fmu.get(OUTPUTS), [0.0; 4]);
        for i in 0..1000 {
            let t = f64::from(i) * 1e-3 + if i % 2 == 1 { 3e-12 } else { 0.0 };
            fmu.get(OUTPUTS);
            fmu.set(&INPUTS, &motors(t));
            fmu.step(t, 1e-3);
        }
        let end = fmu.get(OUTPUTS);
        fmu.ok(fmu.fmi2Terminate());
        assert_eq!(fmu.get(OUTPUTS), end, "readable after the end");
        fmu.ok(fmu.fmi2Reset());
        end
    };
    assert_eq!(run(), run());
}

/// Simulink steps back to operating points that it saved as bytes, in any order.
#[test]
fn simulink_stepping_back() {
    let fmu = in_mode(CoSimulation, StepComplete);
    let (mut saved, mut seen) = (Vec::new(), Vec::new());
    let step = |i: usize| {
        let t = i as f64 * 0.01;
        fmu.set(&INPUTS, &motors(t));
        fmu.step(t, 0.01);
        fmu.get(STATES)
    };
    for i in 0..20 {
        saved.push(fmu.bytes());
        seen.push(step(i));
    }
    for i in [15, 3, 19, 0, 8] {
        fmu.restore(&saved[i]);
        assert_eq!(step(i), seen[i]);
    }
}

/// An input that is held between points at rest keeps everything at rest, to the last bit, whatever
/// the step sizes: nothing drifts while a master waits.
#[test]
fn waiting_at_rest() {
    let fmu = in_mode(CoSimulation, StepComplete);
    let mut time = 0.0;
    for i in 1..100 {
        fmu.step(time, 1e-3 * f64::from(i));
        time += 1e-3 * f64::from(i);
    }
    assert_eq!(distance(&fmu.get(STATES), &[0.0; 6]), 0.0);
}

//! The sequences of calls that real importers were seen to make, odd ones included. What is in their sources or traces is
//! replayed here call by call; every answer must be `fmi2OK` unless said otherwise.

use crate::modes::{enter_continuous_time, in_mode};
use crate::toys::{Oscillator, oscillator::Name};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::fmi2::types::Status;
use fmu_export::{BaseType, Causality, Variables};
use fmu_test_kit::{Arguments, Importer};
use std::ptr::null_mut;

const FORCE: u32 = Name::force as u32;
const POSITION: u32 = Name::position as u32;
const OUTPUTS: [u32; 3] = [POSITION, Name::spring_force as u32, Name::energy as u32];

fn instantiate(arguments: &Arguments) -> Importer {
    Importer::instantiate(fmu_export::fmi2::functions::<Oscillator>(), arguments).unwrap()
}

fn force(t: f64) -> f64 {
    (3.0 * t).sin()
}

fn slope(t: f64) -> f64 {
    3.0 * (3.0 * t).cos()
}

/// Model Exchange only; fixed parameters after the initialization, states while in event mode, all outputs and locals in
/// one call at the end of a step.
#[test]
fn openmodelica() {
    let fmu = instantiate(&Arguments {
        logging_on: true,
        resource_location: Some(c"file:///tmp/not/there/resources"),
        ..Arguments::of::<Oscillator>(ModelExchange)
    });
    fmu.set(&[FORCE], &[force(0.0)]);
    fmu.ok(fmu.fmi2SetupExperiment(0, 0.0, 0.0, 0, 1.0));
    fmu.ok(fmu.fmi2EnterInitializationMode());
    fmu.ok(fmu.fmi2ExitInitializationMode());
    fmu.set(&[Name::mass, Name::stiffness, Name::damping].map(|name| name as u32), &[3.0, 40.0, 0.3]);
    fmu.ok(fmu.fmi2SetInteger(&(Name::springs as u32), 1, &2));
    fmu.ok(fmu.fmi2SetBoolean(&(Name::damped as u32), 1, &0));
    let (mut x, mut rates) = ([f64::NAN; 2], [f64::NAN; 2]);
    fmu.ok(fmu.fmi2GetContinuousStates(x.as_mut_ptr(), 2));
    fmu.ok(fmu.fmi2SetContinuousStates(x.as_ptr(), 2)); // still in event mode
    enter_continuous_time(&fmu);
    let exposed = |causality| matches!(causality, Causality::Output | Causality::Local);
    let all: Vec<u32> = (0..)
        .zip(Oscillator::TABLE)
        .filter(|(_, variable)| exposed(variable.causality()))
        .map(|(vr, _)| vr)
        .collect();
    let mut values = vec![f64::NAN; all.len()];
    for i in 0..200 {
        let t = f64::from(i) * 1e-3;
        fmu.ok(fmu.fmi2SetTime(t));
        fmu.set(&[FORCE], &[force(t)]);
        fmu.ok(fmu.fmi2SetContinuousStates(x.as_ptr(), 2));
        fmu.ok(fmu.fmi2GetDerivatives(rates.as_mut_ptr(), 2));
        fmu.ok(fmu.fmi2CompletedIntegratorStep(1, &mut 0, &mut 0));
        fmu.ok(fmu.fmi2GetReal(all.as_ptr(), all.len(), values.as_mut_ptr()));
        x = std::array::from_fn(|i| x[i] + 1e-3 * rates[i]);
    }
    assert!(values.iter().all(|value| value.is_finite()) && values.iter().any(|value| *value != 0.0));
    fmu.ok(fmu.fmi2Terminate());
}

/// OMSimulator reads and writes one variable per call, all that are exposed, at every step.
fn read_all_one_by_one(fmu: &Importer) -> Vec<f64> {
    (0..)
        .zip(Oscillator::TABLE)
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

/// With input extrapolation: derivatives of the declared order between slaves, and every step done twice around a saved
/// state in a handle that is used again.
#[test]
fn omsimulator() {
    let fmu = instantiate(&Arguments {
        visible: true,
        logging_on: true,
        environment: false,
        resource_location: Some(c"file:////tmp/oms-123/temp/0001_wrist/resources"),
        ..Arguments::of::<Oscillator>(CoSimulation)
    });
    fmu.ok(fmu.fmi2SetupExperiment(1, 1e-4, 0.0, 0, 0.0));
    fmu.ok(fmu.fmi2EnterInitializationMode());
    fmu.set(&[FORCE], &[force(0.0)]);
    read_all_one_by_one(&fmu);
    fmu.ok(fmu.fmi2ExitInitializationMode());
    let mut state = null_mut();
    for i in 0..100 {
        let t = f64::from(i) * 0.01;
        fmu.ok(fmu.fmi2GetFMUstate(&mut state));
        let runs = [(); 2].map(|()| {
            fmu.ok(fmu.fmi2SetFMUstate(state));
            fmu.set(&[FORCE], &[force(t)]);
            fmu.set_rates([FORCE], [slope(t)]);
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
    let arguments = Arguments { guid: Some(c"{stale}".into()), ..Arguments::of::<Oscillator>(CoSimulation) };
    assert!(Importer::instantiate(fmu_export::fmi2::functions::<Oscillator>(), &arguments).is_err());
    for (function, status) in Importer::null(fmu_export::fmi2::functions::<Oscillator>()).call_all() {
        assert_eq!(status, Status::Error, "{function}");
    }
}

/// Variables before SetupExperiment, time in whole nanoseconds, instances stepped side by side, each time by another
/// thread.
#[test]
fn libcosim() {
    const STEP: i64 = 16_666_667;
    const SLAVES: usize = 6;
    let start = |number: usize| {
        let fmu = Importer::of::<Oscillator>(CoSimulation);
        fmu.set(&[FORCE, Name::stiffness as u32], &[0.1 * number as f64, 100.0 + number as f64]);
        fmu.ok(fmu.fmi2SetupExperiment(0, 0.0, 0.0, 0, 0.0));
        fmu.ok(fmu.fmi2EnterInitializationMode());
        fmu.ok(fmu.fmi2ExitInitializationMode());
        fmu
    };
    let step = |fmu: &Importer, i: i64| {
        let time = (i * STEP) as f64 * 1e-9;
        fmu.set(&[FORCE], &[force(time)]);
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
        let expected = (0..120).fold([f64::NAN; 3], |_, i| step(&alone, i));
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
    let fmu = Importer::of::<Oscillator>(CoSimulation);
    fmu.ok(fmu.fmi2SetupExperiment(0, 0.0, 0.0, 1, 0.1));
    fmu.set(&[Name::stiffness as u32, POSITION], &[110.0, 0.05]);
    fmu.ok(fmu.fmi2EnterInitializationMode());
    fmu.set(&[FORCE], &[force(0.0)]);
    fmu.set_rates([FORCE], [slope(0.0)]);
    fmu.ok(fmu.fmi2ExitInitializationMode());
    assert!(fmu.get(OUTPUTS)[1] != 0.0, "the springs feel the start value");
    let mut time = 0.0;
    while time < 0.1 - 1e-9 {
        fmu.set(&[FORCE], &[force(time)]);
        fmu.set_rates([FORCE], [slope(time)]);
        fmu.step(time, 0.01);
        time += 0.01;
        fmu.get(OUTPUTS);
    }
    fmu.ok(fmu.fmi2Terminate());
}

/// Maestro (INTO-CPS) asks for the derivative of an output by the value reference of the derivative variable; PyFMI
/// extrapolates inputs with orders 1 and 2, asks for those that the description has, and raises on anything but `fmi2OK`.
#[test]
fn maestro_and_pyfmi() {
    let fmu = in_mode::<Oscillator>(CoSimulation, StepComplete);
    for i in 0..20 {
        let t = f64::from(i) * 0.01;
        fmu.set(&[FORCE], &[force(t)]);
        for (order, given) in [(1, slope(t)), (2, -9.0 * force(t))] {
            fmu.ok(fmu.fmi2SetRealInputDerivatives(&FORCE, 1, &order, &given));
        }
        fmu.step(t, 0.01);
        let by_derivative = [Name::der_position as u32, Name::der_velocity as u32, Name::energy as u32];
        let rates = [fmu.rates(by_derivative), fmu.rates(OUTPUTS)];
        assert!(rates.as_flattened().iter().all(|rate| rate.is_finite()));
    }
}

/// FMIKit (Simulink) sets no input before the end of the initialization, reads before it sets, and has communication
/// points that are off by 3e-12; its fast restart begins again with a reset.
#[test]
fn fmikit() {
    let fmu = Importer::of::<Oscillator>(CoSimulation);
    let run = || {
        fmu.ok(fmu.fmi2SetupExperiment(0, 0.0, 0.0, 1, 1.0));
        fmu.ok(fmu.fmi2EnterInitializationMode());
        fmu.ok(fmu.fmi2ExitInitializationMode());
        assert_eq!(fmu.get(OUTPUTS), [0.0; 3]);
        for i in 0..1000 {
            let t = f64::from(i) * 1e-3 + if i % 2 == 1 { 3e-12 } else { 0.0 };
            fmu.get(OUTPUTS);
            fmu.set(&[FORCE], &[force(t)]);
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

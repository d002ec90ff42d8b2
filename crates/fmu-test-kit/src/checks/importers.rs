//! Call sequences of real importers, including unusual ones, taken from their sources or traces. Every status
//! must be `fmi2OK` unless a comment states otherwise.

use super::*;
use crate::{Arguments, Importer};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::Status;
use std::ptr::null_mut;

fn set_inputs<M: Exported>(fmu: &Importer, t: f64) {
    fmu.set(&inputs::<M>(), &signals::<M>(t));
}

fn set_inputs_and_rates<M: Exported>(fmu: &Importer, t: f64) {
    set_inputs::<M>(fmu, t);
    fmu.give_rates(&inputs::<M>(), &slopes::<M>(t));
}

fn initialize(fmu: &Importer, stop_time: Option<f64>) {
    let (defined, stop_time) = (stop_time.is_some().into(), stop_time.unwrap_or(0.0));
    fmu.ok(fmu.fmi2SetupExperiment(0, 0.0, 0.0, defined, stop_time));
    fmu.ok(fmu.fmi2EnterInitializationMode());
}

/// OpenModelica: only Model Exchange. Sets fixed parameters after the initialization and states in Event
/// Mode; reads all outputs and locals in one call at the end of a step.
pub fn openmodelica<M: Exported>() {
    let fmu = Importer::with::<M>(&Arguments {
        logging_on: 1,
        resource_location: Some(c"file:///tmp/not/there/resources"),
        ..Arguments::of::<M>(ModelExchange)
    });
    set_inputs::<M>(&fmu, 0.0);
    initialize(&fmu, Some(1.0));
    fmu.ok(fmu.fmi2ExitInitializationMode());
    change_parameters::<M>(&fmu, 0);
    let states = M::STATES.len();
    let (mut x, mut rates) = (vec![f64::NAN; states], vec![f64::NAN; states]);
    fmu.ok(fmu.fmi2GetContinuousStates(x.as_mut_ptr(), states));
    fmu.ok(fmu.fmi2SetContinuousStates(x.as_ptr(), states)); // still in Event Mode
    fmu.enter_continuous_time();
    let mut values = Vec::new();
    for i in 0..200 {
        let t = f64::from(i) * 1e-3;
        fmu.ok(fmu.fmi2SetTime(t));
        set_inputs::<M>(&fmu, t);
        fmu.ok(fmu.fmi2SetContinuousStates(x.as_ptr(), states));
        fmu.ok(fmu.fmi2GetDerivatives(rates.as_mut_ptr(), states));
        fmu.completed_step();
        values = fmu.read(&moving::<M>());
        x.iter_mut().zip(&rates).for_each(|(x, rate)| *x += 1e-3 * rate);
    }
    assert!(values.iter().all(|value| value.is_finite()) && values.iter().any(|value| *value != 0.0));
    fmu.ok(fmu.fmi2Terminate());
}

/// Reads all variables one by one, as OMSimulator does at every step.
fn read_all_one_by_one<M: Exported>(fmu: &Importer) -> Vec<f64> {
    let read = |(vr, variable): (u32, &Variable<M>)| {
        let (mut real, mut integer) = (f64::NAN, -1);
        match variable.base() {
            BaseType::Real => fmu.ok(fmu.fmi2GetReal(&vr, 1, &mut real)),
            BaseType::Integer => fmu.ok(fmu.fmi2GetInteger(&vr, 1, &mut integer)),
            _ => fmu.ok(fmu.fmi2GetBoolean(&vr, 1, &mut integer)),
        }
        if real.is_nan() { f64::from(integer) } else { real }
    };
    (0..).zip(M::TABLE).map(read).collect()
}

/// OMSimulator with input extrapolation: passes derivatives of the declared order between slaves. Performs
/// every step twice from a saved state, in a handle that is reused.
pub fn omsimulator<M: Exported>() {
    let fmu = Importer::with::<M>(&Arguments {
        visible: true,
        logging_on: 1,
        environment: false,
        resource_location: Some(c"file:////tmp/oms-123/temp/0001_wrist/resources"),
        ..Arguments::of::<M>(CoSimulation)
    });
    fmu.ok(fmu.fmi2SetupExperiment(1, 1e-4, 0.0, 0, 0.0));
    fmu.ok(fmu.fmi2EnterInitializationMode());
    let set_one_by_one = |t: f64| {
        for (place, value) in inputs::<M>().into_iter().zip(signals::<M>(t)) {
            fmu.set(&[place], &[value]);
        }
    };
    set_one_by_one(0.0);
    read_all_one_by_one::<M>(&fmu);
    fmu.ok(fmu.fmi2ExitInitializationMode());
    let mut state = null_mut();
    for i in 0..100 {
        let t = f64::from(i) * 0.01;
        fmu.ok(fmu.fmi2GetFMUstate(&mut state));
        let runs = [(); 2].map(|()| {
            fmu.ok(fmu.fmi2SetFMUstate(state));
            set_one_by_one(t);
            for (place, slope) in inputs::<M>().into_iter().zip(slopes::<M>(t)) {
                fmu.give_rates(&[place], &[slope]);
            }
            fmu.step(t, 0.01);
            assert!(outputs::<M>().into_iter().all(|place| fmu.rate(place).is_finite()));
            read_all_one_by_one::<M>(&fmu)
        });
        assert_eq!(runs[0], runs[1], "step {i}");
    }
    fmu.forget(state);
    fmu.ok(fmu.fmi2Terminate());
}

/// OMSimulator ignores a NULL from fmi2Instantiate and makes further calls, which must return errors.
pub fn omsimulator_without_instance<F: Either, M: Exported>() {
    let arguments = Arguments { guid: Some(c"{stale}".into()), ..Arguments::of::<M>(CoSimulation) };
    assert!(F::make::<M>(&arguments).is_err());
    for (function, status) in F::nothing::<M>().call_all() {
        assert_eq!(status, Status::Error, "{function}");
    }
}

/// libcosim: sets variables before fmi2SetupExperiment, counts time in integer nanoseconds, and steps
/// instances in parallel, each step in another thread.
pub fn libcosim<M: Exported>() {
    const STEP: i64 = 16_666_667;
    const SLAVES: usize = 6;
    let start = |number: usize| {
        let fmu = Importer::of::<M>(CoSimulation);
        set_inputs::<M>(&fmu, number as f64);
        let parameter = M::TABLE.iter().zip(0..).find_map(|(of, place)| Some((place, start_of(of)?)));
        let (place, value) = parameter.expect("a parameter");
        fmu.set(&[place], &[value * (1.0 + 0.01 * number as f64)]);
        initialize(&fmu, None);
        fmu.ok(fmu.fmi2ExitInitializationMode());
        fmu
    };
    let step = |fmu: &Importer, i: i64| {
        let time = (i * STEP) as f64 * 1e-9;
        set_inputs::<M>(fmu, time);
        fmu.step(time, STEP as f64 * 1e-9);
        fmu.read(&outputs::<M>())
    };
    let mut slaves: Vec<_> = (0..SLAVES).map(start).collect();
    let mut last = Vec::new();
    for i in 0..120 {
        last = std::thread::scope(|scope| {
            let step = &step;
            let threads: Vec<_> = slaves.iter_mut().map(|fmu| scope.spawn(move || step(fmu, i))).collect();
            threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
        });
    }
    for (number, last) in (0..SLAVES).zip(last) {
        let alone = start(number);
        let expected = (0..120).fold(Vec::new(), |_, i| step(&alone, i));
        assert_eq!(last, expected, "slave {number}");
    }
    // The destructor calls terminate after any error. It prints the log category, which must not be NULL.
    let broken = slaves.pop().expect("a slave");
    assert_eq!(broken.try_step(0.0, f64::NAN), Status::Error);
    assert!(broken.take_log().iter().all(|message| !message.category.is_empty()));
    broken.ok(broken.fmi2Terminate());
}

/// FMPy with set_input_derivatives: sets derivatives in Initialization Mode, reads outputs right after it.
pub fn fmpy<M: Exported>() {
    let fmu = Importer::of::<M>(CoSimulation);
    change_parameters::<M>(&fmu, 1);
    initialize(&fmu, Some(0.1));
    set_inputs_and_rates::<M>(&fmu, 0.0);
    fmu.ok(fmu.fmi2ExitInitializationMode());
    fmu.read(&outputs::<M>());
    let mut time = 0.0;
    while time < 0.1 - 1e-9 {
        set_inputs_and_rates::<M>(&fmu, time);
        fmu.step(time, 0.01);
        time += 0.01;
        assert!(fmu.read(&outputs::<M>()).iter().any(|value| *value != 0.0));
    }
    fmu.ok(fmu.fmi2Terminate());
}

/// Maestro (INTO-CPS) requests the derivative of an output by the value reference of the derivative variable.
/// PyFMI extrapolates inputs with orders 1 and 2 and requests output derivatives of the orders in the
/// description. PyFMI raises an exception for any status but `fmi2OK`.
pub fn maestro_and_pyfmi<M: Exported>() {
    let fmu = Importer::in_mode::<M>(CoSimulation, StepComplete);
    let inputs = inputs::<M>();
    for i in 0..20 {
        let t = f64::from(i) * 0.01;
        set_inputs_and_rates::<M>(&fmu, t);
        let (orders, second) = (vec![2; inputs.len()], signals::<M>(t));
        let (vr, orders, second) = (inputs.as_ptr(), orders.as_ptr(), second.as_ptr());
        fmu.ok(fmu.fmi2SetRealInputDerivatives(vr, inputs.len(), orders, second));
        fmu.step(t, 0.01);
        assert!(moving::<M>().into_iter().all(|place| fmu.rate(place).is_finite()));
    }
}

/// FMIKit (Simulink) sets no input before the end of the initialization and reads before it sets. Its
/// communication points are off by 3e-12, and its fast restart begins with a reset.
pub fn fmikit<M: Exported>() {
    let fmu = Importer::of::<M>(CoSimulation);
    let run = || {
        initialize(&fmu, Some(1.0));
        fmu.ok(fmu.fmi2ExitInitializationMode());
        assert!(fmu.read(&outputs::<M>()).iter().all(|value| *value == 0.0));
        for i in 0..1000 {
            let t = f64::from(i) * 1e-3 + if i % 2 == 1 { 3e-12 } else { 0.0 };
            fmu.read(&outputs::<M>());
            set_inputs::<M>(&fmu, t);
            fmu.step(t, 1e-3);
        }
        let end = fmu.read(&outputs::<M>());
        fmu.ok(fmu.fmi2Terminate());
        assert_eq!(fmu.read(&outputs::<M>()), end, "readable after the end");
        fmu.ok(fmu.fmi2Reset());
        end
    };
    assert_eq!(run(), run());
}

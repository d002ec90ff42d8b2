//! Calls in the log callback, uninitialized memory, and instances freed in any order. `make sanitize` runs these tests with
//! Valgrind and Miri, which detect more than the assertions.
#![allow(missing_docs)]

use fmu_test_kit::models;
#[allow(dead_code, reason = "only the tests of the call table let arrays overlap")]
#[path = "boundary/valid_calls.rs"]
mod valid_calls;

use fmu_export::Exported;
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::Status;
use fmu_test_kit::{Arguments, Either, Importer, fmi3};
use models::{Ball, Counter, Oscillator, Palette, Talker, talker};
use std::ptr::null_mut;
use std::sync::{Arc, Mutex};
use valid_calls::ValidCall;

/// Checks a log callback that calls all functions that take an instance. It receives messages about events, about a rejected
/// call and from the model. Each call in the callback must return an error, and the call that logs must then continue.
fn log_callback_calls_back<F: Either + 'static>(free: unsafe fn(&F)) {
    let arguments = Arguments { logging_on: 1, ..Arguments::new::<Talker>(CoSimulation) };
    let fmu = Box::new(F::make::<Talker>(&arguments).unwrap());
    let other = F::make::<Talker>(&arguments).unwrap();
    let results = Arc::new(Mutex::new(Vec::new()));
    let (address, in_hook) = ((&raw const *fmu).expose_provenance(), results.clone());
    fmu.on_message(Box::new(move || {
        // SAFETY: the instance lives until the end of this test.
        let fmu = unsafe { &*std::ptr::with_exposed_provenance::<F>(address) };
        let (mut state, mut value, mut calls) = (null_mut(), [0.0], fmu.call_all());
        calls.extend([("GetFMUState", fmu.get_state(&mut state)), ("Get", fmu.try_get(&[0], &mut value))]);
        assert!(state.is_null());
        // SAFETY: the FMU ignores the call, because it is delivering a message.
        unsafe { free(fmu) };
        other.initialize(0.0);
        other.ok(other.reset());
        in_hook.lock().unwrap().push(calls);
    }));
    fmu.take_log();
    fmu.initialize(0.0);
    fmu.write_string(talker::Name::heard as u32, "Ping");
    fmu.step(0.0, 1.0);
    fmu.set(&[talker::Name::volume as u32], &[10.5]);
    assert_eq!(fmu.try_set(&[99], &[0.0]), Status::Error);
    fmu.ok(fmu.terminate());
    fmu.ok(fmu.reset());
    let results = std::mem::take(&mut *results.lock().unwrap());
    assert_eq!((results.len(), fmu.take_log().len()), (6, 6));
    for (function, status) in results.into_iter().flatten() {
        assert_eq!(status, Status::Error, "{function}");
    }
    fmu.initialize(0.0);
    // The callback must not run while `drop` frees the instance.
    fmu.on_message(Box::new(|| ()));
}

#[test]
fn the_log_callback_calls_back() {
    // SAFETY: the test calls these functions only in the callback.
    log_callback_calls_back::<Importer>(|fmu| unsafe { fmu.free() });
    // SAFETY: the test calls these functions only in the callback.
    log_callback_calls_back::<fmi3::Importer>(|fmu| unsafe { fmu.free() });
}

/// Checks that no function reads an uninitialized output array, and that each function writes all its values.
#[test]
fn memory_that_was_never_written() {
    fn check<F: Either, M: Exported>() {
        let mut read = 0;
        for (interface, mode) in
            [(CoSimulation, StepComplete), (ModelExchange, Event), (ModelExchange, ContinuousTime)]
        {
            for function in F::functions() {
                let fmu = F::in_mode::<M>(interface, mode);
                let call = ValidCall::new::<F, M>(&fmu, function, mode);
                if call.make(&fmu, |_| ()) == Status::Ok {
                    read += call.read_outputs();
                }
            }
        }
        assert!(read > 200, "only {read} values");
    }
    check::<Importer, Oscillator>();
    check::<Importer, Ball>();
    check::<Importer, Talker>();
    check::<fmi3::Importer, Oscillator>();
    check::<fmi3::Importer, Ball>();
    check::<fmi3::Importer, Palette>();
}

/// Frees one instance before its saved state, and another one after one of its two saved states.
#[test]
fn freed_in_any_order() {
    fn check<F: Either, M: Exported>() {
        let [one, other] = [(); 2].map(|()| F::initialized_at::<M>(0.0));
        let (first, second) = (one.save(), other.save());
        one.ok(one.set_state(first));
        drop(one);
        other.ok(other.set_state(second));
        other.forget(second);
        other.save();
        other.step(0.0, 0.1);
    }
    fn check_both<M: Exported>() {
        check::<Importer, M>();
        check::<fmi3::Importer, M>();
    }
    check_both::<Talker>();
    check_both::<Oscillator>();
    check_both::<Counter>();
}

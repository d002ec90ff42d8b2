//! Calls in the log callback, and memory that was never written. Valgrind and Miri detect more than the
//! assertions (`make sanitize`).
#![allow(missing_docs)]

mod models;

use fmu_export::Exported;
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::fmi2::types::{fmi2EventInfo, fmi2String};
use fmu_export::fmi3::{indicator, reference, types::*};
use fmu_test_kit::{Arguments, Either, Importer, fmi3};
use models::{Ball, Counter, Oscillator, Palette, Talker, oscillator::Name, palette, talker};
use std::mem::MaybeUninit;
use std::ptr::null_mut;
use std::sync::{Arc, Mutex};

/// A log callback that makes all calls for every message: of rejected calls, of discarded queries, of events,
/// of the model. Each call returns an error, and the interrupted call continues.
fn log_callback_calls_back<F: Either + 'static>(free: unsafe fn(&F)) {
    let arguments = Arguments { logging_on: 1, ..Arguments::of::<Talker>(CoSimulation) };
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
        // SAFETY: ignored, because the FMU is delivering a message.
        unsafe { free(fmu) };
        other.initialize(0.0);
        other.ok(other.reset());
        in_hook.lock().unwrap().push(calls);
    }));
    fmu.take_log();
    fmu.initialize(0.0);
    fmu.say(talker::Name::heard as u32, "Ping");
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

/// Returns an array as an importer in C has it on its stack.
fn unwritten<T, const N: usize>() -> [MaybeUninit<T>; N] {
    [const { MaybeUninit::uninit() }; N]
}

/// Returns the elements of an array that the FMU has written.
fn written<T: Copy, const N: usize>(values: [MaybeUninit<T>; N]) -> [T; N] {
    // SAFETY: the FMU returned OK, so all elements are written; valgrind and Miri detect the opposite.
    values.map(|value| unsafe { value.assume_init() })
}

/// Checks that the call writes these values.
#[track_caller]
fn writes<T: Copy + PartialEq + std::fmt::Debug, const N: usize>(
    fmu: &dyn Either,
    expected: [T; N],
    call: impl FnOnce(*mut T) -> Status,
) {
    let mut values = unwritten::<T, N>();
    fmu.ok(call(values.as_mut_ptr().cast()));
    assert_eq!(written(values), expected);
}

/// Checks functions with equal arguments in both FMI versions.
fn unwritten_memory<F: Either>() {
    let fmu: F = F::initialized_at::<Oscillator>(0.0);
    let (state, mut size) = (fmu.save(), unwritten());
    fmu.ok(fmu.state_size(state, size.as_mut_ptr().cast()));
    let [size] = written::<usize, 1>(size);
    let mut bytes = Box::<[u8]>::new_uninit_slice(size);
    fmu.ok(fmu.serialize_into(state, bytes.as_mut_ptr().cast(), size));
    // SAFETY: as above.
    fmu.restore(&unsafe { bytes.assume_init() });
    fmu.forget(state);

    let fmu: F = F::in_mode::<Ball>(ModelExchange, fmu_export::Mode::ContinuousTime);
    writes(&fmu, [1.0, 0.0], |x| fmu.get_states(x, 2));
    writes(&fmu, [0.0, -9.81], |rates| fmu.get_derivatives(rates, 2));
    writes(&fmu, [1.0, 1.0], |nominals| fmu.get_nominals(nominals, 2));
    writes(&fmu, [1.0], |indicator| fmu.get_indicators(indicator, 1));
}

#[test]
fn memory_that_was_never_written() {
    unwritten_memory::<Importer>();
    unwritten_memory::<fmi3::Importer>();
}

#[test]
fn memory_that_was_never_written_in_fmi2() {
    let fmu = &Importer::initialized_at::<Oscillator>(0.0);
    let vr = [Name::position as u32, Name::mass as u32];
    let (unknown, known) = (Name::der_velocity as u32, Name::force as u32);
    writes(fmu, [0.0, 2.0], |two| fmu.fmi2GetReal(vr.as_ptr(), 2, two));
    writes(fmu, [1], |one| fmu.fmi2GetInteger(&(Name::springs as u32), 1, one));
    writes(fmu, [1], |one| fmu.fmi2GetBoolean(&(Name::damped as u32), 1, one));
    writes(fmu, [0.0; 2], |two| fmu.fmi2GetRealOutputDerivatives(vr.as_ptr(), 2, [1, 1].as_ptr(), two));
    writes(fmu, [0.5], |one| fmu.fmi2GetDirectionalDerivative(&unknown, 1, &known, 1, &1.0, one));
    writes(fmu, [0.0], |time| fmu.fmi2GetRealStatus(2, time));
    writes(fmu, [0], |terminated| fmu.fmi2GetBooleanStatus(3, terminated));
    // A query without a result writes nothing.
    let mut nothing = unwritten::<f64, 1>();
    assert_eq!(fmu.fmi2GetRealStatus(3, nothing.as_mut_ptr().cast()), Status::Discard);

    let talker = Importer::initialized_at::<Talker>(0.0);
    let mut texts = unwritten::<fmi2String, 2>();
    let vr = [talker::Name::who as u32, talker::Name::said as u32];
    talker.ok(talker.fmi2GetString(vr.as_ptr(), 2, texts.as_mut_ptr().cast()));
    assert!(written(texts).iter().all(|text| !text.is_null()));

    let fmu = &Importer::of::<Ball>(ModelExchange);
    fmu.initialize(0.0);
    writes(fmu, [fmi2EventInfo::default()], |info| fmu.fmi2NewDiscreteStates(info));
    fmu.ok(fmu.fmi2EnterContinuousTimeMode());
    writes(fmu, [0; 2], |flags| fmu.fmi2CompletedIntegratorStep(1, flags, flags.wrapping_add(1)));
}

#[test]
fn memory_that_was_never_written_in_fmi3() {
    let fmu = &fmi3::Importer::initialized_at::<Palette>(0.0);
    macro_rules! read {
        ($($get:ident $name:ident $expected:expr;)+) => { $(
            writes(fmu, [$expected], |value| fmu.$get(&reference(palette::Name::$name as u32), 1, value, 1));
        )+ };
    }
    read! {
        fmi3GetFloat64 float64 0.0_f64;
        fmi3GetFloat32 float32 0.0_f32;
        fmi3GetInt8 int8 0_i8;
        fmi3GetUInt8 uint8 0_u8;
        fmi3GetInt16 int16 0_i16;
        fmi3GetUInt16 uint16 8080_u16;
        fmi3GetInt32 int32 0_i32;
        fmi3GetUInt32 uint32 0_u32;
        fmi3GetInt64 int64 0_i64;
        fmi3GetInt64 colour 5_i64;
        fmi3GetUInt64 uint64 0_u64;
        fmi3GetBoolean boolean fmi3False;
    }
    let mut bytes = unwritten::<fmi3Binary, 1>();
    let (binary, to_bytes) = (reference(palette::Name::binary as u32), bytes.as_mut_ptr().cast());
    writes(fmu, [0], |size| fmu.fmi3GetBinary(&binary, 1, size, to_bytes, 1));
    written(bytes);
    let mut text = unwritten::<fmi3String, 1>();
    fmu.ok(fmu.fmi3GetString(&reference(palette::Name::string as u32), 1, text.as_mut_ptr().cast(), 1));
    assert!(!written(text)[0].is_null());

    let fmu = &fmi3::Importer::initialized_at::<Oscillator>(0.0);
    let mut time = unwritten::<f64, 1>();
    let end = time.as_mut_ptr().cast();
    writes(fmu, [fmi3False; 3], |flags| {
        let [terminate, early] = [1, 2].map(|index| flags.wrapping_add(index));
        fmu.fmi3DoStep(0.0, 0.5, fmi3True, flags, terminate, early, end)
    });
    assert_eq!(written(time), [0.5]);
    let position = reference(Name::position as u32);
    writes(fmu, [0.0], |one| fmu.fmi3GetOutputDerivatives(&position, 1, &1, one, 1));
    let (unknown, known) = (reference(Name::der_velocity as u32), reference(Name::force as u32));
    for derivative in [fmi3::Importer::fmi3GetDirectionalDerivative, fmi3::Importer::fmi3GetAdjointDerivative]
    {
        writes(fmu, [0.5], |one| derivative(fmu, &unknown, 1, &known, 1, &1.0, 1, one, 1));
    }

    let fmu = &fmi3::Importer::of::<Ball>(ModelExchange);
    fmu.initialize(0.0);
    let mut next = unwritten::<f64, 1>();
    let next_time = next.as_mut_ptr().cast();
    writes(fmu, [fmi3False; 5], |flags| {
        let [terminate, nominals, states, defined] = [1, 2, 3, 4].map(|index| flags.wrapping_add(index));
        fmu.fmi3UpdateDiscreteStates(flags, terminate, nominals, states, defined, next_time)
    });
    assert_eq!(written(next), [0.0]);
    writes(fmu, [2], |states| fmu.fmi3GetNumberOfContinuousStates(states));
    writes(fmu, [1], |indicators| fmu.fmi3GetNumberOfEventIndicators(indicators));
    fmu.ok(fmu.fmi3EnterContinuousTimeMode());
    // The variable of the event indicator.
    writes(fmu, [1.0], |one| fmu.fmi3GetFloat64(&reference(indicator::<Ball>(0)), 1, one, 1));
    writes(fmu, [fmi3False; 2], |flags| {
        fmu.fmi3CompletedIntegratorStep(fmi3True, flags, flags.wrapping_add(1))
    });
}

/// Frees instances and saved states of models with memory on the heap in any order.
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

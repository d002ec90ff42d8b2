//! The same in FMI 3.0.

use crate::models::{Ball, Oscillator, Palette, Talker, oscillator::Name, palette, talker};
use crate::{serialized_into_memory_that_was_never_written, unwritten, writes, written};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Model;
use fmu_export::fmi3::{indicator, reference, types::*};
use fmu_test_kit::Either;
use fmu_test_kit::fmi3::Importer;
use std::cell::{Cell, RefCell};
use std::ffi::CString;
use std::ptr::{null, null_mut};

/// What the log callback works with.
struct Environment {
    functions: fmu_export::fmi3::Functions,
    instance: Cell<fmi3Instance>,
    /// Another instance, which the callback may use.
    other: Importer,
    answers: RefCell<Vec<(&'static str, Status)>>,
    messages: Cell<usize>,
}

/// Calls every function of the instance that is logging, and frees it.
unsafe extern "C" fn call_back(
    environment: fmi3InstanceEnvironment,
    _: fmi3Status,
    _: fmi3String,
    _: fmi3String,
) {
    // SAFETY: the environment that was handed over with the callback, alive until the instance is freed.
    let environment = unsafe { &*environment.cast::<Environment>() };
    environment.messages.set(environment.messages.get() + 1);
    // SAFETY: NULL while it is made, then the instance, which is alive.
    let instance = unsafe { Importer::borrowed(environment.functions, environment.instance.get()) };
    environment.answers.borrow_mut().extend(instance.call_all());
    // SAFETY: not freed: the call is ignored.
    unsafe { (environment.functions.fmi3FreeInstance)(environment.instance.get()) };
    assert_eq!(environment.other.fmi3SetDebugLogging(0, 0, null()), Status::Ok, "others can be used");
}

/// A logger that calls back, on the way of every message. All it gets is fmi3Error, and nothing for freeing.
#[test]
fn the_log_callback_calls_back() {
    let functions = fmu_export::fmi3::functions::<Talker>();
    let environment = Box::new(Environment {
        functions,
        instance: Cell::new(null_mut()),
        other: Importer::of::<Talker>(CoSimulation),
        answers: RefCell::default(),
        messages: Cell::new(0),
    });
    let token = CString::new(Talker::INFO.guid).unwrap();
    // SAFETY: strings, an environment and a callback that live until the end of this test.
    let instance = unsafe {
        (functions.fmi3InstantiateCoSimulation)(
            c"talker".as_ptr(),
            token.as_ptr(),
            null(),
            fmi3False,
            fmi3True,
            fmi3False,
            fmi3False,
            null(),
            0,
            (&raw const *environment).cast_mut().cast(),
            Some(call_back),
            None,
        )
    };
    assert_eq!(environment.messages.replace(0), 1, "while it is made there is nothing to call back");
    environment.answers.take();
    environment.instance.set(instance);
    // SAFETY: alive until it is freed below.
    let fmu = unsafe { Importer::borrowed(functions, instance) };

    fmu.initialize(0.0);
    let text = c"Ping".as_ptr();
    fmu.ok(fmu.fmi3SetString(&reference(talker::Name::heard as u32), 1, &text, 1));
    fmu.step(0.0, 1.0);
    fmu.set(&[talker::Name::volume as u32], &[10.5]);
    assert_eq!(fmu.try_set(&[99], &[0.0]), Status::Error);
    fmu.ok(fmu.fmi3Terminate());
    fmu.ok(fmu.fmi3Reset());
    assert_eq!(environment.messages.get(), 6);
    let answers = environment.answers.take();
    assert_eq!(answers.len(), 6 * 70);
    for (function, status) in answers {
        assert_eq!(status, Status::Error, "{function}");
    }
    fmu.initialize(0.0);
    // SAFETY: the only time that this is not ignored.
    unsafe { (functions.fmi3FreeInstance)(instance) };
}

/// Values of every type, into memory that was never written.
#[test]
fn values_into_memory_that_was_never_written() {
    let fmu = &Importer::initialized_at::<Palette>(0.0);
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

    let talker = Importer::initialized_at::<Talker>(0.0);
    let mut texts = unwritten::<fmi3String, 2>();
    let vr = [reference(talker::Name::who as u32), reference(talker::Name::said as u32)];
    talker.ok(talker.fmi3GetString(vr.as_ptr(), 2, texts.as_mut_ptr().cast(), 2));
    assert!(written(texts).iter().all(|text| !text.is_null()));
}

/// Steps, derivatives, dependencies, sizes and states.
#[test]
fn memory_that_was_never_written() {
    let fmu = &Importer::initialized_at::<Oscillator>(0.0);
    let mut time = unwritten::<f64, 1>();
    let end = time.as_mut_ptr().cast();
    writes(fmu, [fmi3False; 3], |flags| {
        let [terminate, early] = [1, 2].map(|place| flags.wrapping_add(place));
        fmu.fmi3DoStep(0.0, 0.5, fmi3True, flags, terminate, early, end)
    });
    assert_eq!(written(time), [0.5]);
    let position = reference(Name::position as u32);
    writes(fmu, [0.0], |one| fmu.fmi3GetOutputDerivatives(&position, 1, &1, one, 1));
    let (unknown, known) = (reference(Name::der_velocity as u32), reference(Name::force as u32));
    for derivative in [Importer::fmi3GetDirectionalDerivative, Importer::fmi3GetAdjointDerivative] {
        writes(fmu, [0.5], |one| derivative(fmu, &unknown, 1, &known, 1, &1.0, 1, one, 1));
    }
    serialized_into_memory_that_was_never_written(fmu);
}

#[test]
fn memory_that_was_never_written_in_model_exchange() {
    let fmu = &Importer::of::<Ball>(ModelExchange);
    fmu.initialize(0.0);
    let mut next = unwritten::<f64, 1>();
    let next_time = next.as_mut_ptr().cast();
    writes(fmu, [fmi3False; 5], |flags| {
        let [terminate, nominals, states, defined] = [1, 2, 3, 4].map(|place| flags.wrapping_add(place));
        fmu.fmi3UpdateDiscreteStates(flags, terminate, nominals, states, defined, next_time)
    });
    assert_eq!(written(next), [0.0]);
    writes(fmu, [2], |states| fmu.fmi3GetNumberOfContinuousStates(states));
    writes(fmu, [1], |indicators| fmu.fmi3GetNumberOfEventIndicators(indicators));
    fmu.ok(fmu.fmi3EnterContinuousTimeMode());
    writes(fmu, [1.0, 0.0], |x| fmu.fmi3GetContinuousStates(x, 2));
    writes(fmu, [0.0, -9.81], |rates| fmu.fmi3GetContinuousStateDerivatives(rates, 2));
    writes(fmu, [1.0, 1.0], |nominals| fmu.fmi3GetNominalsOfContinuousStates(nominals, 2));
    writes(fmu, [1.0], |indicators| fmu.fmi3GetEventIndicators(indicators, 1));
    // Once more as the variable that stands for it.
    writes(fmu, [1.0], |one| fmu.fmi3GetFloat64(&reference(indicator::<Ball>(0)), 1, one, 1));
    writes(fmu, [fmi3False; 2], |flags| {
        fmu.fmi3CompletedIntegratorStep(fmi3True, flags, flags.wrapping_add(1))
    });
}

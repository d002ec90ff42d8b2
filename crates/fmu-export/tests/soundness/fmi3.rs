//! The same in FMI 3.0.

use crate::toys::{Ball, Oscillator, Palette, Talker, oscillator::Name, palette, talker};
use crate::{unwritten, written};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Model;
use fmu_export::fmi3::{indicator, reference, types::*};
use fmu_test_kit::fmi3::Importer;
use std::cell::{Cell, RefCell};
use std::ffi::CString;
use std::mem::MaybeUninit;
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

/// What the FMU is told.
fn start<T, const N: usize>(values: &mut [MaybeUninit<T>; N]) -> *mut T {
    values.as_mut_ptr().cast()
}

/// Values of every type, into memory that was never written.
#[test]
fn values_into_memory_that_was_never_written() {
    let fmu = Importer::of::<Palette>(CoSimulation);
    fmu.initialize(0.0);
    macro_rules! read {
        ($($get:ident $name:ident $expected:expr;)+) => {
            $(
                let mut value = unwritten();
                fmu.ok(fmu.$get(&reference(palette::Name::$name as u32), 1, start(&mut value), 1));
                assert_eq!(written(value), [$expected], stringify!($name));
            )+
        };
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
    let (mut size, mut bytes) = (unwritten(), unwritten::<fmi3Binary, 1>());
    let binary = reference(palette::Name::binary as u32);
    fmu.ok(fmu.fmi3GetBinary(&binary, 1, start(&mut size), start(&mut bytes), 1));
    assert_eq!(written(size), [0]);
    written(bytes);

    let talker = Importer::of::<Talker>(CoSimulation);
    talker.initialize(0.0);
    let mut texts = unwritten::<fmi3String, 2>();
    let vr = [reference(talker::Name::who as u32), reference(talker::Name::said as u32)];
    talker.ok(talker.fmi3GetString(vr.as_ptr(), 2, start(&mut texts), 2));
    assert!(written(texts).iter().all(|text| !text.is_null()));
}

/// Steps, derivatives, dependencies, sizes and states.
#[test]
fn memory_that_was_never_written() {
    let fmu = Importer::of::<Oscillator>(CoSimulation);
    fmu.initialize(0.0);
    let (mut flags, mut time) = (unwritten::<fmi3Boolean, 3>(), unwritten());
    let [event, terminate, early] = flags.each_mut().map(|flag| flag.as_mut_ptr());
    fmu.ok(fmu.fmi3DoStep(0.0, 0.5, fmi3True, event, terminate, early, start(&mut time)));
    assert_eq!((written(flags), written(time)), ([fmi3False; 3], [0.5]));
    let mut one = unwritten();
    fmu.ok(fmu.fmi3GetOutputDerivatives(&reference(Name::position as u32), 1, &1, start(&mut one), 1));
    assert_eq!(written(one), [0.0]);
    let (unknown, known) = (reference(Name::der_velocity as u32), reference(Name::force as u32));
    for derivative in [Importer::fmi3GetDirectionalDerivative, Importer::fmi3GetAdjointDerivative] {
        let mut one = unwritten();
        fmu.ok(derivative(&fmu, &unknown, 1, &known, 1, &1.0, 1, start(&mut one), 1));
        assert_eq!(written(one), [0.5]);
    }
    let (state, mut size) = (fmu.save(), unwritten());
    fmu.ok(fmu.fmi3SerializedFMUStateSize(state, start(&mut size)));
    let [size] = written(size);
    let mut bytes = Box::<[u8]>::new_uninit_slice(size);
    fmu.ok(fmu.fmi3SerializeFMUState(state, bytes.as_mut_ptr().cast(), size));
    // SAFETY: the FMU answered fmi3OK, so that all are written; valgrind sees if not.
    fmu.restore(&unsafe { bytes.assume_init() });
    fmu.forget(state);
}

#[test]
fn memory_that_was_never_written_in_model_exchange() {
    let fmu = Importer::of::<Ball>(ModelExchange);
    fmu.initialize(0.0);
    let (mut flags, mut next) = (unwritten::<fmi3Boolean, 5>(), unwritten());
    let [again, terminate, nominals, states, defined] = flags.each_mut().map(|flag| flag.as_mut_ptr());
    let next_time = start(&mut next);
    fmu.ok(fmu.fmi3UpdateDiscreteStates(again, terminate, nominals, states, defined, next_time));
    assert_eq!((written(flags), written(next)), ([fmi3False; 5], [0.0]));
    let (mut states, mut indicators) = (unwritten(), unwritten());
    fmu.ok(fmu.fmi3GetNumberOfContinuousStates(start(&mut states)));
    fmu.ok(fmu.fmi3GetNumberOfEventIndicators(start(&mut indicators)));
    assert_eq!((written(states), written(indicators)), ([2], [1]));
    fmu.ok(fmu.fmi3EnterContinuousTimeMode());
    type Get = fn(&Importer, *mut f64, usize) -> Status;
    let calls: [(Get, [f64; 2]); 3] = [
        (Importer::fmi3GetContinuousStates, [1.0, 0.0]),
        (Importer::fmi3GetContinuousStateDerivatives, [0.0, -9.81]),
        (Importer::fmi3GetNominalsOfContinuousStates, [1.0, 1.0]),
    ];
    for (get, expected) in calls {
        let mut values = unwritten();
        fmu.ok(get(&fmu, start(&mut values), 2));
        assert_eq!(written(values), expected);
    }
    let mut values = unwritten();
    fmu.ok(fmu.fmi3GetEventIndicators(start(&mut values), 1));
    // Once more as the variable that stands for it.
    fmu.ok(fmu.fmi3GetFloat64(&reference(indicator::<Ball>(0)), 1, start(&mut values).wrapping_add(1), 1));
    assert_eq!(written(values), [1.0, 1.0]);
    let (mut event, mut terminate) = (unwritten(), unwritten());
    fmu.ok(fmu.fmi3CompletedIntegratorStep(fmi3True, start(&mut event), start(&mut terminate)));
    assert_eq!((written(event), written(terminate)), ([fmi3False], [fmi3False]));
}

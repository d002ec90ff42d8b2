//! What importers do that a Rust library must survive: calling back out of the log callback, and handing over memory that
//! nobody has written yet. Valgrind sees more of it than the assertions; `make sanitize` lets it look.
#![allow(missing_docs)]
// Under Miri, the callback is variadic as in C.
#![cfg_attr(miri, feature(c_variadic))]

#[path = "../models/mod.rs"]
mod models;

mod fmi3;

use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::fmi2::types::*;
use fmu_export::{Exported, Model};
use fmu_test_kit::{Either, Importer};
use std::cell::{Cell, RefCell};
use std::ffi::CString;
use std::mem::MaybeUninit;
use std::ptr::{null, null_mut};
use models::{Ball, Counter, Oscillator, Talker, oscillator::Name, talker};

#[cfg(miri)]
type CallBack = fmi2CallbackLogger;
#[cfg(not(miri))]
type CallBack =
    unsafe extern "C" fn(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String);

/// What the log callback works with.
struct Environment {
    functions: fmu_export::fmi2::Functions,
    component: Cell<fmi2Component>,
    /// Another instance, which the callback may use.
    other: Importer,
    answers: RefCell<Vec<(&'static str, Status)>>,
    messages: Cell<usize>,
}

/// Calls every function of the instance that is logging, and frees it.
unsafe extern "C" fn call_back(
    environment: fmi2ComponentEnvironment,
    _: fmi2String,
    _: fmi2Status,
    _: fmi2String,
    _: fmi2String,
    #[cfg(miri)] _: ...
) {
    // SAFETY: the environment that was handed to fmi2Instantiate, alive until the instance is freed.
    let environment = unsafe { &*environment.cast::<Environment>() };
    environment.messages.set(environment.messages.get() + 1);
    let component = environment.component.get();
    // SAFETY: NULL while it is made, then the instance, which is alive.
    let instance = unsafe { Importer::borrowed(environment.functions, component) };
    environment.answers.borrow_mut().extend(instance.call_all());
    let mut state = null_mut();
    let answers = [
        ("fmi2GetFMUstate", instance.fmi2GetFMUstate(&mut state)),
        ("fmi2GetReal", instance.fmi2GetReal(&0, 1, &mut 0.0)),
        ("fmi2SetDebugLogging", instance.set_debug_logging(true, &[c"logAll"])),
    ];
    environment.answers.borrow_mut().extend(answers);
    assert!(state.is_null());
    // SAFETY: not freed: the call is ignored.
    unsafe { (environment.functions.fmi2FreeInstance)(component) };
    assert_eq!(environment.other.fmi2SetDebugLogging(0, 0, null()), Status::Ok, "others can be used");
}

/// A logger that calls back, on the way of every message: of refusals, of discarded questions, of events, of the model's
/// own. All it gets is fmi2Error, also for fmi2FreeInstance, which has no answer; the call goes on as if nothing was.
#[test]
fn the_log_callback_calls_back() {
    let functions = fmu_export::fmi2::functions::<Talker>();
    let environment = Box::new(Environment {
        functions,
        component: Cell::new(null_mut()),
        other: Importer::of::<Talker>(CoSimulation),
        answers: RefCell::default(),
        messages: Cell::new(0),
    });
    let callbacks = fmi2CallbackFunctions {
        // SAFETY: named arguments travel the same way in variadic and plain calls, see fmu_test_kit.
        logger: Some(unsafe { std::mem::transmute::<CallBack, fmi2CallbackLogger>(call_back as CallBack) }),
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: (&raw const *environment).cast_mut().cast(),
    };
    let guid = CString::new(Talker::INFO.guid).unwrap();
    let instantiate = functions.fmi2Instantiate;
    // SAFETY: strings and callbacks that live until the end of this test.
    let component = unsafe {
        instantiate(c"talker".as_ptr(), 1, guid.as_ptr(), null(), &raw const callbacks, fmi2False, fmi2True)
    };
    assert_eq!(environment.messages.replace(0), 1, "while it is made there is nothing to call back");
    environment.answers.take();
    environment.component.set(component);
    // SAFETY: alive until it is freed below.
    let fmu = unsafe { Importer::borrowed(functions, component) };

    fmu.initialize(0.0);
    let text = c"Ping".as_ptr();
    fmu.ok(fmu.fmi2SetString(&(talker::Name::heard as u32), 1, &text));
    fmu.step(0.0, 1.0);
    fmu.set(&[talker::Name::volume as u32], &[10.5]);
    assert_eq!(fmu.try_set(&[99], &[0.0]), Status::Error);
    assert_eq!(fmu.fmi2GetStatus(0, &mut 0), Status::Discard);
    fmu.ok(fmu.fmi2Terminate());
    fmu.ok(fmu.fmi2Reset());
    assert_eq!(environment.messages.get(), 7);
    let answers = environment.answers.take();
    assert_eq!(answers.len(), 7 * 43);
    for (function, status) in answers {
        assert_eq!(status, Status::Error, "{function}");
    }
    fmu.initialize(0.0);
    // SAFETY: the only time that this is not ignored.
    unsafe { (functions.fmi2FreeInstance)(component) };
}

/// An array as an importer in C has it on its stack.
fn unwritten<T, const N: usize>() -> [MaybeUninit<T>; N] {
    [const { MaybeUninit::uninit() }; N]
}

/// All of an array that the FMU has written.
fn written<T: Copy, const N: usize>(values: [MaybeUninit<T>; N]) -> [T; N] {
    // SAFETY: the FMU answered OK, so that all are written; valgrind sees if not.
    values.map(|value| unsafe { value.assume_init() })
}

/// The call must write these values into memory that was never written.
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

/// Every function that writes, into memory that was never written: values, states, sizes, bytes, flags, event information.
#[test]
fn memory_that_was_never_written() {
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
    // What has nothing to tell writes nothing.
    let mut nothing = unwritten::<f64, 1>();
    assert_eq!(fmu.fmi2GetRealStatus(3, nothing.as_mut_ptr().cast()), Status::Discard);
    serialized_into_memory_that_was_never_written(fmu);

    let talker = Importer::initialized_at::<Talker>(0.0);
    let mut texts = unwritten::<fmi2String, 2>();
    let vr = [talker::Name::who as u32, talker::Name::said as u32];
    talker.ok(talker.fmi2GetString(vr.as_ptr(), 2, texts.as_mut_ptr().cast()));
    assert!(written(texts).iter().all(|text| !text.is_null()));
}

fn serialized_into_memory_that_was_never_written(fmu: &dyn Either) {
    let (state, mut size) = (fmu.save(), unwritten());
    fmu.ok(fmu.state_size(state, size.as_mut_ptr().cast()));
    let [size] = written::<usize, 1>(size);
    let mut bytes = Box::<[u8]>::new_uninit_slice(size);
    fmu.ok(fmu.serialize_into(state, bytes.as_mut_ptr().cast(), size));
    // SAFETY: as above.
    fmu.restore(&unsafe { bytes.assume_init() });
    fmu.forget(state);
}

#[test]
fn memory_that_was_never_written_in_model_exchange() {
    let fmu = &Importer::of::<Ball>(ModelExchange);
    fmu.initialize(0.0);
    writes(fmu, [fmi2EventInfo::default()], |info| fmu.fmi2NewDiscreteStates(info));
    fmu.ok(fmu.fmi2EnterContinuousTimeMode());
    writes(fmu, [1.0, 0.0], |x| fmu.fmi2GetContinuousStates(x, 2));
    writes(fmu, [0.0, -9.81], |rates| fmu.fmi2GetDerivatives(rates, 2));
    writes(fmu, [1.0, 1.0], |nominals| fmu.fmi2GetNominalsOfContinuousStates(nominals, 2));
    writes(fmu, [1.0], |indicator| fmu.fmi2GetEventIndicators(indicator, 1));
    writes(fmu, [0; 2], |flags| fmu.fmi2CompletedIntegratorStep(1, flags, flags.wrapping_add(1)));
}

/// Instances and saved states of models with memory on the heap, freed in any order, also one inside of the other's life.
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
        check::<fmu_test_kit::fmi3::Importer, M>();
    }
    check_both::<Talker>();
    check_both::<Oscillator>();
    check_both::<Counter>();
}

//! The functions that both interface types have (section 2.1).

use super::*;
use crate::call_table::Interface;
use crate::instance::SavedState;
use crate::logger::{Category, Logger};
use crate::state::InstanceState;

/// `fmi2GetTypesPlatform`
pub extern "C" fn fmi2GetTypesPlatform() -> fmi2String {
    c"default".as_ptr()
}

/// `fmi2GetVersion`
pub extern "C" fn fmi2GetVersion() -> fmi2String {
    c"2.0".as_ptr()
}

/// `fmi2Instantiate`. The importer owns the result until it calls `fmi2FreeInstance`.
pub unsafe fn fmi2Instantiate<M: Model>(
    instance_name: fmi2String,
    fmu_type: fmi2Type,
    guid: fmi2String,
    _resource_location: fmi2String,
    functions: *const fmi2CallbackFunctions,
    _visible: fmi2Boolean,
    logging_on: fmi2Boolean,
) -> fmi2Component {
    let instantiate = || {
        if functions.is_null() {
            return None;
        }
        // SAFETY: by contract the callbacks; copied, from any address, for they may go after this call.
        let functions = unsafe { functions.read_unaligned() };
        let log = ImporterLog { logger: functions.logger, environment: functions.component_environment };
        // SAFETY: by contract NULL or a string, both.
        let (instance_name, guid) = unsafe { (string(instance_name), string(guid)) };
        let logger = Logger::new(log, instance_name.unwrap_or(c""), logging_on != fmi2False);
        let refusal = match check_instantiation::<M>(instance_name, fmu_type, guid) {
            Ok(interface) => match catch_unwind(|| InstanceState::<M>::new(interface)) {
                Ok(state) => {
                    let instance = Instance::<M>::new(interface, logger, state);
                    instance.log_event("instantiated");
                    return Some(Box::new(instance));
                }
                Err(panic) => format!("internal failure ({})", panic_message(&*panic)),
            },
            Err(refusal) => refusal.message,
        };
        logger.log(Status::Error, Category::Error, &format!("fmi2Instantiate: {refusal}"));
        None
    };
    match catch_unwind(AssertUnwindSafe(instantiate)) {
        Ok(Some(instance)) => Box::into_raw(instance).cast(),
        _ => std::ptr::null_mut(),
    }
}

fn check_instantiation<M: Model>(
    instance_name: Option<&CStr>,
    fmu_type: fmi2Type,
    guid: Option<&CStr>,
) -> Outcome<Interface> {
    if instance_name.is_none_or(|name| name.to_bytes().trim_ascii().is_empty()) {
        return refuse("the instance needs a name");
    }
    let info = M::INFO;
    if guid.map(CStr::to_bytes) != Some(info.guid.as_bytes()) {
        return refuse(format!(
            "the guid {} is not this library's {}: modelDescription.xml and library come from different FMUs",
            guid.map_or("NULL".into(), CStr::to_string_lossy),
            info.guid
        ));
    }
    match fmu_type {
        0 if info.model_exchange.is_some() => Ok(Interface::ModelExchange),
        1 if info.co_simulation.is_some() => Ok(Interface::CoSimulation),
        0 => refuse("this FMU has no Model Exchange"),
        1 => refuse("this FMU has no Co-Simulation"),
        other => refuse(format!("fmuType must be 0 (Model Exchange) or 1 (Co-Simulation), it is {other}")),
    }
}

/// `fmi2FreeInstance`. Takes the instance back; NULL is ignored.
pub unsafe fn fmi2FreeInstance<M: Model>(c: fmi2Component) {
    if !c.is_null() {
        // SAFETY: by contract from `fmi2Instantiate`, which gave the box away, and not freed before.
        let instance = unsafe { Box::from_raw(c.cast::<Instance<M>>()) };
        let _ = catch_unwind(AssertUnwindSafe(|| drop(instance)));
    }
}

/// `fmi2SetDebugLogging`
pub unsafe fn fmi2SetDebugLogging<M: Model>(
    c: fmi2Component,
    logging_on: fmi2Boolean,
    count: usize,
    categories: *const fmi2String,
) -> Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: by contract an array of this length.
        let names = unsafe { slice(categories, count, "categories") }?;
        let mut found = 0;
        for name in names {
            // SAFETY: by contract NULL or a string.
            let name = unsafe { string(*name) }.map_or(&b""[..], CStr::to_bytes);
            let Some(bit) = Logger::<ImporterLog>::find(name) else {
                let known = Category::ALL.map(|category| category.name().to_string_lossy()).join(", ");
                return refuse(format!(
                    "there is no log category '{}'; the categories are {known}",
                    String::from_utf8_lossy(name)
                ));
            };
            found |= bit;
        }
        instance.set_debug_logging(logging_on != fmi2False, (count > 0).then_some(found));
        Ok(())
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::SetDebugLogging, body) }
}

/// `fmi2SetupExperiment`
pub unsafe fn fmi2SetupExperiment<M: Model>(
    c: fmi2Component,
    tolerance_defined: fmi2Boolean,
    tolerance: fmi2Real,
    start_time: fmi2Real,
    stop_time_defined: fmi2Boolean,
    stop_time: fmi2Real,
) -> Status {
    let body = |instance: &mut Instance<M>| {
        instance.setup_experiment(
            (tolerance_defined != fmi2False).then_some(tolerance),
            start_time,
            (stop_time_defined != fmi2False).then_some(stop_time),
        )
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::SetupExperiment, body) }
}

/// `fmi2EnterInitializationMode`
pub unsafe fn fmi2EnterInitializationMode<M: Model>(c: fmi2Component) -> Status {
    // SAFETY: the module's contract.
    unsafe {
        call::<M>(c, Function::EnterInitializationMode, |instance| instance.enter_initialization_mode())
    }
}

/// `fmi2ExitInitializationMode`
pub unsafe fn fmi2ExitInitializationMode<M: Model>(c: fmi2Component) -> Status {
    let body = |instance: &mut Instance<M>| {
        instance.exit_initialization_mode();
        Ok(())
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::ExitInitializationMode, body) }
}

/// `fmi2Terminate`
pub unsafe fn fmi2Terminate<M: Model>(c: fmi2Component) -> Status {
    let body = |instance: &mut Instance<M>| {
        instance.terminate();
        Ok(())
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::Terminate, body) }
}

/// `fmi2Reset`
pub unsafe fn fmi2Reset<M: Model>(c: fmi2Component) -> Status {
    let body = |instance: &mut Instance<M>| {
        instance.reset();
        Ok(())
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::Reset, body) }
}

/// Defines the getters and setters of a type: the same checks of the arrays, then the method.
macro_rules! values {
    ($get:ident $get_function:ident $get_method:ident, $set:ident $set_function:ident $set_method:ident, $type:ty) => {
        #[doc = concat!("`", stringify!($get), "`")]
        pub unsafe fn $get<M: Model>(
            c: fmi2Component,
            vr: *const fmi2ValueReference,
            count: usize,
            values: *mut $type,
        ) -> Status {
            let body = |instance: &mut Instance<M>| {
                // SAFETY: by contract arrays of this length that do not overlap.
                let (vr, values) = unsafe { (slice(vr, count, "vr")?, slice_mut(values, count, "value")?) };
                instance.$get_method(vr, values)
            };
            // SAFETY: the module's contract.
            unsafe { call(c, Function::$get_function, body) }
        }

        #[doc = concat!("`", stringify!($set), "`")]
        pub unsafe fn $set<M: Model>(
            c: fmi2Component,
            vr: *const fmi2ValueReference,
            count: usize,
            values: *const $type,
        ) -> Status {
            let body = |instance: &mut Instance<M>| {
                // SAFETY: by contract arrays of this length.
                let (vr, values) = unsafe { (slice(vr, count, "vr")?, slice(values, count, "value")?) };
                instance.$set_method(vr, values)
            };
            // SAFETY: the module's contract.
            unsafe { call(c, Function::$set_function, body) }
        }
    };
}

values!(fmi2GetReal GetReal get_real, fmi2SetReal SetReal set_real, fmi2Real);
values!(fmi2GetInteger GetInteger get_integer, fmi2SetInteger SetInteger set_integer, fmi2Integer);
values!(fmi2GetBoolean GetBoolean get_boolean, fmi2SetBoolean SetBoolean set_boolean, fmi2Boolean);
values!(fmi2GetString GetString get_string, fmi2SetString SetString set_string, fmi2String);

/// `fmi2GetFMUstate`. The importer owns the state until it calls `fmi2FreeFMUstate`.
pub unsafe fn fmi2GetFMUstate<M: Model>(c: fmi2Component, state: *mut fmi2FMUstate) -> Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: by contract NULL or a pointer to a handle.
        let handle = unsafe { slice_mut(state, 1, "FMUstate") }?;
        // SAFETY: by contract the handle is NULL or a state of this model that nobody else uses now.
        match unsafe { handle[0].cast::<SavedState<M>>().as_mut() } {
            Some(saved) => instance.save_into(saved),
            None => handle[0] = Box::into_raw(Box::new(instance.save())).cast(),
        }
        Ok(())
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::GetFMUstate, body) }
}

/// `fmi2SetFMUstate`
pub unsafe fn fmi2SetFMUstate<M: Model>(c: fmi2Component, state: fmi2FMUstate) -> Status {
    // SAFETY: the module's contract, for the component and the state.
    unsafe { call(c, Function::SetFMUstate, |instance: &mut Instance<M>| instance.restore(saved(state)?)) }
}

/// `fmi2FreeFMUstate`. Takes the state back and clears the handle; NULL is ignored.
pub unsafe fn fmi2FreeFMUstate<M: Model>(c: fmi2Component, state: *mut fmi2FMUstate) -> Status {
    let body = |_: &mut Instance<M>| {
        if state.is_null() {
            return Ok(());
        }
        // SAFETY: by contract a pointer to a handle.
        let handle = unsafe { slice_mut(state, 1, "FMUstate") }?;
        if !handle[0].is_null() {
            let state = std::mem::replace(&mut handle[0], std::ptr::null_mut());
            // SAFETY: by contract a state that this library gave away as a box and that is not freed.
            drop(unsafe { Box::from_raw(state.cast::<SavedState<M>>()) });
        }
        Ok(())
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::FreeFMUstate, body) }
}

/// `fmi2SerializedFMUstateSize`
pub unsafe fn fmi2SerializedFMUstateSize<M: Model>(
    c: fmi2Component,
    state: fmi2FMUstate,
    size: *mut usize,
) -> Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: by contract NULL or a state of this model; NULL or a pointer to a size.
        unsafe { write(size, instance.serialized_size(saved(state)?)?, "size") }
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::SerializedFMUstateSize, body) }
}

/// `fmi2SerializeFMUstate`
pub unsafe fn fmi2SerializeFMUstate<M: Model>(
    c: fmi2Component,
    state: fmi2FMUstate,
    bytes: *mut fmi2Byte,
    size: usize,
) -> Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: by contract NULL or a state of this model; an array of this length.
        let (saved, bytes) =
            unsafe { (saved(state)?, slice_mut(bytes.cast::<u8>(), size, "serializedState")?) };
        instance.serialize(saved, bytes)
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::SerializeFMUstate, body) }
}

/// `fmi2DeSerializeFMUstate`. The importer owns the state until it calls `fmi2FreeFMUstate`; a state
/// that the handle held before is overwritten.
pub unsafe fn fmi2DeSerializeFMUstate<M: Model>(
    c: fmi2Component,
    bytes: *const fmi2Byte,
    size: usize,
    state: *mut fmi2FMUstate,
) -> Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: by contract an array of this length; NULL or a pointer to a handle.
        let (bytes, handle) = unsafe {
            (slice(bytes.cast::<u8>(), size, "serializedState")?, slice_mut(state, 1, "FMUstate")?)
        };
        let restored = instance.deserialize(bytes)?;
        // SAFETY: by contract the handle is NULL or a state of this model that nobody else uses now.
        match unsafe { handle[0].cast::<SavedState<M>>().as_mut() } {
            Some(saved) => *saved = restored,
            None => handle[0] = Box::into_raw(Box::new(restored)).cast(),
        }
        Ok(())
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::DeSerializeFMUstate, body) }
}

/// The saved state behind a handle.
///
/// # Safety
/// NULL or a state of this model that is not freed and not written for `'a`.
unsafe fn saved<'a, M: Model>(state: fmi2FMUstate) -> Outcome<&'a SavedState<M>> {
    // SAFETY: the caller's promise.
    match unsafe { state.cast::<SavedState<M>>().as_ref() } {
        Some(saved) => Ok(saved),
        None => refuse("the state is NULL; fmi2GetFMUstate makes one"),
    }
}

/// `fmi2GetDirectionalDerivative`
pub unsafe fn fmi2GetDirectionalDerivative<M: Model>(
    c: fmi2Component,
    unknown: *const fmi2ValueReference,
    unknown_count: usize,
    known: *const fmi2ValueReference,
    known_count: usize,
    seed: *const fmi2Real,
    result: *mut fmi2Real,
) -> Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: by contract arrays of these lengths; the written one does not overlap the others.
        let (unknown, known, seed, result) = unsafe {
            (
                slice(unknown, unknown_count, "vUnknown_ref")?,
                slice(known, known_count, "vKnown_ref")?,
                slice(seed, known_count, "dvKnown")?,
                slice_mut(result, unknown_count, "dvUnknown")?,
            )
        };
        instance.directional_derivative(unknown, known, seed, result)
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::GetDirectionalDerivative, body) }
}

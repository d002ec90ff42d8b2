//! What both interface types have (section 2.1).
//!
//! # Safety
//! As in the [module above](super): each argument is what the standard says it is.

use super::arrays::{array, output, place};
use super::call::string;
use super::types::*;
use crate::export::Exported;
use crate::instance::{Instance, Outcome, SavedState, refuse};
use crate::log::{Category, Logger};
use crate::model::Experiment;
use crate::types::BaseType;
use crate::value::Value;
use std::ffi::{CStr, CString};

pub unsafe fn fmi2SetDebugLogging<M: Exported>(
    instance: &mut Instance<M>,
    logging_on: fmi2Boolean,
    count: usize,
    categories: *const fmi2String,
) -> Outcome {
    // SAFETY: by contract an array of this length.
    let names = unsafe { array(categories, count, "categories") }?;
    let mut found = 0;
    for name in names {
        // SAFETY: by contract NULL or a string.
        let name = unsafe { string(*name) }.map_or(&b""[..], CStr::to_bytes);
        let Some(bit) = Logger::find(name) else {
            let known = Category::ALL.map(|category| category.name().to_string_lossy()).join(", ");
            return refuse(format!(
                "there is no log category '{}'; the categories are {known}",
                String::from_utf8_lossy(name)
            ));
        };
        found |= bit;
    }
    match count {
        0 => instance.logger.set_all(logging_on != fmi2False),
        _ => instance.logger.set(found, logging_on != fmi2False),
    }
    Ok(())
}

pub unsafe fn fmi2SetupExperiment<M: Exported>(
    instance: &mut Instance<M>,
    tolerance_defined: fmi2Boolean,
    tolerance: fmi2Real,
    start_time: fmi2Real,
    stop_time_defined: fmi2Boolean,
    stop_time: fmi2Real,
) -> Outcome {
    instance.setup_experiment(Experiment {
        start_time,
        stop_time: (stop_time_defined != fmi2False).then_some(stop_time),
        tolerance: (tolerance_defined != fmi2False).then_some(tolerance),
    })
}

pub unsafe fn fmi2EnterInitializationMode<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.enter_initialization_mode()
}

pub unsafe fn fmi2ExitInitializationMode<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.exit_initialization_mode();
    Ok(())
}

pub unsafe fn fmi2Terminate<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.terminate();
    Ok(())
}

pub unsafe fn fmi2Reset<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.reset()
}

#[inline]
pub unsafe fn fmi2GetReal<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi2ValueReference,
    count: usize,
    values: *mut fmi2Real,
) -> Outcome {
    // SAFETY: by contract arrays of this length that do not overlap.
    let (vr, values) = unsafe { (array(vr, count, "vr")?, output(values, count, "value")?) };
    instance.get_reals(vr, values)
}

#[inline]
pub unsafe fn fmi2SetReal<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi2ValueReference,
    count: usize,
    values: *const fmi2Real,
) -> Outcome {
    // SAFETY: by contract arrays of this length.
    let (vr, values) = unsafe { (array(vr, count, "vr")?, array(values, count, "value")?) };
    instance.set_reals(vr, values)
}

/// An Enumeration goes through the functions of Integers (section 2.2.7).
const WHOLE: &[BaseType] = &[BaseType::Integer, BaseType::Enumeration];

pub unsafe fn fmi2GetInteger<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi2ValueReference,
    count: usize,
    values: *mut fmi2Integer,
) -> Outcome {
    // SAFETY: by contract arrays of this length that do not overlap.
    let (vr, values) = unsafe { (array(vr, count, "vr")?, output(values, count, "value")?) };
    instance.get(vr, WHOLE, |place, value| {
        if let Value::Integer(value) = value {
            values[place].write(fmi2Integer::try_from(value).unwrap_or_default());
        }
    })
}

pub unsafe fn fmi2SetInteger<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi2ValueReference,
    count: usize,
    values: *const fmi2Integer,
) -> Outcome {
    // SAFETY: by contract arrays of this length.
    let (vr, values) = unsafe { (array(vr, count, "vr")?, array(values, count, "value")?) };
    instance.set(vr, WHOLE, values.iter().map(|value| Value::Integer((*value).into())))
}

pub unsafe fn fmi2GetBoolean<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi2ValueReference,
    count: usize,
    values: *mut fmi2Boolean,
) -> Outcome {
    // SAFETY: by contract arrays of this length that do not overlap.
    let (vr, values) = unsafe { (array(vr, count, "vr")?, output(values, count, "value")?) };
    instance.get(vr, &[BaseType::Boolean], |place, value| {
        values[place].write(fmi2Boolean::from(value == Value::Boolean(true)));
    })
}

pub unsafe fn fmi2SetBoolean<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi2ValueReference,
    count: usize,
    values: *const fmi2Boolean,
) -> Outcome {
    // SAFETY: by contract arrays of this length.
    let (vr, values) = unsafe { (array(vr, count, "vr")?, array(values, count, "value")?) };
    if let Some(place) = values.iter().position(|value| !(0..=1).contains(value)) {
        let name = instance.name(vr[place], BaseType::Boolean)?;
        return refuse(format!("{name} must be 0 (false) or 1 (true), it is {}", values[place]));
    }
    instance.set(vr, &[BaseType::Boolean], values.iter().map(|value| Value::Boolean(*value == 1)))
}

/// The texts are the instance's until the next call on it.
pub unsafe fn fmi2GetString<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi2ValueReference,
    count: usize,
    values: *mut fmi2String,
) -> Outcome {
    // SAFETY: by contract arrays of this length that do not overlap.
    let (vr, values) = unsafe { (array(vr, count, "vr")?, output(values, count, "value")?) };
    let mut texts = Vec::with_capacity(vr.len());
    instance.get(vr, &[BaseType::String], |_, value| {
        if let Value::String(text) = value {
            // A zero byte would end the text for C.
            texts.push(CString::new(text.replace('\0', " ")).unwrap_or_default());
        }
    })?;
    values.iter_mut().zip(&texts).for_each(|(value, text)| {
        value.write(text.as_ptr());
    });
    instance.texts = texts;
    Ok(())
}

pub unsafe fn fmi2SetString<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi2ValueReference,
    count: usize,
    values: *const fmi2String,
) -> Outcome {
    // SAFETY: by contract arrays of this length.
    let (vr, values) = unsafe { (array(vr, count, "vr")?, array(values, count, "value")?) };
    let mut texts = Vec::with_capacity(vr.len());
    for (vr, value) in vr.iter().zip(values) {
        // SAFETY: by contract NULL or a string.
        match unsafe { string(*value) }.map(CStr::to_str) {
            Some(Ok(text)) => texts.push(Value::String(text.to_owned())),
            Some(Err(_)) => {
                return refuse(format!(
                    "the text for {} is not UTF-8",
                    instance.name(*vr, BaseType::String)?
                ));
            }
            None => return refuse(format!("the text for {} is NULL", instance.name(*vr, BaseType::String)?)),
        }
    }
    instance.set(vr, &[BaseType::String], texts.iter().cloned())
}

/// The importer owns the state until it calls `fmi2FreeFMUstate`.
pub unsafe fn fmi2GetFMUstate<M: Exported>(instance: &mut Instance<M>, state: *mut fmi2FMUstate) -> Outcome {
    // SAFETY: by contract NULL or a pointer to a handle, which is initialized: NULL or a state.
    let handle = unsafe { place(state, "FMUstate")?.assume_init_mut() };
    // SAFETY: by contract the handle is NULL or a state of this model that nobody else uses now.
    match unsafe { handle.cast::<SavedState<M>>().as_mut() } {
        Some(saved) => instance.save_into(saved),
        None => *handle = Box::into_raw(Box::new(instance.save())).cast(),
    }
    Ok(())
}

pub unsafe fn fmi2SetFMUstate<M: Exported>(instance: &mut Instance<M>, state: fmi2FMUstate) -> Outcome {
    // SAFETY: the module's contract.
    instance.restore(unsafe { saved(state) }?)
}

/// Takes the state back and clears the handle; NULL is ignored.
pub unsafe fn fmi2FreeFMUstate<M: Exported>(_: &mut Instance<M>, state: *mut fmi2FMUstate) -> Outcome {
    if state.is_null() {
        return Ok(());
    }
    // SAFETY: by contract a pointer to a handle, which is initialized: NULL or a state.
    let handle = unsafe { place(state, "FMUstate")?.assume_init_mut() };
    let state = std::mem::replace(handle, std::ptr::null_mut());
    if !state.is_null() {
        // SAFETY: by contract a state that this library gave away as a box and that is not freed.
        drop(unsafe { Box::from_raw(state.cast::<SavedState<M>>()) });
    }
    Ok(())
}

pub unsafe fn fmi2SerializedFMUstateSize<M: Exported>(
    instance: &mut Instance<M>,
    state: fmi2FMUstate,
    size: *mut usize,
) -> Outcome {
    // SAFETY: by contract NULL or a state of this model; NULL or a pointer to a size.
    let (saved, size) = unsafe { (saved(state)?, place(size, "size")?) };
    size.write(instance.serialized_size(saved));
    Ok(())
}

pub unsafe fn fmi2SerializeFMUstate<M: Exported>(
    instance: &mut Instance<M>,
    state: fmi2FMUstate,
    bytes: *mut fmi2Byte,
    size: usize,
) -> Outcome {
    // SAFETY: by contract NULL or a state of this model; an array of this length.
    let (saved, bytes) = unsafe { (saved(state)?, output(bytes.cast::<u8>(), size, "serializedState")?) };
    let needed = instance.serialized_size(saved);
    if size != needed {
        return refuse(format!(
            "the state needs {needed} bytes, the buffer has {size}; ask fmi2SerializedFMUstateSize"
        ));
    }
    let mut written = vec![0; needed];
    instance.serialize(saved, &mut written);
    bytes.iter_mut().zip(written).for_each(|(byte, written)| {
        byte.write(written);
    });
    Ok(())
}

/// The importer owns the state until it calls `fmi2FreeFMUstate`; a state that the handle held before is overwritten.
pub unsafe fn fmi2DeSerializeFMUstate<M: Exported>(
    instance: &mut Instance<M>,
    bytes: *const fmi2Byte,
    size: usize,
    state: *mut fmi2FMUstate,
) -> Outcome {
    // SAFETY: by contract an array of this length; NULL or a pointer to a handle, which is NULL or a state.
    let (bytes, handle) = unsafe {
        (array(bytes.cast::<u8>(), size, "serializedState")?, place(state, "FMUstate")?.assume_init_mut())
    };
    let restored = instance.deserialize(bytes)?;
    // SAFETY: by contract the handle is NULL or a state of this model that nobody else uses now.
    match unsafe { handle.cast::<SavedState<M>>().as_mut() } {
        Some(saved) => *saved = restored,
        None => *handle = Box::into_raw(Box::new(restored)).cast(),
    }
    Ok(())
}

/// The saved state behind a handle.
///
/// # Safety
/// NULL or a state of this model that is not freed and not written for `'a`.
unsafe fn saved<'a, M: Exported>(state: fmi2FMUstate) -> Outcome<&'a SavedState<M>> {
    // SAFETY: the caller's promise.
    match unsafe { state.cast::<SavedState<M>>().as_ref() } {
        Some(saved) => Ok(saved),
        None => refuse("the state is NULL; fmi2GetFMUstate makes one"),
    }
}

pub unsafe fn fmi2GetDirectionalDerivative<M: Exported>(
    instance: &mut Instance<M>,
    unknown: *const fmi2ValueReference,
    unknown_count: usize,
    known: *const fmi2ValueReference,
    known_count: usize,
    seed: *const fmi2Real,
    result: *mut fmi2Real,
) -> Outcome {
    // SAFETY: by contract arrays of these lengths; the written one does not overlap the others.
    let (unknown, known, seed, result) = unsafe {
        (
            array(unknown, unknown_count, "vUnknown_ref")?,
            array(known, known_count, "vKnown_ref")?,
            array(seed, known_count, "dvKnown")?,
            output(result, unknown_count, "dvUnknown")?,
        )
    };
    instance.directional_derivative(unknown, known, seed, result)
}

//! What both interface types have (section 2.1).
//!
//! # Safety
//! As in the [module above](super): each argument is what the standard says it is.

use super::types::*;
use crate::boundary::{
    array, deserialize, free_state, get_state, get_texts, output, serialize, serialized_size,
    set_debug_logging, set_texts,
};
use crate::export::Exported;
use crate::instance::{Direction, Instance, Outcome};
use crate::model::Experiment;
use crate::value::Value;
use fmi_abi::BaseType;

pub unsafe fn fmi2SetDebugLogging<M: Exported>(
    instance: &mut Instance<M>,
    logging_on: fmi2Boolean,
    count: usize,
    categories: *const fmi2String,
) -> Outcome {
    // SAFETY: by contract an array of this length, of strings.
    unsafe { set_debug_logging(instance, logging_on != fmi2False, count, categories) }
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
    instance.exit_initialization_mode()
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
        return instance.refuse_value(vr, &[BaseType::Boolean], place, |name| {
            format!("{name} must be 0 (false) or 1 (true), it is {}", values[place])
        });
    }
    instance.set(vr, &[BaseType::Boolean], values.iter().map(|value| Value::Boolean(*value == 1)))
}

pub unsafe fn fmi2GetString<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi2ValueReference,
    count: usize,
    values: *mut fmi2String,
) -> Outcome {
    // SAFETY: by contract arrays of this length that do not overlap.
    unsafe { get_texts(instance, array(vr, count, "vr")?, output(values, count, "value")?) }
}

pub unsafe fn fmi2SetString<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi2ValueReference,
    count: usize,
    values: *const fmi2String,
) -> Outcome {
    // SAFETY: by contract arrays of this length, of strings.
    unsafe { set_texts(instance, array(vr, count, "vr")?, array(values, count, "value")?) }
}

pub unsafe fn fmi2GetFMUstate<M: Exported>(instance: &mut Instance<M>, state: *mut fmi2FMUstate) -> Outcome {
    // SAFETY: the module's contract, here and below.
    unsafe { get_state(instance, state) }
}

pub unsafe fn fmi2SetFMUstate<M: Exported>(instance: &mut Instance<M>, state: fmi2FMUstate) -> Outcome {
    instance.restore(state.addr())
}

pub unsafe fn fmi2FreeFMUstate<M: Exported>(instance: &mut Instance<M>, state: *mut fmi2FMUstate) -> Outcome {
    // SAFETY: see above.
    unsafe { free_state(instance, state) }
}

pub unsafe fn fmi2SerializedFMUstateSize<M: Exported>(
    instance: &mut Instance<M>,
    state: fmi2FMUstate,
    size: *mut usize,
) -> Outcome {
    // SAFETY: see above.
    unsafe { serialized_size(instance, state, size) }
}

pub unsafe fn fmi2SerializeFMUstate<M: Exported>(
    instance: &mut Instance<M>,
    state: fmi2FMUstate,
    bytes: *mut fmi2Byte,
    size: usize,
) -> Outcome {
    // SAFETY: see above.
    unsafe { serialize(instance, state, bytes.cast(), size) }
}

pub unsafe fn fmi2DeSerializeFMUstate<M: Exported>(
    instance: &mut Instance<M>,
    bytes: *const fmi2Byte,
    size: usize,
    state: *mut fmi2FMUstate,
) -> Outcome {
    // SAFETY: see above.
    unsafe { deserialize(instance, bytes.cast(), size, state) }
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
    instance.derivatives(unknown, known, seed, result, Direction::Forward)
}

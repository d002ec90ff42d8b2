//! What both interface types have (sections 2.2 and 2.3).
//!
//! # Safety
//! As in the [module above](super): each argument is what the standard says it is.

use super::{FromOne, types::*};
use crate::boundary::*;
use crate::export::Exported;
use crate::instance::{Direction, Instance, Outcome, refuse};
use crate::model::Experiment;

pub unsafe fn fmi3SetDebugLogging<M: Exported>(
    instance: &mut Instance<M>,
    logging_on: fmi3Boolean,
    count: usize,
    categories: *const fmi3String,
) -> Outcome {
    // SAFETY: by contract an array of this length, of strings.
    unsafe { set_debug_logging(instance, logging_on != fmi3False, count, categories) }
}

pub unsafe fn fmi3EnterInitializationMode<M: Exported>(
    instance: &mut Instance<M>,
    tolerance_defined: fmi3Boolean,
    tolerance: fmi3Float64,
    start_time: fmi3Float64,
    stop_time_defined: fmi3Boolean,
    stop_time: fmi3Float64,
) -> Outcome {
    instance.enter_initialization_mode_at(Experiment {
        start_time,
        stop_time: (stop_time_defined != fmi3False).then_some(stop_time),
        tolerance: (tolerance_defined != fmi3False).then_some(tolerance),
    })
}

pub unsafe fn fmi3ExitInitializationMode<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.exit_initialization_mode()
}

pub unsafe fn fmi3EnterEventMode<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.enter_event_mode()
}

pub unsafe fn fmi3Terminate<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.terminate();
    Ok(())
}

pub unsafe fn fmi3Reset<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.reset()
}

/// All variables are scalars: there are as many values as variables.
#[inline]
pub(super) fn same(what: &str, needed: usize, count: usize) -> Outcome {
    if count == needed {
        return Ok(());
    }
    refuse(format!("there are {needed} {what}, the array has {count} elements"))
}

pub unsafe fn fmi3GetFMUState<M: Exported>(instance: &mut Instance<M>, state: *mut fmi3FMUState) -> Outcome {
    // SAFETY: the module's contract, here and below.
    unsafe { get_state(instance, state) }
}

pub unsafe fn fmi3SetFMUState<M: Exported>(instance: &mut Instance<M>, state: fmi3FMUState) -> Outcome {
    instance.restore(state.addr())
}

pub unsafe fn fmi3FreeFMUState<M: Exported>(instance: &mut Instance<M>, state: *mut fmi3FMUState) -> Outcome {
    // SAFETY: see above.
    unsafe { free_state(instance, state) }
}

pub unsafe fn fmi3SerializedFMUStateSize<M: Exported>(
    instance: &mut Instance<M>,
    state: fmi3FMUState,
    size: *mut usize,
) -> Outcome {
    // SAFETY: see above.
    unsafe { serialized_size(instance, state, size) }
}

pub unsafe fn fmi3SerializeFMUState<M: Exported>(
    instance: &mut Instance<M>,
    state: fmi3FMUState,
    bytes: *mut fmi3Byte,
    size: usize,
) -> Outcome {
    // SAFETY: see above.
    unsafe { serialize(instance, state, bytes, size) }
}

pub unsafe fn fmi3DeserializeFMUState<M: Exported>(
    instance: &mut Instance<M>,
    bytes: *const fmi3Byte,
    size: usize,
    state: *mut fmi3FMUState,
) -> Outcome {
    // SAFETY: see above.
    unsafe { deserialize(instance, bytes, size, state) }
}

pub unsafe fn fmi3GetDirectionalDerivative<M: Exported>(
    instance: &mut Instance<M>,
    unknown: *const fmi3ValueReference,
    unknown_count: usize,
    known: *const fmi3ValueReference,
    known_count: usize,
    seed: *const fmi3Float64,
    seed_count: usize,
    sensitivity: *mut fmi3Float64,
    sensitivity_count: usize,
) -> Outcome {
    // SAFETY: by contract arrays of these lengths; the written one does not overlap the others.
    unsafe {
        derivatives(
            instance,
            (unknown, unknown_count),
            (known, known_count),
            (seed, seed_count),
            (sensitivity, sensitivity_count),
            Direction::Forward,
        )
    }
}

pub unsafe fn fmi3GetAdjointDerivative<M: Exported>(
    instance: &mut Instance<M>,
    unknown: *const fmi3ValueReference,
    unknown_count: usize,
    known: *const fmi3ValueReference,
    known_count: usize,
    seed: *const fmi3Float64,
    seed_count: usize,
    sensitivity: *mut fmi3Float64,
    sensitivity_count: usize,
) -> Outcome {
    // SAFETY: by contract arrays of these lengths; the written one does not overlap the others.
    unsafe {
        derivatives(
            instance,
            (unknown, unknown_count),
            (known, known_count),
            (seed, seed_count),
            (sensitivity, sensitivity_count),
            Direction::Adjoint,
        )
    }
}

/// # Safety
/// Arrays of these lengths; the written one does not overlap the others.
unsafe fn derivatives<M: Exported>(
    instance: &mut Instance<M>,
    (unknown, unknown_count): (*const fmi3ValueReference, usize),
    (known, known_count): (*const fmi3ValueReference, usize),
    (seed, seed_count): (*const fmi3Float64, usize),
    (sensitivity, sensitivity_count): (*mut fmi3Float64, usize),
    direction: Direction,
) -> Outcome {
    // SAFETY: this function's contract.
    let (unknown, known, seed, sensitivity) = unsafe {
        (
            array::<FromOne>(unknown.cast(), unknown_count, "unknowns")?,
            array(known.cast(), known_count, "knowns")?,
            array(seed, seed_count, "seed")?,
            output(sensitivity, sensitivity_count, "sensitivity")?,
        )
    };
    let (seeded, wanted) = match direction {
        Direction::Forward => (("knowns", known_count), ("unknowns", unknown_count)),
        Direction::Adjoint => (("unknowns", unknown_count), ("knowns", known_count)),
    };
    same(seeded.0, seeded.1, seed_count)?;
    same(wanted.0, wanted.1, sensitivity_count)?;
    instance.derivatives(unknown, known, seed, sensitivity, direction)
}

pub unsafe fn fmi3EvaluateDiscreteStates<M: Exported>(_: &mut Instance<M>) -> Outcome {
    refuse("fmi3UpdateDiscreteStates does it all (providesEvaluateDiscreteStates is false)")
}

pub unsafe fn fmi3UpdateDiscreteStates<M: Exported>(
    instance: &mut Instance<M>,
    again: *mut fmi3Boolean,
    terminate: *mut fmi3Boolean,
    nominals_changed: *mut fmi3Boolean,
    states_changed: *mut fmi3Boolean,
    next_defined: *mut fmi3Boolean,
    next: *mut fmi3Float64,
) -> Outcome {
    // SAFETY: by contract each NULL or a pointer to a value.
    let (again, terminate, nominals_changed, states_changed, next_defined, next) = unsafe {
        (
            place(again, "discreteStatesNeedUpdate")?,
            place(terminate, "terminateSimulation")?,
            place(nominals_changed, "nominalsOfContinuousStatesChanged")?,
            place(states_changed, "valuesOfContinuousStatesChanged")?,
            place(next_defined, "nextEventTimeDefined")?,
            place(next, "nextEventTime")?,
        )
    };
    let event = instance.event()?;
    again.write(event.again.into());
    terminate.write(event.terminate.into());
    nominals_changed.write(event.nominals_changed.into());
    states_changed.write(event.states_changed.into());
    next_defined.write(event.next.is_some().into());
    next.write(event.next.unwrap_or(0.0));
    Ok(())
}

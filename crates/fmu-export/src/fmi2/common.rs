//! Functions of both interface types (section 2.1 of FMI 2.0), and events (section 3.2.2).
//!
//! # Safety
//! The importer guarantees the contract of the [module above](super#safety).

use super::types::*;
use crate::boundary::life_cycle::experiment;
use crate::boundary::values::*;
use crate::boundary::{out_value, partial_derivatives};
use crate::export::Exported;
use crate::instance::{Instance, Outcome};
use fmi_abi::BaseType::*;

pub unsafe fn fmi2SetupExperiment<M: Exported>(
    instance: &mut Instance<M>,
    tolerance_defined: fmi2Boolean,
    tolerance: fmi2Real,
    start_time: fmi2Real,
    stop_time_defined: fmi2Boolean,
    stop_time: fmi2Real,
) -> Outcome {
    instance.setup_experiment(experiment(
        tolerance_defined,
        tolerance,
        start_time,
        stop_time_defined,
        stop_time,
    ))
}

pub unsafe fn fmi2EnterInitializationMode<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.enter_initialization_mode()
}

// Enumerations use the functions of Integers (section 2.2.7 of FMI 2.0).
getters_and_setters! { fmi2ValueReference, [];
    fmi2GetReal get_reals, fmi2SetReal set_reals, fmi2Real: [Real];
    fmi2GetInteger get_integers, fmi2SetInteger set_integers, fmi2Integer: [Integer, Enumeration];
    fmi2GetBoolean get_booleans, fmi2SetBoolean set_booleans, fmi2Boolean: [Boolean];
    fmi2GetString get_strings, fmi2SetString set_strings, fmi2String: [String];
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
    // SAFETY: by contract, the pointers are NULL or point to arrays of these lengths; the array of results does not
    // overlap the others.
    unsafe {
        partial_derivatives::<M, fmi2ValueReference, false>(
            instance,
            ["vUnknown_ref", "vKnown_ref", "dvKnown", "dvUnknown"],
            (unknown, unknown_count),
            (known, known_count),
            (seed, known_count),
            (result, unknown_count),
        )
    }
}

pub unsafe fn fmi2NewDiscreteStates<M: Exported>(
    instance: &mut Instance<M>,
    info: *mut fmi2EventInfo,
) -> Outcome {
    // SAFETY: by contract, `info` is NULL or points to a structure of this type.
    let info = unsafe { out_value(info, "fmi2eventInfo") }?;
    let event = instance.event()?;
    info.write(fmi2EventInfo {
        new_discrete_states_needed: event.again.into(),
        terminate_simulation: event.terminate.into(),
        nominals_of_continuous_states_changed: event.nominals_changed.into(),
        values_of_continuous_states_changed: event.states_changed.into(),
        next_event_time_defined: event.next.is_some().into(),
        next_event_time: event.next.unwrap_or(0.0),
    });
    Ok(())
}

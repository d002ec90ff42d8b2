//! Model Exchange (section 3.2 of both FMI versions).
//!
//! # Safety
//! The importer guarantees the contract of [`fmi2`](crate::fmi2#safety) or [`fmi3`](crate::fmi3#safety).

use super::{argument_name, in_slice, out_slice, out_value};
use crate::export::Exported;
use crate::instance::{Instance, Outcome};

pub unsafe fn enter_continuous_time_mode<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.enter_continuous_time_mode();
    Ok(())
}

pub unsafe fn completed_integrator_step<M: Exported, Boolean: From<bool>>(
    instance: &mut Instance<M>,
    _no_set_fmu_state_prior_to_current_point: Boolean,
    enter_event_mode: *mut Boolean,
    terminate_simulation: *mut Boolean,
) -> Outcome {
    // SAFETY: by contract, each is NULL or points to a value.
    let (enter_event_mode, terminate_simulation) = unsafe {
        (
            out_value(enter_event_mode, "enterEventMode")?,
            out_value(terminate_simulation, "terminateSimulation")?,
        )
    };
    let requested = instance.step_completed();
    enter_event_mode.write(requested.event.into());
    terminate_simulation.write(requested.terminate.into());
    Ok(())
}

pub unsafe fn set_time<M: Exported>(instance: &mut Instance<M>, time: f64) -> Outcome {
    instance.set_time(time)
}

pub unsafe fn set_continuous_states<M: Exported>(
    instance: &mut Instance<M>,
    x: *const f64,
    count: usize,
) -> Outcome {
    let name = argument_name(instance, "x", "continuousStates");
    // SAFETY: by contract, the pointer is NULL or points to an array of this length.
    instance.set_continuous_states(unsafe { in_slice(x, count, name) }?)
}

pub unsafe fn get_derivatives<M: Exported>(
    instance: &mut Instance<M>,
    derivatives: *mut f64,
    count: usize,
) -> Outcome {
    // SAFETY: by contract, the pointer is NULL or points to an array of this length.
    instance.get_derivatives(unsafe { out_slice(derivatives, count, "derivatives") }?)
}

pub unsafe fn get_event_indicators<M: Exported>(
    instance: &mut Instance<M>,
    indicators: *mut f64,
    count: usize,
) -> Outcome {
    // SAFETY: by contract, the pointer is NULL or points to an array of this length.
    instance.get_event_indicators(unsafe { out_slice(indicators, count, "eventIndicators") }?)
}

pub unsafe fn get_continuous_states<M: Exported>(
    instance: &mut Instance<M>,
    x: *mut f64,
    count: usize,
) -> Outcome {
    let name = argument_name(instance, "x", "continuousStates");
    // SAFETY: by contract, the pointer is NULL or points to an array of this length.
    instance.get_continuous_states(unsafe { out_slice(x, count, name) }?)
}

pub unsafe fn get_nominals<M: Exported>(
    instance: &mut Instance<M>,
    nominals: *mut f64,
    count: usize,
) -> Outcome {
    let name = argument_name(instance, "x_nominal", "nominals");
    // SAFETY: by contract, the pointer is NULL or points to an array of this length.
    instance.get_nominals(unsafe { out_slice(nominals, count, name) }?)
}

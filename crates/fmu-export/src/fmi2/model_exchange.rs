//! Model Exchange (section 3.2).
//!
//! # Safety
//! As in the [module above](super): each argument is what the standard says it is.

use super::types::*;
use crate::boundary::{array, output, place};
use crate::export::Exported;
use crate::instance::{Instance, Outcome};

pub unsafe fn fmi2EnterEventMode<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.enter_event_mode()
}

pub unsafe fn fmi2NewDiscreteStates<M: Exported>(
    instance: &mut Instance<M>,
    info: *mut fmi2EventInfo,
) -> Outcome {
    // SAFETY: by contract NULL or a pointer to an event information.
    let info = unsafe { place(info, "fmi2eventInfo") }?;
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

pub unsafe fn fmi2EnterContinuousTimeMode<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.enter_continuous_time_mode();
    Ok(())
}

pub unsafe fn fmi2CompletedIntegratorStep<M: Exported>(
    instance: &mut Instance<M>,
    _no_set_fmu_state_prior_to_current_point: fmi2Boolean,
    enter_event_mode: *mut fmi2Boolean,
    terminate_simulation: *mut fmi2Boolean,
) -> Outcome {
    // SAFETY: by contract each NULL or a pointer to a value.
    let (enter_event_mode, terminate_simulation) = unsafe {
        (place(enter_event_mode, "enterEventMode")?, place(terminate_simulation, "terminateSimulation")?)
    };
    let wanted = instance.step_completed();
    enter_event_mode.write(wanted.event.into());
    terminate_simulation.write(wanted.terminate.into());
    Ok(())
}

pub unsafe fn fmi2SetTime<M: Exported>(instance: &mut Instance<M>, time: fmi2Real) -> Outcome {
    instance.set_time(time)
}

pub unsafe fn fmi2SetContinuousStates<M: Exported>(
    instance: &mut Instance<M>,
    x: *const fmi2Real,
    count: usize,
) -> Outcome {
    // SAFETY: by contract an array of this length.
    instance.set_continuous_states(unsafe { array(x, count, "x") }?)
}

pub unsafe fn fmi2GetDerivatives<M: Exported>(
    instance: &mut Instance<M>,
    derivatives: *mut fmi2Real,
    count: usize,
) -> Outcome {
    // SAFETY: by contract an array of this length.
    instance.get_derivatives(unsafe { output(derivatives, count, "derivatives") }?)
}

pub unsafe fn fmi2GetEventIndicators<M: Exported>(
    instance: &mut Instance<M>,
    indicators: *mut fmi2Real,
    count: usize,
) -> Outcome {
    // SAFETY: by contract an array of this length.
    instance.get_event_indicators(unsafe { output(indicators, count, "eventIndicators") }?)
}

pub unsafe fn fmi2GetContinuousStates<M: Exported>(
    instance: &mut Instance<M>,
    x: *mut fmi2Real,
    count: usize,
) -> Outcome {
    // SAFETY: by contract an array of this length.
    instance.get_continuous_states(unsafe { output(x, count, "x") }?)
}

pub unsafe fn fmi2GetNominalsOfContinuousStates<M: Exported>(
    instance: &mut Instance<M>,
    nominals: *mut fmi2Real,
    count: usize,
) -> Outcome {
    // SAFETY: by contract an array of this length.
    instance.get_nominals(unsafe { output(nominals, count, "x_nominal") }?)
}

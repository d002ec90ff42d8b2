//! Model Exchange (section 3.2).
//!
//! # Safety
//! As in the [module above](super): each argument is what the standard says it is.

use super::types::*;
use crate::boundary::{array, output, place};
use crate::export::Exported;
use crate::instance::{Instance, Outcome};

pub unsafe fn fmi3EnterContinuousTimeMode<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.enter_continuous_time_mode();
    Ok(())
}

pub unsafe fn fmi3CompletedIntegratorStep<M: Exported>(
    instance: &mut Instance<M>,
    _no_set_fmu_state_prior_to_current_point: fmi3Boolean,
    enter_event_mode: *mut fmi3Boolean,
    terminate_simulation: *mut fmi3Boolean,
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

pub unsafe fn fmi3SetTime<M: Exported>(instance: &mut Instance<M>, time: fmi3Float64) -> Outcome {
    instance.set_time(time)
}

pub unsafe fn fmi3SetContinuousStates<M: Exported>(
    instance: &mut Instance<M>,
    x: *const fmi3Float64,
    count: usize,
) -> Outcome {
    // SAFETY: by contract an array of this length.
    instance.set_continuous_states(unsafe { array(x, count, "continuousStates") }?)
}

pub unsafe fn fmi3GetContinuousStateDerivatives<M: Exported>(
    instance: &mut Instance<M>,
    derivatives: *mut fmi3Float64,
    count: usize,
) -> Outcome {
    // SAFETY: by contract an array of this length.
    instance.get_derivatives(unsafe { output(derivatives, count, "derivatives") }?)
}

pub unsafe fn fmi3GetEventIndicators<M: Exported>(
    instance: &mut Instance<M>,
    indicators: *mut fmi3Float64,
    count: usize,
) -> Outcome {
    // SAFETY: by contract an array of this length.
    instance.get_event_indicators(unsafe { output(indicators, count, "eventIndicators") }?)
}

pub unsafe fn fmi3GetContinuousStates<M: Exported>(
    instance: &mut Instance<M>,
    x: *mut fmi3Float64,
    count: usize,
) -> Outcome {
    // SAFETY: by contract an array of this length.
    instance.get_continuous_states(unsafe { output(x, count, "continuousStates") }?)
}

pub unsafe fn fmi3GetNominalsOfContinuousStates<M: Exported>(
    instance: &mut Instance<M>,
    nominals: *mut fmi3Float64,
    count: usize,
) -> Outcome {
    // SAFETY: by contract an array of this length.
    instance.get_nominals(unsafe { output(nominals, count, "nominals") }?)
}

pub unsafe fn fmi3GetNumberOfEventIndicators<M: Exported>(_: &mut Instance<M>, count: *mut usize) -> Outcome {
    // SAFETY: by contract NULL or a pointer to a value.
    unsafe { place(count, "nEventIndicators") }?.write(Instance::<M>::INDICATORS);
    Ok(())
}

pub unsafe fn fmi3GetNumberOfContinuousStates<M: Exported>(
    _: &mut Instance<M>,
    count: *mut usize,
) -> Outcome {
    // SAFETY: by contract NULL or a pointer to a value.
    unsafe { place(count, "nContinuousStates") }?.write(M::STATES.len());
    Ok(())
}

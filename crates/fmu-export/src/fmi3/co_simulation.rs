//! Co-Simulation (section 4.2 of FMI 3.0).
//!
//! # Safety
//! The importer guarantees the contract of the [module above](super#safety).

use super::types::*;
use crate::boundary::{out_value, output_derivatives};
use crate::export::Exported;
use crate::instance::{FromOne, Instance, Outcome};

pub unsafe fn fmi3EnterStepMode<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.enter_step_mode();
    Ok(())
}

pub unsafe fn fmi3GetOutputDerivatives<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi3ValueReference,
    count: usize,
    order: *const fmi3Int32,
    value: *mut fmi3Float64,
    value_count: usize,
) -> Outcome {
    // SAFETY: by contract, the pointers are NULL or point to arrays of these lengths; the array of results does not
    // overlap the others.
    unsafe { output_derivatives::<M, FromOne>(instance, vr, count, (order, "orders"), value, value_count) }
}

#[inline]
pub unsafe fn fmi3DoStep<M: Exported>(
    instance: &mut Instance<M>,
    current_communication_point: fmi3Float64,
    communication_step_size: fmi3Float64,
    _no_set_fmu_state_prior_to_current_point: fmi3Boolean,
    event_handling_needed: *mut fmi3Boolean,
    terminate_simulation: *mut fmi3Boolean,
    early_return: *mut fmi3Boolean,
    last_successful_time: *mut fmi3Float64,
) -> Outcome {
    // SAFETY: by contract, each is NULL or points to a value.
    let (event_handling_needed, terminate_simulation, early_return, last_successful_time) = unsafe {
        (
            out_value(event_handling_needed, "eventHandlingNeeded")?,
            out_value(terminate_simulation, "terminateSimulation")?,
            out_value(early_return, "earlyReturn")?,
            out_value(last_successful_time, "lastSuccessfulTime")?,
        )
    };
    let reached = instance.do_step_to(current_communication_point, communication_step_size)?;
    event_handling_needed.write(reached.event.into());
    terminate_simulation.write(reached.terminate.into());
    early_return.write(reached.early.into());
    last_successful_time.write(reached.time);
    Ok(())
}

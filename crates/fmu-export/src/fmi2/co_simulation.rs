//! Co-Simulation (section 4.2 of FMI 2.0).
//!
//! # Safety
//! The importer guarantees the contract of the [module above](super#safety).

use super::types::*;
use crate::boundary::{in_slice, out_value, output_derivatives};
use crate::export::Exported;
use crate::instance::{Instance, Outcome, discard, reject};

pub unsafe fn fmi2SetRealInputDerivatives<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi2ValueReference,
    count: usize,
    order: *const fmi2Integer,
    value: *const fmi2Real,
) -> Outcome {
    // SAFETY: by contract, the pointers are NULL or point to arrays of this length.
    let (vr, order, value) = unsafe {
        (in_slice(vr, count, "vr")?, in_slice(order, count, "order")?, in_slice(value, count, "value")?)
    };
    instance.set_input_derivatives(vr, order, value)
}

pub unsafe fn fmi2GetRealOutputDerivatives<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi2ValueReference,
    count: usize,
    order: *const fmi2Integer,
    value: *mut fmi2Real,
) -> Outcome {
    // SAFETY: by contract, the pointers are NULL or point to arrays of this length; the array of results does not
    // overlap the others.
    unsafe {
        output_derivatives::<M, fmi2ValueReference>(instance, vr, count, (order, "order"), value, count)
    }
}

#[inline]
pub unsafe fn fmi2DoStep<M: Exported>(
    instance: &mut Instance<M>,
    current_communication_point: fmi2Real,
    communication_step_size: fmi2Real,
    _no_set_fmu_state_prior_to_current_point: fmi2Boolean,
) -> Outcome {
    instance.do_step(current_communication_point, communication_step_size)
}

/// Does nothing. Because steps are synchronous, there is never a step to cancel, and the table of allowed calls
/// permits this function in no state.
pub unsafe fn fmi2CancelStep<M: Exported>(_: &mut Instance<M>) -> Outcome {
    Ok(())
}

/// Returns the kind of status with this number, or an error if there is none.
fn status_kind(kind: fmi2StatusKind) -> Outcome<StatusKind> {
    StatusKind::from_c(kind).map_or_else(|| reject(format!("there is no fmi2StatusKind {kind}")), Ok)
}

/// Returns the status Discard for a query that concerns only asynchronous steps, or for which another function exists.
fn no_status(kind: StatusKind) -> Outcome {
    discard(match kind {
        StatusKind::DoStepStatus | StatusKind::PendingStatus => {
            "no step is pending: fmi2DoStep works synchronously"
        }
        StatusKind::LastSuccessfulTime => "fmi2LastSuccessfulTime is a Real: call fmi2GetRealStatus",
        StatusKind::Terminated => "fmi2Terminated is a Boolean: call fmi2GetBooleanStatus",
    })
}

pub unsafe fn fmi2GetRealStatus<M: Exported>(
    instance: &mut Instance<M>,
    kind: fmi2StatusKind,
    value: *mut fmi2Real,
) -> Outcome {
    match status_kind(kind)? {
        StatusKind::LastSuccessfulTime => {
            // SAFETY: by contract, the pointer is NULL or points to a value.
            unsafe { out_value(value, "value") }?.write(instance.last_successful_time());
            Ok(())
        }
        other => no_status(other),
    }
}

pub unsafe fn fmi2GetBooleanStatus<M: Exported>(
    instance: &mut Instance<M>,
    kind: fmi2StatusKind,
    value: *mut fmi2Boolean,
) -> Outcome {
    match status_kind(kind)? {
        StatusKind::Terminated => {
            // SAFETY: by contract, the pointer is NULL or points to a value.
            unsafe { out_value(value, "value") }?.write(instance.has_ended().into());
            Ok(())
        }
        other => no_status(other),
    }
}

/// Defines the functions that have no status to return, because all their queries concern asynchronous steps.
macro_rules! without_status {
    ($($function:ident $value:ty;)+) => {
        $(
            pub unsafe fn $function<M: Exported>(_: &mut Instance<M>, kind: fmi2StatusKind, _: *mut $value) -> Outcome {
                no_status(status_kind(kind)?)
            }
        )+
    };
}

without_status! {
    fmi2GetStatus fmi2Status;
    fmi2GetIntegerStatus fmi2Integer;
    fmi2GetStringStatus fmi2String;
}

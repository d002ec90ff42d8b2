//! The functions of Co-Simulation (section 4.2).

use super::*;

/// `fmi2SetRealInputDerivatives`
pub unsafe fn fmi2SetRealInputDerivatives<M: Model>(
    c: fmi2Component,
    vr: *const fmi2ValueReference,
    count: usize,
    order: *const fmi2Integer,
    value: *const fmi2Real,
) -> Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: by contract arrays of this length.
        let (vr, order, value) = unsafe {
            (slice(vr, count, "vr")?, slice(order, count, "order")?, slice(value, count, "value")?)
        };
        instance.set_input_derivatives(vr, order, value)
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::SetRealInputDerivatives, body) }
}

/// `fmi2GetRealOutputDerivatives`
pub unsafe fn fmi2GetRealOutputDerivatives<M: Model>(
    c: fmi2Component,
    vr: *const fmi2ValueReference,
    count: usize,
    order: *const fmi2Integer,
    value: *mut fmi2Real,
) -> Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: by contract arrays of this length; the written one does not overlap the others.
        let (vr, order, value) = unsafe {
            (slice(vr, count, "vr")?, slice(order, count, "order")?, slice_mut(value, count, "value")?)
        };
        instance.get_output_derivatives(vr, order, value)
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::GetRealOutputDerivatives, body) }
}

/// `fmi2DoStep`
pub unsafe fn fmi2DoStep<M: Model>(
    c: fmi2Component,
    current_communication_point: fmi2Real,
    communication_step_size: fmi2Real,
    _no_set_fmu_state_prior_to_current_point: fmi2Boolean,
) -> Status {
    let body =
        |instance: &mut Instance<M>| instance.do_step(current_communication_point, communication_step_size);
    // SAFETY: the module's contract.
    unsafe { call(c, Function::DoStep, body) }
}

/// `fmi2CancelStep`. Steps are synchronous, so there is never one to cancel.
pub unsafe fn fmi2CancelStep<M: Model>(c: fmi2Component) -> Status {
    // SAFETY: the module's contract.
    unsafe { call(c, Function::CancelStep, |_: &mut Instance<M>| Ok(())) }
}

fn status_kind(kind: fmi2StatusKind) -> Outcome<StatusKind> {
    StatusKind::from_c(kind).ok_or(()).or_else(|()| refuse(format!("there is no fmi2StatusKind {kind}")))
}

/// `fmi2GetRealStatus`
pub unsafe fn fmi2GetRealStatus<M: Model>(
    c: fmi2Component,
    kind: fmi2StatusKind,
    value: *mut fmi2Real,
) -> Status {
    let body = |instance: &mut Instance<M>| match status_kind(kind)? {
        // SAFETY: by contract NULL or a pointer to a value.
        StatusKind::LastSuccessfulTime => unsafe { write(value, instance.last_successful_time(), "value") },
        other => instance.no_status(other),
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::GetRealStatus, body) }
}

/// `fmi2GetBooleanStatus`
pub unsafe fn fmi2GetBooleanStatus<M: Model>(
    c: fmi2Component,
    kind: fmi2StatusKind,
    value: *mut fmi2Boolean,
) -> Status {
    let body = |instance: &mut Instance<M>| match status_kind(kind)? {
        // SAFETY: by contract NULL or a pointer to a value.
        StatusKind::Terminated => unsafe { write(value, fmi2False, "value") },
        other => instance.no_status(other),
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::GetBooleanStatus, body) }
}

/// Defines the status functions that have no information to give.
macro_rules! no_status {
    ($($name:ident $function:ident $type:ty;)+) => {
        $(
            #[doc = concat!("`", stringify!($name), "`. Answers `fmi2Discard`: it belongs to asynchronous steps.")]
            pub unsafe fn $name<M: Model>(c: fmi2Component, kind: fmi2StatusKind, _value: *mut $type) -> Status {
                let body = |instance: &mut Instance<M>| instance.no_status(status_kind(kind)?);
                // SAFETY: the module's contract.
                unsafe { call(c, Function::$function, body) }
            }
        )+
    };
}

no_status! {
    fmi2GetStatus GetStatus Status;
    fmi2GetIntegerStatus GetIntegerStatus fmi2Integer;
    fmi2GetStringStatus GetStringStatus fmi2String;
}

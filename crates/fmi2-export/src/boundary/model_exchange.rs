//! The functions of Model Exchange (section 3.2).

use super::*;

/// `fmi2EnterEventMode`
pub unsafe fn fmi2EnterEventMode<M: Model>(c: fmi2Component) -> Status {
    let body = |instance: &mut Instance<M>| {
        instance.enter_event_mode();
        Ok(())
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::EnterEventMode, body) }
}

/// `fmi2NewDiscreteStates`. The models here have no events: everything is settled at once.
pub unsafe fn fmi2NewDiscreteStates<M: Model>(c: fmi2Component, info: *mut fmi2EventInfo) -> Status {
    // SAFETY: by contract NULL or a pointer to an event information.
    let body = |_: &mut Instance<M>| unsafe { write(info, fmi2EventInfo::default(), "fmi2eventInfo") };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::NewDiscreteStates, body) }
}

/// `fmi2EnterContinuousTimeMode`
pub unsafe fn fmi2EnterContinuousTimeMode<M: Model>(c: fmi2Component) -> Status {
    let body = |instance: &mut Instance<M>| {
        instance.enter_continuous_time_mode();
        Ok(())
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::EnterContinuousTimeMode, body) }
}

/// `fmi2CompletedIntegratorStep`. No step leads to an event.
pub unsafe fn fmi2CompletedIntegratorStep<M: Model>(
    c: fmi2Component,
    _no_set_fmu_state_prior_to_current_point: fmi2Boolean,
    enter_event_mode: *mut fmi2Boolean,
    terminate_simulation: *mut fmi2Boolean,
) -> Status {
    let body = |_: &mut Instance<M>| {
        // SAFETY: by contract each NULL or a pointer to a value.
        let flags = unsafe {
            [
                slice_mut(enter_event_mode, 1, "enterEventMode")?,
                slice_mut(terminate_simulation, 1, "terminateSimulation")?,
            ]
        };
        for flag in flags {
            flag[0] = fmi2False;
        }
        Ok(())
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::CompletedIntegratorStep, body) }
}

/// `fmi2SetTime`
pub unsafe fn fmi2SetTime<M: Model>(c: fmi2Component, time: fmi2Real) -> Status {
    // SAFETY: the module's contract.
    unsafe { call(c, Function::SetTime, |instance: &mut Instance<M>| instance.set_time(time)) }
}

/// `fmi2SetContinuousStates`
pub unsafe fn fmi2SetContinuousStates<M: Model>(
    c: fmi2Component,
    x: *const fmi2Real,
    count: usize,
) -> Status {
    let body = |instance: &mut Instance<M>| {
        // SAFETY: by contract an array of this length.
        instance.set_continuous_states(unsafe { slice(x, count, "x") }?)
    };
    // SAFETY: the module's contract.
    unsafe { call(c, Function::SetContinuousStates, body) }
}

/// `fmi2GetEventIndicators`. There are none.
pub unsafe fn fmi2GetEventIndicators<M: Model>(
    c: fmi2Component,
    _event_indicators: *mut fmi2Real,
    count: usize,
) -> Status {
    let body = |instance: &mut Instance<M>| instance.get_event_indicators(count);
    // SAFETY: the module's contract.
    unsafe { call(c, Function::GetEventIndicators, body) }
}

/// Defines the functions that fill an array with one value per continuous state.
macro_rules! per_state {
    ($($name:ident $function:ident $method:ident;)+) => {
        $(
            #[doc = concat!("`", stringify!($name), "`")]
            pub unsafe fn $name<M: Model>(c: fmi2Component, values: *mut fmi2Real, count: usize) -> Status {
                let body = |instance: &mut Instance<M>| {
                    // SAFETY: by contract an array of this length.
                    instance.$method(unsafe { slice_mut(values, count, "values") }?)
                };
                // SAFETY: the module's contract.
                unsafe { call(c, Function::$function, body) }
            }
        )+
    };
}

per_state! {
    fmi2GetDerivatives GetDerivatives get_derivatives;
    fmi2GetContinuousStates GetContinuousStates get_continuous_states;
    fmi2GetNominalsOfContinuousStates GetNominalsOfContinuousStates get_nominals;
}

//! The code that all calls on an instance share.

use super::ImporterLog;
use crate::export::Exported;
use crate::instance::{Instance, Outcome, Rejection};
use fmi_abi::Rule;
use fmi_abi::Status;
use fmi_abi::c_types::c_void;
use fmi_abi::{AllowedStates, Mode};
use std::any::Any;
use std::cell::{Cell, UnsafeCell};
use std::panic::{AssertUnwindSafe, catch_unwind};

// WebAssembly is excepted, because a panic there traps, and a trap ends the call but not the process.
#[cfg(all(panic = "abort", not(target_family = "wasm")))]
compile_error!("an FMU must not end the importer's process: build with panic = \"unwind\"");

/// The object to which the importer's instance pointer points.
///
/// Many processors fetch cache lines of 64 bytes in pairs. The alignment puts adjacent instances into separate pairs,
/// so that two threads that step them do not slow each other down.
#[repr(align(128))]
pub(crate) struct Component<M> {
    /// Whether the importer's log callback is running. The callback must not call the instance, so the state of the
    /// instance forbids all calls during this time.
    pub delivering: Cell<bool>,
    pub instance: UnsafeCell<Instance<M>>,
    pub importer: ImporterLog,
}

/// Runs a function's body on the instance of `c`, if the table of allowed calls permits the call, and returns the
/// status.
///
/// # Safety
/// `c` meets the contract of [`fmi2`](crate::fmi2#safety) or [`fmi3`](crate::fmi3#safety).
#[inline(always)]
pub(crate) unsafe fn call<M: Exported>(
    c: *mut c_void,
    rule: &'static Rule,
    body: impl FnOnce(&mut Instance<M>) -> Outcome,
) -> Status {
    // SAFETY: by contract, `c` is NULL or a live component of this model. The reference is shared, because the log
    // callback of a running call may also call this function.
    let Some(component) = (unsafe { c.cast::<Component<M>>().as_ref() }) else {
        return Status::Error;
    };
    // SAFETY: by contract, no other thread uses the component. On this thread, no other reference to the instance is
    // in use, because bodies never call the importer, and `finish` uses none while it delivers messages. The last use
    // of this reference is before any delivery.
    let instance = unsafe { &mut *component.instance.get() };
    if !instance.fmi_state().is_in(rule.accepted()) {
        return not_allowed(component, rule);
    }
    let ended = catch_unwind(AssertUnwindSafe(|| {
        let outcome = body(instance);
        instance.listen();
        outcome
    }));
    match ended {
        Ok(Ok(())) if instance.logger.is_empty() => Status::Ok,
        other => finish(component, rule.name, other),
    }
}

/// Runs the fast path of a call, if the table of allowed calls permits the call, and returns the status. Returns
/// `None` if the caller must use the general path.
///
/// # Safety
/// Same as for [`call`].
#[inline(always)]
pub(crate) unsafe fn call_fast<M: Exported>(
    c: *mut c_void,
    rule: &'static Rule,
    fast_path: impl FnOnce(*mut Instance<M>) -> bool,
) -> Option<Status> {
    // SAFETY: as in `call`.
    let component = unsafe { c.cast::<Component<M>>().as_ref() }?;
    let instance = component.instance.get();
    // SAFETY: as in `call`.
    if !unsafe { &*instance }.fmi_state().is_in(rule.accepted()) {
        return None;
    }
    // The fast path takes a pointer. With a reference, the compiler might read several values with one instruction,
    // which makes the processor stall if one of them was written just before.
    //
    // SAFETY: as in `call`.
    let body = || fast_path(instance).then(|| unsafe { &mut *instance }.listen());
    match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Some(false)) => Some(Status::Ok),
        Ok(None) => None,
        Ok(Some(true)) => Some(finish(component, rule.name, Ok(Ok(())))),
        Err(panic) => Some(finish(component, rule.name, Err(panic))),
    }
}

/// Rejects a call that the table of allowed calls forbids. A call from within the log callback also returns an error,
/// but without a message.
#[cold]
#[inline(never)]
fn not_allowed<M: Exported>(component: &Component<M>, rule: &'static Rule) -> Status {
    if component.delivering.get() {
        return Status::Error;
    }
    let rejection = catch_unwind(AssertUnwindSafe(|| {
        // SAFETY: as in `call`, which no longer uses its reference.
        reject_call(unsafe { &*component.instance.get() }, rule.accepted())
    }));
    finish(component, rule.name, rejection)
}

fn reject_call<M: Exported>(instance: &Instance<M>, accepted: AllowedStates) -> Outcome {
    let (interface, mode) = (instance.interface(), instance.mode());
    let allowed = accepted.names(instance.standard(), interface);
    let message = format!("not allowed in state '{mode}' of {interface}; allowed in: {allowed}");
    let status = if mode == Mode::Fatal { Status::Fatal } else { Status::Error };
    Err(Box::new(Rejection { status, message }))
}

/// How a body ended: with an outcome, or with a panic and its payload.
type Ended = Result<Outcome, Box<dyn Any + Send>>;

/// Ends a call that has messages, an error or a panic: delivers the messages and returns the status.
#[cold]
#[inline(never)]
pub(super) fn finish<M: Exported>(component: &Component<M>, name: &str, ended: Ended) -> Status {
    let status = match &ended {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(rejection)) => rejection.status,
        Err(_) => Status::Fatal,
    };
    let deliver = || {
        let messages = {
            // SAFETY: as in `call`, no other reference to the instance is in use. The last use of this reference is
            // before the first delivery.
            let instance = unsafe { &mut *component.instance.get() };
            match &ended {
                Ok(Ok(())) => {}
                Ok(Err(rejection)) => instance.logger.log(status, format!("{name}: {}", rejection.message)),
                Err(panic) => {
                    instance.break_down();
                    instance.logger.log(
                        status,
                        format!(
                            "{name}: internal failure ({}); free this instance, others are not affected",
                            panic_message(&**panic)
                        ),
                    );
                }
            }
            instance.while_delivering(true);
            instance.logger.take()
        };
        component.delivering.set(true);
        messages.iter().for_each(|message| component.importer.deliver(message));
        component.delivering.set(false);
        // SAFETY: as above. The deliveries have ended.
        unsafe { &mut *component.instance.get() }.while_delivering(false);
    };
    forget_panic(catch_unwind(AssertUnwindSafe(deliver)));
    if let Err(panic) = ended {
        forget_panic(Err(panic));
    }
    status
}

/// Drops the payload of a panic, if there is one. If dropping it panics as well, leaks the second payload.
pub(crate) fn forget_panic(ended: Result<(), Box<dyn Any + Send>>) {
    if let Err(panic) = ended
        && let Err(second) = catch_unwind(AssertUnwindSafe(|| drop(panic)))
    {
        std::mem::forget(second);
    }
}

pub(crate) fn panic_message(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}

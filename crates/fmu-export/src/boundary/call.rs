//! The code that all calls on an instance share.

use super::{Gate, ImporterLog};
use crate::export::Exported;
use crate::instance::{Instance, Outcome, Rejection};
use crate::log::Message;
use fmi_abi::Rule;
use fmi_abi::Status;
use fmi_abi::c_types::c_void;
use fmi_abi::{AllowedStates, FmiState, Mode};
use std::any::Any;
use std::cell::UnsafeCell;
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
    /// Closed while a call uses the instance, and while its messages are delivered.
    pub gate: Gate,
    pub instance: UnsafeCell<Instance<M>>,
    pub importer: ImporterLog,
}

impl<M> Component<M> {
    pub fn new(instance: Instance<M>, importer: ImporterLog) -> Self
    where
        M: Exported,
    {
        Self { gate: Gate::new(instance.fmi_state()), instance: UnsafeCell::new(instance), importer }
    }

    fn deliver(&self, messages: &[Message]) {
        self.gate.set_delivering(true);
        messages.iter().for_each(|message| self.importer.deliver(message));
        self.gate.set_delivering(false);
    }
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
    let state = component.gate.close();
    if !state.is_in(rule.accepted()) {
        return not_allowed(component, rule, state);
    }
    // SAFETY: this call has closed the gate, so no other call uses the instance. The last use of this reference is before
    // any delivery.
    let instance = unsafe { &mut *component.instance.get() };
    let ended = catch_unwind(AssertUnwindSafe(|| {
        let outcome = body(instance);
        instance.listen();
        outcome
    }));
    match ended {
        Ok(Ok(())) if instance.logger.is_empty() => {
            component.gate.open(instance.fmi_state());
            Status::Ok
        }
        other => finish(component, rule.name, other),
    }
}

/// Runs the fast path of a call, if the table of allowed calls permits the call, and returns the status. Returns
/// `None` if the caller must use the general path. `STEPS` is false if the fast path only gets or sets Reals and calls no
/// function of the model.
///
/// # Safety
/// Same as for [`call`]. In addition, two threads do not use the component at the same time, because the gate recognizes
/// only most of such calls.
#[inline(always)]
pub(crate) unsafe fn call_fast<M: Exported, const STEPS: bool>(
    c: *mut c_void,
    rule: &'static Rule,
    fast_path: impl FnOnce(*mut Instance<M>) -> bool,
) -> Option<Status> {
    // SAFETY: as in `call`.
    let component = unsafe { c.cast::<Component<M>>().as_ref() }?;
    let gate = &component.gate;
    if !gate.is_open(rule.accepted()) || STEPS && !gate.begin_step() {
        return None;
    }
    let instance = component.instance.get();
    // The fast path takes a pointer. With a reference, the compiler might read several values with one instruction,
    // which makes the processor stall if one of them was written just before.
    //
    // SAFETY: by contract, no other thread uses the component, and no other call on this thread, because the gate was
    // open.
    let body = || fast_path(instance).then(|| STEPS && unsafe { &mut *instance }.listen());
    let ended = catch_unwind(AssertUnwindSafe(body));
    if STEPS {
        gate.end_step();
    }
    match ended {
        Ok(Some(false)) => Some(Status::Ok),
        Ok(None) => None,
        Ok(Some(true)) => Some(finish_fast(component, rule, Ok(Ok(())))),
        Err(panic) => Some(finish_fast(component, rule, Err(panic))),
    }
}

/// Ends a fast path that has messages or a panic. From here on the call excludes others like one in the general path.
#[cold]
#[inline(never)]
fn finish_fast<M: Exported>(component: &Component<M>, rule: &'static Rule, ended: Ended) -> Status {
    match component.gate.close() {
        FmiState::NONE => reject_overlap(component, rule.name),
        _ => finish(component, rule.name, ended),
    }
}

/// Rejects a call that the table of allowed calls forbids in `state`, or that overlaps another call.
#[cold]
#[inline(never)]
fn not_allowed<M: Exported>(component: &Component<M>, rule: &'static Rule, state: FmiState) -> Status {
    if state == FmiState::NONE {
        return reject_overlap(component, rule.name);
    }
    let rejection = catch_unwind(AssertUnwindSafe(|| {
        // SAFETY: as in `call`.
        reject_call(unsafe { &*component.instance.get() }, rule.accepted())
    }));
    finish(component, rule.name, rejection)
}

/// Rejects a call while another call runs. A call from the log callback gets no message, because a callback that calls
/// the FMU for each message would not end. The message for a call from another thread is delivered on that thread, so
/// it does not wait for the other call, and is independent of the categories that the importer has enabled.
#[cold]
#[inline(never)]
pub(super) fn reject_overlap<M>(component: &Component<M>, name: &str) -> Status {
    if !component.gate.is_delivering() {
        let message = format!(
            "{name}: another thread is calling this instance; make the calls on an instance one after another"
        );
        let message = Message { status: Status::Error, message };
        forget_panic(catch_unwind(AssertUnwindSafe(|| component.deliver(&[message]))));
    }
    Status::Error
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

/// Ends a call that has closed the gate and has messages, an error or a panic: delivers the messages, opens the gate and
/// returns the status.
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
            // SAFETY: as in `call`.
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
            instance.logger.take()
        };
        component.deliver(&messages);
    };
    forget_panic(catch_unwind(AssertUnwindSafe(deliver)));
    if let Err(panic) = ended {
        forget_panic(Err(panic));
    }
    // SAFETY: as in `call`. The deliveries have ended.
    component.gate.open(unsafe { &*component.instance.get() }.fmi_state());
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

//! What every call on an instance has in common.

use super::ImporterLog;
use crate::export::Exported;
use crate::instance::{Instance, Outcome, Refusal};
use fmi_abi::Rule;
use fmi_abi::Status;
use fmi_abi::c_types::c_void;
use fmi_abi::{Mode, Situations};
use std::any::Any;
use std::cell::{Cell, UnsafeCell};
use std::panic::{AssertUnwindSafe, catch_unwind};

// WebAssembly traps instead, which ends the call and not the process.
#[cfg(all(panic = "abort", not(target_family = "wasm")))]
compile_error!("an FMU must not end the importer's process: build with panic = \"unwind\"");

/// What a component points to.
///
/// Processors fetch cache lines of 64 bytes in pairs: instances side by side on the heap share none, so that
/// threads that step them do not take them from each other.
#[repr(align(128))]
pub(crate) struct Component<M> {
    /// Whether the importer's log callback is running: it must not call back. The instance's situation says so, too.
    pub delivering: Cell<bool>,
    pub instance: UnsafeCell<Instance<M>>,
    pub importer: ImporterLog,
}

/// Runs a function's body on the instance behind `c` if the table of allowed calls has it.
///
/// # Safety
/// `c` as in the contract of the standard's module.
#[inline(always)]
pub(crate) unsafe fn call<M: Exported>(
    c: *mut c_void,
    rule: &'static Rule,
    body: impl FnOnce(&mut Instance<M>) -> Outcome,
) -> Status {
    // SAFETY: by contract NULL or a living component of this model. Shared, because the log callback of a call that
    // is not over may come here, too.
    let Some(component) = (unsafe { c.cast::<Component<M>>().as_ref() }) else {
        return Status::Error;
    };
    // SAFETY: by contract no other thread is here, and no call on this thread: none is running a body, because bodies
    // call nothing of the importer's, and none is delivering. The reference ends with this function's use of it, before
    // anything is delivered.
    let instance = unsafe { &mut *component.instance.get() };
    if !instance.situation().is_in(rule.accepted()) {
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

/// Goes the short way of a call if the table of allowed calls has it. `None` if the long way must be gone.
///
/// # Safety
/// As above.
#[inline(always)]
pub(crate) unsafe fn call_at_once<M: Exported>(
    c: *mut c_void,
    rule: &'static Rule,
    way: impl FnOnce(*mut Instance<M>) -> bool,
) -> Option<Status> {
    // SAFETY: as above.
    let component = unsafe { c.cast::<Component<M>>().as_ref() }?;
    let instance = component.instance.get();
    // SAFETY: as above.
    if !unsafe { &*instance }.situation().is_in(rule.accepted()) {
        return None;
    }
    // The way takes a pointer. Behind a reference the compiler may read more than one value at once, and the processor
    // has to wait if one of them was written right before.
    //
    // SAFETY: as above.
    let walk = || way(instance).then(|| unsafe { &mut *instance }.listen());
    match catch_unwind(AssertUnwindSafe(walk)) {
        Ok(Some(false)) => Some(Status::Ok),
        Ok(None) => None,
        Ok(Some(true)) => Some(finish(component, rule.name, Ok(Ok(())))),
        Err(panic) => Some(finish(component, rule.name, Err(panic))),
    }
}

/// A call that is not in the table of allowed calls, or comes out of the log callback: an error without a message.
#[cold]
#[inline(never)]
fn not_allowed<M: Exported>(component: &Component<M>, rule: &'static Rule) -> Status {
    if component.delivering.get() {
        return Status::Error;
    }
    let refusal = catch_unwind(AssertUnwindSafe(|| {
        // SAFETY: as in `call`, which has no use for its reference any more.
        refuse_call(unsafe { &*component.instance.get() }, rule.accepted())
    }));
    finish(component, rule.name, refusal)
}

fn refuse_call<M: Exported>(instance: &Instance<M>, accepted: Situations) -> Outcome {
    let (interface, mode) = (instance.interface(), instance.mode());
    let allowed = accepted.names(instance.standard(), interface);
    let message = format!("not allowed in state '{mode}' of {interface}; allowed in: {allowed}");
    let status = if mode == Mode::Fatal { Status::Fatal } else { Status::Error };
    Err(Box::new(Refusal { status, message }))
}

/// What became of a body: the refusal or the panic that it ended with.
type Ended = Result<Outcome, Box<dyn Any + Send>>;

/// The end of a call that is not simply OK: says what there is to say.
#[cold]
#[inline(never)]
pub(super) fn finish<M: Exported>(component: &Component<M>, name: &str, ended: Ended) -> Status {
    let status = match &ended {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(refusal)) => refusal.status,
        Err(_) => Status::Fatal,
    };
    let deliver = || {
        let messages = {
            // SAFETY: as in `call`: nobody else has a reference to the instance, and this one ends before the first
            // message is delivered.
            let instance = unsafe { &mut *component.instance.get() };
            match &ended {
                Ok(Ok(())) => {}
                Ok(Err(refusal)) => instance.logger.log(status, format!("{name}: {}", refusal.message)),
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
        // SAFETY: as above: what was called back is over.
        unsafe { &mut *component.instance.get() }.while_delivering(false);
    };
    forget_panic(catch_unwind(AssertUnwindSafe(deliver)));
    if let Err(panic) = ended {
        forget_panic(Err(panic));
    }
    status
}

/// Drops what a panic carries. If that panics as well, what the second one carries is left to itself.
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

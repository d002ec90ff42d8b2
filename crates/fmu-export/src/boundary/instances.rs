//! Making and freeing instances.

use super::{Component, ImporterLog, forget_panic, panic_message};
use crate::export::Exported;
use crate::instance::{Importer, Instance, Outcome, refuse};
use crate::log::{Logger, Message};
use crate::model::Setup;
use fmi_abi::Status;
use fmi_abi::c_types::c_void;
use fmi_abi::{Interface, Standard};
use std::cell::{Cell, UnsafeCell};
use std::ffi::CStr;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// What importers pass to make an instance, whatever the standard.
pub(crate) struct Arguments<'a> {
    pub name: Option<&'a CStr>,
    /// The guid, or instantiation token.
    pub guid: Option<&'a CStr>,
    pub resources: Option<&'a CStr>,
    pub logging_on: bool,
    /// What follows from the other arguments, or why it cannot be.
    pub interface: Outcome<Interface>,
    pub importer: Importer,
}

/// Makes an instance, or says why not and gives NULL. The importer owns the result until it frees it.
pub(crate) fn instantiate<M: Exported>(
    function: &str,
    log: impl FnOnce() -> ImporterLog,
    arguments: Arguments,
) -> *mut c_void {
    #[cfg(target_family = "wasm")]
    super::webassembly::keep_panics();
    let make = || {
        let (importer, standard) = (log(), arguments.importer.standard);
        let refusal = match catch_unwind(AssertUnwindSafe(|| make_instance::<M>(arguments))) {
            Ok(Ok(mut instance)) => {
                instance.logger.take().iter().for_each(|message| importer.deliver(message));
                let instance = UnsafeCell::new(instance);
                return Some(Box::new(Component { delivering: Cell::new(false), instance, importer }));
            }
            Ok(Err(refusal)) => refusal.message,
            Err(panic) => {
                let message = format!("internal failure ({})", panic_message(&*panic));
                forget_panic(Err(panic));
                message
            }
        };
        let mut logger = Logger::new(standard, false);
        logger.add(Message { status: Status::Error, text: format!("{function}: {refusal}") });
        logger.take().iter().for_each(|message| importer.deliver(message));
        None
    };
    match catch_unwind(AssertUnwindSafe(make)) {
        Ok(Some(component)) => Box::into_raw(component).cast(),
        Ok(None) => std::ptr::null_mut(),
        Err(panic) => {
            forget_panic(Err(panic));
            std::ptr::null_mut()
        }
    }
}

fn make_instance<M: Exported>(arguments: Arguments) -> Outcome<Instance<M>> {
    let Arguments { name, guid, resources, logging_on, interface, importer } = arguments;
    let Some(name) = name.filter(|name| !name.to_bytes().trim_ascii().is_empty()) else {
        return refuse("the instance needs a name");
    };
    let own = M::INFO.guid;
    if guid.map(CStr::to_bytes) != Some(own.as_bytes()) {
        let what = match importer.standard {
            Standard::Fmi2 => "guid",
            Standard::Fmi3 => "instantiationToken",
        };
        return refuse(format!(
            "the {what} {} is not this library's {own}: modelDescription.xml and library come from different FMUs",
            guid.map_or("NULL".into(), CStr::to_string_lossy),
        ));
    }
    let text = |text: &CStr| text.to_string_lossy().into_owned();
    let setup =
        Setup { interface: interface?, instance_name: text(name), resource_location: resources.map(text) };
    Instance::new(setup, importer, logging_on)
}

/// Takes the instance back; NULL is ignored, and so is a call out of the log callback.
///
/// # Safety
/// NULL or an instance of this model that is not freed.
pub(crate) unsafe fn free<M: Exported>(c: *mut c_void) {
    let component = c.cast::<Component<M>>();
    // SAFETY: by contract NULL or a living component of this model.
    if unsafe { component.as_ref() }.is_none_or(|component| component.delivering.get()) {
        return;
    }
    // SAFETY: by contract from `instantiate`, which gave the box away, and not freed before.
    let mut component = unsafe { Box::from_raw(component) };
    // One at a time: a second panic on the way out of a first would end the process.
    while let Some(model) = component.instance.get_mut().give_any() {
        forget_panic(catch_unwind(AssertUnwindSafe(|| drop(model))));
    }
    forget_panic(catch_unwind(AssertUnwindSafe(|| drop(component))));
}

//! Creation and release of instances.

use super::call::reject_overlap;
use super::{Component, ImporterLog, forget_panic, panic_message};
use crate::export::Exported;
use crate::instance::{Importer, Instance, Outcome, reject};
use crate::log::{Logger, Message};
use crate::memory::reserve_box;
use crate::model::Setup;
use crate::stamp::stamp;
use fmi_abi::Status;
use fmi_abi::c_types::c_void;
use fmi_abi::{FmiState, Interface, Standard};
use std::ffi::CStr;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Arguments that an importer passes for a new instance, in either FMI version.
pub(crate) struct Arguments<'a> {
    pub name: Option<&'a CStr>,
    /// The guid (FMI 2.0) or the instantiation token (FMI 3.0).
    pub guid: Option<&'a CStr>,
    pub resources: Option<&'a CStr>,
    pub logging_on: bool,
    /// Interface type, or the reason why the importer's arguments are invalid.
    pub interface: Outcome<Interface>,
    pub importer: Importer,
}

/// Creates an instance, or logs the reason for a failure and returns NULL. The importer owns the instance until it
/// frees it.
pub(crate) fn instantiate<M: Exported>(
    function: &str,
    log: impl FnOnce() -> ImporterLog,
    arguments: Arguments,
) -> *mut c_void {
    #[cfg(target_family = "wasm")]
    super::webassembly::keep_panics();
    let make = || {
        let (importer, standard) = (log(), arguments.importer.standard);
        let memory = reserve_box();
        let rejection = match catch_unwind(AssertUnwindSafe(|| make_instance::<M>(arguments))) {
            Ok(Ok(mut instance)) => match memory {
                Ok(memory) => {
                    instance.logger.take().iter().for_each(|message| importer.deliver(message));
                    return Some(memory.fill(Component::new(instance, importer)));
                }
                Err(error) => error.to_string(),
            },
            Ok(Err(rejection)) => rejection.message,
            Err(panic) => {
                let message = format!("internal failure ({})", panic_message(&*panic));
                forget_panic(Err(panic));
                message
            }
        };
        let mut logger = Logger::new(standard, false);
        logger.add(Message { status: Status::Error, message: format!("{function}: {rejection}") });
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
    let Arguments { name, guid: wanted, resources, logging_on, interface, importer } = arguments;
    let Some(name) = name.filter(|name| !name.to_bytes().trim_ascii().is_empty()) else {
        return reject("the instance needs a name");
    };
    let own = stamp::<M>();
    if wanted.map(CStr::to_bytes) != Some(own.guid_bytes()) {
        let what = match importer.standard {
            Standard::Fmi2 => "guid",
            Standard::Fmi3 => "instantiationToken",
        };
        return reject(format!(
            "the {what} {} is not this library's {}: modelDescription.xml and library come from different FMUs",
            wanted.map_or("NULL".into(), CStr::to_string_lossy),
            own.guid(),
        ));
    }
    let string = |string: &CStr| string.to_string_lossy().into_owned();
    let setup = Setup {
        interface: interface?,
        instance_name: string(name),
        resource_location: resources.map(string),
    };
    Instance::new(setup, importer, logging_on)
}

/// Frees an instance. Ignores NULL, and an instance that another call uses: the caller may be the log callback or another
/// thread.
///
/// # Safety
/// `c` is NULL or an instance of this model that has not been freed.
pub(crate) unsafe fn free<M: Exported>(function: &str, c: *mut c_void) {
    let component = c.cast::<Component<M>>();
    // SAFETY: by contract, `c` is NULL or a live component of this model.
    let Some(shared) = (unsafe { component.as_ref() }) else { return };
    if shared.gate.close() == FmiState::NONE {
        reject_overlap(shared, function);
        return;
    }
    // SAFETY: by contract, the pointer comes from `instantiate`, which leaked the box, and has not been
    // freed.
    let mut component = unsafe { Box::from_raw(component) };
    // Drops one model at a time, because a second panic while the first one unwinds would abort the process.
    while let Some(model) = component.instance.get_mut().remove_any() {
        forget_panic(catch_unwind(AssertUnwindSafe(|| drop(model))));
    }
    forget_panic(catch_unwind(AssertUnwindSafe(|| drop(component))));
}

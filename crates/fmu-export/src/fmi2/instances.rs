//! The functions that need no instance: versions, making and freeing (section 2.1.4 and 2.1.5).

use super::call::{Component, ImporterLog, forget_panic, panic_message, string};
use super::types::*;
use crate::export::Exported;
use crate::instance::{Instance, Outcome, refuse};
use crate::log::{Logger, Message};
use crate::mode::Interface;
use crate::model::Setup;
use std::cell::{Cell, UnsafeCell};
use std::ffi::CStr;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// `fmi2GetTypesPlatform`
pub extern "C" fn fmi2GetTypesPlatform() -> fmi2String {
    c"default".as_ptr()
}

/// `fmi2GetVersion`
pub extern "C" fn fmi2GetVersion() -> fmi2String {
    c"2.0".as_ptr()
}

/// `fmi2Instantiate`. The importer owns the result until it calls `fmi2FreeInstance`.
pub unsafe extern "C" fn fmi2Instantiate<M: Exported>(
    instance_name: fmi2String,
    fmu_type: fmi2Type,
    guid: fmi2String,
    resource_location: fmi2String,
    functions: *const fmi2CallbackFunctions,
    _visible: fmi2Boolean,
    logging_on: fmi2Boolean,
) -> fmi2Component {
    let make = || {
        if functions.is_null() {
            return None;
        }
        // SAFETY: by contract the callbacks; copied, from any address, for they may go after this call.
        let functions = unsafe { functions.read_unaligned() };
        // SAFETY: by contract NULL or a string, each.
        let (name, guid, resources) =
            unsafe { (string(instance_name), string(guid), string(resource_location)) };
        let importer = ImporterLog {
            logger: functions.logger,
            environment: functions.component_environment,
            instance_name: name.unwrap_or(c"").to_owned(),
        };
        let attempt = || instantiate::<M>(name, fmu_type, guid, resources, logging_on != fmi2False);
        let refusal = match catch_unwind(attempt) {
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
        let mut logger = Logger::new(false);
        logger.add(Message { status: Status::Error, text: format!("fmi2Instantiate: {refusal}") });
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

fn instantiate<M: Exported>(
    name: Option<&CStr>,
    fmu_type: fmi2Type,
    guid: Option<&CStr>,
    resources: Option<&CStr>,
    logging_on: bool,
) -> Outcome<Instance<M>> {
    let Some(name) = name.filter(|name| !name.to_bytes().trim_ascii().is_empty()) else {
        return refuse("the instance needs a name");
    };
    let own = M::INFO.guid;
    if guid.map(CStr::to_bytes) != Some(own.as_bytes()) {
        return refuse(format!(
            "the guid {} is not this library's {own}: modelDescription.xml and library come from different FMUs",
            guid.map_or("NULL".into(), CStr::to_string_lossy),
        ));
    }
    let interface = match fmu_type {
        0 => Interface::ModelExchange,
        1 => Interface::CoSimulation,
        other => {
            return refuse(format!("fmuType must be 0 (Model Exchange) or 1 (Co-Simulation), it is {other}"));
        }
    };
    let text = |text: &CStr| text.to_string_lossy().into_owned();
    let setup = Setup { interface, instance_name: text(name), resource_location: resources.map(text) };
    Instance::new(setup, logging_on)
}

/// `fmi2FreeInstance`. Takes the instance back; NULL is ignored, and so is a call out of the log callback.
pub unsafe extern "C" fn fmi2FreeInstance<M: Exported>(c: fmi2Component) {
    let component = c.cast::<Component<M>>();
    // SAFETY: by contract NULL or a living component of this model.
    if unsafe { component.as_ref() }.is_none_or(|component| component.delivering.get()) {
        return;
    }
    // SAFETY: by contract from `fmi2Instantiate`, which gave the box away, and not freed before.
    let component = unsafe { Box::from_raw(component) };
    forget_panic(catch_unwind(AssertUnwindSafe(|| drop(component))));
}

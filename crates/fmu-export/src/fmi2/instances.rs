//! Functions that do not return a status: versions, creation and release of instances (sections 2.1.4 and 2.1.5 of FMI
//! 2.0).

use super::types::*;
use crate::boundary::{Arguments, Callback, ImporterLog, free, instantiate, string};
use crate::export::Exported;
use crate::instance::{Importer, reject};
use fmi_abi::Interface;

/// `fmi2GetTypesPlatform`. Returns the name of the standard C types.
pub unsafe extern "C" fn fmi2GetTypesPlatform<M: Exported>() -> fmi2String {
    c"default".as_ptr()
}

/// `fmi2GetVersion`. Returns the FMI version.
pub unsafe extern "C" fn fmi2GetVersion<M: Exported>() -> fmi2String {
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
    if functions.is_null() {
        return std::ptr::null_mut();
    }
    // SAFETY: by contract, the pointer refers to the callbacks, and may have any alignment. The callbacks are copied,
    // because the pointer may be invalid after this call.
    let functions = unsafe { functions.read_unaligned() };
    // SAFETY: by contract, each is NULL or a string.
    let (name, guid, resources) = unsafe { (string(instance_name), string(guid), string(resource_location)) };
    let interface = match fmu_type {
        0 => Ok(Interface::ModelExchange),
        1 => Ok(Interface::CoSimulation),
        other => reject(format!("fmuType must be 0 (Model Exchange) or 1 (Co-Simulation), it is {other}")),
    };
    let log = || ImporterLog {
        callback: functions.logger.map(Callback::Fmi2),
        environment: functions.component_environment,
        instance_name: name.unwrap_or(c"").to_owned(),
    };
    let (logging_on, importer) = (logging_on != fmi2False, Importer::FMI2);
    instantiate::<M>(
        "fmi2Instantiate",
        log,
        Arguments { name, guid, resources, logging_on, interface, importer },
    )
}

/// `fmi2FreeInstance`. Ignores NULL, and an instance that another call uses.
pub unsafe extern "C" fn fmi2FreeInstance<M: Exported>(c: fmi2Component) {
    // SAFETY: the importer guarantees the contract of the module.
    unsafe { free::<M>("fmi2FreeInstance", c) }
}

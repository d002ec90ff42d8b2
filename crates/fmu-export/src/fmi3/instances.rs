//! Functions that do not return a status: version, creation and release of instances (sections 2.2.5 and 2.3.1 of FMI
//! 3.0).

use super::types::*;
use crate::boundary::{Arguments, Callback, ImporterLog, free, instantiate, string};
use crate::export::Exported;
use crate::instance::{Importer, Outcome, reject};
use fmi_abi::{Interface, Standard};

/// `fmi3GetVersion`. Returns the FMI version.
pub unsafe extern "C" fn fmi3GetVersion<M: Exported>() -> fmi3String {
    c"3.0".as_ptr()
}

/// `fmi3InstantiateModelExchange`. The importer owns the result until it calls `fmi3FreeInstance`.
pub unsafe extern "C" fn fmi3InstantiateModelExchange<M: Exported>(
    instance_name: fmi3String,
    instantiation_token: fmi3String,
    resource_path: fmi3String,
    _visible: fmi3Boolean,
    logging_on: fmi3Boolean,
    environment: fmi3InstanceEnvironment,
    log_message: Option<fmi3LogMessageCallback>,
) -> fmi3Instance {
    let importer = Importer { standard: Standard::Fmi3, event_mode: false, early_return: false };
    // SAFETY: the importer guarantees the contract of the module.
    unsafe {
        make::<M>(
            "fmi3InstantiateModelExchange",
            [instance_name, instantiation_token, resource_path],
            logging_on,
            (environment, log_message),
            Ok(Interface::ModelExchange),
            importer,
        )
    }
}

/// `fmi3InstantiateCoSimulation`. The importer owns the result until it calls `fmi3FreeInstance`.
pub unsafe extern "C" fn fmi3InstantiateCoSimulation<M: Exported>(
    instance_name: fmi3String,
    instantiation_token: fmi3String,
    resource_path: fmi3String,
    _visible: fmi3Boolean,
    logging_on: fmi3Boolean,
    event_mode_used: fmi3Boolean,
    early_return_allowed: fmi3Boolean,
    _required_intermediate_variables: *const fmi3ValueReference,
    required_count: usize,
    environment: fmi3InstanceEnvironment,
    log_message: Option<fmi3LogMessageCallback>,
    _intermediate_update: Option<fmi3IntermediateUpdateCallback>,
) -> fmi3Instance {
    let importer = Importer {
        standard: Standard::Fmi3,
        event_mode: event_mode_used != fmi3False,
        early_return: early_return_allowed != fmi3False,
    };
    let interface = match required_count {
        0 => Ok(Interface::CoSimulation),
        _ => reject(
            "requiredIntermediateVariables must be empty: this FMU has no intermediate update \
             (providesIntermediateUpdate is false)",
        ),
    };
    // SAFETY: the importer guarantees the contract of the module.
    unsafe {
        make::<M>(
            "fmi3InstantiateCoSimulation",
            [instance_name, instantiation_token, resource_path],
            logging_on,
            (environment, log_message),
            interface,
            importer,
        )
    }
}

/// `fmi3InstantiateScheduledExecution`. Returns NULL, because Scheduled Execution is not supported.
pub unsafe extern "C" fn fmi3InstantiateScheduledExecution<M: Exported>(
    instance_name: fmi3String,
    instantiation_token: fmi3String,
    resource_path: fmi3String,
    _visible: fmi3Boolean,
    logging_on: fmi3Boolean,
    environment: fmi3InstanceEnvironment,
    log_message: Option<fmi3LogMessageCallback>,
    _clock_update: Option<fmi3ClockUpdateCallback>,
    _lock_preemption: Option<fmi3LockPreemptionCallback>,
    _unlock_preemption: Option<fmi3UnlockPreemptionCallback>,
) -> fmi3Instance {
    let importer = Importer { standard: Standard::Fmi3, event_mode: false, early_return: false };
    // SAFETY: the importer guarantees the contract of the module.
    unsafe {
        make::<M>(
            "fmi3InstantiateScheduledExecution",
            [instance_name, instantiation_token, resource_path],
            logging_on,
            (environment, log_message),
            reject("this FMU has no Scheduled Execution"),
            importer,
        )
    }
}

/// Creates an instance, or returns NULL after logging the reason. The strings are its name, the instantiation token
/// and the path of the resources.
///
/// # Safety
/// The strings are NULL or valid; the callback works until the instance is freed.
unsafe fn make<M: Exported>(
    function: &str,
    strings: [fmi3String; 3],
    logging_on: fmi3Boolean,
    (environment, log_message): (fmi3InstanceEnvironment, Option<fmi3LogMessageCallback>),
    interface: Outcome<Interface>,
    importer: Importer,
) -> fmi3Instance {
    // SAFETY: the caller guarantees NULL or strings.
    let [name, guid, resources] = strings.map(|pointer| unsafe { string(pointer) });
    let instance_name = name.unwrap_or(c"").to_owned();
    let log = || ImporterLog { callback: log_message.map(Callback::Fmi3), environment, instance_name };
    let logging_on = logging_on != fmi3False;
    instantiate::<M>(function, log, Arguments { name, guid, resources, logging_on, interface, importer })
}

/// `fmi3FreeInstance`. Ignores NULL, and an instance that another call uses.
pub unsafe extern "C" fn fmi3FreeInstance<M: Exported>(c: fmi3Instance) {
    // SAFETY: the importer guarantees the contract of the module.
    unsafe { free::<M>("fmi3FreeInstance", c) }
}

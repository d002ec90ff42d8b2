//! Instantiates an FMU of either FMI version and of all interface types.

use crate::c_types::{c_char, c_int, c_void};
use crate::fmi2::types::fmi2CallbackFunctions;
use crate::fmi3::types::fmi3LogMessageCallback;
use crate::{Standard, fmi2, fmi3};
use std::ptr::{null, null_mut};

/// Arguments of the instantiation functions (section 2.1.5 of FMI 2.0, 2.3.1 of FMI 3.0), as they are passed to the FMU. Any pointer
/// may be NULL or wrong, so that an FMU can be tested with it.
#[derive(Clone, Copy, Debug)]
pub struct Instantiation {
    /// `fmuType` of FMI 2.0. It selects the function of FMI 3.0: 0 selects Model Exchange, 2 Scheduled Execution, and any other value
    /// Co-Simulation.
    pub interface: c_int,
    /// Name of the instance.
    pub name: *const c_char,
    /// `fmuGUID` of FMI 2.0, `instantiationToken` of FMI 3.0.
    pub token: *const c_char,
    /// Location of the resources: a URI in FMI 2.0, a path in FMI 3.0.
    pub resources: *const c_char,
    /// Whether the FMU may show windows.
    pub visible: u8,
    /// Whether debug logging is on.
    pub logging_on: u8,
    /// Callbacks of FMI 2.0, which the FMU may use until the instance is freed.
    pub callbacks: *const fmi2CallbackFunctions,
    /// Environment of the instance in FMI 3.0. The callbacks of FMI 2.0 contain their own.
    pub environment: *mut c_void,
    /// Log callback of FMI 3.0.
    pub log: Option<fmi3LogMessageCallback>,
    /// Only for Co-Simulation of FMI 3.0, like the following fields: whether the importer handles events.
    pub event_mode_used: u8,
    /// Whether a step may end early.
    pub early_return_allowed: u8,
    /// Value references of the variables that the importer needs during intermediate updates.
    pub required_intermediate_variables: *const u32,
    /// Number of these value references.
    pub required_count: usize,
}

impl Instantiation {
    /// Arguments that are all 0 or NULL.
    pub const ZEROS: Self = Self {
        interface: 0,
        name: null(),
        token: null(),
        resources: null(),
        visible: 0,
        logging_on: 0,
        callbacks: null(),
        environment: null_mut(),
        log: None,
        event_mode_used: 0,
        early_return_allowed: 0,
        required_intermediate_variables: null(),
        required_count: 0,
    };

    /// Returns the name of the function that takes these arguments.
    pub const fn function(&self, standard: Standard) -> &'static str {
        match (standard, self.interface) {
            (Standard::Fmi2, _) => "fmi2Instantiate",
            (Standard::Fmi3, 0) => "fmi3InstantiateModelExchange",
            (Standard::Fmi3, 2) => "fmi3InstantiateScheduledExecution",
            (Standard::Fmi3, _) => "fmi3InstantiateCoSimulation",
        }
    }
}

impl fmi2::Functions {
    /// Calls the instantiation function and returns the instance.
    ///
    /// # Safety
    /// The function accepts the arguments.
    pub unsafe fn instantiate(&self, arguments: &Instantiation) -> *mut c_void {
        let Instantiation { interface, name, token, resources, callbacks, .. } = *arguments;
        let (visible, logging_on) = (arguments.visible.into(), arguments.logging_on.into());
        // SAFETY: the caller guarantees that the function accepts the arguments.
        unsafe { (self.fmi2Instantiate)(name, interface, token, resources, callbacks, visible, logging_on) }
    }
}

impl fmi3::Functions {
    /// Calls the instantiation function of the interface type and returns the instance. Callbacks other than the logger are NULL.
    ///
    /// # Safety
    /// The function accepts the arguments.
    #[rustfmt::skip]
    pub unsafe fn instantiate(&self, arguments: &Instantiation) -> *mut c_void {
        let Instantiation { name, token, resources, visible, logging_on, environment, log, .. } = *arguments;
        let (required, count) = (arguments.required_intermediate_variables, arguments.required_count);
        let (events, early) = (arguments.event_mode_used, arguments.early_return_allowed);
        // SAFETY: the caller guarantees that the function accepts the arguments.
        unsafe {
            match arguments.interface {
                0 => (self.fmi3InstantiateModelExchange)(name, token, resources, visible, logging_on, environment, log),
                2 => (self.fmi3InstantiateScheduledExecution)(
                    name, token, resources, visible, logging_on, environment, log, None, None, None,
                ),
                _ => (self.fmi3InstantiateCoSimulation)(
                    name, token, resources, visible, logging_on, events, early, required, count, environment, log, None,
                ),
            }
        }
    }
}

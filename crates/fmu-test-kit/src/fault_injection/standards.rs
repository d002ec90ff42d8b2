//! Names of the functions that the fault-injecting importer calls most often or treats specially, for each FMI version.

use crate::{Either, Importer, fmi3};
use std::ffi::CStr;

/// An FMI version for the fault-injecting importer.
#[allow(missing_docs, reason = "names of functions")]
pub trait Caller: Either + Sized {
    /// Most frequent functions in Co-Simulation.
    const STEPS: &'static [&'static str];
    /// Most frequent functions in Model Exchange.
    const INTEGRATION: &'static [&'static str];
    /// Functions that reset and initialize an instance, in this order.
    const BEGINNING: &'static [&'static str];
    /// Instantiation functions for Co-Simulation and for Model Exchange.
    const INSTANTIATE: [&'static str; 2];
    const FREE: &'static str;
    /// Functions of saved states: get, set, free, size, serialize, de-serialize.
    const HANDLES: [&'static str; 6];

    /// Checks the functions that take no instance; returns their names.
    fn check_version(&self) -> &'static [&'static str];
}

impl Caller for Importer {
    #[rustfmt::skip]
    const STEPS: &'static [&'static str] = &[
        "fmi2DoStep", "fmi2DoStep", "fmi2DoStep", "fmi2SetReal", "fmi2SetInteger", "fmi2SetBoolean",
        "fmi2SetString", "fmi2GetReal", "fmi2SetRealInputDerivatives", "fmi2GetRealOutputDerivatives",
    ];
    #[rustfmt::skip]
    const INTEGRATION: &'static [&'static str] = &[
        "fmi2SetTime", "fmi2SetContinuousStates", "fmi2SetReal", "fmi2GetReal", "fmi2GetDerivatives",
        "fmi2GetEventIndicators", "fmi2CompletedIntegratorStep", "fmi2EnterEventMode",
        "fmi2NewDiscreteStates", "fmi2EnterContinuousTimeMode",
    ];
    const BEGINNING: &'static [&'static str] =
        &["fmi2Reset", "fmi2SetupExperiment", "fmi2EnterInitializationMode", "fmi2ExitInitializationMode"];
    const INSTANTIATE: [&'static str; 2] = ["fmi2Instantiate"; 2];
    const FREE: &'static str = "fmi2FreeInstance";
    #[rustfmt::skip]
    const HANDLES: [&'static str; 6] = [
        "fmi2GetFMUstate", "fmi2SetFMUstate", "fmi2FreeFMUstate", "fmi2SerializedFMUstateSize",
        "fmi2SerializeFMUstate", "fmi2DeSerializeFMUstate",
    ];

    fn check_version(&self) -> &'static [&'static str] {
        assert_eq!(self.version_and_platform(), [c"2.0", c"default"]);
        &["fmi2GetVersion", "fmi2GetTypesPlatform"]
    }
}

impl Caller for fmi3::Importer {
    #[rustfmt::skip]
    const STEPS: &'static [&'static str] = &[
        "fmi3DoStep", "fmi3DoStep", "fmi3DoStep", "fmi3SetFloat64", "fmi3GetFloat64",
        "fmi3EnterEventMode", "fmi3UpdateDiscreteStates", "fmi3EnterStepMode",
    ];
    #[rustfmt::skip]
    const INTEGRATION: &'static [&'static str] = &[
        "fmi3SetTime", "fmi3SetContinuousStates", "fmi3SetFloat64", "fmi3GetFloat64",
        "fmi3GetContinuousStateDerivatives", "fmi3CompletedIntegratorStep", "fmi3EnterEventMode",
        "fmi3UpdateDiscreteStates", "fmi3EnterContinuousTimeMode",
    ];
    const BEGINNING: &'static [&'static str] =
        &["fmi3Reset", "fmi3EnterInitializationMode", "fmi3ExitInitializationMode"];
    const INSTANTIATE: [&'static str; 2] = ["fmi3InstantiateCoSimulation", "fmi3InstantiateModelExchange"];
    const FREE: &'static str = "fmi3FreeInstance";
    #[rustfmt::skip]
    const HANDLES: [&'static str; 6] = [
        "fmi3GetFMUState", "fmi3SetFMUState", "fmi3FreeFMUState", "fmi3SerializedFMUStateSize",
        "fmi3SerializeFMUState", "fmi3DeserializeFMUState",
    ];

    fn check_version(&self) -> &'static [&'static str] {
        // SAFETY: the function returns a string that stays valid while the library is loaded.
        assert_eq!(unsafe { CStr::from_ptr((self.functions().fmi3GetVersion)()) }, c"3.0");
        &["fmi3GetVersion"]
    }
}

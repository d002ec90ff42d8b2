//! Every function in every state, compared with the states of FMI 3.0 (sections 2.3, 3.2 and 4.2). The table
//! is copied here independently from the text, state by state.

use crate::models::*;
use fmu_export::Interface::{self, CoSimulation, ModelExchange};
use fmu_export::Mode::{self, *};
use fmu_export::fmi3::ALLOWED;
use fmu_export::fmi3::types::*;
use fmu_export::{Exported, Standard};
use fmu_test_kit::Either;
use fmu_test_kit::checks::modes_of_model;
use fmu_test_kit::fmi3::{FUNCTIONS, Importer};

/// Functions of the super state FMU State Settable, section 2.3.1.
const EVERYWHERE: &str = "SetDebugLogging Reset GetFMUState SetFMUState FreeFMUState SerializedFMUStateSize \
    SerializeFMUState DeserializeFMUState";

/// Functions of its states: common ones, further ones of Model Exchange, further ones of Co-Simulation.
/// `Set*` and `Get*` represent the functions of all types.
const STATES: [(Mode, &str, &str, &str); 6] = [
    (
        Instantiated,
        "Set* Get* EnterConfigurationMode EnterInitializationMode GetNumberOfVariableDependencies \
         GetVariableDependencies",
        "GetNumberOfContinuousStates GetNumberOfEventIndicators",
        "",
    ),
    (
        Initialization,
        "Set* Get* GetDirectionalDerivative GetAdjointDerivative GetShiftDecimal GetShiftFraction \
         GetIntervalDecimal GetIntervalFraction SetShiftDecimal SetShiftFraction SetIntervalDecimal \
         SetIntervalFraction ExitInitializationMode GetNumberOfVariableDependencies GetVariableDependencies",
        "GetContinuousStateDerivatives GetContinuousStates GetNominalsOfContinuousStates GetEventIndicators",
        "",
    ),
    (
        Event,
        "Set* Get* SetClock GetClock GetIntervalDecimal GetIntervalFraction GetDirectionalDerivative \
         GetAdjointDerivative EvaluateDiscreteStates UpdateDiscreteStates GetNumberOfVariableDependencies \
         GetVariableDependencies Terminate",
        "GetContinuousStates GetContinuousStateDerivatives GetEventIndicators GetNumberOfContinuousStates \
         GetNumberOfEventIndicators EnterConfigurationMode EnterContinuousTimeMode \
         GetNominalsOfContinuousStates",
        "EnterStepMode",
    ),
    (
        ContinuousTime,
        "SetFloat32 SetFloat64 Get* SetTime SetContinuousStates GetContinuousStates \
         GetContinuousStateDerivatives GetEventIndicators CompletedIntegratorStep EnterEventMode \
         GetDirectionalDerivative GetAdjointDerivative GetNumberOfVariableDependencies \
         GetVariableDependencies GetNominalsOfContinuousStates Terminate",
        "",
        "",
    ),
    (
        StepComplete,
        "Set* Get* GetOutputDerivatives GetDirectionalDerivative GetAdjointDerivative DoStep EnterEventMode \
         EnterConfigurationMode GetNumberOfVariableDependencies GetVariableDependencies Terminate",
        "",
        "",
    ),
    (
        Terminated,
        "Get* GetDirectionalDerivative GetAdjointDerivative GetNumberOfVariableDependencies \
         GetVariableDependencies",
        "GetContinuousStateDerivatives GetContinuousStates GetNominalsOfContinuousStates GetEventIndicators",
        "GetOutputDerivatives",
    ),
];

/// Calls beyond the standard, in interface types that have the function.
const TOLERATED: [(&str, &[Mode]); 6] = [
    ("EnterEventMode", &[Event]),
    ("SetTime", &[Initialization, Event]),
    ("SetContinuousStates", &[Event]),
    ("GetNominalsOfContinuousStates", &[Instantiated]),
    ("GetNumberOfContinuousStates", &[Initialization, ContinuousTime, Terminated]),
    ("GetNumberOfEventIndicators", &[Initialization, ContinuousTime, Terminated]),
];

const TYPES: [&str; 13] = [
    "Float32", "Float64", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64",
    "Boolean", "String", "Binary",
];

fn standard(function: &str, interface: Interface, mode: Mode) -> bool {
    let name = function.strip_prefix("fmi3").unwrap();
    let is_of_type = |prefix: &str| name.strip_prefix(prefix).is_some_and(|of| TYPES.contains(&of));
    let fits = |entry: &str| match entry {
        "Get*" => is_of_type("Get"),
        "Set*" => is_of_type("Set"),
        entry => entry == name,
    };
    let (_, both, in_model_exchange, in_co_simulation) =
        STATES.into_iter().find(|(state, ..)| *state == mode).unwrap();
    let more = if interface == ModelExchange { in_model_exchange } else { in_co_simulation };
    [EVERYWHERE, both, more].into_iter().flat_map(str::split_whitespace).any(fits)
}

fn tolerated(function: &str, interface: Interface, mode: Mode) -> bool {
    let name = function.strip_prefix("fmi3").unwrap();
    (interface == ModelExchange || name == "EnterEventMode")
        && TOLERATED.into_iter().any(|(tolerated, modes)| tolerated == name && modes.contains(&mode))
}

fn every_function_in_every_state<M: Exported>() {
    for (interface, mode) in modes_of_model::<Importer, M>() {
        for function in FUNCTIONS {
            let label = format!("{function} in {mode} of {interface}");
            let fmu = Importer::in_mode::<M>(interface, mode);
            let before = fmu.bytes();
            fmu.take_log();
            let status = fmu.call_with_zeros(function);
            let log = fmu.take_log();
            let is_refused_by_state = log.iter().any(|message| message.text.contains("not allowed in state"));
            let accepted = standard(function, interface, mode) || tolerated(function, interface, mode);
            assert_eq!(is_refused_by_state, !accepted, "{label}: {log:?}");
            if status != Status::Ok {
                assert_eq!((status, log.len()), (Status::Error, 1), "{label}: {log:?}");
                assert!(log[0].text.starts_with(&format!("{function}: ")), "{label}: {log:?}");
                assert_eq!(before, fmu.bytes(), "{label} changed the instance");
            }
        }
    }
}

#[test]
fn calls() {
    every_function_in_every_state::<Ticker>();
    every_function_in_every_state::<Palette>();
}

#[test]
fn table() {
    assert_eq!(ALLOWED.len(), FUNCTIONS.len());
    for rule in ALLOWED {
        for interface in [CoSimulation, ModelExchange] {
            for mode in Importer::modes_of(interface).iter().copied() {
                let label = format!("{} in {mode} of {interface}", rule.name);
                let contain = |set: fmu_export::Situations| set.contain(Standard::Fmi3, interface, mode);
                assert_eq!(contain(rule.standard), standard(rule.name, interface, mode), "{label}");
                assert_eq!(
                    contain(rule.tolerated),
                    tolerated(rule.name, interface, mode),
                    "{label}, tolerated"
                );
                assert!(!rule.accepted().contain(Standard::Fmi2, interface, mode), "{label}, in FMI 2.0");
            }
        }
    }
}

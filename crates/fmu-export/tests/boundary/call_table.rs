//! Allowed calls: every function in every state of the state machines, compared with the standards. The tables here were
//! copied from the text of FMI 2.0.5 and from sections 2.3, 3.2 and 4.2 of FMI 3.0.2, independently of the tested code.

use crate::models::*;
use crate::valid_calls::ValidCall;
use fmu_export::Interface::{self, CoSimulation, ModelExchange};
use fmu_export::Mode::{self, *};
use fmu_export::{Exported, Standard, Status};
use fmu_test_kit::Random;
use fmu_test_kit::calls::Argument;
use fmu_test_kit::checks::modes_of_model;
use fmu_test_kit::serialized::{MODE, with_mode};
use fmu_test_kit::{Either, Importer, fmi3};

/// Columns of the table in section 3.2.3 of FMI 2.0: start/end, instantiated, Initialization Mode, Event Mode,
/// Continuous-Time Mode, terminated, error, fatal.
const MODEL_EXCHANGE: &str = "
    fmi2GetTypesPlatform              |x |x |x |x |x |x |x |
    fmi2GetVersion                    |x |x |x |x |x |x |x |
    fmi2SetDebugLogging               |  |x |x |x |x |x |x |
    fmi2Instantiate                   |x |  |  |  |  |  |  |
    fmi2FreeInstance                  |  |x |x |x |x |x |x |
    fmi2SetupExperiment               |  |x |  |  |  |  |  |
    fmi2EnterInitializationMode       |  |x |  |  |  |  |  |
    fmi2ExitInitializationMode        |  |  |x |  |  |  |  |
    fmi2Terminate                     |  |  |  |x |x |  |  |
    fmi2Reset                         |  |x |x |x |x |x |x |
    fmi2GetReal                       |  |  |2 |x |x |x |7 |
    fmi2GetInteger                    |  |  |2 |x |x |x |7 |
    fmi2GetBoolean                    |  |  |2 |x |x |x |7 |
    fmi2GetString                     |  |  |2 |x |x |x |7 |
    fmi2SetReal                       |  |1 |3 |4 |5 |  |  |
    fmi2SetInteger                    |  |1 |3 |4 |  |  |  |
    fmi2SetBoolean                    |  |1 |3 |4 |  |  |  |
    fmi2SetString                     |  |1 |3 |4 |  |  |  |
    fmi2GetFMUstate                   |  |x |x |x |x |x |7 |
    fmi2SetFMUstate                   |  |x |x |x |x |x |x |
    fmi2FreeFMUstate                  |  |x |x |x |x |x |x |
    fmi2SerializedFMUstateSize        |  |x |x |x |x |x |x |
    fmi2SerializeFMUstate             |  |x |x |x |x |x |x |
    fmi2DeSerializeFMUstate           |  |x |x |x |x |x |x |
    fmi2GetDirectionalDerivative      |  |  |x |x |x |x |7 |
    fmi2EnterEventMode                |  |  |  |x |x |  |  |
    fmi2NewDiscreteStates             |  |  |  |x |  |  |  |
    fmi2EnterContinuousTimeMode       |  |  |  |x |  |  |  |
    fmi2CompletedIntegratorStep       |  |  |  |  |x |  |  |
    fmi2SetTime                       |  |  |  |8 |x |  |  |
    fmi2SetContinuousStates           |  |  |  |  |x |  |  |
    fmi2GetEventIndicators            |  |  |x |x |x |x |7 |
    fmi2GetContinuousStates           |  |  |x |x |x |x |7 |
    fmi2GetDerivatives                |  |  |x |x |x |x |7 |
    fmi2GetNominalsOfContinuousStates |  |x |x |x |x |x |7 |";

/// Columns of the table in section 4.2.4 of FMI 2.0: start/end, instantiated, Initialization Mode, stepComplete,
/// stepInProgress, stepFailed, stepCanceled, terminated, error, fatal.
const CO_SIMULATION: &str = "
    fmi2GetTypesPlatform         |x |x |x |x |x |x |x |x |x |
    fmi2GetVersion               |x |x |x |x |x |x |x |x |x |
    fmi2SetDebugLogging          |  |x |x |x |x |x |x |x |x |
    fmi2Instantiate              |x |  |  |  |  |  |  |  |  |
    fmi2FreeInstance             |  |x |x |x |  |x |x |x |x |
    fmi2SetupExperiment          |  |x |  |  |  |  |  |  |  |
    fmi2EnterInitializationMode  |  |x |  |  |  |  |  |  |  |
    fmi2ExitInitializationMode   |  |  |x |  |  |  |  |  |  |
    fmi2Terminate                |  |  |  |x |  |x |  |  |  |
    fmi2Reset                    |  |x |x |x |  |x |x |x |x |
    fmi2GetReal                  |  |  |2 |x |  |8 |7 |x |7 |
    fmi2GetInteger               |  |  |2 |x |  |8 |7 |x |7 |
    fmi2GetBoolean               |  |  |2 |x |  |8 |7 |x |7 |
    fmi2GetString                |  |  |2 |x |  |8 |7 |x |7 |
    fmi2SetReal                  |  |1 |3 |6 |  |  |  |  |  |
    fmi2SetInteger               |  |1 |3 |6 |  |  |  |  |  |
    fmi2SetBoolean               |  |1 |3 |6 |  |  |  |  |  |
    fmi2SetString                |  |1 |3 |6 |  |  |  |  |  |
    fmi2GetFMUstate              |  |x |x |x |  |8 |7 |x |7 |
    fmi2SetFMUstate              |  |x |x |x |  |x |x |x |x |
    fmi2FreeFMUstate             |  |x |x |x |  |x |x |x |x |
    fmi2SerializedFMUstateSize   |  |x |x |x |  |x |x |x |x |
    fmi2SerializeFMUstate        |  |x |x |x |  |x |x |x |x |
    fmi2DeSerializeFMUstate      |  |x |x |x |  |x |x |x |x |
    fmi2GetDirectionalDerivative |  |  |x |x |  |8 |7 |x |7 |
    fmi2SetRealInputDerivatives  |  |x |x |x |  |  |  |  |  |
    fmi2GetRealOutputDerivatives |  |  |  |x |  |8 |x |x |7 |
    fmi2DoStep                   |  |  |  |x |  |  |  |  |  |
    fmi2CancelStep               |  |  |  |  |x |  |  |  |  |
    fmi2GetStatus                |  |  |  |x |x |x |  |x |  |
    fmi2GetRealStatus            |  |  |  |x |x |x |  |x |  |
    fmi2GetIntegerStatus         |  |  |  |x |x |x |  |x |  |
    fmi2GetBooleanStatus         |  |  |  |x |x |x |  |x |  |
    fmi2GetStringStatus          |  |  |  |x |x |x |  |x |  |";

/// Calls of FMI 2.0 that the standard forbids but the FMU accepts, because real importers make them. For example, FMI Library
/// terminates after an error, and OpenModelica sets time and states in Event Mode. Other tests cover calls that are
/// tolerated for single variables.
const TOLERATED: [(&str, Interface, Mode); 8] = [
    ("fmi2Terminate", CoSimulation, Error),
    ("fmi2Terminate", ModelExchange, Error),
    ("fmi2SetInteger", ModelExchange, ContinuousTime),
    ("fmi2SetBoolean", ModelExchange, ContinuousTime),
    ("fmi2SetString", ModelExchange, ContinuousTime),
    ("fmi2SetTime", ModelExchange, Initialization),
    ("fmi2SetTime", ModelExchange, Event),
    ("fmi2SetContinuousStates", ModelExchange, Event),
];

fn standard_of_fmi2(function: &str, interface: Interface, mode: Mode) -> bool {
    let (table, column) = match (interface, mode) {
        (ModelExchange, mode) => {
            let columns = [Instantiated, Initialization, Event, ContinuousTime, Terminated, Error, Fatal];
            (MODEL_EXCHANGE, columns.iter().position(|column| *column == mode).unwrap())
        }
        (CoSimulation, Instantiated) => (CO_SIMULATION, 0),
        (CoSimulation, Initialization) => (CO_SIMULATION, 1),
        (CoSimulation, StepComplete) => (CO_SIMULATION, 2),
        (CoSimulation, StepFailed) => (CO_SIMULATION, 4),
        (CoSimulation, Terminated) => (CO_SIMULATION, 6),
        (CoSimulation, Error) => (CO_SIMULATION, 7),
        (CoSimulation, Fatal) => (CO_SIMULATION, 8),
        (CoSimulation, mode) => panic!("{mode} is not a state of Co-Simulation"),
    };
    let row = table
        .lines()
        .find_map(|line| line.trim().strip_prefix(function).filter(|rest| rest.starts_with([' ', '|'])));
    // A function that is not in the table belongs to the other interface type.
    let Some(row) = row else { return false };
    // An empty cell and the column "start, end" precede the cell.
    match row.split('|').nth(column + 2).unwrap_or("").trim() {
        "" => false,
        // Footnote 8 of Model Exchange concerns only an FMU without continuous time.
        "8" if interface == ModelExchange => false,
        _ => true,
    }
}

/// Functions that are allowed in all states below: the functions of the super state FMU State Settable, section 2.3.1 of FMI 3.0.
const EVERYWHERE: &str = "SetDebugLogging Reset GetFMUState SetFMUState FreeFMUState SerializedFMUStateSize \
    SerializeFMUState DeserializeFMUState";

/// Functions that are allowed in each state: in both interface types, only in Model Exchange, only in Co-Simulation.
/// `Set*` and `Get*` are the setters and getters of all types.
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

/// Calls of FMI 3.0 that the standard forbids but the FMU accepts, in interface types that have the function.
const TOLERATED_IN_FMI3: [(&str, &[Mode]); 7] = [
    ("EnterEventMode", &[Event]),
    ("ExitConfigurationMode", &[Instantiated]),
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

fn standard_of_fmi3(function: &str, interface: Interface, mode: Mode) -> bool {
    let name = &function[4..];
    let is_of_type = |prefix: &str| name.strip_prefix(prefix).is_some_and(|rest| TYPES.contains(&rest));
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

/// Returns whether the standard of the function allows the call in this mode.
fn standard(function: &str, interface: Interface, mode: Mode) -> bool {
    match function.starts_with("fmi2") {
        true => standard_of_fmi2(function, interface, mode),
        false => standard_of_fmi3(function, interface, mode),
    }
}

/// Returns whether a function, named without its prefix, sets variables of a type that is never continuous.
fn sets_discrete(name: &str) -> bool {
    let of = name.strip_prefix("Set").filter(|of| *of == "Integer" || TYPES.contains(of));
    of.is_some_and(|of| !of.starts_with("Float"))
}

fn tolerated(function: &str, interface: Interface, mode: Mode) -> bool {
    let name = &function[4..];
    TOLERATED.contains(&(function, interface, mode))
        || function.starts_with("fmi3") && mode == ContinuousTime && sets_discrete(name)
        || function.starts_with("fmi3")
            && (interface == ModelExchange || ["EnterEventMode", "ExitConfigurationMode"].contains(&name))
            && TOLERATED_IN_FMI3.into_iter().any(|(of, modes)| of == name && modes.contains(&mode))
}

pub fn accepted(function: &str, interface: Interface, mode: Mode) -> bool {
    standard(function, interface, mode) || tolerated(function, interface, mode)
}

/// Returns a part of the message with which an allowed call is rejected because the model lacks a capability; `None` if
/// the model lacks none.
pub fn lacking<M: Exported>(function: &str, interface: Interface, mode: Mode) -> Option<&'static str> {
    let has_event_mode = M::CO_SIMULATION.is_some_and(|offer| offer.has_event_mode());
    match &function[4..] {
        "EnterEventMode" if interface == CoSimulation && !has_event_mode => Some("eventModeUsed was false"),
        "GetDirectionalDerivative" if !M::PARTIALS => Some("providesDirectionalDerivative"),
        "GetAdjointDerivative" if !M::PARTIALS => Some("providesAdjointDerivatives is false"),
        "SetRealInputDerivatives" if !M::INPUT_DERIVATIVES => Some("canInterpolateInputs"),
        "GetRealOutputDerivatives" | "GetOutputDerivatives" if M::OUTPUT_DERIVATIVES == 0 => {
            Some("maxOutputDerivativeOrder")
        }
        "EnterConfigurationMode" if mode != Instantiated => Some("this FMU has no structural parameters"),
        "EvaluateDiscreteStates" => Some("providesEvaluateDiscreteStates is false"),
        name if name.ends_with("Dependencies") => Some("providesPerElementDependencies is false"),
        name if ["Clock", "Interval", "Shift"].iter().any(|kind| name[3..].starts_with(kind)) => {
            Some("this FMU has no clocks")
        }
        _ => None,
    }
}

/// Returns the mode after an accepted call.
fn next<M: Exported>(function: &str, interface: Interface, mode: Mode) -> Mode {
    let has_event_mode =
        function.starts_with("fmi3") && M::CO_SIMULATION.is_some_and(|offer| offer.has_event_mode());
    match (&function[4..], interface) {
        ("EnterInitializationMode", _) => Initialization,
        ("ExitInitializationMode", CoSimulation) if !has_event_mode => StepComplete,
        ("ExitInitializationMode" | "EnterEventMode", _) => Event,
        ("EnterContinuousTimeMode", _) => ContinuousTime,
        ("EnterStepMode", _) => StepComplete,
        ("Terminate", _) => Terminated,
        ("Reset", _) => Instantiated,
        _ => mode,
    }
}

fn check_every_function<F: Either, M: Exported>() {
    for (interface, mode) in modes_of_model::<F, M>() {
        for function in F::functions() {
            if mode == ContinuousTime && sets_discrete(&function[4..]) {
                // Accepted only if the value does not change, see `tolerances`.
                continue;
            }
            let label = format!("{function} in state '{mode}' of {interface}, {}", M::INFO.name);
            let fmu = F::in_mode::<M>(interface, mode);
            let valid = ValidCall::new::<F, M>(&fmu, function, mode);
            let call = |fmu: &F| valid.make(fmu, |_| ());
            if !accepted(function, interface, mode) {
                let message = fmu.rejected(&label, call);
                assert!(message.starts_with(&format!("{function}: not allowed in")), "{label}: {message}");
                assert!(message.contains(&format!("'{mode}'")), "{label}: {message}");
                assert!(message.contains("; allowed in: "), "{label}: {message}");
                continue;
            }
            if let Some(attribute) = lacking::<M>(function, interface, mode) {
                let message = fmu.rejected(&label, call);
                assert!(message.contains(attribute), "{label}: {message}");
                continue;
            }
            let expected = match *function {
                // Steps are synchronous, so these functions have no result.
                "fmi2GetStatus" | "fmi2GetIntegerStatus" | "fmi2GetStringStatus" => Status::Discard,
                _ => Status::Ok,
            };
            assert_eq!(call(&fmu), expected, "{label}: {:?}", fmu.take_log());
            if expected == Status::Ok {
                valid.read_outputs();
            }
            let (end, bytes) = (next::<M>(function, interface, mode), fmu.bytes());
            assert_eq!(bytes[MODE], with_mode(bytes.clone(), end)[MODE], "{label} does not lead to '{end}'");
        }
    }
}

#[test]
fn every_function_in_every_state() {
    for_every_model!(check_every_function, Importer);
    check_every_function::<fmi3::Importer, Oscillator>();
    check_every_function::<fmi3::Importer, Counter>();
    check_every_function::<fmi3::Importer, Palette>();
    check_every_function::<fmi3::Importer, Talker>();
}

/// Makes random calls. Each must be accepted or rejected according to the tables, and none may be fatal.
#[test]
fn random_walks() {
    walk::<Importer, Oscillator>(CoSimulation);
    walk::<Importer, Oscillator>(ModelExchange);
    walk::<Importer, Counter>(CoSimulation);
    walk::<Importer, Talker>(CoSimulation);
    walk::<fmi3::Importer, Oscillator>(CoSimulation);
    walk::<fmi3::Importer, Oscillator>(ModelExchange);
}

fn walk<F: Either, M: Exported>(interface: Interface) {
    let fmu = F::in_mode::<M>(interface, Instantiated);
    let (mut random, mut mode) = (Random(13), Instantiated);
    let mut visits = std::collections::BTreeMap::new();
    for _ in 0..20_000 {
        let function = F::functions()[random.below(F::functions().len())];
        // Few calls reset the instance or end its simulation, because most other calls need an initialized instance.
        if matches!(&function[4..], "Reset" | "Terminate") && random.below(8) > 0 {
            continue;
        }
        let status = ValidCall::new::<F, M>(&fmu, function, mode).make(&fmu, |_| ());
        let log = fmu.take_log();
        if mode == ContinuousTime && sets_discrete(&function[4..]) {
            assert!(matches!(status, Status::Ok | Status::Error), "{function}: {log:?}");
        } else if lacking::<M>(function, interface, mode).is_some() || !accepted(function, interface, mode) {
            assert_eq!(status, Status::Error, "{function} in state '{mode}' of {interface}: {log:?}");
        } else {
            assert!(matches!(status, Status::Ok | Status::Discard), "{function}: {log:?}");
            mode = next::<M>(function, interface, mode);
        }
        *visits.entry(mode.to_string()).or_insert(0) += 1;
    }
    let modes = if interface == CoSimulation { 4 } else { 5 };
    assert!(visits.len() == modes && visits.values().all(|calls| *calls > 100), "{visits:?}");
}

/// Checks that the table in fmi-abi agrees with the tables here. Unlike the tests that make calls, this test covers all
/// states, and checks which calls the table marks as tolerated.
#[test]
fn table_in_the_code() {
    fn check<F: Either>() {
        let rules: Vec<_> =
            fmu_test_kit::calls::signatures(F::standard()).iter().map(|signature| signature.rule).collect();
        assert_eq!(rules.iter().map(|rule| rule.name).collect::<Vec<_>>(), F::functions());
        for rule in rules {
            for interface in [CoSimulation, ModelExchange] {
                let fatal = (F::standard() == Standard::Fmi2).then_some(Fatal);
                for mode in F::modes_of(interface).iter().copied().chain(fatal) {
                    let label = format!("{} in state '{mode}' of {interface}", rule.name);
                    for standard in [Standard::Fmi2, Standard::Fmi3] {
                        let is_own = standard == F::standard();
                        let contains =
                            |set: fmu_export::AllowedStates| set.contains(standard, interface, mode);
                        assert_eq!(
                            contains(rule.standard),
                            is_own && self::standard(rule.name, interface, mode),
                            "{label}"
                        );
                        assert_eq!(
                            contains(rule.tolerated),
                            is_own && tolerated(rule.name, interface, mode),
                            "{label}"
                        );
                        assert_eq!(
                            contains(rule.accepted()),
                            is_own && accepted(rule.name, interface, mode),
                            "{label}"
                        );
                    }
                }
            }
        }
    }
    check::<Importer>();
    check::<fmi3::Importer>();
}

/// Returns whether this pointer may be NULL, because the function never writes through it, or has nothing to free then.
fn needs_no_pointer(function: &str, name: &str) -> bool {
    matches!(function, "fmi2GetStatus" | "fmi2GetIntegerStatus" | "fmi2GetStringStatus")
        || function.contains("FreeFMU") && name == "state"
}

/// Returns whether values of this C type are bytes, whose address is always aligned.
fn is_one_byte<F: Either>(of: &str) -> bool {
    ["Int8", "UInt8", "Byte"].contains(&of) || of == "Boolean" && F::standard() == Standard::Fmi3
}

/// Checks the pointers of every function: NULL, misaligned addresses, arrays that overlap, and arrays with a length that is larger than
/// memory.
/// The call must be rejected with the reason and must not change anything.
fn pointers<F: Either, M: Exported>() {
    let mut checked = 0;
    for (interface, mode) in modes_of_model::<F, M>() {
        if [Mode::StepFailed, Mode::Terminated, Mode::Error].contains(&mode) {
            continue;
        }
        let fmu = F::in_mode::<M>(interface, mode);
        for function in F::functions() {
            if !accepted(function, interface, mode) || lacking::<M>(function, interface, mode).is_some() {
                continue;
            }
            let mut call = ValidCall::new::<F, M>(&fmu, function, mode);
            if function.ends_with("SetDebugLogging") {
                call.words[1] = 1;
            }
            let is_empty = |of: &Argument| of.of == "usize" && call.words[position(&call, of)] == 0;
            if call.arguments.iter().any(is_empty) {
                continue;
            }
            for (index, argument) in call.arguments.iter().enumerate() {
                let label = format!("{function} in {mode} of {interface}, {}", argument.name);
                let Some((of, _)) = argument.pointee() else { continue };
                if needs_no_pointer(function, argument.name) {
                    continue;
                }
                let message = fmu.rejected(&label, |fmu| call.make(fmu, |words| words[index] = 0));
                assert!(message.contains("NULL"), "{label}: {message}");
                checked += 1;
                if !is_one_byte::<F>(of) {
                    let message = fmu.rejected(&label, |fmu| call.make(fmu, |words| words[index] += 1));
                    assert!(message.contains("not aligned"), "{label}: {message}");
                }
            }
            if !function.ends_with("Binary")
                && let Some(written) = call.overlap()
            {
                let message = fmu.rejected(function, |fmu| call.make(fmu, |_| ()));
                assert!(message.contains(" overlap"), "{function}: {message}");
                // An array that is not aligned does not exist, so it overlaps nothing.
                if call.arguments[written].pointee().is_some_and(|(of, _)| !is_one_byte::<F>(of)) {
                    let message = fmu.rejected(function, |fmu| call.make(fmu, |words| words[written] += 1));
                    assert!(message.contains("not aligned"), "{function}: {message}");
                }
                call = ValidCall::new::<F, M>(&fmu, function, mode);
            }
            let is_array = call.arguments.first().is_some_and(|first| first.name == "vr")
                && !function.ends_with("Binary");
            if is_array || function.ends_with("InputDerivatives") {
                let message = fmu.rejected(function, |fmu| {
                    call.make(fmu, |words| {
                        for (word, argument) in words.iter_mut().zip(call.arguments) {
                            *word = if argument.of == "usize" { u64::MAX / 4 } else { *word };
                        }
                    })
                });
                assert!(message.contains("larger than memory"), "{function}: {message}");
            }
        }
    }
    assert!(checked > 40, "only {checked}");
}

fn position(call: &ValidCall, argument: &Argument) -> usize {
    call.arguments.iter().position(|other| std::ptr::eq(other, argument)).expect("an argument of the call")
}

#[test]
fn null_and_misaligned_pointers() {
    pointers::<Importer, Oscillator>();
    pointers::<Importer, Talker>();
    pointers::<Importer, Ball>();
    pointers::<fmi3::Importer, Oscillator>();
    pointers::<fmi3::Importer, Ball>();
    pointers::<fmi3::Importer, Talker>();
    pointers::<fmi3::Importer, Palette>();
}

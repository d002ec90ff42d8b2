//! Which function may be called when: every function in every state of both state machines, against the
//! tables of the standard, typed in here once more from the text of FMI 2.0.5.

use crate::exact::Random;
use crate::modes::{all_modes, in_mode};
use crate::support::{FUNCTIONS_OF_COMPONENTS, Fmu, Status, call_all, version_and_platform};
use fmi2_export::Interface::{self, CoSimulation, ModelExchange};
use fmi2_export::call_table::CALL_TABLE;
use fmi2_export::call_table::Mode::{self, *};
use fmi2_export::types::{fmi2False, fmi2String, fmi2True};
use prw_testbed::variables::vr;
use std::ptr::{null, null_mut};

/// Section 3.2.3: start/end, instantiated, Initialization Mode, Event Mode, Continuous-Time Mode,
/// terminated, error, fatal.
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

/// Section 4.2.4: start/end, instantiated, Initialization Mode, stepComplete, stepInProgress,
/// stepFailed, stepCanceled, terminated, error, fatal.
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

/// The calls beyond the standard that real masters need: FMI Library terminates after an error,
/// OpenModelica sets time and states in event mode. (What is tolerated for single variables is tested
/// with them.)
const TOLERATED: [(&str, Interface, Mode); 5] = [
    ("fmi2Terminate", CoSimulation, Error),
    ("fmi2Terminate", ModelExchange, Error),
    ("fmi2SetTime", ModelExchange, Initialization),
    ("fmi2SetTime", ModelExchange, Event),
    ("fmi2SetContinuousStates", ModelExchange, Event),
];

/// Whether the standard allows the call in one of our modes.
fn standard(function: &str, interface: Interface, mode: Mode) -> bool {
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
        (CoSimulation, mode) => panic!("{mode} is no state of Co-Simulation"),
    };
    let row = table
        .lines()
        .find_map(|line| line.trim().strip_prefix(function).filter(|rest| rest.starts_with([' ', '|'])));
    // A function that the table lacks belongs to the other interface type.
    let Some(row) = row else { return false };
    // The name is followed by an empty cell before the first bar and by the column "start, end".
    match row.split('|').nth(column + 2).unwrap_or("").trim() {
        "" => false,
        // Footnote 8 of Model Exchange: only for an FMU without continuous time, which this is not.
        "8" if interface == ModelExchange => false,
        _ => true,
    }
}

fn accepted(function: &str, interface: Interface, mode: Mode) -> bool {
    standard(function, interface, mode) || TOLERATED.contains(&(function, interface, mode))
}

/// One harmless call of the function, with arguments that are right in this mode.
fn call(fmu: &Fmu, function: &str, mode: Mode) -> Status {
    let (mut real, mut integer, mut text, mut status) = (0.0, 0, null(), Status::Ok);
    let (mut flags, mut x) = ([0; 2], [0.0; 6]);
    // Before the initialization theta3 can be set (footnote 1), afterwards inputs (3 to 6).
    let settable = if mode == Instantiated { vr::theta3 } else { vr::theta1 };
    // There are parameters of type Integer and Boolean only, and no String at all (footnotes 4 and 6).
    let count = usize::from(matches!(mode, Instantiated | Initialization));
    let no_strings: *mut fmi2String = null_mut();
    match function {
        "fmi2SetDebugLogging" => fmu.fmi2SetDebugLogging(fmi2False, 0, null()),
        "fmi2SetupExperiment" => fmu.fmi2SetupExperiment(fmi2False, 0.0, 0.0, fmi2False, 0.0),
        "fmi2EnterInitializationMode" => fmu.fmi2EnterInitializationMode(),
        "fmi2ExitInitializationMode" => fmu.fmi2ExitInitializationMode(),
        "fmi2Terminate" => fmu.fmi2Terminate(),
        "fmi2Reset" => fmu.fmi2Reset(),
        "fmi2GetReal" => fmu.fmi2GetReal(&vr::tau1, 1, &mut real),
        "fmi2GetInteger" => fmu.fmi2GetInteger(&vr::M, 1, &mut integer),
        "fmi2GetBoolean" => fmu.fmi2GetBoolean(&vr::use_omega, 1, &mut integer),
        "fmi2GetString" => fmu.fmi2GetString(null(), 0, no_strings),
        "fmi2SetReal" => fmu.fmi2SetReal(&settable, 1, &0.1),
        "fmi2SetInteger" => fmu.fmi2SetInteger(&vr::M, count, &3),
        "fmi2SetBoolean" => fmu.fmi2SetBoolean(&vr::use_omega, count, &fmi2True),
        "fmi2SetString" => fmu.fmi2SetString(null(), 0, no_strings),
        "fmi2GetDirectionalDerivative" => {
            fmu.fmi2GetDirectionalDerivative(&vr::tau1, 1, &vr::theta1, 1, &1.0, &mut real)
        }
        "fmi2SetRealInputDerivatives" => fmu.fmi2SetRealInputDerivatives(&vr::theta1, 1, &1, &0.1),
        "fmi2GetRealOutputDerivatives" => fmu.fmi2GetRealOutputDerivatives(&vr::tau1, 1, &1, &mut real),
        "fmi2DoStep" => {
            let known = fmu.fmi2GetRealStatus(2, &mut real) == Status::Ok;
            fmu.take_log();
            fmu.fmi2DoStep(if known { real } else { 0.0 }, 0.01, fmi2True)
        }
        "fmi2CancelStep" => fmu.fmi2CancelStep(),
        "fmi2GetStatus" => fmu.fmi2GetStatus(0, &mut status),
        "fmi2GetRealStatus" => fmu.fmi2GetRealStatus(2, &mut real),
        "fmi2GetIntegerStatus" => fmu.fmi2GetIntegerStatus(0, &mut integer),
        "fmi2GetBooleanStatus" => fmu.fmi2GetBooleanStatus(3, &mut integer),
        "fmi2GetStringStatus" => fmu.fmi2GetStringStatus(1, &mut text),
        "fmi2EnterEventMode" => fmu.fmi2EnterEventMode(),
        "fmi2NewDiscreteStates" => fmu.fmi2NewDiscreteStates(&mut Default::default()),
        "fmi2EnterContinuousTimeMode" => fmu.fmi2EnterContinuousTimeMode(),
        "fmi2CompletedIntegratorStep" => {
            let [enter_event_mode, terminate] = &mut flags;
            fmu.fmi2CompletedIntegratorStep(fmi2True, enter_event_mode, terminate)
        }
        "fmi2SetTime" => fmu.fmi2SetTime(0.5),
        "fmi2SetContinuousStates" => fmu.fmi2SetContinuousStates(x.as_ptr(), 6),
        "fmi2GetDerivatives" => fmu.fmi2GetDerivatives(x.as_mut_ptr(), 6),
        "fmi2GetEventIndicators" => fmu.fmi2GetEventIndicators(null_mut(), 0),
        "fmi2GetContinuousStates" => fmu.fmi2GetContinuousStates(x.as_mut_ptr(), 6),
        "fmi2GetNominalsOfContinuousStates" => fmu.fmi2GetNominalsOfContinuousStates(x.as_mut_ptr(), 6),
        state_function => call_state_function(fmu, state_function),
    }
}

/// The functions of saved states, with a state of the instance's own.
fn call_state_function(fmu: &Fmu, function: &str) -> Status {
    let (mut state, mut second, mut size) = (fmu.save(), null_mut(), 0);
    let mut bytes = fmu.bytes();
    fmu.take_log();
    let status = match function {
        "fmi2GetFMUstate" => fmu.fmi2GetFMUstate(&mut second),
        "fmi2SetFMUstate" => fmu.fmi2SetFMUstate(state),
        "fmi2FreeFMUstate" => fmu.fmi2FreeFMUstate(&mut state),
        "fmi2SerializedFMUstateSize" => fmu.fmi2SerializedFMUstateSize(state, &mut size),
        "fmi2SerializeFMUstate" => fmu.fmi2SerializeFMUstate(state, bytes.as_mut_ptr().cast(), bytes.len()),
        "fmi2DeSerializeFMUstate" => {
            fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut second)
        }
        other => panic!("{other} is no function of FMI 2.0"),
    };
    fmu.forget(state);
    fmu.forget(second);
    status
}

#[test]
fn every_function_in_every_state() {
    let mut allowed_calls = 0;
    for (interface, mode) in all_modes() {
        for function in FUNCTIONS_OF_COMPONENTS {
            let label = format!("{function} in state '{mode}' of {interface}");
            let fmu = in_mode(interface, mode);
            if accepted(function, interface, mode) {
                let expected = match *function {
                    // Steps are synchronous: these have nothing to tell.
                    "fmi2GetStatus" | "fmi2GetIntegerStatus" | "fmi2GetStringStatus" => Status::Discard,
                    _ => Status::Ok,
                };
                assert_eq!(call(&fmu, function, mode), expected, "{label}: {:?}", fmu.take_log());
                allowed_calls += 1;
            } else {
                let message = fmu.refused(&label, |fmu| call(fmu, function, mode));
                assert!(message.starts_with(function), "{label}: {message}");
                assert!(message.contains(&format!("'{mode}'")), "{label}: {message}");
                assert!(message.contains("allowed in"), "{label}: {message}");
            }
        }
    }
    // Counted by hand in the two tables, without the four functions that need no state and without
    // stepInProgress and stepCanceled, plus what is tolerated.
    assert_eq!(allowed_calls, CELLS_OF_CO_SIMULATION + CELLS_OF_MODEL_EXCHANGE + TOLERATED.len());
}

/// What an accepted call makes of the mode.
fn next(function: &str, interface: Interface, mode: Mode) -> Mode {
    match (function, interface) {
        ("fmi2EnterInitializationMode", _) => Initialization,
        ("fmi2ExitInitializationMode", CoSimulation) => StepComplete,
        ("fmi2ExitInitializationMode", ModelExchange) => Event,
        ("fmi2EnterContinuousTimeMode", _) => ContinuousTime,
        ("fmi2EnterEventMode", _) => Event,
        ("fmi2Terminate", _) => Terminated,
        ("fmi2Reset", _) => Instantiated,
        _ => mode,
    }
}

/// Calls in any order: always the same rules, and no call is ever fatal.
#[test]
fn random_walks() {
    for interface in [CoSimulation, ModelExchange] {
        let fmu = Fmu::new(interface);
        let (mut random, mut mode) = (Random(13), Instantiated);
        let mut visits = std::collections::BTreeMap::new();
        for _ in 0..20_000 {
            let function = FUNCTIONS_OF_COMPONENTS[random.bits() as usize % FUNCTIONS_OF_COMPONENTS.len()];
            // Resets are rare, or nothing else would happen.
            if matches!(function, "fmi2Reset" | "fmi2Terminate") && random.bits() % 8 > 0 {
                continue;
            }
            let status = call(&fmu, function, mode);
            if accepted(function, interface, mode) {
                assert!(matches!(status, Status::Ok | Status::Discard), "{function}: {:?}", fmu.take_log());
                mode = next(function, interface, mode);
            } else {
                assert_eq!(status, Status::Error, "{function} in state '{mode}' of {interface}");
            }
            *visits.entry(mode.to_string()).or_insert(0) += 1;
            fmu.take_log();
        }
        let modes = if interface == CoSimulation { 4 } else { 5 };
        assert!(visits.len() == modes && visits.values().all(|calls| *calls > 500), "{visits:?}");
    }
}

const CELLS_OF_CO_SIMULATION: usize = 6 + 1 + 1 + 1 + 2 + 6 + 4 * 5 + 4 * 3 + 6 * 6 + 5 + 3 + 4 + 1 + 5 * 3;
const CELLS_OF_MODEL_EXCHANGE: usize =
    6 + 1 + 1 + 1 + 2 + 6 + 4 * 5 + (4 + 3 * 3) + 6 * 6 + 5 + 2 + 1 + 1 + 1 + 1 + 1 + 3 * 5 + 6;

#[test]
fn fmu_can_be_freed_in_every_state() {
    for (interface, mode) in all_modes() {
        assert!(standard("fmi2FreeInstance", interface, mode));
        drop(in_mode(interface, mode));
    }
}

#[test]
fn versions_need_no_instance() {
    assert_eq!(version_and_platform(), [c"2.0", c"default"]);
}

/// The table in the code says the same, also about states that cannot be reached here, and tells
/// standard and tolerance apart.
#[test]
fn table_in_the_code() {
    assert_eq!(CALL_TABLE.len(), FUNCTIONS_OF_COMPONENTS.len());
    for rule in CALL_TABLE {
        assert!(FUNCTIONS_OF_COMPONENTS.contains(&rule.name), "{}", rule.name);
        for (interface, mode) in all_modes().chain([(CoSimulation, Fatal), (ModelExchange, Fatal)]) {
            let own = if interface == CoSimulation { rule.co_simulation } else { rule.model_exchange };
            let label = format!("{} in state '{mode}' of {interface}", rule.name);
            assert_eq!(own.contains(mode), standard(rule.name, interface, mode), "{label}");
            assert_eq!(
                rule.accepted(interface).contains(mode),
                accepted(rule.name, interface, mode),
                "{label}, with tolerances"
            );
        }
    }
}

/// An importer that ignores a NULL from `fmi2Instantiate` (OMSimulator) gets errors, no crash.
#[test]
fn null_component() {
    let answers = call_all(&Fmu::null());
    assert_eq!(answers.len(), 40);
    for (function, status) in answers {
        assert_eq!(status, Status::Error, "{function}");
    }
}

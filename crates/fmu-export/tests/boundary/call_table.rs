//! Allowed calls: every function in every state of both state machines, compared with the tables of the
//! standard. The tables are copied here independently from the text of FMI 2.0.5.

use crate::offers;
use crate::settable;
use crate::models::*;
use fmu_export::Interface::{self, CoSimulation, ModelExchange};
use fmu_export::Mode::{self, *};
use fmu_export::fmi2::ALLOWED;
use fmu_export::fmi2::types::*;
use fmu_export::{BaseType, Causality, Exported, Variable};
use fmu_test_kit::checks::modes_of_model;
use fmu_test_kit::{Either, FUNCTIONS, Importer, Random};
use std::ptr::{null, null_mut};

/// Columns of the table in section 3.2.3: start/end, instantiated, Initialization Mode, Event Mode,
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

/// Columns of the table in section 4.2.4: start/end, instantiated, Initialization Mode, stepComplete,
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

/// Calls beyond the standard that real importers need: FMI Library terminates after an error, OpenModelica
/// sets time and states in Event Mode. Other tests cover tolerances for single variables.
const TOLERATED: [(&str, Interface, Mode); 5] = [
    ("fmi2Terminate", CoSimulation, Error),
    ("fmi2Terminate", ModelExchange, Error),
    ("fmi2SetTime", ModelExchange, Initialization),
    ("fmi2SetTime", ModelExchange, Event),
    ("fmi2SetContinuousStates", ModelExchange, Event),
];

/// Returns whether the standard allows the call in one of our modes.
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

fn accepted(function: &str, interface: Interface, mode: Mode) -> bool {
    standard(function, interface, mode) || TOLERATED.contains(&(function, interface, mode))
}

/// Returns the index of the first variable that satisfies `wanted`.
fn first<M: Exported>(wanted: impl Fn(&Variable<M>) -> bool) -> Option<u32> {
    M::TABLE.iter().position(wanted).map(|place| place as u32)
}

/// Makes one harmless call of the function, with arguments that are valid in this mode. If the model has no
/// variable for it, passes an empty array.
fn call<M: Exported>(fmu: &Importer, function: &str, interface: Interface, mode: Mode) -> Status {
    let (mut real, mut integer, mut text) = (0.0, 0, null());
    let (mut flags, mut array) = ([0; 2], [0.5; 8]);
    let states = M::STATES.len();
    let some = |vr: Option<u32>| (vr.unwrap_or(0), usize::from(vr.is_some()));
    let of = |base: BaseType| some(first::<M>(|variable| variable.base() == base));
    let settable = |base: BaseType| {
        some(first::<M>(|variable| variable.base() == base && settable::accepted(variable, interface, mode)))
    };
    let unknown = first::<M>(|variable| variable.causality() == Causality::Output).unwrap_or(0);
    let known =
        first::<M>(|variable| variable.causality() == Causality::Input || variable.is_state()).unwrap_or(0);
    match function {
        "fmi2SetDebugLogging" => fmu.fmi2SetDebugLogging(fmi2False, 0, null()),
        "fmi2SetupExperiment" => fmu.fmi2SetupExperiment(fmi2False, 0.0, 0.0, fmi2False, 0.0),
        "fmi2EnterInitializationMode" => fmu.fmi2EnterInitializationMode(),
        "fmi2ExitInitializationMode" => fmu.fmi2ExitInitializationMode(),
        "fmi2Terminate" => fmu.fmi2Terminate(),
        "fmi2Reset" => fmu.fmi2Reset(),
        "fmi2GetReal" => {
            let (vr, count) = of(BaseType::Real);
            fmu.fmi2GetReal(&vr, count, &mut real)
        }
        "fmi2GetInteger" => {
            let (vr, count) = of(BaseType::Integer);
            fmu.fmi2GetInteger(&vr, count, &mut integer)
        }
        "fmi2GetBoolean" => {
            let (vr, count) = of(BaseType::Boolean);
            fmu.fmi2GetBoolean(&vr, count, &mut integer)
        }
        "fmi2GetString" => {
            let (vr, count) = of(BaseType::String);
            fmu.fmi2GetString(&vr, count, &mut text)
        }
        "fmi2SetReal" => {
            let (vr, count) = settable(BaseType::Real);
            fmu.fmi2SetReal(&vr, count, &1.0)
        }
        "fmi2SetInteger" => {
            let (vr, count) = settable(BaseType::Integer);
            fmu.fmi2SetInteger(&vr, count, &3)
        }
        "fmi2SetBoolean" => {
            let (vr, count) = settable(BaseType::Boolean);
            fmu.fmi2SetBoolean(&vr, count, &fmi2True)
        }
        "fmi2SetString" => {
            let (vr, count) = settable(BaseType::String);
            fmu.fmi2SetString(&vr, count, &c"text".as_ptr())
        }
        "fmi2GetDirectionalDerivative" => {
            fmu.fmi2GetDirectionalDerivative(&unknown, 1, &known, 1, &1.0, &mut real)
        }
        "fmi2SetRealInputDerivatives" => fmu.fmi2SetRealInputDerivatives(&known, 1, &1, &0.1),
        "fmi2GetRealOutputDerivatives" => fmu.fmi2GetRealOutputDerivatives(&unknown, 1, &1, &mut real),
        "fmi2DoStep" => {
            let known = fmu.fmi2GetRealStatus(2, &mut real) == Status::Ok;
            fmu.take_log();
            fmu.fmi2DoStep(if known { real } else { 0.0 }, 0.01, fmi2True)
        }
        "fmi2CancelStep" => fmu.fmi2CancelStep(),
        "fmi2GetStatus" => fmu.fmi2GetStatus(0, &mut integer),
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
        "fmi2SetContinuousStates" => fmu.fmi2SetContinuousStates(array.as_ptr(), states),
        "fmi2GetDerivatives" => fmu.fmi2GetDerivatives(array.as_mut_ptr(), states),
        "fmi2GetEventIndicators" => {
            let count = M::MODEL_EXCHANGE.map_or(0, |offer| offer.indicators);
            fmu.fmi2GetEventIndicators(array.as_mut_ptr(), count)
        }
        "fmi2GetContinuousStates" => fmu.fmi2GetContinuousStates(array.as_mut_ptr(), states),
        "fmi2GetNominalsOfContinuousStates" => {
            fmu.fmi2GetNominalsOfContinuousStates(array.as_mut_ptr(), states)
        }
        state_function => call_state_function(fmu, state_function),
    }
}

/// Calls a function of saved states with a state of this instance.
fn call_state_function(fmu: &Importer, function: &str) -> Status {
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

/// Returns the attribute by which the description tells importers not to call a function, if the model lacks
/// the capability.
fn lacking<M: Exported>(function: &str) -> Option<&'static str> {
    match function {
        "fmi2GetDirectionalDerivative" if !M::PARTIALS => Some("providesDirectionalDerivative"),
        "fmi2SetRealInputDerivatives" if !M::INPUT_DERIVATIVES => Some("canInterpolateInputs"),
        "fmi2GetRealOutputDerivatives" if M::OUTPUT_DERIVATIVES == 0 => Some("maxOutputDerivativeOrder"),
        _ => None,
    }
}

#[test]
fn every_function_in_every_state() {
    for_every_model!(check_every_function());
}

fn check_every_function<M: Exported>() {
    let mut allowed_calls = 0;
    for (interface, mode) in modes_of_model::<Importer, M>() {
        for function in FUNCTIONS {
            let label = format!("{function} in state '{mode}' of {interface}, {}", M::INFO.name);
            let fmu = Importer::in_mode::<M>(interface, mode);
            let call = |fmu: &Importer| call::<M>(fmu, function, interface, mode);
            if !accepted(function, interface, mode) {
                let message = fmu.refused(&label, call);
                assert!(message.starts_with(function), "{label}: {message}");
                assert!(message.contains(&format!("'{mode}'")), "{label}: {message}");
                assert!(message.contains("allowed in"), "{label}: {message}");
                continue;
            }
            allowed_calls += 1;
            if let Some(attribute) = lacking::<M>(function) {
                let message = fmu.refused(&label, call);
                assert!(message.contains(attribute), "{label}: {message}");
                continue;
            }
            let expected = match *function {
                // Steps are synchronous, so these functions have no result.
                "fmi2GetStatus" | "fmi2GetIntegerStatus" | "fmi2GetStringStatus" => Status::Discard,
                _ => Status::Ok,
            };
            assert_eq!(call(&fmu), expected, "{label}: {:?}", fmu.take_log());
        }
    }
    // Counted by hand in the two tables, plus the tolerated calls. Without the four functions that need no
    // instance, stepInProgress and stepCanceled.
    let cells = [(CoSimulation, CELLS_OF_CO_SIMULATION), (ModelExchange, CELLS_OF_MODEL_EXCHANGE)];
    let offered = cells.into_iter().filter(|(interface, _)| offers::<M>(*interface));
    let tolerated = TOLERATED.iter().filter(|(_, interface, _)| offers::<M>(*interface)).count();
    assert_eq!(allowed_calls, offered.map(|(_, cells)| cells).sum::<usize>() + tolerated);
}

/// Returns the mode after an accepted call.
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

/// Makes random calls: the rules always hold, and no call is ever fatal.
#[test]
fn random_walks() {
    walk::<Oscillator>(CoSimulation);
    walk::<Oscillator>(ModelExchange);
    walk::<Counter>(CoSimulation);
    walk::<Counter>(ModelExchange);
    walk::<Talker>(CoSimulation);
    walk::<Ball>(ModelExchange);
}

fn walk<M: Exported>(interface: Interface) {
    let fmu = Importer::of::<M>(interface);
    let (mut random, mut mode) = (Random(13), Instantiated);
    let mut visits = std::collections::BTreeMap::new();
    for _ in 0..20_000 {
        let function = FUNCTIONS[random.bits() as usize % FUNCTIONS.len()];
        // Resets are rare, because most other calls need an initialized instance.
        if matches!(function, "fmi2Reset" | "fmi2Terminate") && random.bits() % 8 > 0 {
            continue;
        }
        let status = call::<M>(&fmu, function, interface, mode);
        let log = fmu.take_log();
        if lacking::<M>(function).is_some() || !accepted(function, interface, mode) {
            assert_eq!(status, Status::Error, "{function} in state '{mode}' of {interface}: {log:?}");
        } else {
            assert!(matches!(status, Status::Ok | Status::Discard), "{function}: {log:?}");
            mode = next(function, interface, mode);
        }
        *visits.entry(mode.to_string()).or_insert(0) += 1;
    }
    let modes = if interface == CoSimulation { 4 } else { 5 };
    assert!(visits.len() == modes && visits.values().all(|calls| *calls > 500), "{visits:?}");
}

const CELLS_OF_CO_SIMULATION: usize = 6 + 1 + 1 + 1 + 2 + 6 + 4 * 5 + 4 * 3 + 6 * 6 + 5 + 3 + 4 + 1 + 5 * 3;
const CELLS_OF_MODEL_EXCHANGE: usize =
    6 + 1 + 1 + 1 + 2 + 6 + 4 * 5 + (4 + 3 * 3) + 6 * 6 + 5 + 2 + 1 + 1 + 1 + 1 + 1 + 3 * 5 + 6;

#[test]
fn fmu_can_be_freed_in_every_state() {
    for (interface, mode) in modes_of_model::<Importer, Oscillator>() {
        assert!(standard("fmi2FreeInstance", interface, mode));
        drop(Importer::in_mode::<Oscillator>(interface, mode));
    }
}

#[test]
fn versions_need_no_instance() {
    assert_eq!(Importer::null::<Sum>().version_and_platform(), [c"2.0", c"default"]);
}

/// Checks that the table in the code agrees, also about states that cannot be reached here, and that it
/// distinguishes the standard from tolerated calls.
#[test]
fn table_in_the_code() {
    assert_eq!(ALLOWED.len(), FUNCTIONS.len());
    let broken = [(CoSimulation, Fatal), (ModelExchange, Fatal)];
    for rule in ALLOWED {
        assert!(FUNCTIONS.contains(&rule.name), "{}", rule.name);
        for (interface, mode) in modes_of_model::<Importer, Oscillator>().into_iter().chain(broken) {
            let label = format!("{} in state '{mode}' of {interface}", rule.name);
            assert_eq!(
                rule.standard.contain(fmu_export::Standard::Fmi2, interface, mode),
                standard(rule.name, interface, mode),
                "{label}"
            );
            let tolerated = TOLERATED.contains(&(rule.name, interface, mode));
            assert_eq!(
                rule.tolerated.contain(fmu_export::Standard::Fmi2, interface, mode),
                tolerated,
                "{label}, tolerated"
            );
            assert_eq!(
                rule.accepted().contain(fmu_export::Standard::Fmi2, interface, mode),
                accepted(rule.name, interface, mode),
                "{label}"
            );
        }
    }
}

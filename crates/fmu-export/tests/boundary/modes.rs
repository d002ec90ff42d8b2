//! The way into every state of the state machines (sections 3.2.3 and 4.2.4).

use fmu_export::Mode::{self, *};
use fmu_export::fmi2::types::{fmi2EventInfo, fmi2True};
use fmu_export::{Exported, Interface};
use fmu_test_kit::Importer;
use fmu_test_kit::serialized::with_mode;

pub const INTERFACES: [Interface; 2] = [Interface::CoSimulation, Interface::ModelExchange];

/// The modes of an interface type but fatal, which needs a model that panics.
pub fn modes_of(interface: Interface) -> [Mode; 6] {
    match interface {
        Interface::CoSimulation => {
            [Instantiated, Initialization, StepComplete, StepFailed, Terminated, Error]
        }
        Interface::ModelExchange => [Instantiated, Initialization, Event, ContinuousTime, Terminated, Error],
    }
}

/// Every interface type with every one of its modes.
pub fn all_modes() -> impl Iterator<Item = (Interface, Mode)> {
    INTERFACES.into_iter().flat_map(|interface| modes_of(interface).map(|mode| (interface, mode)))
}

/// Whether the model has an interface type.
pub fn offers<M: Exported>(interface: Interface) -> bool {
    match interface {
        Interface::CoSimulation => M::CO_SIMULATION.is_some(),
        Interface::ModelExchange => M::MODEL_EXCHANGE.is_some(),
    }
}

/// Every interface type that the model has, with every one of its modes.
pub fn modes_of_model<M: Exported>() -> impl Iterator<Item = (Interface, Mode)> {
    all_modes().filter(|(interface, _)| offers::<M>(*interface))
}

/// A new instance in this mode. Nothing that an importer does leads to "error", for refusals leave the mode as it is; a
/// saved state does.
pub fn in_mode<M: Exported>(interface: Interface, mode: Mode) -> Importer {
    let fmu = Importer::of::<M>(interface);
    if mode == Instantiated {
        return fmu;
    }
    fmu.enter_initialization(0.0, None);
    if mode == Initialization {
        return fmu;
    }
    fmu.ok(fmu.fmi2ExitInitializationMode());
    match mode {
        ContinuousTime => _ = enter_continuous_time(&fmu),
        Terminated => fmu.ok(fmu.fmi2Terminate()),
        StepFailed | Error => fmu.restore(&with_mode(fmu.bytes(), mode)),
        _ => {}
    }
    fmu
}

/// From event mode on, with the event iteration; what the rounds have said, together.
#[track_caller]
pub fn enter_continuous_time(fmu: &Importer) -> fmi2EventInfo {
    let mut all = fmi2EventInfo::default();
    loop {
        let mut info = fmi2EventInfo {
            new_discrete_states_needed: fmi2True,
            terminate_simulation: fmi2True,
            nominals_of_continuous_states_changed: fmi2True,
            values_of_continuous_states_changed: fmi2True,
            next_event_time_defined: fmi2True,
            next_event_time: f64::NAN,
        };
        fmu.ok(fmu.fmi2NewDiscreteStates(&mut info));
        all.terminate_simulation |= info.terminate_simulation;
        all.nominals_of_continuous_states_changed |= info.nominals_of_continuous_states_changed;
        all.values_of_continuous_states_changed |= info.values_of_continuous_states_changed;
        if info.new_discrete_states_needed == fmi2True {
            continue;
        }
        all.next_event_time_defined = info.next_event_time_defined;
        all.next_event_time = info.next_event_time;
        fmu.ok(fmu.fmi2EnterContinuousTimeMode());
        return all;
    }
}

//! The way into every state of the state machines (sections 3.2.3 and 4.2.4).

use crate::new;
use fmu_export::Interface;
use fmu_export::Mode::{self, *};
use fmu_export::fmi2::types::{fmi2EventInfo, fmi2True};
use fmu_test_kit::Importer as Fmu;
use fmu_test_kit::serialized::with_mode;

pub const INTERFACES: [Interface; 2] = [Interface::CoSimulation, Interface::ModelExchange];

/// The modes of an interface type. Fatal needs a model that panics, which this one does not.
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

/// A new instance in this mode. Nothing that an importer does leads to "step failed" and "error", for
/// refusals leave the mode as it is; a saved state does.
pub fn in_mode(interface: Interface, mode: Mode) -> Fmu {
    let fmu = new(interface);
    if mode == Instantiated {
        return fmu;
    }
    fmu.enter_initialization(0.0, None);
    if mode == Initialization {
        return fmu;
    }
    fmu.ok(fmu.fmi2ExitInitializationMode());
    match mode {
        ContinuousTime => enter_continuous_time(&fmu),
        Terminated => fmu.ok(fmu.fmi2Terminate()),
        StepFailed | Error => fmu.restore(&with_mode(fmu.bytes(), mode)),
        _ => {}
    }
    fmu
}

/// From event mode on, with an event iteration that must settle at once.
#[track_caller]
pub fn enter_continuous_time(fmu: &Fmu) {
    let mut info = fmi2EventInfo {
        new_discrete_states_needed: fmi2True,
        terminate_simulation: fmi2True,
        nominals_of_continuous_states_changed: fmi2True,
        values_of_continuous_states_changed: fmi2True,
        next_event_time_defined: fmi2True,
        next_event_time: 0.0,
    };
    fmu.ok(fmu.fmi2NewDiscreteStates(&mut info));
    assert_eq!(info, fmi2EventInfo::default(), "nothing happens at events");
    fmu.ok(fmu.fmi2EnterContinuousTimeMode());
}

//! The FMU of the testbed as an importer sees it: its physics, its parameters, its saved states. (What every FMU of
//! fmu-export does at the boundary is tested there, on toy models.)

#![allow(unsafe_code)]

mod co_simulation;
mod derivatives;
mod exact;
mod model_exchange;
mod parameters;
mod robustness;
mod saved_states;
mod start;
mod steps;

use fmu_export::{Interface, Mode, Variable, Variables};
use fmu_test_kit::{Either, Importer};
use prw_testbed::TestbedFmu;
use prw_testbed::variables::Name;

/// The table of variables.
const TABLE: &[Variable<TestbedFmu>] = TestbedFmu::TABLE;

/// The value reference of a variable.
const fn vr(name: Name) -> u32 {
    name as u32
}

/// A new instance.
fn new(interface: Interface) -> Importer {
    Importer::of::<TestbedFmu>(interface)
}

const INTERFACES: [Interface; 2] = [Interface::CoSimulation, Interface::ModelExchange];

/// A new instance in this mode.
fn in_mode(interface: Interface, mode: Mode) -> Importer {
    Importer::in_mode::<TestbedFmu>(interface, mode)
}

/// What every FMU does.
mod every {
    fmu_test_kit::every_check!(prw_testbed::TestbedFmu);
}

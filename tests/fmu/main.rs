//! Tests of the testbed FMU: motion, start, derivatives, parameters, saved states and robustness. The tests of fmu-export
//! cover the C functions, with test models.

#![allow(unsafe_code)]

mod co_simulation;
mod derivatives;
mod exact;
mod exponential;
mod fmikit;
mod model_exchange;
mod parameters;
mod robustness;
mod saved_states;
mod start;

use fmu_export::{Interface, Mode, Variable, Variables};
use fmu_test_kit::{Either, Importer};
use prw_testbed::TestbedFmu;
use prw_testbed::variables::Name;

/// The table of variables.
const TABLE: &[Variable<TestbedFmu>] = TestbedFmu::TABLE;

/// Returns the value reference of a variable.
const fn vr(name: Name) -> u32 {
    name as u32
}

/// Creates an instance.
fn new(interface: Interface) -> Importer {
    Importer::new::<TestbedFmu>(interface)
}

const INTERFACES: [Interface; 2] = [Interface::CoSimulation, Interface::ModelExchange];

/// Creates an instance in this mode.
fn in_mode(interface: Interface, mode: Mode) -> Importer {
    Importer::in_mode::<TestbedFmu>(interface, mode)
}

/// The checks of the test kit that every FMU must pass.
mod every {
    fmu_test_kit::every_check!(prw_testbed::TestbedFmu);
}

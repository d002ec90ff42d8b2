//! The FMU of the testbed as an importer sees it: its physics, its parameters, its saved states. (What every FMU of
//! fmu-export does at the boundary is tested there, on toy models.)

#![allow(unsafe_code)]

mod co_simulation;
mod derivatives;
mod exact;
mod importers;
mod model_exchange;
mod modes;
mod parameters;
mod robustness;
mod saved_states;
mod serialized;
mod start;
mod steps;

use fmu_export::{Interface, Variable, Variables};
use fmu_test_kit::Importer;
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

//! Modes in which a variable can be set (footnotes 1, 3, 4, 5 and 6 of sections 3.2.3 and 4.2.4 of FMI 2.0), for every
//! variable in every state.

use crate::{INTERFACES, offers};
use fmu_export::Interface::{self, CoSimulation, ModelExchange};
use fmu_export::Mode::{self, *};
use fmu_export::{BaseType, Causality, Exported, Initial, Status, Variability, Variable};
use fmu_test_kit::checks::modes_of_model;
use fmu_test_kit::{Either, Importer};

/// Returns whether the standard allows setting the variable in this mode.
fn standard<M>(variable: &Variable<M>, interface: Interface, mode: Mode) -> bool {
    let exact = variable.initial() == Some(Initial::Exact) && variable.variability() != Variability::Constant;
    let input = variable.causality() == Causality::Input;
    let tunable =
        (variable.causality(), variable.variability()) == (Causality::Parameter, Variability::Tunable);
    match (mode, interface) {
        (Instantiated, _) => exact || variable.initial() == Some(Initial::Approx), // footnote 1
        (Initialization, _) => exact || input,                                     // footnote 3
        (StepComplete, CoSimulation) | (Event, ModelExchange) => input || tunable, // footnotes 6 and 4
        (ContinuousTime, ModelExchange) => {
            variable.is_state() || input && variable.variability() == Variability::Continuous // footnote 5
        }
        _ => false,
    }
}

/// Returns whether the FMU also accepts the variable in this mode, because real importers set inputs before the
/// initialization and parameters after it.
fn tolerated<M>(variable: &Variable<M>, mode: Mode) -> bool {
    match (variable.causality(), mode) {
        (Causality::Input, Instantiated) | (Causality::Parameter, StepComplete | Event) => true,
        (Causality::Parameter, ContinuousTime) => variable.base() == BaseType::Real,
        _ => false,
    }
}

pub fn accepted<M>(variable: &Variable<M>, interface: Interface, mode: Mode) -> bool {
    standard(variable, interface, mode) || tolerated(variable, mode)
}

fn set(fmu: &Importer, vr: u32, base: BaseType) -> Status {
    match base {
        BaseType::Real => fmu.try_set(&[vr], &[0.625]),
        BaseType::Integer => fmu.set_integer(vr, 3),
        BaseType::Enumeration => fmu.set_item(vr, 2),
        BaseType::Boolean => fmu.set_boolean(vr, 1),
        _ => fmu.set_string(vr, c"a text".as_ptr()),
    }
}

/// Returns whether the variable has the value that [`set`] sets.
fn is_set(fmu: &Importer, vr: u32, base: BaseType) -> bool {
    match base {
        BaseType::Real => fmu.get([vr]) == [0.625],
        BaseType::Integer => fmu.integer(vr) == 3,
        BaseType::Enumeration => fmu.item(vr) == 2,
        BaseType::Boolean => fmu.boolean(vr),
        _ => fmu.string(vr) == "a text",
    }
}

#[test]
fn every_variable_in_every_state() {
    for_every_model!(check_every_variable);
}

fn check_every_variable<M: Exported>() {
    for (interface, mode) in modes_of_model::<Importer, M>() {
        let fmu = Importer::in_mode::<M>(interface, mode);
        for (vr, variable) in (0..).zip(M::TABLE) {
            let base = variable.base();
            let label = format!("{} in state '{mode}' of {interface}", variable.name());
            if accepted(variable, interface, mode) {
                assert_eq!(set(&fmu, vr, base), Status::Ok, "{label}: {:?}", fmu.take_log());
                continue;
            }
            let message = fmu.rejected(&label, |fmu| set(fmu, vr, base));
            let in_this_state = matches!(mode, Instantiated | Initialization | StepComplete | Event)
                || (mode == ContinuousTime && base == BaseType::Real);
            // If the mode does not allow the function, it does not look at variables, and the message names none.
            assert!(!in_this_state || message.contains(variable.name()), "{label}: {message}");
        }
    }
}

/// Checks that the getters return the values that were set, even of inputs, without a step in between.
#[test]
fn values_are_read_back() {
    for_every_model!(check_values);
}

fn check_values<M: Exported>() {
    for interface in INTERFACES.into_iter().filter(|interface| offers::<M>(*interface)) {
        let fmu = Importer::in_mode::<M>(interface, Initialization);
        let settable =
            || (0..).zip(M::TABLE).filter(|(_, variable)| accepted(variable, interface, Initialization));
        for (vr, variable) in settable() {
            fmu.ok(set(&fmu, vr, variable.base()));
        }
        for (vr, variable) in settable() {
            assert!(is_set(&fmu, vr, variable.base()), "{}", variable.name());
        }
        assert!(settable().count() > 1);
    }
}

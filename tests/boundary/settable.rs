//! Which variable can be set when (footnotes 1, 3, 4, 5 and 6 of sections 3.2.3 and 4.2.4), for every
//! variable in every state.

use crate::modes::{all_modes, in_mode};
use crate::support::{Fmu, Status};
use fmi2_export::BaseType;
use fmi2_export::Interface::{CoSimulation, ModelExchange};
use fmi2_export::call_table::Mode::{self, *};
use prw_testbed::variables::VARIABLES;

/// What kind of variable it is.
#[derive(Clone, Copy, PartialEq)]
enum Class {
    Input,
    State,
    Parameter,
    Calculated,
}

fn class(name: &str) -> Class {
    match name {
        "theta1" | "theta2" | "omega1" | "omega2" => Class::Input,
        "theta3" | "theta4" | "theta5" | "theta6" | "omega5" | "omega6" => Class::State,
        "J2" | "J3" | "H3" | "k1" | "k2" | "c1" | "c2" | "c3" | "M" | "N" | "use_omega" => Class::Parameter,
        _ => Class::Calculated,
    }
}

/// The standard's rule. All inputs are continuous, all states have initial = "exact", all parameters
/// are fixed.
fn standard(class: Class, mode: Mode) -> bool {
    match mode {
        Instantiated => matches!(class, Class::State | Class::Parameter), // footnote 1
        Initialization => class != Class::Calculated,                     // footnote 3
        StepComplete | Event => class == Class::Input,                    // footnotes 6 and 4
        ContinuousTime => matches!(class, Class::Input | Class::State),   // footnote 5
        _ => false,
    }
}

/// What real masters do beyond it: inputs before the initialization, parameters
/// after it.
fn tolerated(class: Class, mode: Mode) -> bool {
    matches!((class, mode), (Class::Input, Instantiated) | (Class::Parameter, StepComplete | Event))
}

fn set(fmu: &Fmu, vr: u32, base_type: BaseType) -> Status {
    match base_type {
        BaseType::Real => fmu.try_set(&[vr], &[0.625]),
        BaseType::Integer => fmu.fmi2SetInteger(&vr, 1, &3),
        BaseType::Boolean => fmu.fmi2SetBoolean(&vr, 1, &1),
        _ => panic!("there are no String variables"),
    }
}

fn get(fmu: &Fmu, vr: u32, base_type: BaseType) -> f64 {
    let (mut real, mut integer) = (f64::NAN, -1);
    match base_type {
        BaseType::Real => fmu.ok(fmu.fmi2GetReal(&vr, 1, &mut real)),
        BaseType::Integer => fmu.ok(fmu.fmi2GetInteger(&vr, 1, &mut integer)),
        _ => fmu.ok(fmu.fmi2GetBoolean(&vr, 1, &mut integer)),
    }
    if base_type == BaseType::Real { real } else { f64::from(integer) }
}

#[test]
fn every_variable_in_every_state() {
    for (interface, mode) in all_modes() {
        let fmu = in_mode(interface, mode);
        for (vr, variable) in (0..).zip(VARIABLES) {
            let base_type = variable.kind().base_type();
            let label = format!("{} in state '{mode}' of {interface}", variable.name());
            let class = class(variable.name());
            if standard(class, mode) || tolerated(class, mode) {
                assert_eq!(set(&fmu, vr, base_type), Status::Ok, "{label}: {:?}", fmu.take_log());
            } else {
                let message = fmu.refused(&label, |fmu| set(fmu, vr, base_type));
                let in_this_state = matches!(mode, Instantiated | Initialization | StepComplete | Event)
                    || (mode == ContinuousTime && base_type == BaseType::Real);
                // Where the whole function is refused, its variables are not looked at.
                assert!(!in_this_state || message.contains(variable.name()), "{label}: {message}");
            }
        }
    }
}

/// What is set is what is read, inputs too, without a step in between.
#[test]
fn values_are_read_back() {
    for interface in [CoSimulation, ModelExchange] {
        let fmu = in_mode(interface, Initialization);
        let settable =
            || (0..).zip(VARIABLES).filter(|(_, variable)| class(variable.name()) != Class::Calculated);
        for (vr, variable) in settable() {
            fmu.ok(set(&fmu, vr, variable.kind().base_type()));
        }
        for (vr, variable) in settable() {
            let base_type = variable.kind().base_type();
            let expected = match base_type {
                BaseType::Real => 0.625,
                BaseType::Integer => 3.0,
                _ => 1.0,
            };
            assert_eq!(get(&fmu, vr, base_type), expected, "{}", variable.name());
        }
    }
}

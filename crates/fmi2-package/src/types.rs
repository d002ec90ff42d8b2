//! Units and types of a model's variables (sections 2.2.2 and 2.2.3).
//!
//! fmi-schema keeps unit, range and nominal value of a variable in its type only, so every variable that
//! has any of these gets a type.

use anyhow::{Result, ensure};
use fmi_schema::fmi2::{
    self, Fmi2Unit, IntegerAttributes, RealAttributes, SimpleType, SimpleTypeElement, TypeDefinitions,
    UnitDefinitions,
};
use fmi2_export::{Kind, RealType, Unit, Variable};

/// The types of the variables, in the order of their first use.
///
/// Fails when two types share a name but nothing else, or a type and a variable share one.
pub(crate) fn type_definitions(variables: &[Variable]) -> Result<Option<TypeDefinitions>> {
    let mut types: Vec<SimpleType> = Vec::new();
    for variable in variables {
        let Some(name) = type_name(&variable.kind()) else { continue };
        let elem = match variable.kind() {
            Kind::Real { of, .. } => SimpleTypeElement::Real(real_attributes(of)),
            Kind::Integer { min, max, .. } => SimpleTypeElement::Integer(integer_attributes(min, max)),
            _ => continue,
        };
        match types.iter().find(|known| known.name == name) {
            Some(known) => ensure!(known.elem == elem, "there are two different types with the name {name}"),
            None => types.push(SimpleType { name, description: None, elem }),
        }
    }
    for name in types.iter().map(|known| &known.name) {
        ensure!(
            variables.iter().all(|variable| variable.name() != name),
            "{name} is a variable and a type; rename one of them (section 2.2.3)"
        );
    }
    Ok((!types.is_empty()).then_some(TypeDefinitions { types }))
}

/// The name of a variable's type, if it needs one.
pub(crate) fn type_name(kind: &Kind) -> Option<String> {
    match *kind {
        Kind::Real { of, .. } => Some(of.name.to_owned()),
        Kind::Integer { min: i32::MIN, max: i32::MAX, .. } => None,
        Kind::Integer { min, max: i32::MAX, .. } => Some(format!("Integer_from_{min}")),
        Kind::Integer { min: i32::MIN, max, .. } => Some(format!("Integer_to_{max}")),
        Kind::Integer { min, max, .. } => Some(format!("Integer_from_{min}_to_{max}")),
        _ => None,
    }
}

fn real_attributes(of: &RealType) -> RealAttributes {
    RealAttributes {
        quantity: Some(of.quantity.to_owned()),
        unit: Some(of.unit.name.to_owned()),
        display_unit: of.unit.display.map(|display| display.name.to_owned()),
        min: of.min,
        max: of.max,
        nominal: of.nominal,
        ..RealAttributes::default()
    }
}

fn integer_attributes(min: i32, max: i32) -> IntegerAttributes {
    IntegerAttributes {
        min: (min != i32::MIN).then_some(f64::from(min)),
        max: (max != i32::MAX).then_some(f64::from(max)),
        ..IntegerAttributes::default()
    }
}

/// The units of the variables, in the order of their first use.
///
/// Fails when two different units share a name.
pub(crate) fn unit_definitions(variables: &[Variable]) -> Result<Option<UnitDefinitions>> {
    let mut units: Vec<&Unit> = Vec::new();
    for variable in variables {
        let Kind::Real { of: RealType { unit, .. }, .. } = variable.kind() else { continue };
        match units.iter().find(|known| known.name == unit.name) {
            Some(known) => {
                ensure!(**known == **unit, "there are two different units with the name {}", unit.name)
            }
            None => units.push(unit),
        }
    }
    let units: Vec<_> = units.into_iter().map(unit_definition).collect();
    Ok((!units.is_empty()).then_some(UnitDefinitions { units }))
}

fn unit_definition(unit: &Unit) -> Fmi2Unit {
    let exponent = |exponent: i32| (exponent != 0).then_some(exponent);
    let display = |display: fmi2_export::DisplayUnit| fmi2::DisplayUnit {
        name: display.name.to_owned(),
        factor: Some(display.factor),
        ..fmi2::DisplayUnit::default()
    };
    Fmi2Unit {
        name: unit.name.to_owned(),
        base_unit: Some(fmi2::BaseUnit {
            kg: exponent(unit.base.kg),
            m: exponent(unit.base.m),
            s: exponent(unit.base.s),
            rad: exponent(unit.base.rad),
            ..fmi2::BaseUnit::default()
        }),
        display_unit: unit.display.map(display).into_iter().collect(),
    }
}

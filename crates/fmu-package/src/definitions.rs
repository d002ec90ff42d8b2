//! Definitions of units and types (sections 2.2.2 and 2.2.3 of FMI 2.0, 2.4.3 and 2.4.4 of FMI 3.0).

use crate::table::{Attributes, Type, Unit};
use crate::xml::Element;
use anyhow::{Result, ensure};
use fmi_abi::Value;

/// The units of these types, in the order of their first use.
///
/// Fails when two different units share a name.
pub(crate) fn unit_definitions(types: &[&Type]) -> Result<Option<Element>> {
    let mut units: Vec<&Unit> = Vec::new();
    for of in types {
        let Attributes::Real { unit, .. } = &of.attributes else { continue };
        match units.iter().find(|known| known.name == unit.name) {
            Some(known) => {
                ensure!(*known == unit, "there are two different units with the name {}", unit.name)
            }
            None => units.push(unit),
        }
    }
    Ok(list("UnitDefinitions", units.into_iter().map(unit_definition)))
}

fn unit_definition(unit: &Unit) -> Element {
    let names = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];
    let exponents = names.into_iter().zip(&unit.exponents).filter(|(_, exponent)| **exponent != 0);
    let base = exponents.fold(Element::new("BaseUnit"), |base, (name, exponent)| base.with(name, exponent));
    let factor = (unit.factor != 1.0).then_some(unit.factor);
    let base = base.with_some("factor", factor).with_some("offset", not_zero(unit.offset));
    let display = unit.display.as_ref().map(|(name, factor, offset)| {
        let unit = Element::new("DisplayUnit").with("name", name);
        unit.with("factor", factor).with_some("offset", not_zero(*offset))
    });
    Element::new("Unit").with("name", &unit.name).containing([base]).containing(display)
}

fn not_zero(offset: f64) -> Option<f64> {
    (offset != 0.0).then_some(offset)
}

/// Those of these types that have a name, in the order of their first use.
///
/// Fails when two different types share a name, or a type and a variable do.
pub(crate) fn type_definitions(
    types: &[&Type],
    variables: &[&str],
    definition: fn(&Type) -> Element,
) -> Result<Option<Element>> {
    let mut named: Vec<&Type> = Vec::new();
    for of in types.iter().filter(|of| !of.name.is_empty()) {
        let name = of.name.as_str();
        ensure!(
            !variables.contains(&name),
            "{name} is a variable and a type; rename one of them (section 2.2.3)"
        );
        match named.iter().find(|known| known.name == name) {
            Some(known) => ensure!(known == of, "there are two different types with the name {name}"),
            None => named.push(of),
        }
    }
    Ok(list("TypeDefinitions", named.into_iter().map(definition)))
}

/// The items of an Enumeration.
pub(crate) fn items(of: &Type) -> impl Iterator<Item = Element> {
    let items: &[_] = if let Attributes::Enumeration(items) = &of.attributes { items } else { &[] };
    items.iter().map(|item| {
        Element::new("Item")
            .with("name", &item.name)
            .with("value", item.value)
            .with_some("description", filled(&item.description))
    })
}

/// The element with what its type says: quantity, unit, range, nominal value, kind of bytes.
pub(crate) fn with_attributes(element: Element, of: &Type) -> Element {
    let Attributes::Real { quantity, unit, nominal, .. } = &of.attributes else {
        return with_range(element, of);
    };
    let element = element
        .with_some("quantity", filled(quantity))
        .with("unit", &unit.name)
        .with_some("displayUnit", unit.display.as_ref().map(|(name, ..)| name));
    with_range(element, of).with_some("nominal", *nominal)
}

/// The element with the values that its type has: their range, or the kind of bytes.
pub(crate) fn with_range(element: Element, of: &Type) -> Element {
    let range = of.base.range();
    match &of.attributes {
        Attributes::Real { min, max, .. } => {
            element.with_some("min", min.map(Value::Real)).with_some("max", max.map(Value::Real))
        }
        Attributes::Integer { min, max } => element
            .with_some("min", (Some(*min) != range.map(|range| range.0)).then_some(min))
            .with_some("max", (Some(*max) != range.map(|range| range.1)).then_some(max)),
        Attributes::Binary { mime_type, max_size } => {
            element.with("mimeType", mime_type).with("maxSize", max_size)
        }
        _ => element,
    }
}

/// The text, unless it is empty.
pub(crate) fn filled(text: &str) -> Option<&str> {
    Some(text).filter(|text| !text.is_empty())
}

/// An element with these in it; `None` if there are none: the schema has no empty lists.
pub(crate) fn list(name: &str, elements: impl IntoIterator<Item = Element>) -> Option<Element> {
    Some(Element::new(name).containing(elements)).filter(|list| !list.children.is_empty())
}

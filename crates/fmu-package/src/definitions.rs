//! Definitions of units and types (sections 2.2.2 and 2.2.3 of FMI 2.0, 2.4.3 and 2.4.4 of FMI 3.0).

use crate::table::{Attributes, Type, Unit};
use anyhow::{Result, ensure};
use fmi_abi::Value;
use fmi_abi::write::Element;

/// Returns the element with the units of these types, in the order of their first use; `None` if there are none.
///
/// # Errors
/// When two different units share a name.
pub(crate) fn unit_definitions(types: &[&Type]) -> Result<Option<Element>> {
    let mut units: Vec<&Unit> = Vec::new();
    for definition in types {
        let Attributes::Real { unit, .. } = &definition.attributes else { continue };
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
    let display = unit.display.as_ref().map(|of| {
        let offset = (of.offset != 0.0).then_some(of.offset);
        Element::new("DisplayUnit")
            .with("name", &of.name)
            .with("factor", of.factor)
            .with_some("offset", offset)
    });
    Element::new("Unit")
        .with("name", &unit.name)
        .containing([unit.base.element("BaseUnit")])
        .containing(display)
}

/// Returns the element with the types that have a name, in the order of their first use; `None` if there are none.
///
/// # Errors
/// When two different types share a name, or a type and a variable do.
pub(crate) fn type_definitions(
    types: &[&Type],
    variables: &[&str],
    to_element: impl Fn(&Type) -> Element,
) -> Result<Option<Element>> {
    let mut named: Vec<&Type> = Vec::new();
    for definition in types.iter().filter(|definition| !definition.name.is_empty()) {
        let name = definition.name.as_str();
        ensure!(
            !variables.contains(&name),
            "{name} is a variable and a type; rename one of them (section 2.2.3 of FMI 2.0)"
        );
        match named.iter().find(|known| known.name == name) {
            Some(known) => ensure!(known == definition, "there are two different types with the name {name}"),
            None => named.push(definition),
        }
    }
    Ok(list("TypeDefinitions", named.into_iter().map(to_element)))
}

/// Returns the items of an Enumeration.
pub(crate) fn items(definition: &Type) -> impl Iterator<Item = Element> {
    let items: &[_] = if let Attributes::Enumeration(items) = &definition.attributes { items } else { &[] };
    items.iter().map(|item| {
        Element::new("Item")
            .with("name", &item.name)
            .with("value", item.value)
            .with_some("description", filled(&item.description))
    })
}

/// Adds the attributes of a type: quantity, unit, range and nominal value, or MIME type and size.
pub(crate) fn with_attributes(element: Element, definition: &Type) -> Element {
    let Attributes::Real { quantity, unit, nominal, .. } = &definition.attributes else {
        return with_range(element, definition);
    };
    let element = element
        .with_some("quantity", filled(quantity))
        .with("unit", &unit.name)
        .with_some("displayUnit", unit.display.as_ref().map(|of| &of.name));
    with_range(element, definition).with_some("nominal", *nominal)
}

/// Adds the range of a type, or the MIME type and the maximum size of a Binary.
pub(crate) fn with_range(element: Element, definition: &Type) -> Element {
    let range = definition.base.range();
    match &definition.attributes {
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

/// Returns a string unless it is empty.
pub(crate) fn filled(string: &str) -> Option<&str> {
    Some(string).filter(|string| !string.is_empty())
}

/// Returns an element with children; `None` if there are none, because the schema does not allow empty lists.
pub(crate) fn list(name: &str, elements: impl IntoIterator<Item = Element>) -> Option<Element> {
    Some(Element::new(name).containing(elements)).filter(|list| !list.children.is_empty())
}

//! Reads units, display units and declared types.

use super::{attribute_or_empty, base_of, child};
use crate::attribute::trimmed;
use crate::description::faults::{Fault, Faults};
use crate::description::{Attributes, Item, Type};
use crate::{BaseType, BaseUnit, DisplayUnit, Standard, Unit, Value, shown};
use roxmltree::Node;
use std::collections::HashSet;
use std::sync::Arc;

/// Reads a unit with its name (section 2.2.2 of FMI 2.0, 2.4.3 of FMI 3.0). Leaves out inverse display units of FMI 3.0, and those of
/// which something cannot be read.
pub(super) fn unit(node: Node, faults: &Faults) -> (String, Unit) {
    let base = child(node, "BaseUnit")
        .and_then(|base| BaseUnit::read(base).map_err(|why| faults.add(Fault::Value, || why)).ok());
    let display_unit = |of: Node| {
        let number = |name, default| match of.has_attribute(name) {
            true => faults.read(of, name),
            false => Some(default),
        };
        let is_inverse = of.has_attribute("inverse") && faults.read(of, "inverse") != Some(false);
        let (factor, offset) = (number("factor", 1.0)?, number("offset", 0.0)?);
        let name = of.attribute("name")?.to_owned();
        (!is_inverse).then_some(DisplayUnit { name, factor, offset })
    };
    let display_units = node.children().filter(|of| of.has_tag_name("DisplayUnit")).filter_map(display_unit);
    let (name, display_units) = (attribute_or_empty(node, "name"), display_units.collect::<Vec<_>>());
    let mut names = HashSet::new();
    for DisplayUnit { name: of, factor, .. } in &display_units {
        if !names.insert(of) {
            faults.add(Fault::Unit, || {
                format!("two display units of {} are called {}", shown(&name), shown(of))
            });
        }
        if *factor == 0.0 {
            faults.add(Fault::Unit, || format!("the factor of the display unit {} is 0", shown(of)));
        }
    }
    (name, Unit { base, display_units })
}

/// Reads a declared type. In FMI 2.0, a child element has the name of the base type and the attributes (section 2.2.3). In FMI 3.0, the
/// element is called, for example, `Float64Type` (section 2.4.4).
pub(super) fn declared_type(node: Node, standard: Standard, faults: &Faults) -> Type {
    let inner = match standard {
        Standard::Fmi2 => node.children().find(Node::is_element).unwrap_or(node),
        Standard::Fmi3 => node,
    };
    let name = inner.tag_name().name();
    let base = if standard == Standard::Fmi2 { name } else { name.strip_suffix("Type").unwrap_or_default() };
    let base = base_of(standard, base);
    Type {
        base,
        attributes: attributes(inner, base, None, faults),
        items: items(node, inner, faults),
        description: attribute_or_empty(node, "description"),
    }
}

/// Reads the attributes of a declared type, or of a variable, which inherits those that it lacks from its declared type.
pub(super) fn attributes(
    node: Node,
    base: Option<BaseType>,
    declared: Option<&Attributes>,
    faults: &Faults,
) -> Attributes {
    let text = |name: &str, of_declared: fn(&Attributes) -> &Option<Arc<str>>| {
        node.attribute(name).map(Arc::from).or_else(|| of_declared(declared?).clone())
    };
    let limit = |name: &str, of_declared: fn(&Attributes) -> &Option<Value>| match node.attribute(name) {
        // An f64 does not have all digits of an integer.
        Some(limit) => base
            .filter(|base| !base.is_float())
            .and_then(|_| trimmed(limit).parse().ok().map(Value::Integer))
            .or_else(|| faults.read(node, name).map(Value::Real)),
        None => of_declared(declared?).clone(),
    };
    let nominal = match node.has_attribute("nominal") {
        true => faults.read(node, "nominal"),
        false => declared.and_then(|of| of.nominal),
    };
    let is_relative = match node.has_attribute("relativeQuantity") {
        true => faults.read(node, "relativeQuantity") == Some(true),
        false => declared.is_some_and(|of| of.is_relative),
    };
    let max_size = match node.has_attribute("maxSize") {
        true => faults.read(node, "maxSize"),
        false => declared.and_then(|of| of.max_size),
    };
    Attributes {
        quantity: text("quantity", |of| &of.quantity),
        unit: text("unit", |of| &of.unit),
        display_unit: text("displayUnit", |of| &of.display_unit),
        is_relative,
        min: limit("min", |of| &of.min),
        max: limit("max", |of| &of.max),
        nominal,
        mime_type: text("mimeType", |of| &of.mime_type),
        max_size,
    }
}

/// Reads the items of an enumeration.
fn items(node: Node, inner: Node, faults: &Faults) -> Vec<Item> {
    let item = |item: Node| {
        Some(Item {
            name: item.attribute("name")?.to_owned(),
            value: faults.read(item, "value")?,
            description: attribute_or_empty(item, "description"),
        })
    };
    let items: Vec<_> = inner.children().filter(|item| item.has_tag_name("Item")).filter_map(item).collect();
    let (mut names, mut values) = (HashSet::new(), HashSet::new());
    let mut is_new = |item: &&Item| names.insert(item.name.clone()) & values.insert(item.value);
    if let Some(item) = items.iter().find(|item| !is_new(item)) {
        let of = || shown(node.attribute("name").unwrap_or_default());
        faults.add(Fault::Definition, || {
            format!(
                "the item {} = {} of {} has the name or the value of another item",
                shown(&item.name),
                item.value,
                of()
            )
        });
    }
    items
}

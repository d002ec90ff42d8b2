//! Reads units, display units and declared types.

use super::{attribute_or_empty, child};
use crate::description::faults::{Fault, Faults};
use crate::{BaseUnit, DisplayUnit, Standard, Unit, shown};
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
    (attribute_or_empty(node, "name"), Unit { base, display_units: display_units.collect() })
}

/// Attributes of a declared type, which are read once for all variables of this type.
pub(super) struct Declared<'a> {
    /// Name of the base type; empty if it is missing.
    pub base: &'a str,
    pub unit: Option<Arc<str>>,
    pub display_unit: Option<Arc<str>>,
    pub min: Option<f64>,
    pub max: Option<f64>,
    pub nominal: Option<f64>,
    pub is_relative: Option<bool>,
}

impl<'a> Declared<'a> {
    /// In FMI 2.0, a child element has the name of the base type and the attributes (section 2.2.3). In FMI 3.0, the element is called, for
    /// example, `Float64Type` (section 2.4.4).
    pub fn read(node: Node<'a, 'a>, standard: Standard, faults: &Faults) -> Self {
        let inner = node.first_element_child();
        let base = match standard {
            Standard::Fmi2 => inner.map_or("", |inner| inner.tag_name().name()),
            Standard::Fmi3 => node.tag_name().name().strip_suffix("Type").unwrap_or_default(),
        };
        let owner = |name: &str| match inner {
            Some(inner) if !node.has_attribute(name) => inner,
            _ => node,
        };
        let text = |name: &str| owner(name).attribute(name).map(Arc::from);
        let number = |name: &str| faults.read(owner(name), name);
        Self {
            base,
            unit: text("unit"),
            display_unit: text("displayUnit"),
            min: number("min"),
            max: number("max"),
            nominal: number("nominal"),
            is_relative: faults.read(owner("relativeQuantity"), "relativeQuantity"),
        }
    }
}

/// Reads an enumeration. In FMI 2.0 the type element contains an element for the base type (section 2.2.3);
/// in FMI 3.0 they are one element (2.4.4).
pub(super) fn enumeration(node: Node, faults: &Faults) -> Option<(String, Vec<(String, i64)>)> {
    let items = node.descendants().filter(|item| item.has_tag_name("Item"));
    let item = |item: Node| Some((item.attribute("name")?.to_owned(), faults.read(item, "value")?));
    let items: Vec<_> = items.filter_map(item).collect();
    let (mut names, mut values) = (HashSet::new(), HashSet::new());
    let mut is_new = |(name, value): &&(String, i64)| names.insert(name.clone()) & values.insert(*value);
    if let Some((name, value)) = items.iter().find(|item| !is_new(item)) {
        let of = || shown(node.attribute("name").unwrap_or_default());
        faults.add(Fault::Definition, || {
            format!(
                "the item {} = {value} of {} has the name or the value of another item",
                shown(name),
                of()
            )
        });
    }
    (!items.is_empty()).then(|| Some((node.attribute("name")?.to_owned(), items)))?
}

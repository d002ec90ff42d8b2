//! Reads variables (section 2.2.7 of FMI 2.0, 2.4.7 of FMI 3.0).

use super::definitions::attributes;
use super::{attribute_or_empty, base_of, elements};
use crate::attribute::{blank_separated, trimmed, value};
use crate::description::faults::{Fault, Faults};
use crate::description::{Alias, Clock, MAX_VALUES, Type, Variable};
use crate::{BaseType, Causality, Initial, Standard, Variability, shown};
use indexmap::IndexMap;
use roxmltree::Node;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// Upper bounds for the memory that a variable and a value in a list take, in bytes.
const VARIABLE: usize = 1000;
const VALUE: usize = 64;

/// The index of each variable of the file among the variables that could be read, in the order of the file.
pub(super) struct Positions(Vec<Option<usize>>);

impl Positions {
    /// Returns the index of the variable at a position, which counts from 1. The outer `None` means that the file has no such variable,
    /// the inner one that it could not be read.
    pub fn find(&self, number: u32) -> Option<Option<usize>> {
        self.0.get((number as usize).checked_sub(1)?).copied()
    }
}

/// Reads the variables. Variables without a value reference or a type are left out.
pub(super) fn variables(
    root: Node,
    standard: Standard,
    types: &IndexMap<String, Type>,
    structure: &HashMap<u32, usize>,
    faults: &Faults,
) -> Result<(Vec<Variable>, Positions), String> {
    let nodes: Vec<Node> = elements(root, "ModelVariables").collect();
    reserve(root, &nodes)?;
    let quiet = |node: Node, name: &str| value(node, name).and_then(Result::ok);
    let reference = |node: &Node| u32::try_from(quiet(*node, "valueReference")?).ok();
    // Start values of structural parameters, which are sizes.
    let starts: HashMap<u32, Option<usize>> =
        nodes.iter().rev().filter_map(|node| Some((reference(node)?, quiet(*node, "start")))).collect();
    // Value references of the variables that may be sizes (section 2.4.7.2 of FMI 3.0).
    let is_size = |node: &&Node| {
        let is = |name, value| node.attribute(name).map(trimmed) == Some(value);
        node.has_tag_name("UInt64")
            && (is("causality", "structuralParameter") || is("variability", "constant"))
    };
    let sizes: HashSet<u32> = nodes.iter().filter(is_size).filter_map(reference).collect();
    let (mut found, mut positions) = (Vec::new(), Positions(Vec::with_capacity(nodes.len())));
    let mut derivatives = Vec::new();
    let mut remaining = MAX_VALUES;
    for node in &nodes {
        let named = || shown(node.attribute("name").unwrap_or_default());
        let is_type = |child: &Node| base_of(standard, child.tag_name().name()).is_some();
        let of_type = match standard {
            Standard::Fmi2 => node.children().find(is_type),
            Standard::Fmi3 => Some(*node).filter(|node| is_type(node) || node.has_tag_name("Clock")),
        };
        let reference: Option<u32> = faults.read(*node, "valueReference");
        if node.attribute("valueReference").is_none() {
            faults.add(Fault::Reference, || format!("{} has no value reference", named()));
        } else if of_type.is_none() {
            faults.add(Fault::Type, || match standard {
                Standard::Fmi2 => format!("{} has no type", named()),
                Standard::Fmi3 => {
                    format!("{} has the type {}, which is unknown", named(), shown(node.tag_name().name()))
                }
            });
        }
        let (Some(reference), Some(of_type)) = (reference, of_type) else {
            positions.0.push(None);
            continue;
        };
        positions.0.push(Some(found.len()));
        let declared = of_type.attribute("declaredType").and_then(|name| types.get(name));
        let base = base_of(standard, of_type.tag_name().name());
        if let Some(other) = declared.map(|declared| declared.base).filter(|other| *other != base) {
            let name = |base: Option<BaseType>| base.and_then(|base| base.element(standard));
            faults.add(Fault::Definition, || {
                format!(
                    "{} is of type {}, but its declaredType is of {}",
                    named(),
                    of_type.tag_name().name(),
                    name(other).map_or("an unknown type".to_owned(), |other| format!("type {other}"))
                )
            });
        }
        // A size is a number, or the value of a structural parameter (section 2.4.7.2 of FMI 3.0).
        let size = |dimension: Node| {
            let has = |name| dimension.has_attribute(name);
            if has("start") == has("valueReference") {
                let count = if has("start") { "both start and" } else { "neither start nor" };
                faults.add(Fault::Dimension, || {
                    format!("a Dimension of {} has {count} valueReference", named())
                });
            }
            faults.read(dimension, "start").or_else(|| {
                let parameter = faults.read(dimension, "valueReference")?;
                if !sizes.contains(&parameter) {
                    faults.add(Fault::Dimension, || {
                        let what = "which is neither a structural parameter nor a constant of type UInt64";
                        format!("the size of {} is the variable {parameter}, {what}", named())
                    });
                }
                structure.get(&parameter).copied().or_else(|| *starts.get(&parameter)?)
            })
        };
        let dimensions = node.children().filter(|child| child.has_tag_name("Dimension")).map(size).collect();
        let mut variable = variable(*node, of_type, declared, (standard, reference, dimensions), faults);
        variable.limit(&mut remaining);
        derivatives.push(faults.read::<u32>(of_type, "derivative"));
        found.push(variable);
    }
    let by_reference: HashMap<u32, usize> =
        found.iter().enumerate().rev().map(|(index, of)| (of.reference, index)).collect();
    for (index, (variable, derivative)) in found.iter_mut().zip(derivatives).enumerate() {
        let Some(of) = derivative else { continue };
        let state = match standard {
            Standard::Fmi2 => positions.find(of),
            Standard::Fmi3 => by_reference.get(&of).copied().map(Some),
        };
        if state.is_none() {
            let name = shown(&variable.name);
            faults
                .add(Fault::Structure, || format!("{name} is the derivative of {of}, which does not exist"));
        }
        variable.derivative_of = state.flatten();
        if variable.derivative_of == Some(index) {
            let name = shown(&variable.name);
            faults.add(Fault::Structure, || format!("{name} is the derivative of itself"));
        }
    }
    Ok((found, positions))
}

/// Checks that there is enough memory for the variables and for the values in lists.
fn reserve(root: Node, nodes: &[Node]) -> Result<(), String> {
    let lists = root
        .descendants()
        .flat_map(|node| ["start", "dependencies", "dependenciesKind"].map(|name| node.attribute(name)));
    let values: usize = lists.flatten().map(|list| list.split_ascii_whitespace().count()).sum();
    let aliases = nodes.iter().flat_map(Node::children).filter(|child| child.has_tag_name("Alias")).count();
    crate::xml::reserve(VARIABLE * (nodes.len() + aliases) + VALUE * values)
        .map_err(|why| format!("modelDescription.xml cannot be read: {why}"))
}

/// Reads a variable. The attributes of its type are in the element `of_type`, or else in the declared type.
fn variable(
    node: Node,
    of_type: Node,
    declared: Option<&Type>,
    (standard, reference, dimensions): (Standard, u32, Option<Vec<usize>>),
    faults: &Faults,
) -> Variable {
    let base = base_of(standard, of_type.tag_name().name());
    let causality = faults.read(node, "causality").unwrap_or(Causality::Local);
    let variability = faults.read(node, "variability");
    let has_variability = node.has_attribute("variability");
    let variability = variability.unwrap_or_else(|| default_variability(standard, causality, base));
    let initial = faults.read(node, "initial").or_else(|| default_initial(causality, variability));
    let product = |sizes: &Vec<usize>| sizes.iter().try_fold(1_usize, |all, size| all.checked_mul(*size));
    let size = dimensions.as_ref().and_then(product);
    Variable {
        name: attribute_or_empty(node, "name"),
        reference,
        base,
        causality,
        variability,
        has_variability,
        initial,
        start: start_values(node, of_type, base, faults),
        dimensions,
        size,
        is_too_large: false,
        attributes: attributes(of_type, base, declared.map(|of| &of.attributes), faults),
        declared_type: of_type.attribute("declaredType").map(str::to_owned),
        derivative_of: None,
        reinit: faults.read(of_type, "reinit") == Some(true),
        clocked: node.attribute("clocks").is_some(),
        clocks: faults.read_list(node, "clocks").unwrap_or_default(),
        once_per_instant: faults.read(node, "canHandleMultipleSetPerTimeInstant") == Some(false),
        clock: node.has_tag_name("Clock").then(|| Box::new(Clock::read(node, faults))),
        description: attribute_or_empty(node, "description"),
        aliases: node.children().filter(|child| child.has_tag_name("Alias")).map(alias).collect(),
    }
}

fn alias(node: Node) -> Alias {
    Alias {
        name: attribute_or_empty(node, "name"),
        display_unit: node.attribute("displayUnit").map(Arc::from),
        description: attribute_or_empty(node, "description"),
    }
}

/// Reads the start values as written. In FMI 3.0, strings and binary values are in child elements (section 2.4.7.5).
fn start_values(node: Node, of_type: Node, base: Option<BaseType>, faults: &Faults) -> Vec<String> {
    let list = of_type.attribute("start");
    let start: Vec<String> = match base {
        Some(BaseType::String | BaseType::Binary) | None => list.map(str::to_owned).into_iter().collect(),
        Some(_) => blank_separated(list.unwrap_or_default()).map(str::to_owned).collect(),
    };
    if !start.is_empty() {
        return start;
    }
    let starts = node.children().filter(|child| child.has_tag_name("Start"));
    let value = |child: Node| {
        if !child.has_attribute("value") {
            let name = || shown(node.attribute("name").unwrap_or_default());
            faults.add(Fault::Attribute, || format!("a Start of {} lacks its value", name()));
        }
        attribute_or_empty(child, "value")
    };
    starts.map(value).collect()
}

/// Returns the default of `initial`, if there is one (table in section 2.2.7 of FMI 2.0, 2.4.7.4 of FMI 3.0).
fn default_initial(causality: Causality, variability: Variability) -> Option<Initial> {
    use Causality::{CalculatedParameter, Independent, Input, Local, Output, Parameter, StructuralParameter};
    match (causality, variability) {
        (Input | Independent, _) => None,
        (Parameter | StructuralParameter, _) | (Local | Output, Variability::Constant) => {
            Some(Initial::Exact)
        }
        (CalculatedParameter | Output | Local, _) => Some(Initial::Calculated),
    }
}

fn default_variability(standard: Standard, causality: Causality, base: Option<BaseType>) -> Variability {
    use Causality::{CalculatedParameter, Parameter, StructuralParameter};
    match causality {
        Parameter | CalculatedParameter | StructuralParameter if standard == Standard::Fmi3 => {
            Variability::Fixed
        }
        _ if base.is_some_and(BaseType::is_float) => Variability::Continuous,
        _ => Variability::Discrete,
    }
}

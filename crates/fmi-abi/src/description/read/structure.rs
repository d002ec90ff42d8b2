//! Reads the model structure (section 2.2.8 of FMI 2.0, 2.4.8 of FMI 3.0).

use super::variables::Positions;
use super::{child, elements};
use crate::description::faults::{Fault, Faults};
use crate::description::{ModelDescription, Unknown};
use crate::{DependencyKind, Standard, Variability, shown};
use roxmltree::Node;
use std::collections::{HashMap, HashSet};

impl ModelDescription {
    /// Reads the model structure, which refers to variables by position in FMI 2.0, counted from 1, and by value
    /// reference in FMI 3.0.
    pub(super) fn structure(&mut self, root: Node, positions: &Positions, faults: &Faults) {
        let by_reference: HashMap<u32, usize> =
            self.variables.iter().enumerate().rev().map(|(index, of)| (of.reference, index)).collect();
        let standard = self.standard;
        let find = |number: u32| {
            let found = match standard {
                Standard::Fmi2 => positions.find(number),
                Standard::Fmi3 => by_reference.get(&number).copied().map(Some),
            };
            if found.is_none() {
                let why = || format!("ModelStructure refers to {number}, which does not exist");
                faults.add(Fault::Structure, why);
            }
            found.flatten()
        };
        let attribute = if standard == Standard::Fmi2 { "index" } else { "valueReference" };
        let list = |group: &str, of_fmi3: &str| -> Vec<Unknown> {
            let Some(structure) = child(root, "ModelStructure") else { return Vec::new() };
            // Only the first entry of a variable counts.
            let mut known = HashSet::new();
            let mut new = |node| {
                let unknown = unknown(node, attribute, &find, faults)?;
                let is_new = known.insert(unknown.variable);
                if !is_new {
                    let name = shown(&self.variables[unknown.variable].name);
                    faults.add(Fault::Unknown, || format!("ModelStructure lists {name} twice as {of_fmi3}"));
                }
                is_new.then_some(unknown)
            };
            match standard {
                Standard::Fmi2 => elements(structure, group).filter_map(&mut new).collect(),
                Standard::Fmi3 => {
                    let nodes = structure.children().filter(|node| node.has_tag_name(of_fmi3));
                    nodes.filter_map(&mut new).collect()
                }
            }
        };
        let outputs = list("Outputs", "Output");
        let derivatives = list("Derivatives", "ContinuousStateDerivative");
        let initial_unknowns = list("InitialUnknowns", "InitialUnknown");
        let indicators = list("", "EventIndicator");
        for indicator in &indicators {
            let variable = &self.variables[indicator.variable];
            if !variable.is_float() || variable.variability != Variability::Continuous {
                let name = shown(&variable.name);
                let why = || format!("the event indicator {name} is not a continuous floating-point number");
                faults.add(Fault::Unknown, why);
            }
        }
        (self.outputs, self.derivatives, self.initial_unknowns) = (outputs, derivatives, initial_unknowns);
        self.event_indicators = match standard {
            Standard::Fmi2 if root.has_attribute("numberOfEventIndicators") => {
                faults.read(root, "numberOfEventIndicators")
            }
            Standard::Fmi2 => Some(0),
            Standard::Fmi3 => indicators.iter().try_fold(0_usize, |count, unknown| {
                count.checked_add(self.variables[unknown.variable].size?)
            }),
        };
        self.indicators = indicators;
    }
}

/// Reads an unknown. `find` returns the index of a variable, or `None` if it does not exist or cannot be read. If one of the dependencies
/// cannot be read, the unknown may depend on everything, as if the attribute were missing.
fn unknown(
    node: Node,
    attribute: &str,
    find: &impl Fn(u32) -> Option<usize>,
    faults: &Faults,
) -> Option<Unknown> {
    let kind = node.tag_name().name();
    if node.attribute(attribute).is_none() {
        faults.add(Fault::Structure, || format!("ModelStructure has an {kind} without {attribute}"));
    }
    let variable = find(faults.read(node, attribute)?)?;
    let dependencies: Option<Vec<u32>> = faults.read_list(node, "dependencies");
    let dependencies =
        dependencies.and_then(|list| list.into_iter().map(find).collect::<Option<Vec<usize>>>());
    let listed = |name: &str| node.attribute(name).map(|list| list.split_ascii_whitespace().count());
    if let (Some(kinds), count) = (listed("dependenciesKind"), listed("dependencies"))
        && count != Some(kinds)
    {
        let why = || {
            let count = count.map_or("no dependencies".to_owned(), |count| format!("{count} dependencies"));
            format!("an {kind} of ModelStructure has {kinds} dependenciesKind, but {count}")
        };
        faults.add(Fault::Unknown, why);
    }
    let mut kinds: Vec<DependencyKind> = faults.read_list(node, "dependenciesKind").unwrap_or_default();
    if dependencies.as_ref().is_none_or(|list| list.len() != kinds.len()) {
        kinds.clear();
    }
    Some(Unknown { variable, dependencies, kinds })
}

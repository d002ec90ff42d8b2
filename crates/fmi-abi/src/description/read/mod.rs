//! Reads model descriptions.

mod definitions;
mod structure;
mod variables;

use super::faults::{Fault, Faults};
use super::{About, LogCategory, ModelDescription, Offer};
use crate::attribute::trimmed;
use crate::{BaseType, Standard, shown, shown_number};
use definitions::{declared_type, unit};
use roxmltree::Node;
use std::collections::{HashMap, HashSet};
use variables::variables;

impl ModelDescription {
    /// Reads a `modelDescription.xml`.
    ///
    /// # Errors
    /// Fails if the string is not well-formed XML or would take too much memory or time, if the FMI version is not
    /// supported, and if `modelIdentifier` is not safe as the name of a file. The message names the reason.
    pub fn parse(xml: &str) -> Result<Self, String> {
        Self::parse_configured(xml, &HashMap::new())
    }

    /// Reads a `modelDescription.xml` for an instance in which structural parameters have other values than their start
    /// values. `structure` maps their value references to these values, which determine the sizes of arrays (section
    /// 2.4.7.2 of FMI 3.0).
    ///
    /// # Errors
    /// Fails for the same reasons as [`parse`](Self::parse).
    pub fn parse_configured(xml: &str, structure: &HashMap<u32, usize>) -> Result<Self, String> {
        let document = crate::xml::parse(xml, "modelDescription.xml")?;
        let root = document.root_element();
        let version = attribute_or_empty(root, "fmiVersion");
        let (standard, token) = match version.as_str() {
            "2.0" => (Standard::Fmi2, "guid"),
            version if is_version_3(version) => (Standard::Fmi3, "instantiationToken"),
            "1.0" => {
                let why = "its fmiVersion is \"1.0\"; FMI 2.0 and 3.0 are supported here, and FMPy and PyFMI run FMI 1.0";
                return Err(why.to_owned());
            }
            other => {
                return Err(format!("its fmiVersion is \"{}\"; FMI 2.0 and 3.0 are supported", shown(other)));
            }
        };
        let faults = Faults::default();
        let needs = |node: Node, name: &str| {
            if node.attribute(name).is_none() {
                faults.add(Fault::Attribute, || format!("{} lacks {name}", node.tag_name().name()));
            }
        };
        needs(root, "modelName");
        needs(root, token);
        let offer = |name: &str| {
            let node = child(root, name)?;
            // The schema of FMI 2.0 allows an element twice.
            if root.children().filter(|child| child.has_tag_name(name)).nth(1).is_some() {
                faults.add(Fault::Interface, || format!("there are two elements {name}"));
            }
            needs(node, "modelIdentifier");
            Some(Offer::read(node, standard, &faults))
        };
        let (co_simulation, model_exchange) = (offer("CoSimulation"), offer("ModelExchange"));
        [&co_simulation, &model_exchange].into_iter().flatten().try_for_each(Offer::check)?;
        let experiment = child(root, "DefaultExperiment");
        let time = |name: &str| -> Option<f64> { faults.read(experiment?, name) };
        let named =
            |list| elements(root, list).filter_map(|node| Some((node.attribute("name")?.to_owned(), node)));
        let tolerance = time("tolerance");
        if let Some(tolerance) = tolerance.filter(|tolerance| *tolerance < 0.0) {
            faults
                .add(Fault::Experiment, || format!("the tolerance {} is negative", shown_number(tolerance)));
        }
        let unique = |list, fault, what: &str| {
            let mut known = HashSet::new();
            for (name, _) in named(list).filter(|(name, _)| !known.insert(name.clone())) {
                faults.add(fault, || format!("two {what} are called {}", shown(&name)));
            }
        };
        unique("UnitDefinitions", Fault::Unit, "units");
        unique("TypeDefinitions", Fault::Definition, "types");
        let types = named("TypeDefinitions");
        let types = types.map(|(name, node)| (name, declared_type(node, standard, &faults))).collect();
        let (variables, positions) = variables(root, standard, &types, structure, &faults)?;
        let category =
            |(name, node)| LogCategory { name, description: attribute_or_empty(node, "description") };
        let mut description = Self {
            standard,
            version,
            model_name: attribute_or_empty(root, "modelName"),
            token: attribute_or_empty(root, token),
            about: About {
                description: attribute_or_empty(root, "description"),
                author: attribute_or_empty(root, "author"),
                version: attribute_or_empty(root, "version"),
                copyright: attribute_or_empty(root, "copyright"),
                license: attribute_or_empty(root, "license"),
                generation_tool: attribute_or_empty(root, "generationTool"),
            },
            co_simulation,
            model_exchange,
            scheduled_execution: child(root, "ScheduledExecution")
                .map(|node| Offer::read(node, standard, &faults)),
            default_experiment: ["startTime", "stopTime", "stepSize"].map(time),
            default_tolerance: tolerance.filter(|tolerance| tolerance.is_finite() && *tolerance > 0.0),
            variables,
            outputs: Vec::new(),
            derivatives: Vec::new(),
            initial_unknowns: Vec::new(),
            event_indicators: None,
            indicators: Vec::new(),
            log_categories: named("LogCategories").map(category).collect(),
            units: elements(root, "UnitDefinitions").map(|node| unit(node, &faults)).collect(),
            types,
            structured_names: root.attribute("variableNamingConvention").map(trimmed) == Some("structured"),
            faults: Vec::new(),
        };
        description.structure(root, &positions, &faults);
        description.faults = faults.into_list();
        Ok(description)
    }
}

/// Returns whether this is a version of FMI 3, such as 3.0, 3.1.2 or 3.0-beta.1, as the schema of FMI 3.0 defines them.
fn is_version_3(version: &str) -> bool {
    let (numbers, draft) = version.split_once('-').map_or((version, None), |(of, draft)| (of, Some(draft)));
    let parts: Vec<&str> = numbers.split('.').collect();
    let are_numbers = parts.iter().all(|part| !part.is_empty() && part.bytes().all(|of| of.is_ascii_digit()));
    parts[0] == "3" && (2..=3).contains(&parts.len()) && are_numbers && draft != Some("")
}

/// Returns the base type of an XML element.
fn base_of(standard: Standard, element: &str) -> Option<BaseType> {
    BaseType::ALL.into_iter().find(|base| base.element(standard) == Some(element))
}

pub(super) fn attribute_or_empty(node: Node, name: &str) -> String {
    node.attribute(name).unwrap_or_default().to_owned()
}

fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    node.children().find(|child| child.has_tag_name(name))
}

pub(super) fn elements<'a>(node: Node<'a, 'a>, list: &str) -> impl Iterator<Item = Node<'a, 'a>> {
    child(node, list).into_iter().flat_map(|list| list.children()).filter(Node::is_element)
}

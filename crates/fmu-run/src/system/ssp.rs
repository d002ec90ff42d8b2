//! Reads systems from SSP files (System Structure and Parameterization 1.0).

use super::{Component, Definition, Order, StartValue, System};
use crate::error::Error;
use crate::files::{Files, Kind};
use crate::fmu::Loaded;
use crate::start::StartValues;
use roxmltree::{Document, Node};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Content of `SystemStructure.ssd`.
#[derive(Default)]
struct Read {
    /// Components with the files of their FMUs, in their order.
    components: Vec<(String, String)>,
    /// Connectors of systems.
    connectors: Vec<String>,
    connections: Vec<(String, String)>,
    start: Vec<(String, Value)>,
}

/// A start value with its unit.
#[derive(Clone)]
struct Value {
    kind: String,
    text: String,
    unit: Option<String>,
}

impl System {
    /// Unpacks an SSP file, then loads and connects its FMUs. Systems may be nested. A connector of the outer
    /// system is an input or output with its name. Start values come from parameter bindings.
    ///
    /// # Safety
    /// The requirement of [`Fmu::open`](crate::Fmu::open), for each FMU in the file.
    ///
    /// # Errors
    /// Returns [`Error::Fmu`] if the file is no SSP file, or one of its FMUs cannot be loaded. Returns
    /// [`Error::Request`] as [`connect`](Self::connect) does, and for unsupported content: components that
    /// are no FMUs, parameter mappings, signal dictionaries, transformations of connections.
    pub unsafe fn open(path: &Path, order: Order) -> Result<Self, Error> {
        let fail = |why: String| Error::Fmu(format!("{}: {why}", path.display()));
        let directory = Files::open(path, Kind::Ssp).map_err(fail)?;
        let text = directory.xml("SystemStructure.ssd").map_err(fail)?;
        let document = Document::parse(&text)
            .map_err(|error| fail(format!("SystemStructure.ssd is no XML: {error}")))?;
        let root = document.root_element();
        let system =
            child(root, "System").ok_or_else(|| fail("SystemStructure.ssd has no System".to_owned()))?;
        let mut read = Read::default();
        read.system(directory.path(), system, "").map_err(fail)?;

        let mut loaded: BTreeMap<&str, Arc<Loaded>> = BTreeMap::new();
        let mut components = Vec::new();
        for (name, source) in &read.components {
            let fmu = match loaded.get(source.as_str()) {
                Some(fmu) => Arc::clone(fmu),
                None => {
                    // SAFETY: the caller guarantees that the libraries are sound.
                    let opened = unsafe { Loaded::open(&directory.path().join(source), false) };
                    let opened = opened.map_err(|error| {
                        let inside = format!("{}/", directory.path().display());
                        fail(format!("component {name}: {}", error.to_string().replace(&inside, "")))
                    })?;
                    Arc::clone(loaded.entry(source).or_insert_with(|| Arc::new(opened)))
                }
            };
            components.push(Component { name: name.clone(), fmu });
        }
        let mut definition = Definition::of(root.attribute("name").unwrap_or("system"), components);
        read.connect(&mut definition);
        definition.start = read.start_values(&definition)?;
        let experiment = child(root, "DefaultExperiment");
        definition.stop_time =
            experiment.and_then(|of| of.attribute("stopTime")).and_then(|text| text.parse().ok());
        let system = definition.finish(order)?;
        StartValues::of(&system, &[])?;
        Ok(system)
    }
}

impl Read {
    /// Reads a system; names of its elements begin with `path`.
    fn system(&mut self, directory: &Path, node: Node, path: &str) -> Result<(), String> {
        self.bindings(directory, node, path)?;
        for connector in children(node, "Connectors") {
            self.connectors.push(format!("{path}{}", needed(connector, "name")?));
        }
        for element in children(node, "Elements") {
            let name = needed(element, "name")?;
            match element.tag_name().name() {
                "System" => self.system(directory, element, &format!("{path}{name}."))?,
                "Component" => {
                    let source = needed(element, "source")?;
                    let kind = element.attribute("type").unwrap_or("application/x-fmu-sharedlibrary");
                    if kind != "application/x-fmu-sharedlibrary" {
                        return Err(format!(
                            "component {path}{name} is no FMU but {kind}, which cannot be run"
                        ));
                    }
                    self.bindings(directory, element, &format!("{path}{name}."))?;
                    self.components.push((format!("{path}{name}"), source));
                }
                other => return Err(format!("{path}{name} is a {other}, which cannot be run")),
            }
        }
        for connection in children(node, "Connections") {
            let end = |side: &str| -> Result<String, String> {
                let connector = needed(connection, &format!("{side}Connector"))?;
                let element = connection.attribute(format!("{side}Element").as_str()).unwrap_or_default();
                let dot = if element.is_empty() { "" } else { "." };
                Ok(format!("{path}{element}{dot}{connector}"))
            };
            let (from, to) = (end("start")?, end("end")?);
            if let Some(change) = connection.children().find(Node::is_element)
                && change.tag_name().name().ends_with("Transformation")
            {
                let kind = change.tag_name().name();
                return Err(format!(
                    "the connection from {from} to {to} has a {kind}, which is not supported"
                ));
            }
            self.connections.push((from, to));
        }
        Ok(())
    }

    /// Reads the start values that are bound to an element; later values replace earlier ones.
    fn bindings(&mut self, directory: &Path, node: Node, path: &str) -> Result<(), String> {
        for binding in children(node, "ParameterBindings") {
            let path = format!("{path}{}", binding.attribute("prefix").unwrap_or_default());
            if child(binding, "ParameterMapping").is_some() {
                return Err(format!("the parameters of {path:?} have a mapping, which is not supported"));
            }
            match (binding.attribute("source"), child(binding, "ParameterValues")) {
                (_, Some(values)) => {
                    let set = values.children().find(|of| of.tag_name().name() == "ParameterSet");
                    set.map_or(Ok(()), |set| self.parameters(set, &path))?;
                }
                (Some(source), None) => {
                    let text = std::fs::read_to_string(directory.join(source))
                        .map_err(|_| format!("there is no readable {source} in it"))?;
                    let document =
                        Document::parse(&text).map_err(|error| format!("{source} is no XML: {error}"))?;
                    self.parameters(document.root_element(), &path)?;
                }
                (None, None) => return Err(format!("a parameter binding of {path:?} has no values")),
            }
        }
        Ok(())
    }

    fn parameters(&mut self, set: Node, path: &str) -> Result<(), String> {
        for parameter in children(set, "Parameters") {
            let name = format!("{path}{}", needed(parameter, "name")?);
            let value = parameter.children().find(Node::is_element);
            let value = value.ok_or_else(|| format!("{name} has no value"))?;
            let text = value.attribute("value").or_else(|| value.attribute("name"));
            let text = text.ok_or_else(|| format!("{name} has no value"))?.to_owned();
            let (kind, unit) =
                (value.tag_name().name().to_owned(), value.attribute("unit").map(str::to_owned));
            self.start.push((name, Value { kind, text, unit }));
        }
        Ok(())
    }

    /// Finds the connections between components, through all connectors of nested systems, and the connectors
    /// of the outer system.
    fn connect(&self, definition: &mut Definition) {
        let is_own = |definition: &Definition, name: &str| definition.look_up(name).is_some();
        for (_, to) in &self.connections {
            let from = self.origin(to);
            match [is_own(definition, from), is_own(definition, to)] {
                [true, true] => definition.connections.push((from.to_owned(), to.clone())),
                [false, true] => definition.connectors.entry(from.to_owned()).or_default().push(to.clone()),
                [true, false] => _ = definition.connectors.insert(to.clone(), vec![from.to_owned()]),
                [false, false] => {}
            }
        }
    }

    /// Returns the origin of a connection that ends here.
    fn origin<'a>(&'a self, end: &'a str) -> &'a str {
        let mut at = end;
        // A path without a circle has at most as many steps as there are connections.
        for _ in &self.connections {
            match self.connections.iter().find(|(_, to)| to == at) {
                Some((from, _)) => at = from,
                None => break,
            }
        }
        at
    }

    /// Returns the start values by variable, in the variable's unit. Omits values of inputs that outputs
    /// feed, because outputs would overwrite them. Omits values of connectors without a connection, because
    /// they have no effect.
    fn start_values(&self, definition: &Definition) -> Result<Vec<(String, StartValue)>, Error> {
        let mut all: Vec<(String, StartValue)> = Vec::new();
        for (name, Value { kind, text, unit }) in &self.start {
            let leads_nowhere = self.connectors.contains(name) && !definition.connectors.contains_key(name);
            if leads_nowhere {
                continue;
            }
            let found = definition.find(name)?[0];
            if found.source.is_some() {
                continue;
            }
            let value = match (kind.as_str(), text.parse::<f64>()) {
                ("Real" | "Integer", Ok(number)) => {
                    let scale = unit.as_deref().map(|unit| found.display_unit(name, unit)).transpose()?;
                    let (factor, offset) = scale.unwrap_or((1.0, 0.0));
                    StartValue::Number((number - offset) / factor)
                }
                _ => StartValue::Text(text.clone()),
            };
            all.push((name.clone(), value));
        }
        Ok(all)
    }
}

fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    node.children().find(|child| child.tag_name().name() == name)
}

fn children<'a>(node: Node<'a, 'a>, list: &str) -> impl Iterator<Item = Node<'a, 'a>> {
    child(node, list).into_iter().flat_map(|list| list.children()).filter(Node::is_element)
}

fn needed(node: Node, name: &str) -> Result<String, String> {
    let value = node.attribute(name).map(str::to_owned);
    value.ok_or_else(|| format!("a {} lacks {name}", node.tag_name().name()))
}

//! Reads systems from SSP files.

use super::FMU;
use super::source::Base;
use crate::error::Error;
use crate::files::{Files, Kind, STRUCTURE};
use crate::fmu::Loaded;
use crate::start::StartValues;
use crate::system::{Component, Definition, Order, StartValue, System};
use fmi_abi::files::{Limits, read_xml};
use fmi_abi::{shown, xml};
use roxmltree::Node;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Maximum memory of names and parameters, in bytes. Names of nested systems are repeated for each element, and several elements may
/// refer to the same parameter file, so a small file may need much memory.
const MAX_BYTES: usize = 128 << 20;

/// Content of `SystemStructure.ssd`.
struct Read<'a> {
    base: Base<'a>,
    /// Names of the components and paths of their FMUs, in the order of the file.
    components: Vec<(String, PathBuf)>,
    /// Names of the connectors of the outer and all nested systems.
    connectors: HashSet<String>,
    connections: Vec<(String, String)>,
    start: Vec<(String, Value)>,
    /// Number of bytes that may still be read.
    remaining: usize,
}

/// A start value with its unit.
#[derive(Clone)]
struct Value {
    kind: String,
    text: String,
    unit: Option<String>,
}

impl System {
    /// Unpacks an SSP file, then loads and connects its FMUs. Systems may be nested. A connector of the outer system is an input or
    /// output of the system, with the same name, if it is connected to a component. Start values are read from parameter bindings.
    /// All files to which the system refers must be in the archive. `path` may also be the directory of an unpacked system.
    ///
    /// # Safety
    /// The requirement of [`Fmu::open`](crate::Fmu::open), for each FMU in the file.
    ///
    /// # Errors
    /// Returns [`Error::Fmu`] if the file is not an SSP file, if one of its FMUs cannot be loaded, and for unsupported content:
    /// components that are not FMUs, parameter mappings, signal dictionaries, transformations of connections. Returns
    /// [`Error::Request`] if a start value does not fit its variable. Also returns the errors of [`connect`](Self::connect).
    pub unsafe fn open(path: &Path, order: Order) -> Result<Self, Error> {
        let fail = |why: String| Error::Fmu(format!("{}: {why}", path.display()));
        let mut limits = Limits::default();
        let directory = Files::open(path, Kind::Ssp, &mut limits).map_err(fail)?;
        let text = directory.xml(STRUCTURE).map_err(fail)?;
        let document = xml::parse(&text, STRUCTURE).map_err(fail)?;
        let root = document.root_element();
        let system = child(root, "System").ok_or_else(|| fail(format!("{STRUCTURE} has no System")))?;
        let is_archive = matches!(directory, Files::Temporary(_));
        let mut read = Read::of(Base { directory: directory.path(), is_archive });
        read.system(system, "").map_err(fail)?;

        let mut loaded: BTreeMap<&Path, Arc<Loaded>> = BTreeMap::new();
        let mut components = Vec::new();
        for (name, source) in &read.components {
            let fmu = match loaded.get(source.as_path()) {
                Some(fmu) => Arc::clone(fmu),
                None => {
                    // SAFETY: the caller guarantees that the libraries are sound.
                    let opened = unsafe { Loaded::open(source, false, &mut limits) };
                    let opened = opened.map_err(|error| {
                        let inside = directory.path().canonicalize().unwrap_or_default();
                        let inside = format!("{}/", inside.display());
                        fail(format!("component {}: {}", shown(name), error.to_string().replace(&inside, "")))
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

impl<'a> Read<'a> {
    fn of(base: Base<'a>) -> Self {
        Self {
            base,
            components: Vec::new(),
            connectors: HashSet::new(),
            connections: Vec::new(),
            start: Vec::new(),
            remaining: MAX_BYTES,
        }
    }

    /// Subtracts from the number of bytes that may still be read. Fails if too few remain.
    fn take(&mut self, bytes: usize) -> Result<(), String> {
        let remaining = self.remaining.checked_sub(bytes);
        self.remaining = remaining.ok_or("the names and parameters of its elements take too much memory")?;
        Ok(())
    }

    /// Returns the full name of an element. `path` is the name of its system, which ends with a dot or is empty.
    fn name(&mut self, path: &str, name: &str) -> Result<String, String> {
        self.take(path.len() + name.len() + size_of::<String>())?;
        Ok(format!("{path}{name}"))
    }

    /// Reads a system. The names of its elements begin with `path`. The recursion is limited, because the XML parser limits the depth
    /// of the file.
    fn system(&mut self, node: Node, path: &str) -> Result<(), String> {
        self.bindings(node, path)?;
        for connector in children(node, "Connectors") {
            let name = self.name(path, needed(connector, "name")?)?;
            self.connectors.insert(name);
        }
        for element in children(node, "Elements") {
            let name = self.name(path, needed(element, "name")?)?;
            match element.tag_name().name() {
                "System" => self.system(element, &format!("{name}."))?,
                "Component" => self.component(element, name)?,
                other => return Err(format!("{} is a {}, which cannot be run", shown(&name), shown(other))),
            }
        }
        for connection in children(node, "Connections") {
            self.connection(connection, path)?;
        }
        Ok(())
    }

    fn component(&mut self, element: Node, name: String) -> Result<(), String> {
        let source = needed(element, "source")?;
        let kind = element.attribute("type").unwrap_or(FMU);
        if kind != FMU {
            return Err(format!(
                "component {} is not an FMU but {}, which cannot be run",
                shown(&name),
                shown(kind)
            ));
        }
        self.bindings(element, &format!("{name}."))?;
        let file = self.base.find(source).map_err(|why| format!("component {}: {why}", shown(&name)))?;
        self.components.push((name, file));
        Ok(())
    }

    fn connection(&mut self, connection: Node, path: &str) -> Result<(), String> {
        let mut end = |side: &str| -> Result<String, String> {
            let connector = needed(connection, &format!("{side}Connector"))?;
            let element = connection.attribute(format!("{side}Element").as_str()).unwrap_or_default();
            let dot = if element.is_empty() { "" } else { "." };
            self.name(path, &format!("{element}{dot}{connector}"))
        };
        let (from, to) = (end("start")?, end("end")?);
        if let Some(change) = connection.children().find(Node::is_element)
            && change.tag_name().name().ends_with("Transformation")
        {
            let kind = change.tag_name().name();
            return Err(format!(
                "the connection from {} to {} has a {}, which is not supported",
                shown(&from),
                shown(&to),
                shown(kind)
            ));
        }
        self.connections.push((from, to));
        Ok(())
    }

    /// Reads the start values that are bound to an element. Later values replace earlier ones.
    fn bindings(&mut self, node: Node, path: &str) -> Result<(), String> {
        for binding in children(node, "ParameterBindings") {
            let path = self.name(path, binding.attribute("prefix").unwrap_or_default())?;
            if child(binding, "ParameterMapping").is_some() {
                return Err(format!(
                    "the parameters of \"{}\" have a mapping, which is not supported",
                    shown(&path)
                ));
            }
            match (binding.attribute("source"), child(binding, "ParameterValues")) {
                (_, Some(values)) => {
                    let set = values.children().find(|of| of.tag_name().name() == "ParameterSet");
                    set.map_or(Ok(()), |set| self.parameters(set, &path))?;
                }
                (Some(source), None) => {
                    let file = self.base.find(source)?;
                    let text = read_xml(&file).map_err(|why| format!("{} {why}", shown(source)))?;
                    self.take(text.len())?;
                    let document = xml::parse(&text, &shown(source))?;
                    self.parameters(document.root_element(), &path)?;
                }
                (None, None) => {
                    return Err(format!("a parameter binding of \"{}\" has no values", shown(&path)));
                }
            }
        }
        Ok(())
    }

    fn parameters(&mut self, set: Node, path: &str) -> Result<(), String> {
        for parameter in children(set, "Parameters") {
            let name = self.name(path, needed(parameter, "name")?)?;
            let value = parameter.children().find(Node::is_element);
            let no_value = || format!("{} has no value", shown(&name));
            let value = value.ok_or_else(no_value)?;
            let text = value.attribute("value").or_else(|| value.attribute("name"));
            let text = text.ok_or_else(no_value)?.to_owned();
            let (kind, unit) =
                (value.tag_name().name().to_owned(), value.attribute("unit").map(str::to_owned));
            self.take(text.len() + unit.as_ref().map_or(0, String::len) + size_of::<Value>())?;
            self.start.push((name, Value { kind, text, unit }));
        }
        Ok(())
    }

    /// Finds the connections between components, which may lead through connectors of nested systems, and the connectors of the outer
    /// system.
    fn connect(&self, definition: &mut Definition) {
        let is_own = |definition: &Definition, name: &str| definition.look_up(name).is_some();
        let mut connections = Vec::new();
        for ((_, to), from) in self.connections.iter().zip(self.origins()) {
            match [is_own(definition, from), is_own(definition, to)] {
                [true, true] => connections.push((from.to_owned(), to.clone())),
                [false, true] => definition.connectors.entry(from.to_owned()).or_default().push(to.clone()),
                [true, false] => _ = definition.connectors.insert(to.clone(), vec![from.to_owned()]),
                [false, false] => {}
            }
        }
        definition.set_connections(connections);
    }

    /// Returns the origin of each connection, which is the start of the chain of connections that ends with it.
    fn origins(&self) -> impl Iterator<Item = &str> {
        let mut first = HashMap::new();
        for (index, (_, to)) in self.connections.iter().enumerate() {
            first.entry(to.as_str()).or_insert(index);
        }
        let before = |index: usize| first.get(self.connections[index].0.as_str()).copied();
        // For each connection, the first connection of its chain, once it is known.
        let mut begins: Vec<Option<usize>> = vec![None; self.connections.len()];
        for index in 0..begins.len() {
            let (mut at, mut path) = (index, Vec::new());
            while begins[at].is_none() {
                // In a cycle of connections, any of them may be the first.
                begins[at] = Some(at);
                path.push(at);
                match before(at) {
                    Some(next) => at = next,
                    None => break,
                }
            }
            let begin = begins[at];
            path.into_iter().for_each(|index| begins[index] = begin);
        }
        begins.into_iter().flatten().map(|index| self.connections[index].0.as_str())
    }

    /// Returns the start values by variable, in the variable's unit. Values of inputs that are connected to outputs are left out,
    /// because the outputs overwrite them. Values of unconnected connectors are left out, because they have no effect.
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

fn needed<'a>(node: Node<'a, 'a>, name: &str) -> Result<&'a str, String> {
    node.attribute(name).ok_or_else(|| format!("a {} lacks {name}", shown(node.tag_name().name())))
}

//! Reads the structure of a system: components, connectors, connections and parameter bindings.

use super::FMU;
use super::source::Base;
use crate::change::Change;
use crate::error::Error;
use crate::unit::Unit;
use fmi_abi::{boolean, shown};
use roxmltree::Node;
use std::cell::Cell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Maximum memory of names and parameters, in bytes, and number of comparisons. Names of nested systems are repeated for each element,
/// several elements may refer to the same parameter file, and each parameter may have many mappings, so a small file may need much
/// memory or time.
const MOST: usize = 128 << 20;

/// Content of `SystemStructure.ssd`.
pub(super) struct Read<'r> {
    /// The file, for messages.
    pub path: &'r Path,
    pub base: Base<'r>,
    /// Names of the components and paths of their FMUs, in the order of the file.
    pub components: Vec<(String, PathBuf)>,
    /// Connectors of systems and components by name.
    pub connectors: HashMap<String, Declared>,
    pub connections: Vec<Connection>,
    /// Bindings of inner elements precede those of their system, whose values replace theirs (section 5.2.3 of SSP 1.0).
    pub bindings: Vec<Binding<'r>>,
    pub units: Units,
    /// Items of enumerations by name.
    pub enumerations: HashMap<String, Vec<(String, String)>>,
    /// Number of bytes that may still be read, or comparisons that may still be made.
    remaining: Cell<usize>,
}

/// A parameter binding of a system or a component.
pub(super) struct Binding<'r> {
    pub node: Node<'r, 'r>,
    /// Name of the system or component, which ends with a dot or is empty.
    pub path: String,
    /// Index of the component, unless it is the binding of a system.
    pub component: Option<usize>,
}

/// Definitions of units by name.
pub(super) type Units = HashMap<String, Unit>;

/// A connector as declared in the file.
pub(super) struct Declared {
    /// `input`, `output`, `parameter` and so on; empty if missing.
    pub kind: String,
    pub unit: Option<Arc<str>>,
    pub enumeration: Option<String>,
    /// Whether it belongs to a system, not to a component.
    pub is_of_system: bool,
    /// Whether it belongs to the outer system.
    pub is_outer: bool,
}

/// A connection as written in the file.
pub(super) struct Connection {
    pub ends: [Endpoint; 2],
    pub suppress_conversion: bool,
    pub transformation: Option<Transformation>,
}

/// A connector at one end of a connection.
pub(super) struct Endpoint {
    pub name: String,
    /// Whether it belongs to the system that has the connection, not to one of its elements.
    pub is_own: bool,
}

/// A transformation of values (section 4.5.2 of SSP 1.0).
pub(super) enum Transformation {
    Change(Change),
    /// Names of items of enumerations, each with the name that replaces it.
    Names(Vec<(String, String)>),
}

impl<'r> Read<'r> {
    pub fn of(path: &'r Path, base: Base<'r>, root: Node) -> Self {
        let item =
            |item: Node| Some((item.attribute("name")?.to_owned(), item.attribute("value")?.to_owned()));
        let enumerations = children(root, "Enumerations").filter_map(|of| {
            let items = of.children().filter(Node::is_element).filter_map(item).collect();
            Some((of.attribute("name")?.to_owned(), items))
        });
        Self {
            path,
            base,
            components: Vec::new(),
            connectors: HashMap::new(),
            connections: Vec::new(),
            bindings: Vec::new(),
            units: units(root),
            enumerations: enumerations.collect(),
            remaining: Cell::new(MOST),
        }
    }

    /// Returns an error of the file.
    pub fn fail(&self, why: &str) -> Error {
        Error::Fmu(format!("{}: {why}", self.path.display()))
    }

    /// Subtracts bytes or comparisons from the number that remains. Fails if too few remain.
    pub fn take(&self, count: usize) -> Result<(), String> {
        let remaining = self.remaining.get().checked_sub(count);
        let why = "the names, parameters and mappings of its elements take too much memory or time";
        self.remaining.set(remaining.ok_or(why)?);
        Ok(())
    }

    /// Returns the full name of an element. `path` is the name of its system, which ends with a dot or is empty.
    fn name(&self, path: &str, name: &str) -> Result<String, String> {
        self.take(path.len() + name.len() + size_of::<String>())?;
        Ok(format!("{path}{name}"))
    }

    /// Reads a system. The names of its elements begin with `path`. The recursion is limited, because the XML parser limits the depth
    /// of the file.
    pub fn system(&mut self, node: Node<'r, 'r>, path: &str) -> Result<(), String> {
        self.connectors(node, path, true)?;
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
        self.bindings(node, path, None)
    }

    fn connectors(&mut self, node: Node, path: &str, is_of_system: bool) -> Result<(), String> {
        for connector in children(node, "Connectors") {
            let name = self.name(path, needed(connector, "name")?)?;
            let kind = connector.attribute("kind").unwrap_or_default().to_owned();
            let of_type = |name: &str, attribute| {
                let of_type = connector.children().find(|of| of.tag_name().name() == name);
                of_type.and_then(|of| of.attribute(attribute))
            };
            let unit = of_type("Real", "unit").map(Arc::from);
            let enumeration = of_type("Enumeration", "name").map(str::to_owned);
            let is_outer = is_of_system && path.is_empty();
            self.take(size_of::<Declared>() + kind.len())?;
            self.connectors.insert(name, Declared { kind, unit, enumeration, is_of_system, is_outer });
        }
        Ok(())
    }

    fn component(&mut self, element: Node<'r, 'r>, name: String) -> Result<(), String> {
        let source = needed(element, "source")?;
        let kind = element.attribute("type").unwrap_or(FMU);
        if kind != FMU {
            return Err(format!(
                "component {} is not an FMU but {}, which cannot be run",
                shown(&name),
                shown(kind)
            ));
        }
        let path = format!("{name}.");
        self.connectors(element, &path, false)?;
        self.bindings(element, &path, Some(self.components.len()))?;
        let file = self.base.find(source).map_err(|why| format!("component {}: {why}", shown(&name)))?;
        self.components.push((name, file));
        Ok(())
    }

    fn connection(&mut self, connection: Node, path: &str) -> Result<(), String> {
        let end = |side: &str| -> Result<Endpoint, String> {
            let connector = needed(connection, &format!("{side}Connector"))?;
            let element = connection.attribute(format!("{side}Element").as_str()).unwrap_or_default();
            let dot = if element.is_empty() { "" } else { "." };
            let name = self.name(path, &format!("{element}{dot}{connector}"))?;
            Ok(Endpoint { name, is_own: element.is_empty() })
        };
        let ends = [end("start")?, end("end")?];
        let suppress_conversion =
            connection.attribute("suppressUnitConversion").and_then(boolean) == Some(true);
        let transformation = Transformation::of(connection)?;
        self.connections.push(Connection { ends, suppress_conversion, transformation });
        Ok(())
    }

    fn bindings(&mut self, node: Node<'r, 'r>, path: &str, component: Option<usize>) -> Result<(), String> {
        for node in children(node, "ParameterBindings") {
            self.take(path.len() + size_of::<Binding>())?;
            self.bindings.push(Binding { node, path: path.to_owned(), component });
        }
        Ok(())
    }
}

impl Transformation {
    /// Reads the transformation of a connection or of an entry of a mapping, if there is one.
    pub fn of(node: Node) -> Result<Option<Self>, String> {
        let is_transformation = |node: &Node| node.tag_name().name().ends_with("Transformation");
        let Some(node) = node.children().find(is_transformation) else { return Ok(None) };
        let kind = node.tag_name().name();
        let number = |name: &str, default| match node.attribute(name) {
            None => Ok(default),
            Some(text) => text
                .trim()
                .parse::<f64>()
                .map_err(|_| format!("{name} of a {kind} is {:?}, not a number", shown(text))),
        };
        if kind == "LinearTransformation" {
            let change = Change::linear(number("factor", 1.0)?, number("offset", 0.0)?);
            return Ok(Some(Self::Change(change)));
        }
        let entries = node.children().filter(Node::is_element);
        let pairs = entries.map(|entry| Ok([needed(entry, "source")?, needed(entry, "target")?]));
        let pairs: Vec<[&str; 2]> = pairs.collect::<Result<_, String>>()?;
        let value = |text: &str| match kind {
            "BooleanMappingTransformation" => boolean(text).map(|value| f64::from(u8::from(value))),
            _ => text.trim().parse::<i32>().ok().map(f64::from),
        };
        match kind {
            "BooleanMappingTransformation" | "IntegerMappingTransformation" => {
                let wrong = |text: &str| format!("a {kind} cannot contain {:?}", shown(text));
                let value = |text: &str| value(text).ok_or_else(|| wrong(text));
                let pairs = pairs.into_iter().map(|[from, to]| Ok((value(from)?, value(to)?)));
                Ok(Some(Self::Change(Change::map(pairs.collect::<Result<_, String>>()?))))
            }
            "EnumerationMappingTransformation" => {
                let pairs = pairs.into_iter().map(|[from, to]| (from.to_owned(), to.to_owned()));
                Ok(Some(Self::Names(pairs.collect())))
            }
            other => Err(format!(
                "a connection or mapping has the transformation {}, which is unknown",
                shown(other)
            )),
        }
    }

    /// Returns an upper bound for the number of comparisons in [`change`](Self::change) with this number of items.
    pub fn comparisons(&self, items: usize) -> usize {
        match self {
            Self::Change(_) => 0,
            Self::Names(pairs) => pairs.len().saturating_mul(items),
        }
    }

    /// Returns the change of values between enumerations with these items.
    pub fn change(&self, from: &[(String, String)], to: &[(String, String)]) -> Result<Change, String> {
        let number = |items: &[(String, String)], name: &String| {
            let item = items.iter().find(|(item, _)| item == name);
            let number = item.and_then(|(_, number)| number.trim().parse::<f64>().ok());
            number.ok_or_else(|| format!("{} is not an item of the enumeration", shown(name)))
        };
        match self {
            Self::Change(change) => Ok(change.clone()),
            Self::Names(pairs) => {
                let pairs = pairs.iter().map(|(one, other)| Ok((number(from, one)?, number(to, other)?)));
                pairs.collect::<Result<_, String>>().map(Change::map)
            }
        }
    }
}

/// Reads the definitions of units in an SSD or SSV file.
pub(super) fn units(root: Node) -> Units {
    let unit = |node: Node| {
        let attributes = child(node, "BaseUnit")?.attributes();
        let attributes: Vec<_> = attributes.map(|of| (of.name().to_owned(), of.value().to_owned())).collect();
        Some((node.attribute("name")?.to_owned(), Unit::of(&attributes)?))
    };
    children(root, "Units").filter_map(unit).collect()
}

pub(super) fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    node.children().find(|child| child.tag_name().name() == name)
}

pub(super) fn children<'a>(node: Node<'a, 'a>, list: &str) -> impl Iterator<Item = Node<'a, 'a>> {
    child(node, list).into_iter().flat_map(|list| list.children()).filter(Node::is_element)
}

pub(super) fn needed<'a>(node: Node<'a, 'a>, name: &str) -> Result<&'a str, String> {
    node.attribute(name).ok_or_else(|| format!("a {} lacks {name}", shown(node.tag_name().name())))
}

//! Reads the structure of a system: components, connectors, connections and parameter bindings.

use super::source::Base;
use super::{FMU, KNOWN};
use crate::change::Change;
use crate::connector::joined;
use crate::error::Error;
use crate::system::known::{only_attributes, warn_of_others};
use fmi_abi::description::Item;
use fmi_abi::xml::attribute;
use fmi_abi::{BaseUnit, boolean, shown};
use roxmltree::Node;
use std::cell::{Cell, RefCell};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Maximum memory of names and parameters, in bytes, and number of comparisons. Names of nested systems are repeated for each element,
/// several elements may refer to the same parameter file, and each parameter may have many mappings, so a small file may need much
/// memory or time.
const MOST: usize = 128 << 20;

/// Kinds of connectors (section 4.3.1 of SSP 1.0 and 2.0); empty if the file does not state it.
const KINDS: [&str; 9] = [
    "",
    "input",
    "output",
    "inout",
    "parameter",
    "calculatedParameter",
    "structuralParameter",
    "constant",
    "local",
];

/// Maximum number of warnings.
pub(in crate::system) const WARNINGS: usize = 100;

/// A connector of a system, or a connector or variable of a component: the index of the element and the name in it. They are not joined
/// to one name, because both may contain dots.
pub(super) type Place<'r> = (usize, &'r str);

/// A system or component.
pub(super) struct Element {
    /// Name with the names of the systems around it; empty for the outer system.
    pub name: String,
    /// Index of the component; `None` for a system.
    pub component: Option<usize>,
}

/// Content of `SystemStructure.ssd`.
pub(super) struct Read<'r> {
    /// The file, for messages.
    pub path: &'r Path,
    pub base: Base<'r>,
    /// Systems and components; the outer system is the first.
    pub elements: Vec<Element>,
    /// Indices of the elements by name.
    by_name: HashMap<String, usize>,
    /// Lengths of the names of the elements, in bytes.
    lengths: BTreeSet<usize>,
    /// Indices of the components among the elements and paths of their FMUs, in the order of the file.
    pub components: Vec<(usize, PathBuf)>,
    /// Connectors of systems and components.
    pub connectors: HashMap<Place<'r>, Declared<'r>>,
    pub connections: Vec<Connection<'r>>,
    /// Bindings of inner elements precede those of their system, whose values replace theirs (section 5.2.3 of SSP 1.0).
    pub bindings: Vec<Binding<'r>>,
    pub units: Units,
    /// Items of enumerations by name.
    pub enumerations: HashMap<String, Vec<Item>>,
    /// Number of bytes that may still be read, or comparisons that may still be made.
    remaining: Cell<usize>,
    /// What was read, but is strange.
    warnings: RefCell<Vec<String>>,
}

/// A parameter binding of a system or a component.
pub(super) struct Binding<'r> {
    pub node: Node<'r, 'r>,
    /// Index of the system or component.
    pub element: usize,
}

/// Definitions of units by name.
pub(super) type Units = HashMap<String, BaseUnit>;

/// A connector as declared in the file.
pub(super) struct Declared<'r> {
    /// `input`, `output`, `parameter` and so on; empty if missing.
    pub kind: &'r str,
    pub unit: Option<&'r str>,
    pub enumeration: Option<&'r str>,
}

/// A connection as written in the file.
pub(super) struct Connection<'r> {
    pub ends: [Endpoint<'r>; 2],
    pub suppress_conversion: bool,
    pub transformation: Option<Transformation>,
}

/// A connector at one end of a connection.
pub(super) struct Endpoint<'r> {
    pub place: Place<'r>,
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
    /// Reads what a file defines for all of its systems: units and enumerations.
    pub fn of(path: &'r Path, base: Base<'r>, root: Node) -> Result<Self, String> {
        let item = |item: Node| {
            let value = attribute(item, "value")?.ok_or_else(|| "an item lacks its value".to_owned())?;
            Ok(Item { name: needed(item, "name")?.to_owned(), value, description: String::new() })
        };
        let enumerations = children(root, "Enumerations").map(|of| {
            let items =
                of.children().filter(|of| of.is_element() && of.tag_name().name() == "Item").map(item);
            Ok((needed(of, "name")?.to_owned(), items.collect::<Result<_, String>>()?))
        });
        Ok(Self {
            path,
            base,
            elements: vec![Element { name: String::new(), component: None }],
            by_name: HashMap::new(),
            lengths: BTreeSet::new(),
            components: Vec::new(),
            connectors: HashMap::new(),
            connections: Vec::new(),
            bindings: Vec::new(),
            units: units(root)?,
            enumerations: enumerations.collect::<Result<_, String>>()?,
            remaining: Cell::new(MOST),
            warnings: RefCell::default(),
        })
    }

    /// Returns an error of the file.
    pub fn fail(&self, why: &str) -> Error {
        Error::Fmu(format!("{}: {why}", self.path.display()))
    }

    /// Adds a warning.
    pub fn warn(&self, why: impl FnOnce() -> String) {
        let mut all = self.warnings.borrow_mut();
        if all.len() < WARNINGS {
            all.push(why());
        }
    }

    /// Adds a warning for each element and attribute that SSP does not define.
    pub fn warn_of_others(&self, root: Node) {
        warn_of_others(root, KNOWN, &mut |why| self.warn(|| why));
    }

    /// Returns the warnings, each once.
    pub fn take_warnings(&self) -> Vec<String> {
        let mut all = self.warnings.take();
        let mut known = HashSet::new();
        all.retain(|why| known.insert(why.clone()));
        all
    }

    /// Subtracts bytes or comparisons from the number that remains. Fails if too few remain.
    pub fn take(&self, count: usize) -> Result<(), String> {
        let remaining = self.remaining.get().checked_sub(count);
        let why = "the names, parameters and mappings of its elements take too much memory or time";
        self.remaining.set(remaining.ok_or(why)?);
        Ok(())
    }

    /// Returns the name of a connector or variable in the system.
    pub fn name_of(&self, (element, name): Place) -> String {
        joined(&self.elements[element].name, name)
    }

    /// Adds an element of a system, and returns its index.
    fn element(&mut self, system: usize, name: &str) -> Result<usize, String> {
        let path = &self.elements[system].name;
        self.take(2 * (path.len() + name.len()) + size_of::<Element>() + size_of::<(String, usize)>())?;
        let (name, index) = (joined(path, name), self.elements.len());
        if self.by_name.insert(name.clone(), index).is_some() {
            return Err(format!("two elements are named {}", shown(&name)));
        }
        self.lengths.insert(name.len());
        self.elements.push(Element { name, component: None });
        Ok(index)
    }

    /// Reads the outer system.
    pub fn outer_system(&mut self, node: Node<'r, 'r>) -> Result<(), String> {
        self.system(node, 0)
    }

    /// Reads a system. The recursion is limited, because the XML parser limits the depth of the file.
    fn system(&mut self, node: Node<'r, 'r>, own: usize) -> Result<(), String> {
        self.connectors(node, own)?;
        for node in children(node, "Elements") {
            let index = self.element(own, needed(node, "name")?)?;
            match node.tag_name().name() {
                "System" => self.system(node, index)?,
                "Component" => self.component(node, index)?,
                other => {
                    let name = shown(&self.elements[index].name);
                    return Err(format!("{name} is a {}, which cannot be run", shown(other)));
                }
            }
        }
        for connection in children(node, "Connections") {
            self.connection(connection, own)?;
        }
        self.bindings(node, own)
    }

    fn connectors(&mut self, node: Node<'r, 'r>, element: usize) -> Result<(), String> {
        for connector in children(node, "Connectors") {
            let place = (element, needed(connector, "name")?);
            let kind = connector.attribute("kind").unwrap_or_default();
            if !KINDS.contains(&kind) {
                let name = self.name_of(place);
                return Err(format!("the connector {} is of the unknown kind {}", shown(&name), shown(kind)));
            }
            let of_type = |name: &str, attribute| {
                let of_type = connector.children().find(|of| of.tag_name().name() == name);
                of_type.and_then(|of| of.attribute(attribute))
            };
            let unit = of_type("Real", "unit").filter(|unit| !unit.is_empty());
            let enumeration = of_type("Enumeration", "name");
            self.take(size_of::<(Place, Declared)>())?;
            if self.connectors.insert(place, Declared { kind, unit, enumeration }).is_some() {
                return Err(format!("two connectors are named {}", shown(&self.name_of(place))));
            }
        }
        Ok(())
    }

    fn component(&mut self, element: Node<'r, 'r>, index: usize) -> Result<(), String> {
        let source = needed(element, "source")?;
        let kind = element.attribute("type").unwrap_or(FMU);
        let name = || shown(&self.elements[index].name);
        if kind != FMU {
            return Err(format!(
                "component {} is not an FMU but {}, which cannot be run",
                name(),
                shown(kind)
            ));
        }
        let interface = element.attribute("implementation").unwrap_or("any");
        if !matches!(interface, "any" | "CoSimulation") {
            return Err(format!(
                "component {} asks for {} (implementation), and systems run Co-Simulation only",
                name(),
                shown(interface)
            ));
        }
        let file = self.base.find(source).map_err(|why| format!("component {}: {why}", name()))?;
        self.connectors(element, index)?;
        self.elements[index].component = Some(self.components.len());
        self.components.push((index, file));
        self.bindings(element, index)
    }

    fn connection(&mut self, connection: Node<'r, 'r>, system: usize) -> Result<(), String> {
        let end = |side: &str| -> Result<Endpoint<'r>, String> {
            let connector = needed(connection, &format!("{side}Connector"))?;
            if connection.has_attribute(format!("{side}Indices").as_str()) {
                return Err(format!(
                    "a connection has {side}Indices, and elements of arrays cannot be connected"
                ));
            }
            let element = connection.attribute(format!("{side}Element").as_str()).unwrap_or_default();
            if element.is_empty() {
                return Ok(Endpoint { place: (system, connector), is_own: true });
            }
            let name = joined(&self.elements[system].name, element);
            self.take(name.len())?;
            let Some(index) = self.by_name.get(&name) else {
                let full = shown(&joined(&name, connector)).into_owned();
                return Err(format!(
                    "a connection leads to {full}, but there is no element {}",
                    shown(&name)
                ));
            };
            Ok(Endpoint { place: (*index, connector), is_own: false })
        };
        let ends = [end("start")?, end("end")?];
        self.take(size_of::<Connection>())?;
        let suppress_conversion = attribute(connection, "suppressUnitConversion")?.unwrap_or(false);
        let transformation = Transformation::of(connection)?;
        self.connections.push(Connection { ends, suppress_conversion, transformation });
        Ok(())
    }

    fn bindings(&mut self, node: Node<'r, 'r>, element: usize) -> Result<(), String> {
        for node in children(node, "ParameterBindings") {
            self.take(size_of::<Binding>())?;
            self.bindings.push(Binding { node, element });
        }
        Ok(())
    }

    /// Returns what the name of a parameter can denote in an element: a connector or variable of it or, in a system, of the elements in
    /// it, whose names precede the name of the connector. There are several if the name can be split at several dots. `exists` returns
    /// whether there is such a connector or variable.
    pub fn resolved<'n>(
        &self,
        element: usize,
        name: &'n str,
        exists: impl Fn(Place<'n>) -> bool,
    ) -> Result<Vec<Place<'n>>, String> {
        let path = &self.elements[element].name;
        let full = joined(path, name);
        let own = full.len() - name.len();
        let mut found = Vec::from_iter(Some((element, name)).filter(|place| exists(*place)));
        for length in self.lengths.range(own..).take_while(|length| **length < full.len()) {
            self.take(*length)?;
            let inner = full.get(..*length).and_then(|inner| self.by_name.get(inner));
            let rest = name.get(length - own..).and_then(|rest| rest.strip_prefix('.'));
            found.extend(inner.copied().zip(rest).filter(|place| exists(*place)));
        }
        Ok(found)
    }
}

impl Transformation {
    /// Reads the transformation of a connection or of an entry of a mapping, if there is one.
    pub fn of(node: Node) -> Result<Option<Self>, String> {
        let others = ["ConnectionGeometry", "Annotations"];
        let is_transformation = |node: &Node| node.is_element() && !others.contains(&node.tag_name().name());
        let Some(node) = node.children().find(is_transformation) else { return Ok(None) };
        let kind = node.tag_name().name();
        if kind == "LinearTransformation" {
            only_attributes(node, &["factor", "offset"])?;
            let (factor, offset) = (attribute(node, "factor")?, attribute(node, "offset")?);
            return Ok(Some(Self::Change(Change::linear(factor.unwrap_or(1.0), offset.unwrap_or(0.0)))));
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
    pub fn change(&self, from: &[Item], to: &[Item]) -> Result<Change, String> {
        let number = |items: &[Item], name: &String| {
            let item = items.iter().find(|item| item.name == *name);
            let number = item.map(|item| item.value as f64);
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

/// Reads the definitions of units in an SSD or SSV file. A unit without a definition is left out; an empty `BaseUnit` defines nothing.
pub(super) fn units(root: Node) -> Result<Units, String> {
    let mut units = Units::new();
    for node in children(root, "Units") {
        let Some(base) = child(node, "BaseUnit") else { continue };
        let unit = BaseUnit::read(base)?;
        if unit != BaseUnit::ONE {
            units.insert(needed(node, "name")?.to_owned(), unit);
        }
    }
    Ok(units)
}

pub(in crate::system) fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    node.children().find(|child| child.tag_name().name() == name)
}

pub(in crate::system) fn children<'a>(node: Node<'a, 'a>, list: &str) -> impl Iterator<Item = Node<'a, 'a>> {
    child(node, list).into_iter().flat_map(|list| list.children()).filter(Node::is_element)
}

pub(in crate::system) fn needed<'a>(node: Node<'a, '_>, name: &str) -> Result<&'a str, String> {
    node.attribute(name).ok_or_else(|| format!("a {} lacks {name}", shown(node.tag_name().name())))
}

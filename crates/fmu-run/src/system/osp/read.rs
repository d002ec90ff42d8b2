//! Opens systems for libcosim.

use super::STRUCTURE;
use crate::connector::Place;
use crate::connector::joined;
use crate::error::{Error, request};
use crate::start::StartValues;
use crate::system::known::{Known, warn_of_others};
use crate::system::ssp::{Base, WARNINGS, child, children, needed};
use crate::system::{Definition, Order, System};
use fmi_abi::files::{Limits, read_xml};
use fmi_abi::xml::{self, attribute};
use fmi_abi::{Causality, Value, shown};
use roxmltree::Node;
use std::path::{Path, PathBuf};

/// Elements and attributes that have a meaning here. Step sizes of simulators and power bonds have none: all components step together.
#[rustfmt::skip]
const KNOWN: &[Known] = &[
    ("OspSystemStructure", &["Description", "StartTime", "EndTime", "BaseStepSize", "Algorithm", "Simulators", "Functions",
        "Connections"], &["version"]),
    ("Simulators", &["Simulator"], &[]),
    ("Simulator", &["InitialValues"], &["name", "source"]),
    ("InitialValues", &["InitialValue"], &[]),
    ("InitialValue", &["Real", "Integer", "Boolean", "String"], &["variable"]),
    ("Connections", &["VariableConnection"], &[]),
    ("VariableConnection", &["Variable"], &[]),
    ("Variable", &[], &["simulator", "name", "causality"]),
];

/// A connection between two variables, each with its simulator.
type Connection<'d> = [(&'d str, &'d str); 2];

/// Content of `OspSystemStructure.xml`.
struct Read<'d> {
    /// Names and FMUs of the simulators.
    simulators: Vec<(String, PathBuf)>,
    /// Initial values, each with the index of its simulator and the name of its variable.
    initial: Vec<(usize, &'d str, Value)>,
    connections: Vec<Connection<'d>>,
    end_time: Option<f64>,
}

impl System {
    /// Returns the directory of a system for libcosim; `path` is the directory or its `OspSystemStructure.xml`. `None` if it is no
    /// such system.
    pub(in crate::system) fn osp_directory(path: &Path) -> Option<PathBuf> {
        if path.is_dir() && path.join(STRUCTURE).is_file() && !path.join(crate::files::STRUCTURE).is_file() {
            return Some(path.to_owned());
        }
        let is_structure = path.file_name().is_some_and(|name| name == STRUCTURE) && path.is_file();
        let directory = path.parent().filter(|_| is_structure)?;
        Some(if directory.as_os_str().is_empty() { PathBuf::from(".") } else { directory.to_owned() })
    }

    /// Opens a system for libcosim.
    ///
    /// # Safety
    /// The requirement of [`open`](Self::open).
    ///
    /// # Errors
    /// Returns [`Error::Fmu`] if the file cannot be read, or contains functions or connections of groups or signals. Also returns the
    /// errors of [`connect`](Self::connect).
    pub(in crate::system) unsafe fn open_osp(directory: &Path, order: Order) -> Result<Self, Error> {
        let fail = |why: String| Error::Fmu(format!("{}: {why}", directory.display()));
        // The path must be absolute, because the location of the resources is derived from it.
        let directory =
            &directory.canonicalize().map_err(|error| fail(format!("cannot be opened ({error})")))?;
        let text = read_xml(&directory.join(STRUCTURE)).map_err(|why| fail(format!("{STRUCTURE} {why}")))?;
        let mut declared = String::new();
        let document = xml::parse_undeclared(&text, STRUCTURE, &mut declared).map_err(fail)?;
        let read = Read::of(document.root_element(), &Base { directory, is_archive: false });
        let read = read.map_err(|why| fail(format!("{STRUCTURE}: {why}")))?;
        // SAFETY: the caller has met the requirement.
        let components = unsafe { Self::load(&read.simulators, directory, &mut Limits::default()) };
        let mut definition = Definition::of("system", components.map_err(fail)?);
        warn_of_others(document.root_element(), KNOWN, &mut |why| {
            if definition.warnings.len() < WARNINGS && !definition.warnings.contains(&why) {
                definition.warnings.push(why);
            }
        });
        definition.check_components()?;
        let connections = read.connections.iter().map(|ends| directed(&definition, ends));
        let connections = connections.collect::<Result<_, Error>>()?;
        definition.set_connections(connections, Vec::new());
        for (component, variable, value) in read.initial {
            let place = Place { component, variable: variable.to_owned() };
            definition.existing(&place)?;
            definition.start.push((place, value));
        }
        definition.stop_time = read.end_time;
        let system = definition.finish(order)?;
        StartValues::of(&system, &[])?;
        Ok(system)
    }
}

impl<'d> Read<'d> {
    fn of(root: Node<'d, 'd>, base: &Base) -> Result<Self, String> {
        let mut read =
            Self { simulators: Vec::new(), initial: Vec::new(), connections: Vec::new(), end_time: None };
        if let Some(function) = children(root, "Functions").next() {
            return Err(format!("it has a {}, and functions cannot be run", function.tag_name().name()));
        }
        for simulator in children(root, "Simulators") {
            let name = needed(simulator, "name")?;
            let source = base.find(needed(simulator, "source")?);
            let source = source.map_err(|why| format!("simulator {}: {why}", shown(name)))?;
            for initial in children(simulator, "InitialValues") {
                let variable = needed(initial, "variable")?;
                let value = initial.children().find(Node::is_element).map(value).transpose()?.flatten();
                let value =
                    value.ok_or_else(|| format!("{} has no value", shown(&joined(name, variable))))?;
                read.initial.push((read.simulators.len(), variable, value));
            }
            read.simulators.push((name.to_owned(), source));
        }
        for connection in children(root, "Connections") {
            let kind = connection.tag_name().name();
            if kind != "VariableConnection" {
                return Err(format!("it has a {}, which cannot be run; connect the variables", shown(kind)));
            }
            let ends = connection.children().filter(Node::is_element);
            let ends = ends.map(|end| Ok((needed(end, "simulator")?, needed(end, "name")?)));
            let ends = <[_; 2]>::try_from(ends.collect::<Result<Vec<_>, String>>()?);
            let ends =
                ends.map_err(|ends| format!("a VariableConnection has {} variables, not 2", ends.len()));
            read.connections.push(ends?);
        }
        if let Some(text) = child(root, "EndTime").and_then(|node| node.text()) {
            let time = text.trim().parse().map_err(|_| format!("EndTime is {:?}, not a number", shown(text)));
            read.end_time = Some(time?);
        }
        Ok(read)
    }
}

/// Reads an initial value.
fn value(node: Node) -> Result<Option<Value>, String> {
    match node.tag_name().name() {
        "Real" => Ok(attribute(node, "value")?.map(Value::Real)),
        "Integer" => Ok(attribute(node, "value")?.map(|value: i64| Value::Integer(value.into()))),
        "Boolean" => Ok(attribute(node, "value")?.map(Value::Boolean)),
        "String" => Ok(node.attribute("value").map(Value::from)),
        other => Err(format!("an initial value is a {}, which is unknown", shown(other))),
    }
}

/// Returns the ends of a connection, the output first. In the file they have any order.
fn directed(definition: &Definition, ends: &Connection) -> Result<(Place, Place), Error> {
    let place = |(simulator, variable): (&str, &str)| {
        let component = definition.by_name.get(simulator).copied();
        let Some(component) = component else {
            return request(format!("a connection leads to {}, which is no simulator", shown(simulator)));
        };
        Ok(Place { component, variable: variable.to_owned() })
    };
    let (one, other) = (place(ends[0])?, place(ends[1])?);
    let is_input = definition.existing(&one)?.variable.causality == Causality::Input;
    Ok(if is_input { (other, one) } else { (one, other) })
}

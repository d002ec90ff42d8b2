//! Start values of a system: parameter sets and the mappings of their names and values (sections 5.2.3, 6 and 7 of SSP 1.0).

use super::read::{Binding, Place, Read, Transformation, child, children, needed, units};
use super::routes::{Link, NamedUnit, Routes};
use super::source::Base;
use crate::change::Change;
use crate::connector;
use crate::error::{Error, request};
use crate::lookup::Found;
use crate::system::Definition;
use crate::system::known::only_attributes;
use fmi_abi::files::read_xml;
use fmi_abi::xml::attribute;
use fmi_abi::{Value, boolean, shown, xml};
use roxmltree::Node;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// A parameter of a parameter set.
#[derive(Clone)]
struct Parameter {
    kind: String,
    text: String,
    unit: Option<NamedUnit>,
}

/// An entry of a parameter mapping.
struct Entry {
    target: String,
    suppress_conversion: bool,
    transformation: Option<Transformation>,
}

/// Entries of a mapping by the name of the parameter. A parameter may be mapped to several names.
type Mapping = HashMap<String, Vec<Entry>>;

/// The system whose parameters are read.
pub(super) struct Target<'t> {
    read: &'t Read<'t>,
    definition: &'t Definition,
    routes: &'t Routes<'t>,
    /// The connections from each connector.
    next: HashMap<Place<'t>, Vec<&'t Link<'t>>>,
}

impl<'t> Target<'t> {
    pub fn of(
        read: &'t Read<'t>,
        definition: &'t Definition,
        links: &'t [Link<'t>],
        routes: &'t Routes<'t>,
    ) -> Self {
        let mut next: HashMap<Place, Vec<&Link>> = HashMap::new();
        links.iter().for_each(|link| next.entry(link.from).or_default().push(link));
        Self { read, definition, routes, next }
    }

    /// Returns the start values by the names of variables, in their units. Later values replace earlier ones, and values of a system
    /// replace values of the systems and components in it. Values without a variable are warnings, because a parameter set may be made for
    /// several systems. Values of inputs that are connected to outputs are left out, because the outputs replace them.
    pub fn start_values(&self) -> Result<Vec<(connector::Place, Value)>, Error> {
        let (read, mut all) = (self.read, Vec::new());
        for binding in &read.bindings {
            let component = read.elements[binding.element].component;
            let directory = component.map(|index| self.definition.components[index].fmu.directory());
            let values = read.values(binding, directory).map_err(|why| read.fail(&why))?;
            let mapping = read.mapping(binding, directory).map_err(|why| read.fail(&why))?;
            let names: HashSet<&str> = values.iter().map(|(name, _)| name.as_str()).collect();
            for source in mapping.iter().flat_map(Mapping::keys).filter(|source| !names.contains(&***source))
            {
                let owner = read.owner(binding);
                read.warn(|| format!("a mapping of {owner} has {:?}, which is no parameter", shown(source)));
            }
            for (name, value) in values {
                let Some(mapping) = &mapping else {
                    self.apply((binding.element, &name), &value, None, &mut all)?;
                    continue;
                };
                for entry in mapping.get(&name).into_iter().flatten() {
                    self.apply((binding.element, &entry.target), &value, Some(entry), &mut all)?;
                }
            }
        }
        Ok(all)
    }

    /// Adds the start values of the variables that a name in an element denotes: a variable of a component, or the variables to which a
    /// connector leads.
    fn apply(
        &self,
        (element, name): Place,
        value: &Parameter,
        entry: Option<&Entry>,
        all: &mut Vec<(connector::Place, Value)>,
    ) -> Result<(), Error> {
        let Self { read, definition, routes, next } = self;
        let fail = |why: String| read.fail(&why);
        let mapped = entry.map_or(0, |entry| {
            size_of::<Entry>() + entry.transformation.as_ref().map_or(0, |of| of.comparisons(1))
        });
        read.take(mapped).map_err(fail)?;
        let is_of_system = |(element, _): Place| read.elements[element].component.is_none();
        let exists = |place: Place| {
            read.variable(definition, place).is_some()
                || is_of_system(place) && read.connectors.contains_key(&place)
        };
        let places = read.resolved(element, name, exists).map_err(fail)?;
        let full = read.name_of((element, name));
        if places.len() > 1 {
            return request(format!(
                "the parameter {} is ambiguous, because several elements with dots in their names have such a connector",
                shown(&full)
            ));
        }
        let unused = |why| read.warn(|| format!("the value of {} is not used, because {why}", shown(&full)));
        let Some(place) = places.first().copied() else {
            unused("there is no such variable");
            return Ok(());
        };
        let is_overwritten =
            || routes.get(&place).is_some_and(|route| read.variable(definition, route.origin).is_some());
        let ends = match read.variable(definition, place) {
            Some(_) => vec![(place, Change::default())],
            None if is_overwritten() => Vec::new(),
            None => read.downstream(definition, (next, routes), place)?,
        };
        if ends.is_empty() && !is_overwritten() {
            unused("it leads to no variable");
        }
        let unit = read.unit_of(definition, place);
        for (end, change) in ends {
            let found = read.variable(definition, end).filter(|found| found.source.is_none());
            if let Some((found, end)) = found.zip(read.place(end)) {
                let bytes = end.variable.len() + value.text.len() + size_of::<(connector::Place, Value)>();
                read.take(bytes).map_err(fail)?;
                let warn = |why| read.warn(|| why);
                all.push((end, value.converted(&full, found, unit.as_ref(), entry, &change, &warn)?));
            }
        }
        Ok(())
    }
}

/// Types of parameter sets and of their mappings (sections 5.2.3 and 5.2.4 of SSP 1.0).
const VALUES: &str = "application/x-ssp-parameter-set";
const MAPPING: &str = "application/x-ssp-parameter-mapping";

/// Types of values (section 6.3 of SSP 1.0).
const TYPES: [&str; 6] = ["Real", "Integer", "Boolean", "String", "Enumeration", "Binary"];

impl Read<'_> {
    /// Returns the file to which an element refers, and its name; `None` if the element has the content itself. `directory` is the
    /// component's.
    fn file(&self, node: Node, directory: Option<&Path>) -> Result<Option<(String, String)>, String> {
        let Some(source) = node.attribute("source").filter(|source| !source.is_empty()) else {
            return Ok(None);
        };
        let file = match (node.attribute("sourceBase"), directory) {
            (Some("component"), Some(directory)) => Base { directory, is_archive: true }.find(source)?,
            (Some("component"), None) => {
                return Err(format!(
                    "{} is to be found in a component, but belongs to a system",
                    shown(source)
                ));
            }
            _ => self.base.find(source)?,
        };
        let text = read_xml(&file).map_err(|why| format!("{} {why}", shown(source)))?;
        Ok(Some((source.to_owned(), text)))
    }

    /// Reads the values of a parameter binding, by name.
    fn values(
        &self,
        binding: &Binding,
        directory: Option<&Path>,
    ) -> Result<Vec<(String, Parameter)>, String> {
        let prefix = binding.node.attribute("prefix").unwrap_or_default();
        self.check_type(binding, binding.node, VALUES)?;
        if let Some(values) = child(binding.node, "ParameterValues") {
            let set = child(values, "ParameterSet");
            return set.map_or(Ok(Vec::new()), |set| self.parameters(set, prefix));
        }
        let Some((name, text)) = self.file(binding.node, directory)? else {
            return Err(format!("a parameter binding of {} has no values", self.owner(binding)));
        };
        self.take(text.len())?;
        let mut declared = String::new();
        let document = xml::parse_undeclared(&text, &shown(&name), &mut declared)?;
        self.warn_of_others(document.root_element());
        self.parameters(document.root_element(), prefix)
    }

    /// Returns the element of a binding, for messages.
    fn owner(&self, binding: &Binding) -> String {
        match &*self.elements[binding.element].name {
            "" => "the system".to_owned(),
            name => shown(name).into_owned(),
        }
    }

    /// Fails if parameters or a mapping are of a type that is not read here.
    fn check_type(&self, binding: &Binding, node: Node, wanted: &str) -> Result<(), String> {
        match node.attribute("type") {
            Some(other) if other != wanted => Err(format!(
                "{} has a {} of the type {}, which cannot be read; convert it to {wanted}",
                self.owner(binding),
                node.tag_name().name(),
                shown(other)
            )),
            _ => Ok(()),
        }
    }

    fn parameters(&self, set: Node, prefix: &str) -> Result<Vec<(String, Parameter)>, String> {
        let units = units(set)?;
        let (mut found, mut names) = (Vec::new(), HashSet::new());
        for parameter in children(set, "Parameters") {
            let name = format!("{prefix}{}", needed(parameter, "name")?);
            if !names.insert(name.clone()) {
                return Err(format!("a parameter set has {} twice", shown(&name)));
            }
            let no_value = || format!("{} has no value", shown(&name));
            let is_value = |node: &Node| node.is_element() && node.tag_name().name() != "Annotations";
            let mut values = parameter.children().filter(is_value);
            let value = values.next().ok_or_else(no_value)?;
            if values.next().is_some() {
                return Err(format!("{} has several values", shown(&name)));
            }
            if !TYPES.contains(&value.tag_name().name()) {
                let other = shown(value.tag_name().name());
                return Err(format!("{} is a {other}; there are {}", shown(&name), TYPES.join(", ")));
            }
            only_attributes(value, &["value", "unit", "name", "mime-type"])
                .map_err(|why| format!("{}: {why}", shown(&name)))?;
            let text = value.attribute("value").or_else(|| value.attribute("name")).ok_or_else(no_value)?;
            let unit = value
                .attribute("unit")
                .filter(|unit| !unit.is_empty())
                .map(|unit| NamedUnit { name: unit.into(), definition: units.get(unit).copied() });
            self.take(name.len() + text.len() + size_of::<(String, Parameter)>())?;
            let (kind, text) = (value.tag_name().name().to_owned(), text.to_owned());
            found.push((name, Parameter { kind, text, unit }));
        }
        Ok(found)
    }

    /// Reads the mapping of a parameter binding, if it has one. Then only the parameters in it are used, with their new names.
    fn mapping(&self, binding: &Binding, directory: Option<&Path>) -> Result<Option<Mapping>, String> {
        let Some(node) = child(binding.node, "ParameterMapping") else { return Ok(None) };
        self.check_type(binding, node, MAPPING)?;
        let Some((name, text)) = self.file(node, directory)? else {
            let inside =
                child(node, "ParameterMapping").or_else(|| child(node, "MappingEntry").map(|_| node));
            let why =
                || format!("a parameter mapping of {} has neither a source nor entries", self.owner(binding));
            return self.entries(inside.ok_or_else(why)?).map(Some);
        };
        self.take(text.len())?;
        let mut declared = String::new();
        let document = xml::parse_undeclared(&text, &shown(&name), &mut declared)?;
        self.warn_of_others(document.root_element());
        self.entries(document.root_element()).map(Some)
    }

    fn entries(&self, mapping: Node) -> Result<Mapping, String> {
        let mut entries = Mapping::new();
        let nodes = mapping.children().filter(|node| node.tag_name().name() == "MappingEntry");
        for node in nodes {
            let (source, target) = (needed(node, "source")?, needed(node, "target")?.to_owned());
            self.take(source.len() + target.len() + size_of::<Entry>())?;
            let transformation = Transformation::of(node)?;
            let suppress_conversion = attribute(node, "suppressUnitConversion")?.unwrap_or(false);
            let entry = Entry { target, suppress_conversion, transformation };
            entries.entry(source.to_owned()).or_default().push(entry);
        }
        Ok(entries)
    }
}

impl Parameter {
    /// Converts the value to the unit of the parameter with this name, applies the transformation of the mapping, and then the change on
    /// the way to the variable.
    fn converted(
        &self,
        name: &str,
        found: Found,
        unit: Option<&NamedUnit>,
        entry: Option<&Entry>,
        change: &Change,
        warn: &dyn Fn(String),
    ) -> Result<Value, Error> {
        let transformation = entry.and_then(|entry| entry.transformation.as_ref());
        let wrong = |what: &str| {
            let (name, text) = (shown(name), shown(&self.text));
            Error::Request(format!("the value of {name} is {text:?}, not {what}"))
        };
        let text = self.text.trim();
        let number = match self.kind.as_str() {
            "Real" => Some(text.parse().map_err(|_| wrong("a number"))?),
            "Integer" => Some(text.parse::<i32>().map(f64::from).map_err(|_| wrong("an integer"))?),
            "Boolean" => boolean(&self.text).map(|value| f64::from(u8::from(value))),
            _ => None,
        };
        let Some(mut number) = number else {
            return match transformation {
                None => Ok(Value::String(self.text.clone())),
                Some(Transformation::Names(pairs)) => {
                    let mapped = pairs.iter().find(|(from, _)| *from == self.text);
                    Ok(Value::String(mapped.map_or(&self.text, |(_, to)| to).clone()))
                }
                Some(_) => request(format!("{} has a transformation, but is not a number", shown(name))),
            };
        };
        // Values are converted if both have a unit (section 5.2.3 of SSP 1.0).
        if let (Some(own), Some(unit), false) =
            (&self.unit, unit, entry.is_some_and(|entry| entry.suppress_conversion))
        {
            // Without definitions, the unit may be a display unit of the variable.
            let displayed = || found.display_unit(name, &own.name);
            number = match (own.conversion_to(unit), displayed()) {
                (Ok(Some(change)), _) => change.apply(number),
                (_, Ok((factor, offset))) => (number - offset) / factor,
                (Err(_), Err(why)) => return Err(why),
                (Ok(None), Err(_)) => {
                    warn(format!(
                        "the value of {} is in {:?} and the variable in {:?}, one of which is not defined, so the value is not converted",
                        shown(name),
                        shown(&own.name),
                        shown(&unit.name)
                    ));
                    number
                }
            };
        }
        if let Some(transformation) = transformation {
            let change = transformation.change(&[], &[]);
            let fail = |why| Error::Request(format!("the value of {} cannot be mapped: {why}", shown(name)));
            number = change.map_err(fail)?.apply(number);
        }
        Ok(Value::Real(change.apply(number)))
    }
}

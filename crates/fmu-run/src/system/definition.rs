//! The content of a system: finds its variables by name, and checks its connections.

use super::{Component, Definition, Exchange, Order, System, nearest, order};
use crate::change::Change;
use crate::connector::joined;
use crate::connector::{End, Place};
use crate::description::Variable;
use crate::error::{Error, request};
use crate::lookup::Found;
use crate::pool::Pool;
use fmi_abi::{BaseType, Causality, Interface, shown};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::{Arc, OnceLock};

impl Definition {
    pub fn of(name: &str, components: Vec<Component>) -> Self {
        let mut by_name = HashMap::new();
        for (index, component) in components.iter().enumerate() {
            by_name.entry(component.name.clone()).or_insert(index);
        }
        Self {
            name: name.to_owned(),
            lengths: by_name.keys().map(String::len).collect(),
            by_name,
            components,
            connectors: BTreeMap::new(),
            loose: HashSet::new(),
            connections: Vec::new(),
            changes: Vec::new(),
            sources: HashMap::new(),
            exchange: Exchange::default(),
            start: Vec::new(),
            warnings: Vec::new(),
            stop_time: None,
            pool: Pool::default(),
            arrays: OnceLock::new(),
        }
    }

    /// Sets the connections. `changes` has a change for each of them, or is empty if units must be equal.
    pub fn set_connections(&mut self, connections: Vec<(Place, Place)>, changes: Vec<Change>) {
        self.sources.clear();
        for (index, (_, Place { component, variable })) in connections.iter().enumerate() {
            // A variable that does not exist is an error of `finish`.
            if let Some(variable) = self.components[*component].fmu.description.variable(variable) {
                self.sources.entry((*component, variable.key())).or_insert(index);
            }
        }
        (self.connections, self.changes) = (connections, changes);
    }

    /// Fails unless the components have different names and all can run in Co-Simulation.
    pub fn check_components(&self) -> Result<(), Error> {
        if self.components.is_empty() {
            return request("a system needs at least one component".to_owned());
        }
        for (index, Component { name, fmu }) in self.components.iter().enumerate() {
            if name.is_empty() {
                return request("a component has no name".to_owned());
            }
            if self.by_name[name] != index {
                return request(format!("two components are named {name}"));
            }
            fmu.library(Interface::CoSimulation)?;
            if fmu.once_per_process(Interface::CoSimulation)
                && self.components[..index].iter().any(|other| Arc::ptr_eq(&other.fmu, fmu))
            {
                return Err(Error::Fmu(format!(
                    "{} can have only one instance per process (canBeInstantiatedOnlyOncePerProcess)",
                    fmu.description.model_name
                )));
            }
        }
        Ok(())
    }

    /// Checks the connections and sorts them into stages.
    pub fn finish(mut self, order: Order) -> Result<System, Error> {
        for end in self.connectors.values().flat_map(|connector| &connector.ends) {
            self.existing(&end.place)?;
        }
        let names: Vec<_> =
            self.connections.iter().map(|(from, to)| (self.name_of(from), self.name_of(to))).collect();
        let mut ends = Vec::new();
        for (index, ((from, to), places)) in names.iter().zip(&self.connections).enumerate() {
            let (output, input) = (self.existing(&places.0)?, self.existing(&places.1)?);
            check_direction([from, to], [output.variable, input.variable])?;
            let ((from_fmu, output_of), (to_fmu, input_of)) =
                ((output.description, output.variable), (input.description, input.variable));
            let checked = match self.changes.get(index) {
                Some(change) => from_fmu.connects_by(change, output_of, to_fmu, input_of),
                None => from_fmu.connects(output_of, to_fmu, input_of),
            };
            if let Err(why) = checked {
                return request(format!("{from} cannot feed {to}: {why}"));
            }
            if matches!(output.variable.base, BaseType::String | BaseType::Binary) {
                return request(format!("{from} cannot feed {to}: only numbers and Booleans are passed on"));
            }
            if self.sources[&(input.component, input.variable.key())] != index {
                return request(format!("{to} is fed twice"));
            }
            ends.push((output, input));
        }
        let stages = order::stages(&names, &ends, &self.changes, order)?;
        self.exchange = Exchange { order, stages };
        Ok(System(Arc::new(self)))
    }

    /// Returns the name of a variable in the system.
    pub fn name_of(&self, place: &Place) -> String {
        joined(&self.components[place.component].name, &place.variable)
    }

    /// Returns the variable of a component by its name in the FMU.
    pub fn at(&self, component: usize, variable: &str) -> Option<Found<'_>> {
        let description = &self.components[component].fmu.description;
        let variable = description.variable(variable)?;
        let source = self.sources.get(&(component, variable.key())).map(|index| &self.connections[*index].0);
        let source = source.map(|of| (&*self.components[of.component].name, &*of.variable));
        Some(Found { component, variable, description, source, connector: None })
    }

    /// Returns the variable of a component, or an error that names a similar variable.
    pub fn existing(&self, Place { component, variable }: &Place) -> Result<Found<'_>, Error> {
        self.at(*component, variable).ok_or_else(|| self.missing(*component, variable))
    }

    /// Returns the error for a variable that a component does not have.
    pub fn missing(&self, component: usize, variable: &str) -> Error {
        let Component { name, fmu } = &self.components[component];
        // The other variable is one of a component whose name is a part of this name.
        let other =
            || Error::Request(format!("component {} has no variable \"{}\"", shown(name), shown(variable)));
        match fmu.description.why_missing(variable) {
            Some(why) => Error::Request(format!("{} {why}", shown(&joined(name, variable)))),
            None => self.find(&joined(name, variable)).err().unwrap_or_else(other),
        }
    }

    /// Finds the variable of a component by its name in the system, for a connection.
    pub fn place(&self, name: &str) -> Result<Place, Error> {
        let Found { component, variable, .. } = self.find(name)?[0];
        Ok(Place { component, variable: variable.name.clone() })
    }

    /// Returns the variables of components with this name in the system. There are several if the name is ambiguous: it can be split at
    /// several dots, because names of components and variables may contain dots.
    pub fn matches(&self, name: &str) -> Vec<Found<'_>> {
        match &*self.components {
            [component] if component.name.is_empty() => self.at(0, name).into_iter().collect(),
            _ => {
                let split = |length: &usize| {
                    let (component, own) = (name.get(..*length)?, name.get(*length..)?.strip_prefix('.')?);
                    self.at(*self.by_name.get(component)?, own)
                };
                self.lengths.range(..name.len()).filter_map(split).collect()
            }
        }
    }

    pub fn find(&self, name: &str) -> Result<Vec<Found<'_>>, Error> {
        let variables = self.matches(name);
        let found: Vec<_> = match self.connectors.get(name) {
            Some(connector) => {
                let at = |end: &End| self.at(end.place.component, &end.place.variable);
                let ends = connector.ends.iter();
                ends.filter_map(|end| Some(Found { connector: Some((connector, end)), ..at(end)? })).collect()
            }
            None => variables.clone(),
        };
        self.check_unique(name, &variables, &found)?;
        if !found.is_empty() {
            return Ok(found);
        }
        if self.loose.contains(name) {
            return request(format!(
                "{name} is a connector that no connection leads to a variable of an FMU"
            ));
        }
        let missing = self.components.iter().find_map(|component| {
            let own = match component.name.as_str() {
                "" => name,
                of => name.strip_prefix(of)?.strip_prefix('.')?,
            };
            component.fmu.description.why_missing(own)
        });
        if let Some(why) = missing {
            return request(format!("{name} {why}"));
        }
        let names = || {
            let variables = self.components.iter().flat_map(|component| {
                component.fmu.description.variables.iter().map(|of| joined(&component.name, &of.name))
            });
            variables.chain(self.connectors.keys().cloned())
        };
        let element = format!("{name}[");
        let of_array = names().find(|known| known.starts_with(&element));
        // Names that are too long for a message are not compared, because that takes long and they are rarely misspelled.
        let is_short = name.len() <= fmi_abi::SHOWN;
        let similar =
            || is_short.then(|| nearest(name, names().filter(|known| known.len() <= fmi_abi::SHOWN)));
        let hint = of_array.or_else(|| similar().flatten());
        let hint = hint.map_or(String::new(), |near| format!("; did you mean {near:?}?"));
        request(format!("{} has no variable \"{}\"{hint}", shown(&self.name), shown(name)))
    }

    /// Fails if a name denotes several variables, or a variable and a connector that is something else. `found` is what it denotes as the
    /// name of a connector, if there is one.
    fn check_unique(&self, name: &str, variables: &[Found], found: &[Found]) -> Result<(), Error> {
        let is_same = |of: &Found| {
            found.iter().all(|other| {
                let is_changed = other.connector.is_some_and(|(_, end)| !end.into.is_identity());
                (other.component, other.variable.key()) == (of.component, of.variable.key()) && !is_changed
            })
        };
        if variables.iter().all(is_same) {
            return Ok(());
        }
        let variable = |of: &Found| {
            let component = &self.components[of.component].name;
            format!("the variable {} of component {}", shown(&of.variable.name), shown(component))
        };
        let connector = self.connectors.contains_key(name).then(|| "a connector of the system".to_owned());
        let all: Vec<_> = connector.into_iter().chain(variables.iter().map(variable)).collect();
        request(format!("{} is ambiguous: it is {}; rename one of them", shown(name), all.join(" and ")))
    }
}

/// Fails if a connection between these variables, whose names are given, does not lead from an output to an input.
pub fn check_direction(names: [&str; 2], variables: [&Variable; 2]) -> Result<(), Error> {
    let [from, to] = names;
    request(match variables.map(|of| of.causality) {
        [Causality::Output, Causality::Input] => return Ok(()),
        [Causality::Input, Causality::Output] => format!(
            "the connection from {from} to {to} is reversed: {to} is the output, and {from} the input that it feeds"
        ),
        [Causality::Output, other] => format!("{to} is {other}, not input"),
        [other, _] => format!("{from} is {other}, not output"),
    })
}

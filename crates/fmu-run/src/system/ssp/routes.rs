//! Follows connections from an output to an input, which may lead through connectors of nested systems, with the units and
//! transformations on the way (sections 4.5.2 and 5.3.2 of SSP 1.0).

use super::read::{Endpoint, Read, Transformation};
use crate::change::Change;
use crate::connector::{Connector, End};
use crate::error::{Error, request};
use crate::system::Definition;
use crate::unit::Unit;
use fmi_abi::shown;
use std::collections::HashMap;
use std::sync::Arc;

/// Maximum number of transformations that replace single values, on the way from an output to an input.
const MOST_MAPS: usize = 100;

/// A connection in the direction of the values.
pub(super) struct Link<'r> {
    pub from: &'r str,
    pub to: &'r str,
    suppress_conversion: bool,
    transformation: Option<&'r Transformation>,
}

/// A unit with its definition, if there is one.
#[derive(Clone)]
pub(super) struct NamedUnit {
    pub name: Arc<str>,
    pub definition: Option<Unit>,
}

/// The way of a value to the end of a connection.
#[derive(Clone)]
pub(super) struct Route<'r> {
    /// Start of the first connection.
    pub origin: &'r str,
    pub change: Change,
    /// Unit of the value at the end.
    unit: Option<NamedUnit>,
}

/// Routes by the end of their last connection.
pub(super) type Routes<'r> = HashMap<&'r str, Route<'r>>;

impl NamedUnit {
    /// Returns the conversion to another unit, or a message. Without definitions, the names must be equal.
    pub fn conversion_to(&self, other: &Self) -> Result<Change, String> {
        let change = match (self.definition, other.definition) {
            (Some(one), Some(other)) => one.conversion_to(other),
            _ => (self.name == other.name).then(Change::default),
        };
        change.ok_or_else(|| {
            format!("the output is in {}, the input in {}", shown(&self.name), shown(&other.name))
        })
    }
}

impl Read<'_> {
    /// Determines the directions of the connections. Their attributes `start` and `end` do not state the direction; the kinds of the
    /// connectors do (section 5.3.2 of SSP 1.0).
    pub fn links(&self, definition: &Definition) -> Result<Vec<Link<'_>>, Error> {
        let mut links = Vec::new();
        for connection in &self.connections {
            let [start, end] = &connection.ends;
            let sources = [self.is_source(definition, start)?, self.is_source(definition, end)?];
            let (from, to) = match sources {
                [Some(false), Some(true) | None] | [None, Some(true)] => (end, start),
                [one, other] if one.is_some() && one == other => {
                    let [one, other] = [start, end].map(|end| self.kind(definition, end).unwrap_or_default());
                    return request(format!(
                        "the connection between {} and {} has no direction: one is {}, the other {}",
                        shown(&start.name),
                        shown(&end.name),
                        shown(&one),
                        shown(&other)
                    ));
                }
                _ => (start, end),
            };
            links.push(Link {
                from: &from.name,
                to: &to.name,
                suppress_conversion: connection.suppress_conversion,
                transformation: connection.transformation.as_ref(),
            });
        }
        Ok(links)
    }

    /// Returns the kind of a connector: the causality of its variable, or as declared for a system.
    fn kind(&self, definition: &Definition, end: &Endpoint) -> Option<String> {
        let of_component = || definition.look_up(&end.name).map(|found| found.variable.causality.to_string());
        let of_system = || self.connectors.get(&end.name).map(|connector| connector.kind.clone());
        match end.is_own {
            true => of_system().or_else(of_component),
            false => of_component().or_else(of_system),
        }
    }

    /// Returns whether values come from this end of a connection; `None` if the kind is unknown. Seen from inside, inputs of a system
    /// are sources.
    fn is_source(&self, definition: &Definition, end: &Endpoint) -> Result<Option<bool>, Error> {
        let Some(kind) = self.kind(definition, end) else {
            // The message names a similar variable.
            definition.find(&end.name)?;
            return request(format!("there is no connector {}", shown(&end.name)));
        };
        Ok(match kind.as_str() {
            "output" | "calculatedParameter" => Some(!end.is_own),
            "input" | "parameter" | "structuralParameter" => Some(end.is_own),
            _ => None,
        })
    }

    /// Returns the unit of a variable of a component or of a connector.
    pub fn unit_of(&self, definition: &Definition, name: &str) -> Option<NamedUnit> {
        if let Some(found) = definition.look_up(name)
            && let Some(unit) = &found.variable.unit
        {
            let definition = found.description.unit_of(found.variable);
            return Some(NamedUnit { name: Arc::clone(unit), definition });
        }
        let unit = self.connectors.get(name)?.unit.as_ref()?;
        Some(NamedUnit { name: Arc::clone(unit), definition: self.units.get(&**unit).copied() })
    }

    /// Returns the route to the end of each connection.
    pub fn routes<'r>(&self, definition: &Definition, links: &[Link<'r>]) -> Result<Routes<'r>, Error> {
        let mut feeds = HashMap::new();
        for (index, link) in links.iter().enumerate() {
            if feeds.insert(link.to, index).is_some() {
                return request(format!("{} is fed twice", shown(link.to)));
            }
        }
        let mut routes = Routes::new();
        for link in links {
            let mut path = vec![link];
            let mut first = link;
            while !routes.contains_key(first.from)
                && let Some(before) = feeds.get(first.from)
            {
                first = &links[*before];
                path.push(first);
                if path.len() > links.len() {
                    return request(format!(
                        "the connections to {} form a circle without a variable",
                        shown(link.to)
                    ));
                }
            }
            for link in path.into_iter().rev() {
                let before = routes.get(link.from).cloned().unwrap_or_else(|| Route {
                    origin: link.from,
                    change: Change::default(),
                    unit: self.unit_of(definition, link.from),
                });
                let (change, unit) = self.hop(definition, link, before.unit)?;
                let change = before.change.then(&change);
                if change.maps() > MOST_MAPS {
                    return request(format!("the way to {} has too many transformations", shown(link.to)));
                }
                routes.insert(link.to, Route { origin: before.origin, change, unit });
            }
        }
        Ok(routes)
    }

    /// Returns the change of values on a connection, whose start has this unit, and the unit at its end. Units are converted before the
    /// transformation (section 4.5.2 of SSP 1.0).
    fn hop(
        &self,
        definition: &Definition,
        link: &Link,
        unit: Option<NamedUnit>,
    ) -> Result<(Change, Option<NamedUnit>), Error> {
        let fail =
            |why| Error::Request(format!("{} cannot feed {}: {why}", shown(link.from), shown(link.to)));
        let unit_at_end = self.unit_of(definition, link.to);
        let mut change = Change::default();
        if let (Some(one), Some(other), false) = (&unit, &unit_at_end, link.suppress_conversion) {
            change = one.conversion_to(other).map_err(fail)?;
        }
        let Some(transformation) = link.transformation else { return Ok((change, unit_at_end.or(unit))) };
        let items = |name| self.items(definition, name);
        let ends = [items(link.from), items(link.to)];
        let [from, to] = [ends[0].or(ends[1]), ends[1].or(ends[0])].map(Option::unwrap_or_default);
        let comparisons = transformation.comparisons(from.len() + to.len());
        self.take(comparisons).map_err(|why| self.fail(&why))?;
        Ok((change.then(&transformation.change(from, to).map_err(fail)?), unit_at_end))
    }

    /// Returns the items of the enumeration of a variable or a connector.
    fn items<'r>(&'r self, definition: &'r Definition, name: &str) -> Option<&'r [(String, String)]> {
        let of_variable = definition.look_up(name).and_then(|found| found.description.items(found.variable));
        of_variable.or_else(|| {
            let enumeration = self.connectors.get(name)?.enumeration.as_ref()?;
            self.enumerations.get(enumeration).map(Vec::as_slice)
        })
    }

    /// Adds the connections between components and the connectors of the systems to the definition.
    pub fn connect(&self, definition: &mut Definition, links: &[Link], routes: &Routes) {
        let (mut connections, mut changes, mut passing) = (Vec::new(), Vec::new(), Vec::new());
        for Link { to, .. } in links {
            let Route { origin, change, unit } = &routes[to];
            let [from, into] = [origin, to].map(|name| definition.look_up(name));
            match (from, into) {
                (Some(_), Some(_)) => {
                    connections.push(((*origin).to_owned(), (*to).to_owned()));
                    changes.push(change.clone());
                }
                (None, Some(found)) => {
                    let end = End { variable: (*to).to_owned(), into: change.clone(), out: change.inverse() };
                    let unit = self.unit_of(definition, origin).filter(|_| !change.is_identity());
                    let variable = in_unit(found.variable, unit);
                    let new = Connector { variable, is_output: false, ends: Vec::new() };
                    definition.connectors.entry((*origin).to_owned()).or_insert(new).ends.push(end);
                }
                (Some(found), None) => {
                    let (into, variable) = (change.inverse(), (*origin).to_owned());
                    let end = End { variable, into, out: change.clone() };
                    let variable = in_unit(found.variable, unit.clone().filter(|_| !change.is_identity()));
                    let new = Connector { variable, is_output: true, ends: vec![end] };
                    definition.connectors.insert((*to).to_owned(), new);
                }
                (None, None) => passing.push((*to, *origin, change, unit)),
            }
        }
        // An input of the system that also is its output is read where it is stored: in the input of a component.
        for (to, origin, change, unit) in passing {
            let is_output =
                |name| self.connectors.get(name).is_some_and(|of| of.is_outer && of.kind == "output");
            if let Some(Connector { variable, ends, .. }) = definition.connectors.get(origin)
                && let (true, Some(end)) = (is_output(to), ends.first())
            {
                let out = end.out.clone().then(change);
                let variable = in_unit(variable, unit.clone().filter(|_| !out.is_identity()));
                let end = End { variable: end.variable.clone(), into: out.inverse(), out };
                definition
                    .connectors
                    .insert(to.to_owned(), Connector { variable, is_output: true, ends: vec![end] });
            }
        }
        let loose = self.connectors.iter().filter(|(name, of)| {
            let is_named = if routes.contains_key(name.as_str()) { of.is_outer } else { of.is_of_system };
            is_named && !definition.connectors.contains_key(*name)
        });
        definition.loose = loose.map(|(name, _)| name.clone()).collect();
        definition.set_connections(connections, changes);
    }

    /// Returns the variables of components to which the value of a connector leads, each with the change on the way. `next` has the
    /// connections from each connector.
    pub fn downstream<'l>(
        &self,
        definition: &Definition,
        (next, routes): (&HashMap<&str, Vec<&Link<'l>>>, &Routes),
        name: &str,
    ) -> Result<Vec<(&'l str, Change)>, Error> {
        let own_unit = || {
            self.unit_of(definition, name).or_else(|| routes.get(name).and_then(|route| route.unit.clone()))
        };
        let (mut found, mut open) = (Vec::new(), vec![(name, Change::default(), own_unit())]);
        while let Some((at, before, unit)) = open.pop() {
            for link in next.get(at).into_iter().flatten() {
                self.take(size_of::<(&str, Change)>()).map_err(|why| self.fail(&why))?;
                let (change, unit) = self.hop(definition, link, unit.clone())?;
                let change = before.clone().then(&change);
                match definition.look_up(link.to) {
                    Some(_) => found.push((link.to, change)),
                    None => open.push((link.to, change, unit)),
                }
            }
        }
        Ok(found)
    }
}

/// Returns a copy of the variable in the unit of its connector, if that differs.
fn in_unit(variable: &crate::Variable, unit: Option<NamedUnit>) -> crate::Variable {
    match unit {
        Some(unit) => variable.in_unit(unit.name),
        None => variable.clone(),
    }
}

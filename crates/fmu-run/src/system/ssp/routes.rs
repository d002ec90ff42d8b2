//! Follows connections from an output to an input, which may lead through connectors of nested systems, with the units and
//! transformations on the way (sections 4.5.2 and 5.3.2 of SSP 1.0).

use super::read::{Endpoint, Place, Read, Transformation};
use crate::change::Change;
use crate::connector::{self, Connector, End};
use crate::error::{Error, request};
use crate::lookup::Found;
use crate::system::Definition;
use fmi_abi::description::Item;
use fmi_abi::{BaseUnit, shown};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// Maximum number of transformations that replace single values, on the way from an output to an input.
const MOST_MAPS: usize = 100;

/// A connection in the direction of the values.
pub(super) struct Link<'r> {
    pub from: Place<'r>,
    pub to: Place<'r>,
    suppress_conversion: bool,
    transformation: Option<&'r Transformation>,
}

/// A unit with its definition, if there is one.
#[derive(Clone)]
pub(super) struct NamedUnit {
    pub name: Arc<str>,
    pub definition: Option<BaseUnit>,
}

/// The way of a value to the end of a connection.
#[derive(Clone)]
pub(super) struct Route<'r> {
    /// Start of the first connection.
    pub origin: Place<'r>,
    pub change: Change,
    /// Unit of the value at the end.
    unit: Option<NamedUnit>,
}

/// Routes by the end of their last connection.
pub(super) type Routes<'r> = HashMap<Place<'r>, Route<'r>>;

impl NamedUnit {
    /// Returns the conversion to another unit. `None` if it is unknown, because the names differ and a definition is missing.
    ///
    /// # Errors
    /// Fails if the units measure different quantities.
    pub fn conversion_to(&self, other: &Self) -> Result<Option<Change>, String> {
        match (self.definition, other.definition) {
            (Some(one), Some(of_other)) => match one.conversion_to(&of_other) {
                Some((factor, offset)) => Ok(Some(Change::linear(factor, offset))),
                None => Err(format!(
                    "the output is in {}, the input in {}",
                    shown(&self.name),
                    shown(&other.name)
                )),
            },
            _ => Ok((self.name == other.name).then(Change::default)),
        }
    }
}

impl<'r> Read<'r> {
    /// Determines the directions of the connections. Their attributes `start` and `end` do not state the direction; the kinds of the
    /// connectors do (section 5.3.2 of SSP 1.0).
    pub fn links(&'r self, definition: &Definition) -> Result<Vec<Link<'r>>, Error> {
        let mut links = Vec::new();
        for connection in &self.connections {
            let [start, end] = &connection.ends;
            let sources = [self.is_source(definition, start)?, self.is_source(definition, end)?];
            let (from, to) = match sources {
                [Some(false), Some(true) | None] | [None, Some(true)] => (end, start),
                [one, other] if one == other => {
                    let (one, other) = (self.kind(definition, start)?, self.kind(definition, end)?);
                    return request(format!(
                        "the connection between {} and {} has no direction: one is {}, the other {}",
                        shown(&self.name_of(start.place)),
                        shown(&self.name_of(end.place)),
                        shown(&one),
                        shown(&other)
                    ));
                }
                _ => (start, end),
            };
            links.push(Link {
                from: from.place,
                to: to.place,
                suppress_conversion: connection.suppress_conversion,
                transformation: connection.transformation.as_ref(),
            });
        }
        Ok(links)
    }

    /// Returns the variable of a component; `None` for a connector of a system.
    pub fn variable<'d>(&self, definition: &'d Definition, (element, name): Place) -> Option<Found<'d>> {
        definition.at(self.elements[element].component?, name)
    }

    /// Returns the kind of a connector: the causality of its variable, or as declared for a system.
    fn kind(&self, definition: &Definition, end: &Endpoint) -> Result<String, Error> {
        let (element, name) = end.place;
        let declared = self.connectors.get(&end.place);
        let Some(component) = self.elements[element].component else {
            let full = self.name_of(end.place);
            let missing = || Error::Request(format!("there is no connector {}", shown(&full)));
            let kind = declared.map(|connector| connector.kind.to_owned());
            // The message names a similar variable.
            return kind.ok_or_else(|| definition.find(&full).err().unwrap_or_else(missing));
        };
        match definition.at(component, name) {
            Some(found) => Ok(found.variable.causality.to_string()),
            None if declared.is_some() => {
                let (why, full) = (definition.missing(component, name), self.name_of(end.place));
                request(format!("{} is a connector, but not a variable of the FMU: {why}", shown(&full)))
            }
            None => Err(definition.missing(component, name)),
        }
    }

    /// Returns whether values come from this end of a connection; `None` if the kind is unknown. Seen from inside, inputs of a system
    /// are sources.
    fn is_source(&self, definition: &Definition, end: &Endpoint) -> Result<Option<bool>, Error> {
        let kind = self.kind(definition, end)?;
        Ok(match kind.as_str() {
            "output" | "calculatedParameter" => Some(!end.is_own),
            "input" | "parameter" | "structuralParameter" => Some(end.is_own),
            _ => None,
        })
    }

    /// Returns the unit of a variable of a component or of a connector.
    pub fn unit_of(&self, definition: &Definition, place: Place) -> Option<NamedUnit> {
        if let Some(found) = self.variable(definition, place)
            && let Some(unit) = &found.variable.unit
        {
            let definition = found.description.unit_of(found.variable);
            return Some(NamedUnit { name: Arc::clone(unit), definition });
        }
        let unit = self.connectors.get(&place)?.unit?;
        Some(NamedUnit { name: unit.into(), definition: self.units.get(unit).copied() })
    }

    /// Returns the route to the end of each connection.
    pub fn routes(&self, definition: &Definition, links: &[Link<'r>]) -> Result<Routes<'r>, Error> {
        let mut feeds = HashMap::new();
        for (index, link) in links.iter().enumerate() {
            if feeds.insert(link.to, index).is_some() {
                return request(format!("{} is fed twice", shown(&self.name_of(link.to))));
            }
        }
        let mut routes = Routes::new();
        for link in links {
            let mut path = vec![link];
            let mut first = link;
            while !routes.contains_key(&first.from)
                && let Some(before) = feeds.get(&first.from)
            {
                first = &links[*before];
                path.push(first);
                if path.len() > links.len() {
                    return request(format!(
                        "the connections to {} form a circle without a variable",
                        shown(&self.name_of(link.to))
                    ));
                }
            }
            for link in path.into_iter().rev() {
                let before = routes.get(&link.from).cloned().unwrap_or_else(|| Route {
                    origin: link.from,
                    change: Change::default(),
                    unit: self.unit_of(definition, link.from),
                });
                let (change, unit) = self.hop(definition, link, before.unit)?;
                let change = before.change.then(&change);
                if change.maps() > MOST_MAPS {
                    return request(format!(
                        "the way to {} has too many transformations",
                        shown(&self.name_of(link.to))
                    ));
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
        let names = || [link.from, link.to].map(|place| shown(&self.name_of(place)).into_owned());
        let fail = |why| {
            let [from, to] = names();
            Error::Request(format!("{from} cannot feed {to}: {why}"))
        };
        let unit_at_end = self.unit_of(definition, link.to);
        let mut change = Change::default();
        if let (Some(one), Some(other), false) = (&unit, &unit_at_end, link.suppress_conversion) {
            change = one.conversion_to(other).map_err(fail)?.unwrap_or_else(|| {
                self.warn(|| {
                    let ([from, to], undefined) = (names(), if one.definition.is_none() { one } else { other });
                    format!(
                        "the unit {:?} is not defined, so values pass unconverted from {from}, in {:?}, to {to}, in {:?}",
                        shown(&undefined.name),
                        shown(&one.name),
                        shown(&other.name)
                    )
                });
                Change::default()
            });
        }
        let Some(transformation) = link.transformation else { return Ok((change, unit_at_end.or(unit))) };
        let items = |place| self.items(definition, place);
        let ends = [items(link.from), items(link.to)];
        let [from, to] = [ends[0].or(ends[1]), ends[1].or(ends[0])].map(Option::unwrap_or_default);
        let comparisons = transformation.comparisons(from.len() + to.len());
        self.take(comparisons).map_err(|why| self.fail(&why))?;
        Ok((change.then(&transformation.change(from, to).map_err(fail)?), unit_at_end))
    }

    /// Returns the items of the enumeration of a variable or a connector.
    fn items<'d>(&'d self, definition: &'d Definition, place: Place) -> Option<&'d [Item]> {
        let of_variable =
            self.variable(definition, place).and_then(|found| found.description.items(found.variable));
        of_variable.or_else(|| {
            let enumeration = self.connectors.get(&place)?.enumeration?;
            self.enumerations.get(enumeration).map(Vec::as_slice)
        })
    }

    /// Returns the place of a variable of a component.
    pub fn place(&self, (element, name): Place) -> Option<connector::Place> {
        Some(connector::Place { component: self.elements[element].component?, variable: name.to_owned() })
    }

    /// Adds the connections between components and the connectors of the systems to the definition.
    pub fn connect(
        &self,
        definition: &mut Definition,
        links: &[Link<'r>],
        routes: &Routes<'r>,
    ) -> Result<(), Error> {
        let (mut connections, mut changes, mut passing) = (Vec::new(), Vec::new(), Vec::new());
        let mut connectors: BTreeMap<Place, Connector> = BTreeMap::new();
        for Link { to, .. } in links {
            let Route { origin, change, unit } = &routes[to];
            let [from, into] = [*origin, *to].map(|place| self.variable(definition, place));
            match (from.zip(self.place(*origin)), into.zip(self.place(*to))) {
                (Some((_, from)), Some((_, to))) => {
                    connections.push((from, to));
                    changes.push(change.clone());
                }
                (None, Some((found, place))) => {
                    let end = End { place, into: change.clone(), out: change.inverse() };
                    let unit = self.unit_of(definition, *origin).filter(|_| !change.is_identity());
                    let variable = in_unit(found.variable, unit);
                    let new = Connector { variable, is_output: false, ends: Vec::new() };
                    connectors.entry(*origin).or_insert(new).ends.push(end);
                }
                (Some((found, place)), None) => {
                    let end = End { place, into: change.inverse(), out: change.clone() };
                    let variable = in_unit(found.variable, unit.clone().filter(|_| !change.is_identity()));
                    connectors.insert(*to, Connector { variable, is_output: true, ends: vec![end] });
                }
                (None, None) => passing.push((*to, *origin, change, unit)),
            }
        }
        // An input of the system that also is its output is read where it is stored: in the input of a component.
        for (to, origin, change, unit) in passing {
            let is_output = to.0 == 0 && self.connectors.get(&to).is_some_and(|of| of.kind == "output");
            if let Some(Connector { variable, ends, .. }) = connectors.get(&origin)
                && let (true, Some(end)) = (is_output, ends.first())
            {
                let out = end.out.clone().then(change);
                let variable = in_unit(variable, unit.clone().filter(|_| !out.is_identity()));
                let end = End { place: end.place.clone(), into: out.inverse(), out };
                connectors.insert(to, Connector { variable, is_output: true, ends: vec![end] });
            }
        }
        let loose = self.connectors.keys().filter(|place| {
            let is_of_system = self.elements[place.0].component.is_none();
            let is_named = if routes.contains_key(place) { place.0 == 0 } else { is_of_system };
            is_named && !connectors.contains_key(place)
        });
        definition.loose = loose.map(|place| self.name_of(*place)).collect();
        for (place, connector) in connectors {
            let name = self.name_of(place);
            if definition.connectors.contains_key(&name) {
                return request(format!("two connectors are named {}", shown(&name)));
            }
            definition.connectors.insert(name, connector);
        }
        definition.set_connections(connections, changes);
        Ok(())
    }

    /// Returns the variables of components to which the value of a connector leads, each with the change on the way. `next` has the
    /// connections from each connector.
    pub fn downstream(
        &self,
        definition: &Definition,
        (next, routes): (&HashMap<Place, Vec<&Link<'r>>>, &Routes),
        place: Place,
    ) -> Result<Vec<(Place<'r>, Change)>, Error> {
        let own_unit = || {
            self.unit_of(definition, place)
                .or_else(|| routes.get(&place).and_then(|route| route.unit.clone()))
        };
        let (mut found, mut open) = (Vec::new(), vec![(place, Change::default(), own_unit())]);
        while let Some((at, before, unit)) = open.pop() {
            for link in next.get(&at).into_iter().flatten() {
                self.take(size_of::<(Place, Change)>()).map_err(|why| self.fail(&why))?;
                let (change, unit) = self.hop(definition, link, unit.clone())?;
                let change = before.clone().then(&change);
                match self.variable(definition, link.to) {
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

//! The variables of a system, with the start values that are in force.

use super::{Component, System};
use crate::change::Change;
use crate::connector::{Connector, joined};
use crate::description::{Description, Variable};
use crate::selection::Target;
use crate::start::StartValues;
use fmi_abi::{BaseType, Value};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// The variables of a [`System`]. It does not keep the FMUs loaded.
#[derive(Clone, Debug)]
pub struct Variables {
    own: Vec<(String, Variable)>,
    components: Vec<(String, Arc<Description>)>,
    /// Variables to which the system gives other start values than their FMUs, by the indices of component and variable.
    changed: HashMap<(usize, usize), Variable>,
}

impl Variables {
    /// Returns the names and the variables: inputs and outputs of the system first, then variables of the components. Their start values
    /// are those with which a run begins, so the system's count where it has any.
    pub fn iter(&self) -> impl Iterator<Item = (String, &Variable)> {
        let of_components =
            self.components.iter().enumerate().flat_map(move |(component, (name, description))| {
                description.variables.iter().enumerate().map(move |(index, of)| {
                    (joined(name, &of.name), self.changed.get(&(component, index)).unwrap_or(of))
                })
            });
        self.own.iter().map(|(name, of)| (name.clone(), of)).chain(of_components)
    }
}

impl System {
    /// Returns all variables with their names in the system.
    pub fn variables(&self) -> Variables {
        let starts = self.starts();
        let start_of = |component: usize, of: &Variable| starts.get(&(component, of.key())).cloned();
        let own = self.0.connectors.iter().map(|(name, Connector { variable, ends, .. })| {
            let start = ends.first().and_then(|end| {
                let found = self.0.at(end.place.component, &end.place.variable)?;
                let own = start_of(found.component, found.variable).or_else(|| found.variable.start.clone());
                if end.out.is_identity() { own } else { changed_text(found.variable, &own?, &end.out) }
            });
            (name.clone(), variable.starting_at(start))
        });
        let of = |component: &Component| (component.name.clone(), Arc::clone(&component.fmu.description));
        let given: HashSet<usize> = starts.keys().map(|(component, _)| *component).collect();
        let changed = given.into_iter().flat_map(|component| {
            let variables = self.components()[component].fmu.description.variables.iter().enumerate();
            variables.filter_map(move |(index, of)| {
                let start = start_of(component, of)?;
                Some(((component, index), of.starting_at(Some(start))))
            })
        });
        let changed = changed.collect();
        Variables { own: own.collect(), components: self.components().iter().map(of).collect(), changed }
    }

    /// Returns the start values of the system as strings, by component and [key](Variable::key). If structural parameters have made them
    /// invalid, there are none, and a run is an error.
    fn starts(&self) -> HashMap<(usize, u64), Arc<str>> {
        let all = StartValues::of(self, &[]).unwrap_or_default();
        let key = |of: Target| (of.component, crate::description::key_of(of.base, of.reference));
        let numbers = all.numbers(0).map(|(of, number)| (key(of), text_of(of.base, number)));
        let values = all.values(0).map(|(of, value)| (key(of), Arc::from(&*value.to_string())));
        numbers.chain(values).collect()
    }
}

/// Returns a number as the start value of a variable of this type.
fn text_of(base: BaseType, number: f64) -> Arc<str> {
    let value = match base {
        BaseType::Boolean => Value::Boolean(number != 0.0),
        base if base.is_float() => Value::Real(number),
        _ => Value::Integer(number as i128),
    };
    value.to_string().into()
}

/// Returns the start value of a connector: the start value of its variable after the change on the way. `None` if it is not a number.
fn changed_text(of: &Variable, start: &str, change: &Change) -> Option<Arc<str>> {
    let number = match Value::read(of.base, start)? {
        Value::Real(number) => number,
        Value::Integer(number) => number as f64,
        Value::Boolean(value) => f64::from(u8::from(value)),
        Value::String(_) | Value::Binary(_) => return None,
    };
    Some(text_of(of.base, change.apply(number)))
}

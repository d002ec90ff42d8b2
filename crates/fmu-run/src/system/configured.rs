//! Systems whose structural parameters differ from the model description (section 2.3.6 of FMI 3.0).

use super::{Component, Definition, System};
use crate::description::Structural;
use crate::error::{Error, request};
use crate::selection::Target;
use crate::start::{Start, StartValues};
use fmi_abi::Value;
use std::sync::Arc;

/// Start values by name.
type Given<'s, 'a> = Vec<(&'s str, Start<'a>)>;

impl System {
    /// Returns whether a variable is a structural parameter, which determines the sizes of arrays.
    pub fn is_structural(&self, name: &str) -> bool {
        self.find(name).is_ok_and(|found| found.iter().any(|found| found.variable.is_structural()))
    }

    /// Takes the structural parameters out of the start values. Returns a system in which they have these values, and the other start
    /// values. The arrays of the new system may have other sizes, so its variables may differ. [`run`](Self::run) and
    /// [`instances`](Self::instances) call this function.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if a structural parameter has separate values for several runs or instances, or a value that does
    /// not fit, and [`Error::Fmu`] if the model description cannot be read with the new sizes.
    pub fn configured<'s, 'a>(&self, start: &[(&'s str, Start<'a>)]) -> Result<(Self, Given<'s, 'a>), Error> {
        let (structural, others): (Vec<_>, Vec<_>) =
            start.iter().copied().partition(|(name, _)| self.is_structural(name));
        if structural.is_empty() {
            return Ok((self.clone(), others));
        }
        let mut values: Vec<Vec<Structural>> = vec![Vec::new(); self.components().len()];
        let given = StartValues::given(self, &structural)?;
        for (target, value) in one_for_all(&given)? {
            let Target { component, base, reference } = target;
            values[component].push(Structural { base, reference, value });
        }
        let components = self.components().iter().zip(values).map(|(component, structure)| {
            let fmu = if structure.is_empty() {
                Arc::clone(&component.fmu)
            } else {
                Arc::new(component.fmu.configured(structure)?)
            };
            Ok(Component { name: component.name.clone(), fmu })
        });
        let mut definition = Definition::of(self.name(), components.collect::<Result<_, Error>>()?);
        definition.connectors.clone_from(&self.0.connectors);
        definition.loose.clone_from(&self.0.loose);
        definition.set_connections(self.0.connections.clone(), self.0.changes.clone());
        definition.start.clone_from(&self.0.start);
        definition.warnings.clone_from(&self.0.warnings);
        definition.stop_time = self.0.stop_time;
        let system = match self.sole() {
            Some(_) => Self(Arc::new(definition)),
            None => definition.finish(self.exchange().order)?,
        };
        Ok((system, others))
    }
}

/// Returns the values. Fails unless each variable has a single value for all runs or instances.
fn one_for_all(given: &StartValues) -> Result<Vec<(Target, Value)>, Error> {
    let all = given.values(0).map(|(target, value)| (target, value.clone()));
    // Only sizes of arrays must be integers (section 2.4.7.2 of FMI 3.0).
    let numbers = given.numbers(0).map(|(target, number)| {
        let value = if target.base.is_float() { Value::Real(number) } else { Value::Integer(number as i128) };
        (target, value)
    });
    if !given.is_for_all() {
        return request("a structural parameter needs one value for all runs or instances".to_owned());
    }
    Ok(all.chain(numbers).collect())
}

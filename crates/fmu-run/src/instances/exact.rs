//! Values that `f64` cannot represent: strings, bytes and 64-bit integers.

use super::{Instances, Mask};
use crate::error::{Error, request};
use crate::lookup::is_exact;
use crate::selection::Target;
use crate::start::exact;
use fmi_abi::{BaseType, Value};

impl Instances {
    /// Returns the exact value of a variable of any type in each instance; `None` for a failed instance.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the variable is unknown.
    pub fn values(&mut self, name: &str) -> Result<Vec<Option<Value>>, Error> {
        let of = Target::of(self.system.find_first(name)?);
        let mut values = vec![None; self.len()];
        for (one, value) in self.all.iter_mut().zip(&mut values) {
            one.with(|_, instance| instance.get_value(of).map(|found| *value = Some(found)));
        }
        Ok(values)
    }

    /// Sets a variable that is a string, bytes or a 64-bit integer. There is one value for all instances, or a value for each.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the variable is unknown, read-only or of another type, or if a value does not fit its type.
    ///
    /// # Panics
    /// Panics if the number of values is wrong.
    pub fn set_values(&mut self, name: &str, values: &[Value], mask: Mask) -> Result<(), Error> {
        assert!(
            values.len() == 1 || values.len() == self.len(),
            "one value is required, or a value for each instance"
        );
        let mut targets = Vec::new();
        for found in self.system.find(name)? {
            found.check_settable(name)?;
            if !is_exact(found.variable.base) {
                return request(format!("{name} is {}; set it with set", found.variable.kind_in_words()));
            }
            let own = values.iter().map(|value| exact(found, name, value.clone()));
            targets.push((Target::of(found), own.collect::<Result<Vec<_>, _>>()?));
        }
        self.alive(mask, |index, _, instance| {
            let value = |values: &[Value]| values[if values.len() == 1 { 0 } else { index }].clone();
            targets.iter().try_for_each(|(target, values)| instance.set_value(*target, &value(values)))
        });
        Ok(())
    }

    /// Returns the value of a string variable in each instance; `None` for a failed instance.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the variable is unknown or not a string.
    pub fn texts(&mut self, name: &str) -> Result<Vec<Option<String>>, Error> {
        let found = self.system.find_first(name)?;
        if found.variable.base != BaseType::String {
            return request(format!("{name} is {}, not a string", found.variable.kind_in_words()));
        }
        let text = |value: Option<Value>| value.map(|value| value.to_string());
        Ok(self.values(name)?.into_iter().map(text).collect())
    }
}

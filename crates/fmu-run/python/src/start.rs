//! Converts start values, which are given as a dict.

use crate::arguments::{in_own_unit, items};
use crate::buffers::{Numbers, array_of, shape};
use crate::exact::{Exact, Values, exact_type};
use fmu_run::{Elements, System};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Start values by name. A variable has a number, a string, bytes or a 64-bit integer, or a sequence of them, one for each run or
/// instance. A whole array has one value for all elements, an array, or an array for each run or instance.
#[derive(Default)]
pub struct Start {
    values: Vec<(String, Values)>,
    /// The values as Python objects, in the units of the variables. They are returned as `Runs.start`.
    given: Vec<(String, Py<PyAny>)>,
}

impl Start {
    /// Converts start values. Values given as (value, unit) are converted to the unit of their variable.
    pub fn of(system: &System, given: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let mut start = Self::default();
        for (name, value) in items("start", given)? {
            start.add(system, name, value)?;
        }
        Ok(start)
    }

    /// Sets the structural parameters among the start values. Returns the new system and its start values. Their `names` and `dict`
    /// include the structural parameters, but their `values` do not.
    pub fn configured(system: &System, given: Option<&Bound<'_, PyAny>>) -> PyResult<(System, Self)> {
        let (mut structural, mut others) = (Self::default(), Vec::new());
        for (name, value) in items("start", given)? {
            if system.is_structural(&name) {
                structural.add(system, name, value)?;
            } else {
                others.push((name, value));
            }
        }
        let (system, _) = system.configured(&structural.values()).map_err(crate::python)?;
        let mut start = Self { values: Vec::new(), ..structural };
        others.into_iter().try_for_each(|(name, value)| start.add(&system, name, value))?;
        Ok((system, start))
    }

    fn add(&mut self, system: &System, name: String, value: Bound<'_, PyAny>) -> PyResult<()> {
        if system.array(&name).is_none() && exact_type(system, &name)?.is_some() {
            let of = Exact::of(&name, &value)?;
            let count = of.shape.first().copied().unwrap_or(1);
            of.check(&format!("the start value of {name}"), &[&[], &[count]])?;
            self.values.push((name.clone(), Values::Exact(of)));
            self.given.push((name, value.unbind()));
            return Ok(());
        }
        let value = in_own_unit(system, &name, &value, false)?;
        match system.array(&name) {
            None => self.values.push((name.clone(), values_of(&name, &value)?)),
            Some(array) => self.add_array(system, &name, array, &value)?,
        }
        self.given.push((name, value.unbind()));
        Ok(())
    }

    /// Returns the values for the Rust interface.
    pub fn values(&self) -> Vec<(&str, fmu_run::Start<'_>)> {
        self.values.iter().map(|(name, of)| (name.as_str(), start(of))).collect()
    }

    /// Returns the names of the variables or arrays that have a start value.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.given.iter().map(|(name, _)| name.as_str())
    }

    /// Returns the values as Python objects, in the units of the variables.
    pub fn dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (name, value) in &self.given {
            dict.set_item(name, value)?;
        }
        Ok(dict)
    }

    /// Adds the elements of an array. The start value is a single value for all elements, an array for all runs or instances, or an
    /// array for each run or instance.
    fn add_array(
        &mut self,
        system: &System,
        name: &str,
        array: &Elements,
        value: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let count = array.names.len();
        let is_exact = array.names.first().map_or(Ok(None), |first| exact_type(system, first))?.is_some();
        // Strings are names of enumeration items, or "true" and "false".
        let is_text =
            || array_of(name, value).is_err() && Exact::of(name, value).is_ok_and(|of| of.is_text());
        let values = if is_exact || is_text() {
            Values::Exact(Exact::of(name, value)?)
        } else {
            Values::Numbers(Numbers::of(name, value)?)
        };
        let by_run = check_shape(name, values.shape(), array)?;
        let elements = array.names.iter().enumerate();
        self.values.extend(
            elements.map(|(number, element)| (element.clone(), values.element(number, count, by_run))),
        );
        Ok(())
    }
}

/// Checks the shape of the start value of an array. Returns whether there is an array for each run or instance.
fn check_shape(name: &str, given: &[usize], array: &Elements) -> PyResult<bool> {
    let by_run = given.len() == array.sizes.len() + 1 && given.ends_with(&array.sizes);
    if by_run || given.is_empty() || *given == array.sizes {
        return Ok(by_run);
    }
    let own = array.sizes.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    Err(PyValueError::new_err(format!(
        "the start value of {name} has the shape {}; it must be {}, (n, {own}) with an array for each run or instance, or one value \
        for all elements",
        shape(given),
        shape(&array.sizes)
    )))
}

/// Returns the start value for the Rust interface.
fn start(values: &Values) -> fmu_run::Start<'_> {
    match values {
        Values::Numbers(Numbers::One(number)) => fmu_run::Start::Same(*number),
        Values::Numbers(numbers) => fmu_run::Start::Each(numbers.values()),
        Values::Exact(of) if of.shape.is_empty() => fmu_run::Start::Value(&of.values[0]),
        Values::Exact(of) => fmu_run::Start::EachValue(&of.values),
    }
}

/// Converts the start value of a variable that is a number. Strings are Booleans and items of enumerations.
fn values_of(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Values> {
    let numbers = match Numbers::of(name, value) {
        Ok(numbers) => numbers,
        Err(error) if !error.is_instance_of::<PyValueError>(value.py()) => return Err(error),
        Err(error) => {
            let text = Exact::of(name, value).ok().filter(Exact::is_text);
            return text.map(Values::Exact).ok_or(error);
        }
    };
    match numbers.shape() {
        [] | [_] => Ok(Values::Numbers(numbers)),
        given => Err(PyValueError::new_err(format!(
            "the start value of {name} has the shape {}; it must be one number for all runs or instances, or (n,) with one number \
            for each",
            shape(given)
        ))),
    }
}

//! Start values that are given as a dict.

use crate::buffers::Numbers;
use fmu_run::System;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

/// Start values by name: a number or an array with one for each run or instance, a string or a sequence of
/// strings.
#[derive(Default)]
pub struct Start(Vec<(String, Value, Py<PyAny>)>);

enum Value {
    Numbers(Numbers),
    Text(String),
    Texts(Vec<String>),
}

impl Start {
    /// Reads start values. Converts values given as (value, unit) to the unit of their variable.
    pub fn of(system: &System, given: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let mut start = Self::default();
        for (name, value) in given.into_iter().flatten() {
            let name: String = name.extract()?;
            let value = in_own_unit(system, &name, value)?;
            start.0.push((name.clone(), Value::of(&name, &value)?, value.unbind()));
        }
        Ok(start)
    }

    /// Returns the values for the Rust interface.
    pub fn values(&self) -> Vec<(&str, fmu_run::Start<'_>)> {
        self.0.iter().map(|(name, of, _)| (name.as_str(), of.value())).collect()
    }

    /// Returns the values as Python objects, in the units of the variables.
    pub fn dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (name, _, value) in &self.0 {
            dict.set_item(name, value)?;
        }
        Ok(dict)
    }
}

/// Converts (value, unit) to the unit of the variable; returns a value without unit unchanged.
fn in_own_unit<'py>(system: &System, name: &str, value: Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let Ok((number, unit)) = value.extract::<(Bound<'py, PyAny>, String)>() else { return Ok(value) };
    if number.is_instance_of::<PyString>() {
        return Ok(value);
    }
    let (factor, offset) = system.display_unit(name, &unit).map_err(crate::python)?;
    let numbers = value.py().import("numpy")?.call_method1("asarray", (number, "float64"))?;
    numbers.sub(offset)?.div(factor)
}

impl Value {
    fn value(&self) -> fmu_run::Start<'_> {
        match self {
            Self::Numbers(numbers) if numbers.shape().is_empty() => fmu_run::Start::Same(numbers.values()[0]),
            Self::Numbers(numbers) => fmu_run::Start::Each(numbers.values()),
            Self::Text(text) => fmu_run::Start::Text(text),
            Self::Texts(texts) => fmu_run::Start::EachText(texts),
        }
    }

    fn of(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(text) = value.cast::<PyString>() {
            return Ok(Self::Text(text.extract()?));
        }
        if let Ok(texts) = value.extract::<Vec<String>>() {
            return Ok(Self::Texts(texts));
        }
        let numbers = Numbers::of(value)
            .map_err(|error| PyValueError::new_err(format!("{name}: {}", error.value(value.py()))))?;
        match numbers.shape() {
            [] | [_] => Ok(Self::Numbers(numbers)),
            shape => Err(PyValueError::new_err(format!(
                "the start value of {name} has the shape {shape:?}; it must be a number, or an array with one for each"
            ))),
        }
    }
}

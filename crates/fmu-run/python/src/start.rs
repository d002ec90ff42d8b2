//! Start values that are given as a dict.

use crate::buffers::Numbers;
use fmu_run::System;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyTuple};

/// By name: a number or an array with one for each run or instance, a text or a sequence of such.
#[derive(Default)]
pub struct Start(Vec<(String, Value)>);

enum Value {
    Numbers(Numbers),
    Text(String),
    Texts(Vec<String>),
}

impl Start {
    /// Values that are given as (value, unit) become those in the unit of their variable.
    pub fn of(system: &System, given: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let mut start = Self::default();
        for (name, value) in given.into_iter().flatten() {
            let name: String = name.extract()?;
            let value = Value::of(system, &name, &value)?;
            start.0.push((name, value));
        }
        Ok(start)
    }

    /// As Rust has them.
    pub fn values(&self) -> Vec<(&str, fmu_run::Start<'_>)> {
        self.0.iter().map(|(name, of)| (name.as_str(), of.value())).collect()
    }
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

    fn of(system: &System, name: &str, value: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(text) = value.cast::<PyString>() {
            return Ok(Self::Text(text.extract()?));
        }
        if let Ok(pair) = value.cast::<PyTuple>()
            && pair.len() == 2
            && let (number, Ok(unit)) = (pair.get_item(0)?, pair.get_item(1)?.cast::<PyString>())
            && !number.is_instance_of::<PyString>()
        {
            let unit: String = unit.extract()?;
            let (factor, offset) = system.display_unit(name, &unit).map_err(crate::python)?;
            let numbers = value.py().import("numpy")?.call_method1("asarray", (number, "float64"))?;
            return Self::of(system, name, &numbers.sub(offset)?.div(factor)?);
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

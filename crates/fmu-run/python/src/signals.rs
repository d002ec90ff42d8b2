//! Converts the inputs of runs: numbers, time series and whole arrays.

use crate::arguments::in_own_unit;
use crate::buffers::{Numbers, shape};
use crate::exact::{Exact, Values, exact_type};
use fmu_run::{Elements, System, Trajectory};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyString, PyTuple};
use std::sync::Arc;

/// The inputs of runs. Each element of an array is an input.
#[derive(Default)]
pub struct Signals(Vec<Signal>);

struct Signal {
    name: String,
    source: Source,
    /// Times at which the values are given, if they are not the communication points.
    times: Option<Arc<Numbers>>,
    /// Whether there is a value for each time.
    by_time: bool,
    /// Whether there are separate values for each run.
    by_run: bool,
}

enum Source {
    Values(Values),
    /// The time derivative of the input with this name.
    RateOf(String),
}

impl Signals {
    /// Converts inputs or their rates, whose values are given for this number of communication points or at their own times.
    pub fn of(
        system: &System,
        given: &[(String, Bound<'_, PyAny>)],
        times: usize,
        are_rates: bool,
    ) -> PyResult<Self> {
        let mut signals = Self::default();
        for (name, value) in given {
            let (own_times, value) = with_times(name, value)?;
            let times = own_times.as_ref().map_or(times, |times| times.values().len());
            let array = system.array(name);
            let element = array.and_then(|array| array.names.first()).unwrap_or(name);
            let values = if exact_type(system, element)?.is_some() {
                Values::Exact(Exact::of(name, &value)?)
            } else if let Some(other) = rate_of(name, &value)? {
                let (name, source) = (name.clone(), Source::RateOf(other));
                signals.0.push(Signal { name, source, times: None, by_time: false, by_run: false });
                continue;
            } else {
                Values::Numbers(Numbers::of(name, &in_own_unit(system, name, &value, are_rates)?)?)
            };
            signals.push(name, array, values, (own_times, times))?;
        }
        Ok(signals)
    }

    /// Returns the values for the Rust interface.
    pub fn trajectories(&self) -> Vec<(&str, Trajectory<'_>)> {
        let trajectories = self.0.iter().map(|Signal { name, source, times, by_time, by_run }| {
            let times = times.as_ref().filter(|_| *by_time).map(|times| times.values());
            let trajectory = match source {
                Source::RateOf(other) => Trajectory::RateOf(other),
                Source::Values(Values::Exact(Exact { values, .. })) => match times {
                    _ if !by_time => Trajectory::Value(&values[0]),
                    Some(times) => Trajectory::SampledValues { times, values },
                    None => Trajectory::Values(values),
                },
                Source::Values(Values::Numbers(numbers)) => match (times, numbers.values()) {
                    (_, values) if !by_time => Trajectory::Constant(values[0]),
                    (Some(times), values) => Trajectory::Sampled { times, values },
                    (None, values) if *by_run => Trajectory::EachRun(values),
                    (None, values) => Trajectory::Shared(values),
                },
            };
            (name.as_str(), trajectory)
        });
        trajectories.collect()
    }

    /// Adds a variable, or the elements of an array.
    fn push(
        &mut self,
        name: &str,
        array: Option<&Elements>,
        values: Values,
        (own_times, times): (Option<Arc<Numbers>>, usize),
    ) -> PyResult<()> {
        let (given, sizes) = (values.shape(), array.map_or(&[][..], |array| &array.sizes));
        if own_times.is_some() && given.is_empty() {
            return Err(PyValueError::new_err(format!(
                "{name} has {times} times, but one value; give a value for each time, or only the value"
            )));
        }
        let has_sizes = given.ends_with(sizes);
        let (by_time, by_run) = match given.len().checked_sub(sizes.len()) {
            _ if given.is_empty() => (false, false),
            Some(0) if has_sizes => (false, false),
            Some(1) if has_sizes && given[0] == times => (true, false),
            Some(2) if has_sizes && given[1] == times => (true, true),
            _ => {
                let mut of_time = vec![times.to_string()];
                of_time.extend(sizes.iter().map(usize::to_string));
                let of_time = of_time.join(", ");
                let comma = if sizes.is_empty() { "," } else { "" };
                let constant = if sizes.is_empty() { String::new() } else { format!(", {}", shape(sizes)) };
                return Err(PyValueError::new_err(format!(
                    "{name} has the shape {}; it must be ({of_time}{comma}), (runs, {of_time}){constant} or one value",
                    shape(given)
                )));
            }
        };
        let mut push = |name: &str, values| {
            let (name, source, times) = (name.to_owned(), Source::Values(values), own_times.clone());
            self.0.push(Signal { name, source, times, by_time, by_run });
        };
        match array {
            None => push(name, values),
            Some(Elements { names, .. }) => names
                .iter()
                .enumerate()
                .for_each(|(number, element)| push(element, values.element(number, names.len(), by_time))),
        }
        Ok(())
    }
}

/// Returns the name of the input if the value is "der(name)", which requests its derivative. Fails for other strings.
fn rate_of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Option<String>> {
    let Ok(text) = given.cast::<PyString>() else { return Ok(None) };
    let text: String = text.extract()?;
    match text.strip_prefix("der(").and_then(|text| text.strip_suffix(')')) {
        Some(other) => Ok(Some(other.to_owned())),
        None => Err(PyValueError::new_err(format!(
            "{name} is {text:?}; the value of a number is a number, or the derivative of another input, such as \"der(u)\""
        ))),
    }
}

/// Separates (times, values) into the times and the values, and (times, values, unit) into the times and (values, unit). Returns
/// other values unchanged, without times. The times must be a sequence, because a tuple of two numbers is an input with two values.
#[allow(clippy::type_complexity, reason = "a pair")]
fn with_times<'py>(
    name: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<(Option<Arc<Numbers>>, Bound<'py, PyAny>)> {
    let none = || Ok((None, given.clone()));
    let Some(tuple) = given.cast::<PyTuple>().ok().filter(|tuple| matches!(tuple.len(), 2 | 3)) else {
        return none();
    };
    let [times, values] = [tuple.get_item(0)?, tuple.get_item(1)?];
    let is_sequence = |of: &Bound<'py, PyAny>| of.len().is_ok() && !of.is_instance_of::<PyString>();
    let has_unit = tuple.len() == 3;
    if !is_sequence(&times) || !has_unit && !is_sequence(&values) {
        return none();
    }
    if has_unit && !tuple.get_item(2)?.is_instance_of::<PyString>() {
        return Err(PyValueError::new_err(format!(
            "{name} is a tuple of three, (times, values, unit), but its unit is no string; for three runs, write a list"
        )));
    }
    let times = Numbers::of(&format!("the times of {name}"), &times)?;
    if times.shape().len() != 1 {
        return Err(PyValueError::new_err(format!(
            "the times of {name} have the shape {}; (times, values) has one dimension of times",
            shape(times.shape())
        )));
    }
    let values = match has_unit {
        true => PyTuple::new(given.py(), [values, tuple.get_item(2)?])?.into_any(),
        false => values,
    };
    Ok((Some(Arc::new(times)), values))
}

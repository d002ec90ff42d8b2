//! Inputs of runs: numbers, time series and whole arrays.

use crate::arguments::{in_own_unit, shape};
use crate::buffers::Numbers;
use fmu_run::{System, Trajectory};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Values of inputs.
#[derive(Default)]
pub struct Signals(Vec<Signal>);

struct Signal {
    name: String,
    values: Numbers,
    /// Whether there is a value for each time, and whether for each run.
    by_time: bool,
    by_run: bool,
}

impl Signals {
    /// Reads inputs, each for this number of times.
    pub fn of(system: &System, given: &[(String, Bound<'_, PyAny>)], times: usize) -> PyResult<Self> {
        let mut signals = Self::default();
        for (name, value) in given {
            let values = Numbers::of(name, &in_own_unit(system, name, value)?)?;
            match system.array(name) {
                None => signals.push(name, &[], values, &[name.clone()], times)?,
                Some(array) => signals.push(name, &array.sizes, values, &array.names, times)?,
            }
        }
        Ok(signals)
    }

    /// Returns the values for the Rust interface.
    pub fn trajectories(&self) -> Vec<(&str, Trajectory<'_>)> {
        let trajectories = self.0.iter().map(|Signal { name, values, by_time, by_run }| {
            let trajectory = match (by_time, by_run) {
                (false, _) => Trajectory::Constant(values.values()[0]),
                (true, false) => Trajectory::Shared(values.values()),
                (true, true) => Trajectory::EachRun(values.values()),
            };
            (name.as_str(), trajectory)
        });
        trajectories.collect()
    }

    /// Adds the elements of an array, or a single variable.
    fn push(
        &mut self,
        name: &str,
        sizes: &[usize],
        values: Numbers,
        elements: &[String],
        times: usize,
    ) -> PyResult<()> {
        let given = values.shape();
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
                let constant = if sizes.is_empty() { String::new() } else { format!("{}, ", shape(sizes)) };
                return Err(PyValueError::new_err(format!(
                    "{name} has the shape {}; it must be ({of_time}{comma}), (runs, {of_time}), {constant}or a number",
                    shape(given)
                )));
            }
        };
        if elements.len() == 1 && sizes.is_empty() {
            self.0.push(Signal { name: name.to_owned(), values, by_time, by_run });
            return Ok(());
        }
        let all = values.values();
        for (number, element) in elements.iter().enumerate() {
            let own = match given.is_empty() {
                true => all.to_vec(),
                false => all.iter().skip(number).step_by(elements.len()).copied().collect(),
            };
            self.0.push(Signal { name: element.clone(), values: Numbers::Row(own), by_time, by_run });
        }
        Ok(())
    }
}

//! Inputs whose values `f64` cannot represent: strings, bytes, 64-bit integers.

use super::Trajectory;
use super::resampling::Resampling;
use crate::error::{Error, request};
use crate::lookup::Found;
use crate::selection::Target;
use crate::start::exact;
use crate::system_instance::SystemInstance;
use fmi_abi::Value;
use fmi_abi::client::Rejection;

/// An input with its values for all runs. Each value holds until the next one.
pub(super) struct Input {
    targets: Vec<Target>,
    values: Vec<Value>,
    /// Number of values for each run; 0 if there is one value for all times of all runs.
    length: usize,
    /// Whether each run has its own values.
    is_each: bool,
    /// Index of the value at each communication point, if the input is given at its own times.
    indices: Option<Vec<usize>>,
}

impl Input {
    /// Checks the values of an input and converts them to its type.
    pub fn of(name: &str, found: &[Found], trajectory: Trajectory, time: &[f64]) -> Result<Self, Error> {
        let reals = |values: &[f64]| values.iter().copied().map(Value::Real).collect::<Vec<_>>();
        let mut indices = None;
        let (values, length) = match trajectory {
            Trajectory::Constant(value) => (reals(&[value]), 0),
            Trajectory::Shared(values) | Trajectory::EachRun(values) => (reals(values), time.len()),
            Trajectory::RateOf(_) => {
                return request(format!("{name} is not a floating-point number and has no rate"));
            }
            Trajectory::Value(value) => (vec![value.clone()], 0),
            Trajectory::Values(values) => (values.to_vec(), time.len()),
            Trajectory::Sampled { times, values } => {
                indices = Some(Resampling::of(name, times, time)?.indices());
                (reals(values), times.len())
            }
            Trajectory::SampledValues { times, values } => {
                indices = Some(Resampling::of(name, times, time)?.indices());
                (values.to_vec(), times.len())
            }
        };
        if length != 0 && (values.len() % length != 0 || values.is_empty()) {
            return request(format!("{name} has {} values for {length} times", values.len()));
        }
        let values = values.into_iter().map(|value| exact(found[0], name, value));
        let values = values.collect::<Result<Vec<_>, _>>()?;
        let is_each = length != 0 && values.len() > length;
        Ok(Self {
            targets: found.iter().copied().map(Target::of).collect(),
            values,
            length,
            is_each,
            indices,
        })
    }

    fn value(&self, run: usize, time: usize) -> &Value {
        if self.length == 0 {
            return &self.values[0];
        }
        let index = self.indices.as_ref().map_or(time, |indices| indices[time]);
        &self.values[if self.is_each { run * self.length } else { 0 } + index]
    }

    /// Returns whether the value at the time with this index is new: it is the first one, or differs from the one before.
    pub fn changes(&self, run: usize, time: usize) -> bool {
        time == 0 || self.value(run, time) != self.value(run, time - 1)
    }

    /// Sets the value at the time with this index if it is new.
    pub fn set(&self, instance: &mut SystemInstance, run: usize, time: usize) -> Result<(), Rejection> {
        if !self.changes(run, time) {
            return Ok(());
        }
        let value = self.value(run, time);
        self.targets.iter().try_for_each(|target| instance.set_value(*target, value))
    }
}

//! Values of inputs, of any type.

use super::Trajectory;
use super::resampling::Resampling;
use crate::error::{Error, request};
use std::borrow::Cow;

/// Values of an input in all runs: numbers, or [values](fmi_abi::Value) that `f64` cannot represent.
pub(super) struct Series<'a, T: Clone> {
    values: Cow<'a, [T]>,
    /// Number of values of a run: 1 if the input is constant.
    length: usize,
    /// Whether each run has its own values.
    is_each: bool,
    /// Whether a value holds until the next one; otherwise values are interpolated.
    pub is_held: bool,
    /// The input's own times, if it is not given at the communication points.
    resampling: Option<Resampling>,
}

impl<'a, T: Clone> Series<'a, T> {
    /// Checks the number of values of a trajectory. `points` are the communication points.
    pub fn of(
        name: &str,
        values: Cow<'a, [T]>,
        trajectory: &Trajectory,
        is_held: bool,
        points: &[f64],
    ) -> Result<Self, Error> {
        let (length, resampling) = match trajectory {
            Trajectory::Constant(_) | Trajectory::Value(_) | Trajectory::RateOf(_) => (1, None),
            Trajectory::Shared(_) | Trajectory::EachRun(_) | Trajectory::Values(_) => (points.len(), None),
            Trajectory::Sampled { times, .. } | Trajectory::SampledValues { times, .. } => {
                (times.len(), Some(Resampling::of(name, times, points)?))
            }
        };
        let is_each = values.len() > length;
        if values.is_empty()
            || !values.len().is_multiple_of(length)
            || is_each && matches!(trajectory, Trajectory::Shared(_))
        {
            return request(format!("{name} has {} values for {length} times", values.len()));
        }
        Ok(Self { values, length, is_each, is_held, resampling })
    }

    /// Returns the values of a run.
    pub fn of_run(&self, run: usize) -> &[T] {
        &self.values[if self.is_each { run * self.length } else { 0 }..][..self.length]
    }

    /// Returns the times of the values of a run, s.
    pub fn times<'s>(&'s self, points: &'s [f64]) -> &'s [f64] {
        match &self.resampling {
            Some(resampling) => &resampling.times,
            None => &points[..self.length],
        }
    }

    /// Returns the index of the last value of a run that is not after the communication point with this index.
    pub fn index(&self, point: usize) -> usize {
        match &self.resampling {
            Some(resampling) => resampling.index(point),
            None => point.min(self.length - 1),
        }
    }
}

impl Series<'_, f64> {
    /// Returns the value at the communication point with this index. `values` are those of the run.
    #[inline(always)]
    pub fn value(&self, values: &[f64], point: usize) -> f64 {
        match (&self.resampling, values) {
            (None, [value]) => *value,
            (None, values) => values[point],
            (Some(resampling), values) => resampling.value(values, point, self.is_held),
        }
    }
}

//! Inputs whose values `f64` cannot represent: strings, bytes, 64-bit integers.

use super::Trajectory;
use super::series::Series;
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
    series: Series<'static, Value>,
}

impl Input {
    /// Checks the values of an input and converts them to its type.
    pub fn of(name: &str, found: &[Found], trajectory: Trajectory, time: &[f64]) -> Result<Self, Error> {
        let reals = |values: &[f64]| values.iter().copied().map(Value::Real).collect::<Vec<_>>();
        let values = match trajectory {
            Trajectory::Constant(value) => reals(&[value]),
            Trajectory::Shared(values) | Trajectory::EachRun(values) | Trajectory::Sampled { values, .. } => {
                reals(values)
            }
            Trajectory::RateOf(_) => {
                return request(format!("{name} is not a floating-point number and has no rate"));
            }
            Trajectory::Value(value) => vec![value.clone()],
            Trajectory::Values(values) | Trajectory::SampledValues { values, .. } => values.to_vec(),
        };
        let values = values.into_iter().map(|value| exact(found[0], name, value));
        let values = values.collect::<Result<Vec<_>, _>>()?;
        let series = Series::of(name, values.into(), &trajectory, true, time)?;
        Ok(Self { targets: found.iter().copied().map(Target::of).collect(), series })
    }

    fn value(&self, run: usize, time: usize) -> &Value {
        &self.series.of_run(run)[self.series.index(time)]
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

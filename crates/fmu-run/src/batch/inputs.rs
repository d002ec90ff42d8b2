//! Checks the inputs of a batch.

use super::exact::Input;
use super::series::Series;
use super::{Batch, Trajectory};
use crate::description::Variable;
use crate::error::{Error, request};
use crate::lookup::{Found, article, is_exact};
use crate::selection::{Assigned, Selection, fits};
use crate::system::System;
use fmi_abi::{BaseType, Standard, Variability};
use std::borrow::Cow;

/// Numeric inputs and their values.
#[derive(Default)]
pub(super) struct Inputs<'a> {
    pub variables: Selection,
    pub values: Vec<Series<'a, f64>>,
}

/// Checks the names of the inputs. Adds the inputs whose values `f64` cannot represent to `exact`, and passes all others to
/// `numeric`, with their variables.
pub(super) fn each_input<'a, 's>(
    system: &'s System,
    batch: &'a Batch,
    exact: &mut Vec<Input>,
    mut numeric: impl FnMut(&'a str, Trajectory<'a>, Vec<Found<'s>>) -> Result<(), Error>,
) -> Result<(), Error> {
    let mut known = Assigned::default();
    for (name, trajectory) in batch.inputs.iter().filter(|(name, _)| !system.is_clocked(name)) {
        let variables = system.find(name)?;
        input_of(name, &variables)?;
        known.add(name, &variables);
        if is_exact(variables[0].variable.base) {
            exact.push(Input::of(name, &variables, *trajectory, batch.time)?);
        } else {
            numeric(name, *trajectory, variables)?;
        }
    }
    known.check("inputs")
}

/// Fails unless the variables with a name are an input, or another variable that may be set during a run.
pub(super) fn input_of(name: &str, variables: &[Found]) -> Result<(), Error> {
    variables.iter().try_for_each(|found| found.check_own(name))?;
    let of = variables[0].variable;
    if !of.is_settable() || of.is_structural() || of.variability == Some(Variability::Fixed) {
        let kind = match &of.variability {
            Some(variability) => format!("{variability} {}", of.causality),
            None => of.causality.to_string(),
        };
        let hint = match variables[0].check_start(name) {
            Ok(()) => "; give it a start value",
            Err(_) => ", which cannot be set",
        };
        return request(format!("{name} is not an input but {}{hint}", article(&kind)));
    }
    Ok(())
}

/// Returns whether values of a variable are held between the times at which they are given; otherwise they are interpolated.
pub(super) fn is_held(of: &Variable) -> bool {
    !of.base.is_float() || of.variability.is_some_and(|of| of != Variability::Continuous)
}

/// Checks the values of a numeric input. `time` are the communication points.
pub(super) fn checked<'a>(
    name: &str,
    base: (BaseType, Standard),
    trajectory: Trajectory<'a>,
    is_held: bool,
    time: &[f64],
) -> Result<Series<'a, f64>, Error> {
    let values: Cow<[f64]> = match trajectory {
        Trajectory::Constant(value) => vec![value].into(),
        Trajectory::Shared(values) | Trajectory::EachRun(values) | Trajectory::Sampled { values, .. } => {
            values.into()
        }
        Trajectory::RateOf(other) => {
            return request(format!(
                "{name} is the derivative of {other}; derivatives of other inputs are for continuous inputs in Model Exchange"
            ));
        }
        Trajectory::Value(_) | Trajectory::Values(_) | Trajectory::SampledValues { .. } => {
            return request(format!("{name} is a number; give its values as numbers"));
        }
    };
    fits(name, base, &values)?;
    Series::of(name, values, &trajectory, is_held, time)
}

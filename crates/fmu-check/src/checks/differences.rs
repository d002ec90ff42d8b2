//! Checks partial derivatives against central differences of the values that the FMU returns.

use super::derivatives::{
    declared, is_continuous_scalar, knowns, middle_values, names, numbers_if_ok, references,
    request_derivatives, set_known, to_middle, unknowns,
};
use super::integration::{Integrated, integrate_with_events};
use crate::call_sequence::Run;
use crate::checker::Checker;
use crate::description::Variable;
use crate::values::inputs_by;
use crate::writer::{Part, Read, Trajectory, Writer, value_of};
use std::sync::Arc;

/// Checks derivatives against central differences in the middle of a simulation. Uses directional derivatives if
/// `is_directional` is true, otherwise adjoint derivatives.
pub fn differences(
    checker: &Checker,
    trajectory: &Trajectory,
    unknowns: &[usize],
    knowns: &[usize],
    is_directional: bool,
) -> anyhow::Result<()> {
    let description = &checker.description;
    let states = if trajectory.is_stepped() { Vec::new() } else { description.states() };
    if !trajectory.is_stepped() && states.len() != description.states_count().unwrap_or(0) {
        return Ok(());
    }
    let (values, vector) = middle_values(checker, trajectory, knowns, &states)?;
    for (known, value) in knowns.iter().zip(values) {
        let variable = &description.variables[*known];
        let value = value.first().copied().filter(|value| value.is_finite() && !variable.once_per_instant);
        let Some(value) = value else { continue };
        let Some(step) = step_in_range(variable, value) else { continue };
        let mut writer = checker.writer(trajectory);
        writer.write(0, &to_middle(trajectory));
        let derivatives = request_column(
            &mut writer,
            &references(description, unknowns),
            variable.reference,
            is_directional,
        );
        let reads = [step, -step, step / 2.0, -step / 2.0, 0.0].map(|by| {
            set_known(&mut writer, &states, &vector, *known, &[value + by]);
            writer.read_these(0, unknowns)
        });
        let differences = Arc::new(Differences {
            unknowns: unknowns.to_vec(),
            itself: description.aliases(*known).collect(),
            names: names(description, unknowns),
            known: variable.name.clone(),
            may_react_later: trajectory.is_stepped(),
            step,
            derivatives,
            reads,
        });
        let precision = Arc::clone(&differences);
        let criterion = move |run: &Run| differences.evaluate(run, 1e-4);
        let run = checker.evaluate("derivatives.directional", writer.sequence.clone(), criterion)?;
        if !checker.has("derivatives.directional") {
            let criterion = move |run: &Run| precision.evaluate(run, 2e-7);
            checker.record("derivatives.precision", &run, &writer.sequence, criterion);
        }
    }
    Ok(())
}

/// Returns the step of the differences at a value; `None` if a step up or down leaves the range of the variable.
fn step_in_range(variable: &Variable, value: f64) -> Option<f64> {
    let step = 1e-4 * variable.nominal.max(value.abs()).max(1e-3);
    let is_in_range = |number: f64| {
        variable.min.is_none_or(|min| number >= min) && variable.max.is_none_or(|max| number <= max)
    };
    (is_in_range(value - step) && is_in_range(value + step)).then_some(step)
}

/// Checks the derivatives of initial unknowns with respect to inputs in Initialization Mode. They may differ from later derivatives, for
/// example because initial states are computed from inputs.
pub fn initial(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let [has_directional, has_adjoint] = declared(checker, trajectory.interface);
    let listed = description.initial_unknowns.iter().map(|unknown| unknown.variable);
    let mut unknowns: Vec<usize> =
        listed.filter(|index| is_continuous_scalar(description, *index)).take(200).collect();
    unknowns.dedup();
    if !has_directional && !has_adjoint || unknowns.is_empty() {
        return Ok(());
    }
    let inputs = inputs_by(description, 0.1)
        .into_iter()
        .filter(|(index, _)| is_continuous_scalar(description, *index));
    for (known, value) in inputs.take(checker.at_most(8)) {
        let variable = &description.variables[known];
        let (value, step) = (value.numbers()[0], 1e-4 * variable.nominal.max(1e-3));
        let parts = [Part::Make, Part::Enter];
        let mut writer = checker.writer(trajectory);
        writer.write(0, &parts);
        writer.set_numbers(0, known, &[value]);
        let derivatives = request_column(
            &mut writer,
            &references(description, &unknowns),
            variable.reference,
            has_directional,
        );
        let reads = [step, -step, step / 2.0, -step / 2.0, 0.0].map(|by| {
            writer.set_numbers(0, known, &[value + by]);
            writer.read_these(0, &unknowns)
        });
        let differences = Differences {
            unknowns: unknowns.clone(),
            itself: description.aliases(known).collect(),
            names: names(description, &unknowns)
                .into_iter()
                .map(|name| format!("{name} in Initialization Mode"))
                .collect(),
            known: variable.name.clone(),
            may_react_later: true,
            step,
            derivatives,
            reads,
        };
        let criterion = move |run: &Run| differences.evaluate(run, 1e-4);
        checker.check("derivatives.directional", writer.sequence, criterion)?;
    }
    Ok(())
}

/// Checks derivatives against differences after an event of an integration: a state event, or a time event if there is none.
pub fn after_events(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let Integrated { trajectory: mut up_to_event, chosen } = integrate_with_events(checker, trajectory)?;
    let Some(event) = chosen.into_iter().find(|index| up_to_event.points[*index].event) else {
        return Ok(());
    };
    // Derivatives are requested in the middle of a simulation, so the number of points is set to make the event the
    // last point of the first half.
    let event_point = up_to_event.points[event].clone();
    up_to_event.points.resize(2 * (event + 1), event_point);
    let [has_directional, has_adjoint] = declared(checker, up_to_event.interface);
    let unknowns = unknowns(&checker.description, up_to_event.interface);
    let mut knowns = knowns(&checker.description, up_to_event.interface);
    knowns.truncate(checker.at_most(40));
    if !has_directional && !has_adjoint || unknowns.is_empty() {
        return Ok(());
    }
    differences(checker, &up_to_event, &unknowns, &knowns, has_directional)
}

/// Requests the derivatives of all unknowns with respect to one known, by one directional derivative or by an adjoint derivative for each
/// unknown. Returns, for each unknown, the number of the call and the index in its result.
fn request_column(
    writer: &mut Writer,
    unknowns: &[u32],
    known: u32,
    is_directional: bool,
) -> Vec<(u32, usize)> {
    if is_directional {
        let id = request_derivatives(
            writer,
            "GetDirectionalDerivative",
            unknowns,
            &[known],
            &[1.0],
            unknowns.len(),
        );
        return (0..unknowns.len()).map(|row| (id, row)).collect();
    }
    let adjoint =
        |row: &u32| (request_derivatives(writer, "GetAdjointDerivative", &[*row], &[known], &[1.0], 1), 0);
    unknowns.iter().map(adjoint).collect()
}

/// Calls for the derivatives with respect to one known, and the reads for the differences.
struct Differences {
    unknowns: Vec<usize>,
    /// Names of the unknowns in messages.
    names: Vec<String>,
    known: String,
    /// Indices of the known and its aliases, because the standard does not define the derivative of a variable with respect to itself.
    itself: Vec<usize>,
    /// Whether unknowns may stay unchanged until a later call, such as the next step of Co-Simulation.
    may_react_later: bool,
    step: f64,
    /// For each unknown, the number of the call for its derivative, and the index in the result of the call.
    derivatives: Vec<(u32, usize)>,
    /// Reads of the unknowns with +step, -step, +step/2, -step/2 and 0 added to the known.
    reads: [Vec<Read>; 5],
}

impl Differences {
    /// Describes the first derivative that differs from the central difference. Allows a relative difference of `tolerance`, and the error
    /// of the central difference, which is estimated by comparing two step sizes.
    fn evaluate(&self, run: &Run, tolerance: f64) -> Option<String> {
        for (row, unknown) in self.unknowns.iter().enumerate() {
            if self.itself.contains(unknown) {
                continue;
            }
            let number = |reads: &Vec<Read>| -> Option<f64> {
                let value = value_of(run, reads, *unknown)?.numbers().first().copied();
                value.filter(|number| number.is_finite())
            };
            let values: Vec<f64> = self.reads.iter().map(number).collect::<Option<_>>()?;
            let (id, index) = self.derivatives[row];
            let derivative = numbers_if_ok(run, id)?.get(index).copied()?;
            let (step, center) = (self.step, values[4]);
            let (wide, narrow) = ((values[0] - values[1]) / (2.0 * step), (values[2] - values[3]) / step);
            // One-sided differences that disagree indicate a kink, where the derivative does not exist.
            let (left, right) = ((center - values[3]) / (step / 2.0), (values[2] - center) / (step / 2.0));
            let rounding = 1e-13 * center.abs().max(values[0].abs()) / step;
            let error = (wide - narrow).abs() * 10.0 + rounding * 100.0;
            let scale = narrow.abs().max(derivative.abs());
            let kink = (left - right).abs() > 0.05 * scale + rounding * 100.0;
            let reacts_later = self.may_react_later && narrow == 0.0 && wide == 0.0;
            if kink && error > 1e-9 || reacts_later {
                continue;
            }
            let allowed = tolerance * (scale + 1e-5);
            if !derivative.is_finite() || (derivative - narrow).abs() > allowed + error {
                return Some(format!(
                    "the derivative of {} with respect to {} is {derivative:?}, differences give {narrow:?}",
                    self.names[row], self.known
                ));
            }
        }
        None
    }
}

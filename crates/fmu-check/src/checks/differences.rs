//! Checks partial derivatives against central differences of the values that the FMU returns.

use super::derivatives::{
    MOST_KNOWNS, declared, is_continuous_scalar, knowns, middle_values, names, numbers_if_ok, references,
    request_derivatives, set_known, to_middle, unknowns, write_to_middle,
};
use super::integration::{Integrated, integrate_with_events};
use crate::call_sequence::{Arg, Run, Values};
use crate::checker::Checker;
use crate::description::{Description, Unknown, Variable};
use crate::trajectory::step_size;
use crate::values::other_numbers;
use crate::writer::{Part, Read, Trajectory, Writer, number_of};
use fmi_abi::{BaseType, Causality};
use std::sync::Arc;

/// Number of knowns in a call sequence.
const TOGETHER: usize = 8;
/// Maximum number of derivatives with respect to a known that are also requested one by one.
const SINGLY: usize = 40;

/// Checks derivatives against central differences in the middle of a simulation with these parameters. Uses directional derivatives if
/// `is_directional` is true, otherwise adjoint derivatives. Compares only the derivatives that are not zero, or whose unknown is declared
/// to depend on the known, because a model with many states has few of them.
pub fn differences(
    checker: &Checker,
    trajectory: &Trajectory,
    unknowns: &[usize],
    knowns: &[usize],
    is_directional: bool,
    parameters: &[(usize, Values)],
) -> anyhow::Result<()> {
    let description = &checker.description;
    let states = if trajectory.is_stepped() { Vec::new() } else { description.states() };
    if !trajectory.is_stepped() && states.len() != description.states_count() {
        return Ok(());
    }
    let (values, vector) = middle_values(checker, trajectory, knowns, &states, parameters)?;
    let nonzero = nonzero(checker, trajectory, unknowns, knowns, parameters)?;
    let mut compared = Vec::new();
    for ((known, value), nonzero) in knowns.iter().zip(values).zip(nonzero) {
        let variable = &description.variables[*known];
        let value = value.first().copied().filter(|value| value.is_finite() && !variable.once_per_instant);
        let Some(value) = value else { continue };
        let Some(step) = step_in_range(variable, value) else { continue };
        let listed = description.outputs.iter().chain(&description.derivatives);
        let mut rows = dependents(description, listed, *known, unknowns);
        rows.extend(nonzero.into_iter().map(|row| unknowns[row]));
        rows.sort_unstable();
        rows.dedup();
        if !rows.is_empty() {
            compared.push((*known, value, step, rows));
        }
    }
    for group in compared.chunks(TOGETHER) {
        let mut writer = checker.writer(trajectory);
        write_to_middle(&mut writer, parameters);
        let mut all = Vec::new();
        for (known, value, step, rows) in group {
            let reads = STEPS.map(|times| {
                set_known(&mut writer, &states, &vector, *known, &[value + times * step]);
                writer.read_these(0, rows)
            });
            let reference = description.variables[*known].reference;
            let derivatives =
                request_column(&mut writer, &references(description, rows), reference, is_directional);
            let differences = Differences::new(description, rows.clone(), *known, *step, derivatives, reads);
            all.push(Differences { may_react_later: trajectory.is_stepped(), ..differences });
        }
        let all = Arc::new(all);
        let precise = Arc::clone(&all);
        let criterion = move |run: &Run| all.iter().find_map(|one| one.evaluate(run, 1e-4));
        let run = checker.evaluate("derivatives.directional", writer.sequence.clone(), criterion)?;
        if !checker.has("derivatives.directional") {
            let criterion = move |run: &Run| precise.iter().find_map(|one| one.evaluate(run, 2e-7));
            checker.record("derivatives.precision", &run, &writer.sequence, criterion);
        }
    }
    Ok(())
}

/// The values of a known at which unknowns are read, as factors of the step that is added. The last one leaves the known unchanged.
const STEPS: [f64; 5] = [1.0, -1.0, 0.5, -0.5, 0.0];

/// Returns the unknowns of this list that are declared to depend on a known.
fn dependents<'d>(
    description: &Description,
    listed: impl Iterator<Item = &'d Unknown>,
    known: usize,
    unknowns: &[usize],
) -> Vec<usize> {
    let aliases: Vec<usize> = description.aliases(known).collect();
    let depends = |unknown: &&Unknown| {
        let is_listed = |list: &Vec<usize>| list.iter().any(|index| aliases.contains(index));
        unknown.dependencies.as_ref().is_none_or(is_listed)
    };
    let dependent = listed.filter(depends).map(|unknown| unknown.variable);
    dependent.filter(|index| unknowns.contains(index)).collect()
}

/// Returns for each known the positions of the unknowns whose directional derivatives are not zero; none if a call fails.
fn nonzero(
    checker: &Checker,
    trajectory: &Trajectory,
    unknowns: &[usize],
    knowns: &[usize],
    parameters: &[(usize, Values)],
) -> anyhow::Result<Vec<Vec<usize>>> {
    let mut writer = checker.writer(trajectory);
    write_to_middle(&mut writer, parameters);
    let [rows, columns] = [unknowns, knowns].map(|indices| references(&checker.description, indices));
    let ids: Vec<u32> = columns
        .iter()
        .map(|known| {
            let (name, count) = ("GetDirectionalDerivative", rows.len());
            request_derivatives(&mut writer, name, &rows, &[*known], &[1.0], count)
        })
        .collect();
    let run = checker.execute(&writer.sequence)?;
    let rows = |id: u32| {
        let column = numbers_if_ok(&run, id).unwrap_or_default();
        (0..column.len()).filter(|row| column[*row] != 0.0).collect()
    };
    Ok(ids.into_iter().map(rows).collect())
}

/// Returns the step of the differences at a value; `None` if a step up or down leaves the range of the variable.
fn step_in_range(variable: &Variable, value: f64) -> Option<f64> {
    let step = 1e-4 * variable.nominal().max(value.abs()).max(1e-3);
    let is_in_range = |number: f64| {
        variable.min().is_none_or(|min| number >= min) && variable.max().is_none_or(|max| number <= max)
    };
    (is_in_range(value - step) && is_in_range(value + step)).then_some(step)
}

/// Checks the derivatives of initial unknowns with respect to inputs and exact variables in Initialization Mode. They may differ from later
/// derivatives, for example because initial states are computed from inputs.
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
    let values = other_numbers(description, &[Causality::Input, Causality::Parameter]).into_iter().filter(
        |(index, _)| {
            let variable = &description.variables[*index];
            variable.base == Some(BaseType::Real) && variable.size == Some(1) && !variable.once_per_instant
        },
    );
    for (known, value) in values.take(MOST_KNOWNS) {
        let variable = &description.variables[known];
        let rows = dependents(description, description.initial_unknowns.iter(), known, &unknowns);
        let value = value.numbers()[0];
        let Some(step) = step_in_range(variable, value).filter(|_| !rows.is_empty()) else { continue };
        let mut writer = checker.writer(trajectory);
        writer.write(0, &[Part::Make, Part::Enter]);
        let reads = STEPS.map(|times| {
            writer.set_numbers(0, known, &[value + times * step]);
            writer.read_these(0, &rows)
        });
        let derivatives =
            request_column(&mut writer, &references(description, &rows), variable.reference, has_directional);
        let mut differences = Differences::new(description, rows, known, step, derivatives, reads);
        differences.names.iter_mut().for_each(|name| name.push_str(" in Initialization Mode"));
        differences.may_react_later = true;
        let criterion = move |run: &Run| differences.evaluate(run, 1e-4);
        checker.check("derivatives.directional", writer.sequence, criterion)?;
    }
    Ok(())
}

/// Checks the derivatives with respect to time in Model Exchange, in the middle of a simulation.
pub fn by_time(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let Some(time) = description.independent() else { return Ok(()) };
    let unknowns = unknowns(description, trajectory.interface);
    let listed = description.outputs.iter().chain(&description.derivatives);
    let rows = dependents(description, listed, time, &unknowns);
    let count = trajectory.points.len() / 2;
    if !declared(checker, trajectory.interface)[0] || rows.is_empty() || count == 0 {
        return Ok(());
    }
    let step = 1e-4 * step_size(description);
    let middle = trajectory.points[count - 1].time + 2.0 * step;
    let mut writer = checker.writer(trajectory);
    writer.write(0, &to_middle(trajectory));
    let read_at = |writer: &mut Writer, times: f64| {
        writer.call(0, "SetTime", vec![Arg::real(middle + times * step)]);
        writer.read_these(0, &rows)
    };
    // Time must not go back.
    let [low, lower, center] = [-1.0, -0.5, 0.0].map(|times| read_at(&mut writer, times));
    let reference = description.variables[time].reference;
    let derivatives = request_column(&mut writer, &references(description, &rows), reference, true);
    let [higher, high] = [0.5, 1.0].map(|times| read_at(&mut writer, times));
    let reads = [high, low, higher, lower, center];
    let differences = Differences::new(description, rows, time, step, derivatives, reads);
    let criterion = move |run: &Run| differences.evaluate(run, 1e-4);
    checker.check("derivatives.directional", writer.sequence, criterion)
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
    differences(checker, &up_to_event, &unknowns, &knowns, has_directional, &[])
}

/// Requests the derivatives of all unknowns with respect to one known, by one directional derivative or by an adjoint derivative for each
/// unknown. Because the FMU rejects the directional derivative if it does not provide that of one unknown, also requests a few one by one.
/// Returns, for each unknown, the numbers of the calls and the index in the result of each.
fn request_column(writer: &mut Writer, unknowns: &[u32], known: u32, is_directional: bool) -> Requests {
    let name = if is_directional { "GetDirectionalDerivative" } else { "GetAdjointDerivative" };
    let count = unknowns.len();
    let column = is_directional.then(|| request_derivatives(writer, name, unknowns, &[known], &[1.0], count));
    let is_single = !is_directional || (2..=SINGLY).contains(&count);
    let mut derivative = |(row, unknown): (usize, &u32)| -> Vec<(u32, usize)> {
        let single =
            is_single.then(|| (request_derivatives(writer, name, &[*unknown], &[known], &[1.0], 1), 0));
        column.map(|id| (id, row)).into_iter().chain(single).collect()
    };
    unknowns.iter().enumerate().map(&mut derivative).collect()
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
    derivatives: Requests,
    /// Reads of the unknowns with +step, -step, +step/2, -step/2 and 0 added to the known.
    reads: [Vec<Read>; 5],
}

/// For each unknown, the numbers of the calls for its derivative, and the index in the result of each call.
type Requests = Vec<Vec<(u32, usize)>>;

impl Differences {
    /// Makes the differences of unknowns that may not stay unchanged.
    fn new(
        description: &Description,
        unknowns: Vec<usize>,
        known: usize,
        step: f64,
        derivatives: Requests,
        reads: [Vec<Read>; 5],
    ) -> Self {
        Self {
            names: names(description, &unknowns),
            unknowns,
            known: description.variables[known].name.clone(),
            itself: description.aliases(known).collect(),
            may_react_later: false,
            step,
            derivatives,
            reads,
        }
    }

    /// Describes the first derivative that differs from the central difference. Allows a relative difference of `tolerance`, and the error
    /// of the central difference, which is estimated by comparing two step sizes.
    fn evaluate(&self, run: &Run, tolerance: f64) -> Option<String> {
        for (row, unknown) in self.unknowns.iter().enumerate() {
            if self.itself.contains(unknown) {
                continue;
            }
            let number =
                |reads: &Vec<Read>| number_of(run, reads, *unknown).filter(|number: &f64| number.is_finite());
            let Some(values) = self.reads.iter().map(number).collect::<Option<Vec<f64>>>() else { continue };
            let derivative = |(id, index): &(u32, usize)| numbers_if_ok(run, *id)?.get(*index).copied();
            let calls = &self.derivatives[row];
            let Some(derivative) = calls.iter().find_map(derivative) else {
                // A derivative that the FMU does not provide is not a mistake, unless the FMU states that it is not a number.
                if let Some(why) = calls.last().and_then(|(id, _)| not_finite(run, *id)) {
                    let (name, known) = (&self.names[row], &self.known);
                    return Some(format!("the derivative of {name} with respect to {known}: {why}"));
                }
                continue;
            };
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

/// Returns the message of a rejected call that states that a result is not finite.
fn not_finite(run: &Run, id: u32) -> Option<String> {
    let outcome = run.outcome(id).filter(|outcome| outcome.status.is_some_and(|status| status > 1))?;
    let texts = outcome.log.iter().filter_map(|message| message.text.as_ref());
    texts.map(|text| String::from_utf8_lossy(text).into_owned()).find(|text| text.contains("finite"))
}

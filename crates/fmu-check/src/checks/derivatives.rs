//! Checks partial derivatives against differences, adjoint derivatives against directional ones, and vectors against variables.

use super::excited::{Excited, excited};
use crate::call_sequence::{Arg, Kind, Run, Values};
use crate::checker::Checker;
use crate::description::Description;
use crate::finding::Criterion;
use crate::values::inputs_by;
use crate::writer::{Part, Read, Trajectory, Writer, value_of};
use fmi_abi::{BaseType, Interface};
use std::sync::Arc;

/// Returns a continuous scalar unknown and a continuous scalar known on which it may depend.
pub fn pair(description: &Description, interface: Interface) -> Option<(usize, usize)> {
    let unknowns = unknowns(description, interface);
    let knowns = knowns(description, interface);
    let mut listed = description.outputs.iter().chain(&description.derivatives);
    listed.find_map(|unknown| {
        let depends = |known: &&usize| unknown.dependencies.as_ref().is_none_or(|list| list.contains(known));
        let known = knowns.iter().find(depends).filter(|_| unknowns.contains(&unknown.variable))?;
        Some((unknown.variable, *known))
    })
}

fn continuous(description: &Description, index: usize) -> bool {
    let variable = &description.variables[index];
    variable.base == Some(BaseType::Real)
        && variable.variability == "continuous"
        && variable.size == Some(1)
        && !variable.clocked
}

/// Returns at most 200 continuous scalar outputs and, in Model Exchange, state derivatives.
fn unknowns(description: &Description, interface: Interface) -> Vec<usize> {
    let derivatives: &[_] =
        if interface == Interface::ModelExchange { &description.derivatives } else { &[] };
    let listed = description.outputs.iter().chain(derivatives).map(|unknown| unknown.variable);
    let mut found: Vec<usize> = listed.filter(|index| continuous(description, *index)).collect();
    found.dedup();
    found.truncate(200);
    found
}

/// Returns the continuous scalar inputs and, in Model Exchange, states.
fn knowns(description: &Description, interface: Interface) -> Vec<usize> {
    let inputs =
        (0..description.variables.len()).filter(|index| description.variables[*index].causality == "input");
    let states = if interface == Interface::ModelExchange { description.states() } else { Vec::new() };
    inputs.chain(states).filter(|index| continuous(description, *index)).collect()
}

/// Requests partial derivatives of unknowns with respect to knowns.
pub fn derivative(
    writer: &mut Writer,
    function: &str,
    unknowns: &[u32],
    knowns: &[u32],
    seed: &[f64],
    results: usize,
) -> u32 {
    let sizes = writer.fmi3();
    let size = |size: usize| sizes.then_some(Arg::Integer(size as i64));
    let mut args = Vec::new();
    for references in [unknowns, knowns] {
        args.push(Arg::In(Kind::U32, references.iter().map(|reference| u64::from(*reference)).collect()));
        args.push(Arg::Integer(references.len() as i64));
    }
    args.push(Arg::In(Kind::F64, seed.iter().map(|number| number.to_bits()).collect()));
    args.extend(size(seed.len()));
    args.push(Arg::Out(Kind::F64, results));
    args.extend(size(results));
    writer.call(0, function, args)
}

/// Returns the parts of the simulation up to the point in the middle, where partial derivatives are requested.
pub fn to_middle(trajectory: &Trajectory) -> [Part; 2] {
    [Part::Begin, Part::Points(trajectory.points.len() / 2)]
}

/// Returns whether directional derivatives are declared, and whether adjoint derivatives are.
fn offers(checker: &Checker, interface: Interface) -> [bool; 2] {
    let directional = ["providesDirectionalDerivative", "providesDirectionalDerivatives"];
    [&directional[..], &["providesAdjointDerivatives"]].map(|names| checker.can(interface, names))
}

/// Checks derivatives against differences, adjoint derivatives against directional ones, and the derivative for a seed of ones
/// against the sum of the derivatives for unit seeds.
pub fn directional(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let [has_directional, has_adjoint] = offers(checker, trajectory.interface);
    let unknowns = unknowns(&checker.description, trajectory.interface);
    let mut knowns = knowns(&checker.description, trajectory.interface);
    knowns.truncate(checker.at_most(40));
    if !has_directional && !has_adjoint || unknowns.is_empty() || knowns.is_empty() {
        return Ok(());
    }
    let mut writer = checker.writer(trajectory);
    writer.write(0, &to_middle(trajectory));
    let before = writer.read(0);
    let [outputs, inputs] = [&unknowns, &knowns].map(|indices| references(&checker.description, indices));
    let mut request = |function: &str, seed: &[f64], count: usize| {
        derivative(&mut writer, function, &outputs, &inputs, seed, count)
    };
    let unit = |index: usize, count: usize| -> Vec<f64> {
        (0..count).map(|at| f64::from(u8::from(at == index))).collect()
    };
    let columns: Vec<u32> = (0..knowns.len() * usize::from(has_directional))
        .map(|index| request("GetDirectionalDerivative", &unit(index, knowns.len()), unknowns.len()))
        .collect();
    let sum = has_directional
        .then(|| request("GetDirectionalDerivative", &vec![1.0; knowns.len()], unknowns.len()));
    let rows: Vec<u32> = (0..unknowns.len() * usize::from(has_adjoint))
        .map(|index| request("GetAdjointDerivative", &unit(index, unknowns.len()), knowns.len()))
        .collect();
    let after = writer.read(0);
    let sequence = writer.sequence.clone();
    let message = "{} was {}, after derivatives were requested it is {}";
    let is_unchanged = checker.differ(&before, &after, message);
    let run = checker.evaluate("derivatives.changed", sequence.clone(), is_unchanged)?;
    if run.end != crate::call_sequence::End::Done {
        return Ok(());
    }
    let names = [&unknowns, &knowns].map(|indices| names(&checker.description, indices));
    if let Some(sum) = sum {
        let criterion = is_linear(columns.clone(), sum, names[0].clone());
        checker.record("derivatives.linear", &run, &sequence, criterion);
        let rules = [("derivatives.adjoint", 1e-6), ("derivatives.adjoint-digits", 1e-11)];
        rules.into_iter().filter(|_| has_adjoint).any(|(name, tolerance)| {
            let criterion = is_transposed(columns.clone(), rows.clone(), names.clone(), tolerance);
            checker.record(name, &run, &sequence, criterion)
        });
        order(checker, trajectory, &outputs, &inputs)?;
    }
    differences(checker, trajectory, &unknowns, &knowns, has_directional)
}

pub fn references(description: &Description, indices: &[usize]) -> Vec<u32> {
    indices.iter().map(|index| description.variables[*index].reference).collect()
}

fn names(description: &Description, indices: &[usize]) -> Vec<String> {
    indices.iter().map(|index| description.variables[*index].name.clone()).collect()
}

/// Returns the numbers that a call wrote if it returned OK.
fn numbers(run: &Run, id: u32) -> Option<Vec<f64>> {
    run.written(id).filter(|_| run.status(id) == Some(0)).map(Values::numbers)
}

/// Returns the criterion that the derivatives for unit seeds add up to the derivative for a seed of ones.
fn is_linear(columns: Vec<u32>, sum: u32, names: Vec<String>) -> impl Criterion {
    move |run: &Run| {
        let columns: Vec<Vec<f64>> = columns.iter().map(|id| numbers(run, *id)).collect::<Option<_>>()?;
        let together = numbers(run, sum)?;
        (0..names.len()).find_map(|row| {
            let added: f64 = columns.iter().map(|column| column[row]).sum();
            let scale: f64 = columns.iter().map(|column| column[row].abs()).sum();
            let off = (added - together[row]).abs() > 1e-6 * scale.max(1e-12);
            off.then(|| {
                format!(
                    "the derivatives of {} add up to {added:?}, requested together they are {:?}",
                    names[row], together[row]
                )
            })
        })
    }
}

/// Returns the criterion that the adjoint derivatives are the transposed directional derivatives.
fn is_transposed(
    columns: Vec<u32>,
    rows: Vec<u32>,
    names: [Vec<String>; 2],
    tolerance: f64,
) -> impl Criterion {
    move |run: &Run| {
        let matrix = |ids: &[u32]| ids.iter().map(|id| numbers(run, *id)).collect::<Option<Vec<_>>>();
        let (columns, rows) = (matrix(&columns)?, matrix(&rows)?);
        let [unknowns, knowns] = &names;
        for (row, name) in unknowns.iter().enumerate() {
            for (column, known) in knowns.iter().enumerate() {
                let (one, other) = (columns[column][row], rows[row][column]);
                if (one - other).abs() > tolerance * one.abs().max(other.abs()).max(1e-300) {
                    return Some(format!(
                        "the derivative of {name} with respect to {known} is {one:?}, the adjoint one {other:?}"
                    ));
                }
            }
        }
        None
    }
}

/// Checks that the derivatives do not depend on the order of unknowns and knowns.
fn order(checker: &Checker, trajectory: &Trajectory, unknowns: &[u32], knowns: &[u32]) -> anyhow::Result<()> {
    let reversed = |list: &[u32]| list.iter().rev().copied().collect::<Vec<_>>();
    let seed: Vec<f64> = (1..=knowns.len()).map(|number| number as f64).collect();
    let back: Vec<f64> = seed.iter().rev().copied().collect();
    let mut writer = checker.writer(trajectory);
    writer.write(0, &to_middle(trajectory));
    let name = "GetDirectionalDerivative";
    let one = derivative(&mut writer, name, unknowns, knowns, &seed, unknowns.len());
    let other = derivative(&mut writer, name, &reversed(unknowns), &reversed(knowns), &back, unknowns.len());
    checker.check("derivatives.order", writer.sequence, move |run| {
        let (one, other) = (numbers(run, one)?, numbers(run, other)?);
        let scale = one.iter().fold(0.0_f64, |greatest, number| greatest.max(number.abs()));
        let off = |(one, other): (&f64, &f64)| (one - other).abs() > 1e-6 * scale;
        let at = one.iter().zip(other.iter().rev()).position(off)?;
        let (is, reversed, number) = (one[at], other[other.len() - 1 - at], at + 1);
        Some(format!(
            "derivative {number} is {is:?}, and {reversed:?} when variables are named in reverse order"
        ))
    })
}

/// Sets a known: an element of the state vector if it is one of `states`, otherwise an input.
pub fn set_known(writer: &mut Writer, states: &[usize], vector: &[f64], known: usize, numbers: &[f64]) {
    match states.iter().position(|index| *index == known) {
        Some(at) => {
            let mut vector = vector.to_vec();
            vector[at] = numbers[0];
            writer.set_states(0, &vector);
        }
        None => {
            writer.set_numbers(0, known, numbers);
        }
    }
}

/// Returns the numbers of each known, and the vector of states, in the middle of a trajectory.
pub fn middle_values(
    checker: &Checker,
    trajectory: &Trajectory,
    knowns: &[usize],
    states: &[usize],
) -> anyhow::Result<(Vec<Vec<f64>>, Vec<f64>)> {
    let mut writer = checker.writer(trajectory);
    writer.write(0, &to_middle(trajectory));
    let read = writer.read_these(0, knowns);
    let vector = (!states.is_empty()).then(|| writer.vector(0, "GetContinuousStates", states.len()));
    let run = checker.execute(&writer.sequence)?;
    let numbers = |values: Option<Values>| values.map(|values| values.numbers()).unwrap_or_default();
    let values = knowns.iter().map(|known| numbers(value_of(&run, &read, *known))).collect();
    Ok((values, numbers(vector.and_then(|id| run.written(id)).cloned())))
}

/// Checks each derivative against central differences with two step sizes. Their difference estimates the error.
fn differences(
    checker: &Checker,
    trajectory: &Trajectory,
    unknowns: &[usize],
    knowns: &[usize],
    by_column: bool,
) -> anyhow::Result<()> {
    let description = &checker.description;
    let states = if trajectory.is_stepped() { Vec::new() } else { description.states() };
    if !trajectory.is_stepped() && states.len() != description.states_count().unwrap_or(0) {
        return Ok(());
    }
    let (values, vector) = middle_values(checker, trajectory, knowns, &states)?;
    for (known, value) in knowns.iter().zip(values) {
        let variable = &description.variables[*known];
        let value = value.first().copied();
        let Some(value) = value.filter(|value| value.is_finite() && !variable.once_per_instant) else {
            continue;
        };
        let step = 1e-4 * variable.nominal.max(value.abs()).max(1e-3);
        let inside = |number: f64| {
            variable.min.is_none_or(|min| number >= min) && variable.max.is_none_or(|max| number <= max)
        };
        if !inside(value - step) || !inside(value + step) {
            continue;
        }
        let mut writer = checker.writer(trajectory);
        writer.write(0, &to_middle(trajectory));
        let analytic = column(&mut writer, &references(description, unknowns), variable.reference, by_column);
        let reads = [step, -step, step / 2.0, -step / 2.0, 0.0].map(|by| {
            set_known(&mut writer, &states, &vector, *known, &[value + by]);
            writer.read_these(0, unknowns)
        });
        let differences = Arc::new(Differences {
            unknowns: unknowns.to_vec(),
            // The standard does not define the derivative of a state with respect to itself.
            itself: description.aliases(*known).collect(),
            names: names(description, unknowns),
            known: variable.name.clone(),
            is_stepped: trajectory.is_stepped(),
            step,
            analytic,
            reads,
        });
        let precise = Arc::clone(&differences);
        let sequence = writer.sequence.clone();
        let criterion = move |run: &Run| differences.evaluate(run, 1e-4);
        let run = checker.evaluate("derivatives.directional", sequence.clone(), criterion)?;
        if !checker.has("derivatives.directional") {
            checker.record("derivatives.precision", &run, &sequence, move |run| precise.evaluate(run, 2e-7));
        }
    }
    Ok(())
}

/// Checks the derivatives of initial unknowns with respect to inputs in Initialization Mode, where a getter may return other values than
/// later, for example because states follow from inputs.
pub fn initial(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let [by_column, by_row] = offers(checker, trajectory.interface);
    let listed = description.initial_unknowns.iter().map(|unknown| unknown.variable);
    let mut unknowns: Vec<usize> = listed.filter(|index| continuous(description, *index)).take(200).collect();
    unknowns.dedup();
    if !by_column && !by_row || unknowns.is_empty() {
        return Ok(());
    }
    let inputs = inputs_by(description, 0.1).into_iter().filter(|(index, _)| continuous(description, *index));
    for (known, value) in inputs.take(checker.at_most(8)) {
        let variable = &description.variables[known];
        let (value, step) = (value.numbers()[0], 1e-4 * variable.nominal.max(1e-3));
        let parts = [Part::Make, Part::Enter];
        let mut writer = checker.writer(trajectory);
        writer.write(0, &parts);
        writer.set_numbers(0, known, &[value]);
        let analytic =
            column(&mut writer, &references(description, &unknowns), variable.reference, by_column);
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
            is_stepped: true,
            step,
            analytic,
            reads,
        };
        let criterion = move |run: &Run| differences.evaluate(run, 1e-4);
        checker.check("derivatives.directional", writer.sequence, criterion)?;
    }
    Ok(())
}

/// Requests the derivatives of all unknowns with respect to one known: in one call, or by one adjoint derivative each.
fn column(writer: &mut Writer, unknowns: &[u32], known: u32, by_column: bool) -> Vec<(u32, usize)> {
    if by_column {
        let id = derivative(writer, "GetDirectionalDerivative", unknowns, &[known], &[1.0], unknowns.len());
        return (0..unknowns.len()).map(|row| (id, row)).collect();
    }
    let adjoint = |row: &u32| (derivative(writer, "GetAdjointDerivative", &[*row], &[known], &[1.0], 1), 0);
    unknowns.iter().map(adjoint).collect()
}

/// Derivatives with respect to one known, and the reads for the differences.
struct Differences {
    unknowns: Vec<usize>,
    names: Vec<String>,
    known: String,
    /// Indices of the known and its aliases.
    itself: Vec<usize>,
    is_stepped: bool,
    step: f64,
    /// Number of the call that returned the derivative of each unknown, and the index in its result.
    analytic: Vec<(u32, usize)>,
    /// Reads of the unknowns with +step, -step, +step/2, -step/2 and 0 added to the known.
    reads: [Vec<Read>; 5],
}

impl Differences {
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
            let (id, index) = self.analytic[row];
            let derivative = numbers(run, id)?.get(index).copied()?;
            let (step, here) = (self.step, values[4]);
            let (wide, narrow) = ((values[0] - values[1]) / (2.0 * step), (values[2] - values[3]) / step);
            // One-sided differences that disagree indicate a kink, where the derivative does not exist.
            let (left, right) = ((here - values[3]) / (step / 2.0), (values[2] - here) / (step / 2.0));
            let rounding = 1e-13 * here.abs().max(values[0].abs()) / step;
            let doubt = (wide - narrow).abs() * 10.0 + rounding * 100.0;
            let scale = narrow.abs().max(derivative.abs());
            let kink = (left - right).abs() > 0.05 * scale + rounding * 100.0;
            // An output of Co-Simulation may change only in the next step, so its differences are 0.
            let silent = self.is_stepped && narrow == 0.0 && wide == 0.0;
            if kink && doubt > 1e-9 || silent {
                continue;
            }
            let enough = tolerance * (scale + 1e-5);
            if !derivative.is_finite() || (derivative - narrow).abs() > enough + doubt {
                return Some(format!(
                    "the derivative of {} with respect to {} is {derivative:?}, differences give {narrow:?}",
                    self.names[row], self.known
                ));
            }
        }
        None
    }
}

/// Checks derivatives against differences after the first state event of an integration or, if there is none, after its first event.
pub fn after_events(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let Excited { trajectory: mut after, chosen } = excited(checker, trajectory)?;
    let Some(event) = chosen.into_iter().find(|index| after.points[*index].event) else { return Ok(()) };
    // The middle of the simulation is after the event.
    let last = after.points[event].clone();
    after.points.resize(2 * (event + 1), last);
    let [by_column, by_row] = offers(checker, after.interface);
    let unknowns = unknowns(&checker.description, after.interface);
    let mut knowns = knowns(&checker.description, after.interface);
    knowns.truncate(checker.at_most(40));
    if !by_column && !by_row || unknowns.is_empty() {
        return Ok(());
    }
    differences(checker, &after, &unknowns, &knowns, by_column)
}

/// Checks that the vectors of states and derivatives equal their variables, in the order of ModelStructure, and that nominal
/// values are positive and finite.
pub fn vectors(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let count = description.states_count().unwrap_or(0);
    let derivatives: Vec<usize> = description.derivatives.iter().map(|unknown| unknown.variable).collect();
    let states = description.states();
    if count == 0 || states.len() != derivatives.len() {
        return Ok(());
    }
    let mut writer = checker.writer(trajectory);
    writer.begin(0);
    let derivatives_name = writer.derivatives_name();
    let (mut vectors, mut nominals) = (Vec::new(), None);
    for point in &trajectory.points {
        writer.point(0, point);
        nominals = Some(writer.vector(0, "GetNominalsOfContinuousStates", count));
        for (name, indices) in [("GetContinuousStates", &states), (derivatives_name, &derivatives)] {
            vectors.push((writer.vector(0, name, count), writer.read_these(0, indices), indices.clone()));
        }
    }
    let model = description.clone();
    let run = checker.evaluate("derivatives.vectors", writer.sequence.clone(), move |run| {
        vectors.iter().filter(|(vector, ..)| run.succeeds(*vector)).find_map(|(vector, reads, indices)| {
            let numbers = run.written(*vector)?.numbers();
            let values = indices.iter().filter_map(|index| value_of(run, reads, *index));
            let values: Vec<f64> = values.flat_map(|value| value.numbers()).collect();
            let unlike = |(one, other): (&f64, &f64)| one.to_bits() != other.to_bits() && one != other;
            let at = numbers.iter().zip(&values).position(unlike);
            let at = at.filter(|_| numbers.len() == values.len())?;
            let name = &model.variables[indices[at.min(indices.len() - 1)]].name;
            let (one, other) = (numbers[at], values[at]);
            Some(format!("number {} of the vector is {one:?}, {name} is {other:?}", at + 1))
        })
    })?;
    checker.record("derivatives.nominals", &run, &writer.sequence, move |run| {
        let numbers = numbers(run, nominals?)?;
        let bad = numbers.iter().find(|number| !(**number > 0.0 && number.is_finite()))?;
        Some(format!("a nominal value is {bad:?}"))
    });
    Ok(())
}

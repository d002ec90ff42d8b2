//! Partial derivatives against differences, adjoint against directional ones, vectors against variables.

use crate::call_sequence::{Arg, Kind, Run};
use crate::checker::Checker;
use crate::description::Description;
use crate::finding::Judge;
use crate::values::Value;
use crate::writer::{Read, Trajectory, Writer, value_of};
use fmi_abi::{BaseType, Interface};
use std::sync::Arc;

/// Finds a continuous scalar unknown and a continuous scalar known on which the unknown may depend.
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

/// The unknowns: outputs, and in Model Exchange state derivatives.
fn unknowns(description: &Description, interface: Interface) -> Vec<usize> {
    let derivatives: &[_] =
        if interface == Interface::ModelExchange { &description.derivatives } else { &[] };
    let listed = description.outputs.iter().chain(derivatives).map(|unknown| unknown.variable);
    let mut found: Vec<usize> = listed.filter(|index| continuous(description, *index)).collect();
    found.dedup();
    found.truncate(200);
    found
}

/// The knowns: inputs, and in Model Exchange states.
fn knowns(description: &Description, interface: Interface) -> Vec<usize> {
    let inputs =
        (0..description.variables.len()).filter(|index| description.variables[*index].causality == "input");
    let states = if interface == Interface::ModelExchange { description.states() } else { Vec::new() };
    inputs.chain(states).filter(|index| continuous(description, *index)).collect()
}

fn derivative(
    writer: &mut Writer,
    function: &str,
    unknowns: &[u32],
    knowns: &[u32],
    seed: &[f64],
    results: usize,
) -> u32 {
    let array = |references: &[u32]| Arg::In(Kind::U32, references.iter().map(|of| u64::from(*of)).collect());
    let mut args = vec![
        array(unknowns),
        Arg::Whole(unknowns.len() as i64),
        array(knowns),
        Arg::Whole(knowns.len() as i64),
        Arg::In(Kind::F64, seed.iter().map(|number| number.to_bits()).collect()),
    ];
    if writer.fmi3() {
        args.push(Arg::Whole(seed.len() as i64));
    }
    args.push(Arg::Out(Kind::F64, results));
    if writer.fmi3() {
        args.push(Arg::Whole(results as i64));
    }
    writer.call(0, function, args)
}

/// The point of the trajectory at which partial derivatives are requested: near its middle and outside of events.
fn amid(writer: &mut Writer, trajectory: &Trajectory) -> Vec<f64> {
    let to = trajectory.points.len() / 2;
    writer.begin(0, trajectory);
    let mut states = Vec::new();
    for point in &trajectory.points[..to] {
        writer.point(0, trajectory, point);
        if !point.states.is_empty() {
            states.clone_from(&point.states);
        }
    }
    states
}

/// Checks directional derivatives against differences, adjoint derivatives against directional ones, and the derivative for
/// a sum of seeds against the sum of derivatives.
pub fn directional(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in &checker.trajectories {
        let interface = trajectory.interface;
        let has_directional =
            checker.can(interface, &["providesDirectionalDerivative", "providesDirectionalDerivatives"]);
        let has_adjoint = checker.can(interface, &["providesAdjointDerivatives"]);
        let unknowns = unknowns(&checker.description, interface);
        let mut knowns = knowns(&checker.description, interface);
        knowns.truncate(checker.most(40));
        if !has_directional && !has_adjoint || unknowns.is_empty() || knowns.is_empty() {
            continue;
        }
        let mut writer = checker.writer();
        amid(&mut writer, trajectory);
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
        let model = checker.description.clone();
        let is_unchanged: Judge = Arc::new(move |run| {
            let (name, before, after) = crate::writer::difference(&model, run, &before, &after)?;
            Some(format!("{name} was {before}, after derivatives were asked for it is {after}"))
        });
        let run = checker.judge("derivatives.changed", sequence.clone(), is_unchanged)?;
        if run.end != crate::call_sequence::End::Done {
            continue;
        }
        let [unknown_names, known_names] =
            [&unknowns, &knowns].map(|indices| names(&checker.description, indices));
        if let Some(sum) = sum {
            let judge = is_linear(columns.clone(), sum, unknown_names.clone());
            checker.keep("derivatives.linear", &run, &sequence, judge);
        }
        if has_directional && has_adjoint {
            for (name, tolerance) in [("derivatives.adjoint", 1e-6), ("derivatives.adjoint-digits", 1e-11)] {
                let names = [unknown_names.clone(), known_names.clone()];
                let judge = is_transposed(columns.clone(), rows.clone(), names, tolerance);
                if checker.keep(name, &run, &sequence, judge) {
                    break;
                }
            }
        }
        if has_directional {
            order(checker, trajectory, &outputs, &inputs)?;
        }
        differences(checker, trajectory, &unknowns, &knowns, has_directional)?;
    }
    Ok(())
}

/// Value references of variables.
fn references(description: &Description, indices: &[usize]) -> Vec<u32> {
    indices.iter().map(|index| description.variables[*index].reference).collect()
}

/// Names of variables.
fn names(description: &Description, indices: &[usize]) -> Vec<String> {
    indices.iter().map(|index| description.variables[*index].name.clone()).collect()
}

/// The numbers that a successful call wrote.
fn numbers(run: &Run, id: u32) -> Option<Vec<f64>> {
    run.written(id).filter(|_| run.status(id) == Some(0)).map(|of| of.numbers())
}

/// Judges whether the derivatives for unit seeds add up to the derivative for a seed of ones.
fn is_linear(columns: Vec<u32>, sum: u32, names: Vec<String>) -> Judge {
    Arc::new(move |run| {
        let columns: Vec<Vec<f64>> = columns.iter().map(|id| numbers(run, *id)).collect::<Option<_>>()?;
        let together = numbers(run, sum)?;
        (0..names.len()).find_map(|row| {
            let added: f64 = columns.iter().map(|column| column[row]).sum();
            let scale: f64 = columns.iter().map(|column| column[row].abs()).sum();
            let off = (added - together[row]).abs() > 1e-6 * scale.max(1e-12);
            off.then(|| {
                format!(
                    "the derivatives of {} add up to {added:?}, asked for together they are {:?}",
                    names[row], together[row]
                )
            })
        })
    })
}

/// Judges whether the adjoint derivatives are the transposed directional derivatives.
fn is_transposed(columns: Vec<u32>, rows: Vec<u32>, names: [Vec<String>; 2], tolerance: f64) -> Judge {
    Arc::new(move |run| {
        let matrix = |ids: &[u32]| ids.iter().map(|id| numbers(run, *id)).collect::<Option<Vec<_>>>();
        let (columns, rows) = (matrix(&columns)?, matrix(&rows)?);
        let [unknowns, knowns] = &names;
        for (row, name) in unknowns.iter().enumerate() {
            for (column, known) in knowns.iter().enumerate() {
                let (one, other) = (columns[column][row], rows[row][column]);
                if (one - other).abs() > tolerance * one.abs().max(other.abs()).max(1e-300) {
                    return Some(format!("of {name} by {known}: directional {one:?}, adjoint {other:?}"));
                }
            }
        }
        None
    })
}

/// Requests the derivatives again with unknowns and knowns in another order.
fn order(checker: &Checker, trajectory: &Trajectory, unknowns: &[u32], knowns: &[u32]) -> anyhow::Result<()> {
    let reversed = |list: &[u32]| list.iter().rev().copied().collect::<Vec<_>>();
    let seed: Vec<f64> = (1..=knowns.len()).map(|number| number as f64).collect();
    let back: Vec<f64> = seed.iter().rev().copied().collect();
    let mut writer = checker.writer();
    amid(&mut writer, trajectory);
    let name = "GetDirectionalDerivative";
    let one = derivative(&mut writer, name, unknowns, knowns, &seed, unknowns.len());
    let other = derivative(&mut writer, name, &reversed(unknowns), &reversed(knowns), &back, unknowns.len());
    let judge: Judge = Arc::new(move |run| {
        let numbers = |id: u32| run.written(id).filter(|_| run.status(id) == Some(0)).map(|of| of.numbers());
        let (one, other) = (numbers(one)?, numbers(other)?);
        let scale = one.iter().fold(0.0_f64, |most, number| most.max(number.abs()));
        let off = |(one, other): (&f64, &f64)| (one - other).abs() > 1e-6 * scale;
        let at = one.iter().zip(other.iter().rev()).position(off)?;
        let (is, reversed) = (one[at], other[other.len() - 1 - at]);
        Some(format!(
            "derivative {} is {is:?}, and {reversed:?} when variables are named in reverse order",
            at + 1
        ))
    });
    checker.judge("derivatives.order", writer.sequence, judge)?;
    Ok(())
}

/// Sets one known and reads what depends on it.
fn moved(writer: &mut Writer, states: &[f64], trajectory: &Trajectory, known: usize, value: f64) {
    let description = writer.description;
    match description.states().iter().position(|index| *index == known) {
        Some(at) if trajectory.interface == Interface::ModelExchange => {
            let mut states = states.to_vec();
            states[at] = value;
            writer.set_states(0, &states);
        }
        _ => {
            writer.set(0, &[(known, Value::Numbers(vec![value]))]);
        }
    }
}

/// Checks each derivative against differences with two step sizes, whose disagreement estimates their error.
fn differences(
    checker: &Checker,
    trajectory: &Trajectory,
    unknowns: &[usize],
    knowns: &[usize],
    by_column: bool,
) -> anyhow::Result<()> {
    let description = &checker.description;
    let count = description.states_count().unwrap_or(0);
    if trajectory.interface == Interface::ModelExchange && description.states().len() != count {
        return Ok(());
    }
    // The current values are the base of the differences.
    let mut writer = checker.writer();
    amid(&mut writer, trajectory);
    let read = writer.read_these(0, knowns);
    let of_states = (trajectory.interface == Interface::ModelExchange && count > 0)
        .then(|| writer.vector(0, "GetContinuousStates", count));
    let run = checker.play(&writer.sequence)?;
    let states = of_states.and_then(|id| run.written(id)).map(|of| of.numbers()).unwrap_or_default();
    for known in knowns {
        let variable = &description.variables[*known];
        let value = value_of(&run, &read, *known).and_then(|value| value.numbers().first().copied());
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
        let mut writer = checker.writer();
        amid(&mut writer, trajectory);
        let analytic = column(&mut writer, &references(description, unknowns), variable.reference, by_column);
        let mut reads: Vec<Vec<Read>> = Vec::new();
        for by in [step, -step, step / 2.0, -step / 2.0, 0.0] {
            moved(&mut writer, &states, trajectory, *known, value + by);
            reads.push(writer.read_these(0, unknowns));
        }
        let differences = Arc::new(Differences {
            // The standard does not define the derivative of a state with respect to itself.
            unknowns: unknowns.to_vec(),
            itself: description.aliases(*known).collect(),
            names: names(description, unknowns),
            known: variable.name.clone(),
            is_stepped: trajectory.interface == Interface::CoSimulation,
            step,
            analytic,
            reads,
        });
        let precise = Arc::clone(&differences);
        let sequence = writer.sequence.clone();
        let judge: Judge = Arc::new(move |run| differences.judge(run, 1e-4));
        let run = checker.judge("derivatives.directional", sequence.clone(), judge)?;
        if !checker.has("derivatives.directional") {
            let judge: Judge = Arc::new(move |run| precise.judge(run, 2e-7));
            checker.keep("derivatives.precision", &run, &sequence, judge);
        }
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

/// The derivatives with respect to one known, and the reads for their differences.
struct Differences {
    unknowns: Vec<usize>,
    names: Vec<String>,
    known: String,
    /// The variables that are the known.
    itself: Vec<usize>,
    is_stepped: bool,
    step: f64,
    /// The call that wrote the derivative of each unknown, and its index there.
    analytic: Vec<(u32, usize)>,
    /// The unknowns with the known at +step, -step, +step/2, -step/2 and 0.
    reads: Vec<Vec<Read>>,
}

impl Differences {
    fn judge(&self, run: &Run, tolerance: f64) -> Option<String> {
        for (row, unknown) in self.unknowns.iter().enumerate() {
            if self.itself.contains(unknown) {
                continue;
            }
            let number = |reads: &Vec<Read>| {
                let value = value_of(run, reads, *unknown)?.numbers().first().copied();
                value.filter(|number| number.is_finite())
            };
            let values: Vec<f64> = self.reads.iter().map(number).collect::<Option<_>>()?;
            let (id, index) = self.analytic[row];
            let answer = numbers(run, id)?.get(index).copied()?;
            let (step, here) = (self.step, values[4]);
            let (wide, narrow) = ((values[0] - values[1]) / (2.0 * step), (values[2] - values[3]) / step);
            // One-sided differences show a kink, where there is no derivative to compare with.
            let (left, right) = ((here - values[3]) / (step / 2.0), (values[2] - here) / (step / 2.0));
            let rounding = 1e-13 * here.abs().max(values[0].abs()) / step;
            let doubt = (wide - narrow).abs() * 10.0 + rounding * 100.0;
            let scale = narrow.abs().max(answer.abs());
            let kink = (left - right).abs() > 0.05 * scale + rounding * 100.0;
            // An output that changes only in the next step has no difference here.
            let silent = self.is_stepped && narrow == 0.0 && wide == 0.0;
            if kink && doubt > 1e-9 || silent {
                continue;
            }
            let enough = tolerance * (scale + 1e-5);
            if !answer.is_finite() || (answer - narrow).abs() > enough + doubt {
                return Some(format!(
                    "of {} by {}: {answer:?}, differences give {narrow:?}",
                    self.names[row], self.known
                ));
            }
        }
        None
    }
}

/// The vectors of states and derivatives are the values of their variables, in the order of the model structure.
pub fn vectors(checker: &Checker) -> anyhow::Result<()> {
    let Some(trajectory) =
        checker.trajectories.iter().find(|trajectory| trajectory.interface == Interface::ModelExchange)
    else {
        return Ok(());
    };
    let description = &checker.description;
    let count = description.states_count().unwrap_or(0);
    if count == 0 || description.states().len() != description.derivatives.len() {
        return Ok(());
    }
    let mut writer = checker.writer();
    writer.begin(0, trajectory);
    let derivatives: Vec<usize> = description.derivatives.iter().map(|unknown| unknown.variable).collect();
    let states = description.states();
    let mut asked = Vec::new();
    let mut nominals = None;
    for point in &trajectory.points {
        writer.point(0, trajectory, point);
        nominals = Some(writer.vector(0, "GetNominalsOfContinuousStates", count));
        asked.push([
            (writer.vector(0, "GetContinuousStates", count), writer.read_these(0, &states), states.clone()),
            (writer.derivatives(0, count), writer.read_these(0, &derivatives), derivatives.clone()),
        ]);
    }
    let model = description.clone();
    let judge: Judge = Arc::new(move |run| {
        for (vector, reads, indices) in asked.iter().flatten() {
            if run.status(*vector).is_none_or(|status| status > 1) {
                continue;
            }
            let numbers = run.written(*vector)?.numbers();
            let of_variables: Vec<f64> = indices
                .iter()
                .filter_map(|index| value_of(run, reads, *index))
                .flat_map(|value| value.numbers())
                .collect();
            if of_variables.len() != numbers.len() {
                return None;
            }
            if let Some(at) = numbers
                .iter()
                .zip(&of_variables)
                .position(|(one, other)| one.to_bits() != other.to_bits() && one != other)
            {
                let name = model.variables[indices[at.min(indices.len() - 1)]].name.clone();
                return Some(format!(
                    "number {} of the vector is {:?}, {name} is {:?}",
                    at + 1,
                    numbers[at],
                    of_variables[at]
                ));
            }
        }
        None
    });
    let run = checker.judge("derivatives.vectors", writer.sequence.clone(), judge)?;
    let judge: Judge = Arc::new(move |run| {
        let numbers =
            run.written(nominals?).filter(|_| run.status(nominals.unwrap_or(0)) == Some(0))?.numbers();
        let bad = numbers.iter().find(|number| !(**number > 0.0 && number.is_finite()))?;
        Some(format!("a nominal value is {bad:?}"))
    });
    checker.keep("derivatives.nominals", &run, &writer.sequence, judge);
    Ok(())
}

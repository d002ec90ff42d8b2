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
        let depends = |known: &&usize| {
            unknown.dependencies.as_ref().is_none_or(|list| list.iter().any(|(index, _)| index == *known))
        };
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

/// Each column against differences, the transposed against the adjoint, a sum of seeds against the sum.
pub fn directional(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in &checker.trajectories {
        let interface = trajectory.interface;
        let has_directional =
            checker.can(interface, &["providesDirectionalDerivative", "providesDirectionalDerivatives"]);
        let has_adjoint = checker.can(interface, &["providesAdjointDerivatives"]);
        if !has_directional && !has_adjoint {
            continue;
        }
        let description = &checker.description;
        let unknowns = unknowns(description, interface);
        let mut knowns = knowns(description, interface);
        knowns.truncate(checker.most(40));
        if unknowns.is_empty() || knowns.is_empty() {
            continue;
        }
        let reference = |indices: &[usize]| -> Vec<u32> {
            indices.iter().map(|index| description.variables[*index].reference).collect()
        };
        let (of_unknowns, of_knowns) = (reference(&unknowns), reference(&knowns));
        let mut writer = checker.writer();
        amid(&mut writer, trajectory);
        let first = writer.read(0);
        let unit = |index: usize, count: usize| -> Vec<f64> {
            (0..count).map(|at| f64::from(u8::from(at == index))).collect()
        };
        let columns: Vec<u32> = if has_directional {
            (0..knowns.len())
                .map(|index| {
                    derivative(
                        &mut writer,
                        "GetDirectionalDerivative",
                        &of_unknowns,
                        &of_knowns,
                        &unit(index, knowns.len()),
                        unknowns.len(),
                    )
                })
                .collect()
        } else {
            Vec::new()
        };
        let sum = has_directional.then(|| {
            derivative(
                &mut writer,
                "GetDirectionalDerivative",
                &of_unknowns,
                &of_knowns,
                &vec![1.0; knowns.len()],
                unknowns.len(),
            )
        });
        let rows: Vec<u32> = if has_adjoint {
            (0..unknowns.len())
                .map(|index| {
                    derivative(
                        &mut writer,
                        "GetAdjointDerivative",
                        &of_unknowns,
                        &of_knowns,
                        &unit(index, unknowns.len()),
                        knowns.len(),
                    )
                })
                .collect()
        } else {
            Vec::new()
        };
        let last = writer.read(0);
        let names: Vec<String> =
            unknowns.iter().map(|index| description.variables[*index].name.clone()).collect();
        let knows: Vec<String> =
            knowns.iter().map(|index| description.variables[*index].name.clone()).collect();
        let sequence = writer.sequence.clone();

        // Asking changes nothing.
        let model = description.clone();
        let judge: Judge = Arc::new(move |run| {
            let (name, before, after) = crate::writer::difference(&model, run, &first, &last)?;
            Some(format!("{name} was {before}, after derivatives were asked for it is {after}"))
        });
        let run = checker.judge("derivatives.changed", sequence.clone(), judge)?;
        if run.end != crate::call_sequence::End::Done {
            continue;
        }
        if has_directional {
            let (columns, names, sum) = (columns.clone(), names.clone(), sum.unwrap_or_default());
            let judge: Judge = Arc::new(move |run| {
                let columns: Option<Vec<Vec<f64>>> = columns
                    .iter()
                    .map(|id| {
                        (run.status(*id) == Some(0)).then(|| run.written(*id).map(|of| of.numbers()))?
                    })
                    .collect();
                let columns = columns?;
                let together = run.written(sum).filter(|_| run.status(sum) == Some(0))?.numbers();
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
            });
            checker.keep("derivatives.linear", &run, &sequence, judge);
        }
        if has_directional && has_adjoint {
            for (name, tolerance) in [("derivatives.adjoint", 1e-6), ("derivatives.adjoint-digits", 1e-11)] {
                let (columns, rows, names, knows) =
                    (columns.clone(), rows.clone(), names.clone(), knows.clone());
                let judge: Judge = Arc::new(move |run| {
                    let matrix = |ids: &[u32]| -> Option<Vec<Vec<f64>>> {
                        ids.iter()
                            .map(|id| {
                                (run.status(*id) == Some(0))
                                    .then(|| run.written(*id).map(|of| of.numbers()))?
                            })
                            .collect()
                    };
                    let (columns, rows) = (matrix(&columns)?, matrix(&rows)?);
                    for (row, name) in names.iter().enumerate() {
                        for (column, known) in knows.iter().enumerate() {
                            let (one, other) = (columns[column][row], rows[row][column]);
                            if (one - other).abs() > tolerance * one.abs().max(other.abs()).max(1e-300) {
                                return Some(format!(
                                    "of {name} by {known}: directional {one:?}, adjoint {other:?}"
                                ));
                            }
                        }
                    }
                    None
                });
                if checker.keep(name, &run, &sequence, judge) {
                    break;
                }
            }
        }
        if has_directional {
            order(checker, trajectory, &of_unknowns, &of_knowns)?;
        }
        let by_column = has_directional;
        differences(checker, trajectory, &unknowns, &knowns, by_column)?;
    }
    Ok(())
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

/// Each derivative against differences with two distances, whose own error shows in what they differ by.
fn differences(
    checker: &Checker,
    trajectory: &Trajectory,
    unknowns: &[usize],
    knowns: &[usize],
    by_column: bool,
) -> anyhow::Result<()> {
    let description = &checker.description;
    if trajectory.interface == Interface::ModelExchange
        && description.states().len() != description.states_count().unwrap_or(0)
    {
        return Ok(());
    }
    let reference = |indices: &[usize]| -> Vec<u32> {
        indices.iter().map(|index| description.variables[*index].reference).collect()
    };
    let of_unknowns = reference(unknowns);
    // The current values are the base of the differences.
    let mut writer = checker.writer();
    amid(&mut writer, trajectory);
    let read = writer.read_these(0, knowns);
    let count = description.states_count().unwrap_or(0);
    let of_states = (trajectory.interface == Interface::ModelExchange && count > 0)
        .then(|| writer.vector(0, "GetContinuousStates", count));
    let run = checker.play(&writer.sequence)?;
    let states = of_states.and_then(|id| run.written(id)).map(|of| of.numbers()).unwrap_or_default();
    for known in knowns {
        let variable = &description.variables[*known];
        let Some(value) = value_of(&run, &read, *known).and_then(|value| value.numbers().first().copied())
        else {
            continue;
        };
        if !value.is_finite() || variable.once_per_instant {
            continue;
        }
        let step = 1e-4 * variable.nominal.max(value.abs()).max(1e-3);
        let inside = |number: f64| {
            variable.min.is_none_or(|min| number >= min) && variable.max.is_none_or(|max| number <= max)
        };
        if !inside(value - step) || !inside(value + step) {
            continue;
        }
        let mut writer = checker.writer();
        amid(&mut writer, trajectory);
        let of_known = [variable.reference];
        let analytic: Vec<u32> = if by_column {
            vec![derivative(
                &mut writer,
                "GetDirectionalDerivative",
                &of_unknowns,
                &of_known,
                &[1.0],
                unknowns.len(),
            )]
        } else {
            (0..unknowns.len())
                .map(|row| {
                    derivative(
                        &mut writer,
                        "GetAdjointDerivative",
                        &of_unknowns[row..=row],
                        &of_known,
                        &[1.0],
                        1,
                    )
                })
                .collect()
        };
        let mut reads: Vec<Vec<Read>> = Vec::new();
        for by in [step, -step, step / 2.0, -step / 2.0] {
            moved(&mut writer, &states, trajectory, *known, value + by);
            reads.push(writer.read_these(0, unknowns));
        }
        moved(&mut writer, &states, trajectory, *known, value);
        let back = writer.read_these(0, unknowns);
        let same: Vec<usize> = description.aliases(*known).collect();
        let stepped = trajectory.interface == Interface::CoSimulation;
        let (unknowns, model, known_name) = (unknowns.to_vec(), description.clone(), variable.name.clone());
        let compare = Arc::new(move |run: &Run, tolerance: f64| {
            for (row, unknown) in unknowns.iter().enumerate() {
                // The standard does not define the derivative of a state with respect to itself.
                if same.contains(unknown) {
                    continue;
                }
                let number = |reads: &[Read]| {
                    value_of(run, reads, *unknown)?
                        .numbers()
                        .first()
                        .copied()
                        .filter(|number| number.is_finite())
                };
                let values: Option<Vec<f64>> = reads.iter().map(|reads| number(reads)).collect();
                let values = values?;
                let here = number(&back)?;
                let answer = if analytic.len() == 1 && unknowns.len() != 1 || by_column {
                    run.written(analytic[0])
                        .filter(|_| run.status(analytic[0]) == Some(0))?
                        .numbers()
                        .get(row)
                        .copied()?
                } else {
                    run.written(analytic[row])
                        .filter(|_| run.status(analytic[row]) == Some(0))?
                        .numbers()
                        .first()
                        .copied()?
                };
                let (wide, narrow) = ((values[0] - values[1]) / (2.0 * step), (values[2] - values[3]) / step);
                // One-sided differences show a kink, where there is no derivative to compare with.
                let (left, right) = ((here - values[3]) / (step / 2.0), (values[2] - here) / (step / 2.0));
                let rounding = 1e-13 * here.abs().max(values[0].abs()) / step;
                let doubt = (wide - narrow).abs() * 10.0 + rounding * 100.0;
                let kink = (left - right).abs() > 0.05 * narrow.abs().max(answer.abs()) + rounding * 100.0;
                if kink && doubt > 1e-9 {
                    continue;
                }
                let scale = narrow.abs().max(answer.abs());
                // An output that changes only in the next step has no difference here.
                let silent = narrow == 0.0 && wide == 0.0;
                if silent && stepped {
                    continue;
                }
                let enough = tolerance * (scale + 1e-5);
                if !answer.is_finite() || (answer - narrow).abs() > enough + doubt {
                    return Some(format!(
                        "of {} by {known_name}: {answer:?}, differences give {narrow:?}",
                        model.variables[*unknown].name
                    ));
                }
            }
            None
        });
        let precise = Arc::clone(&compare);
        let sequence = writer.sequence.clone();
        let run = checker.judge(
            "derivatives.directional",
            sequence.clone(),
            Arc::new(move |run| compare(run, 1e-4)),
        )?;
        let judge: Judge = Arc::new(move |run| precise(run, 2e-7));
        if !checker.has("derivatives.directional") {
            checker.keep("derivatives.precision", &run, &sequence, judge);
        }
    }
    Ok(())
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

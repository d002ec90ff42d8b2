//! Partial derivatives against differences, adjoint against directional ones, vectors against variables.

use crate::checker::Checker;
use crate::description::Description;
use crate::finding::Judge;
use crate::script::{Arg, Kind, Run};
use crate::values::Value;
use crate::writer::{Course, Read, Writer, value_of};
use fmi_abi::{BaseType, Interface};
use std::sync::Arc;

/// A scalar unknown and a known that are continuous, of which the unknown may depend on the known.
pub fn pair(description: &Description, interface: Interface) -> Option<(usize, usize)> {
    let unknowns = unknowns(description, interface);
    let knowns = knowns(description, interface);
    let mut listed = description.outputs.iter().chain(&description.derivatives);
    listed.find_map(|unknown| {
        let depends = |known: &&usize| {
            unknown.dependencies.as_ref().is_none_or(|list| list.iter().any(|(place, _)| place == *known))
        };
        let known = knowns.iter().find(depends).filter(|_| unknowns.contains(&unknown.variable))?;
        Some((unknown.variable, *known))
    })
}

fn continuous(description: &Description, place: usize) -> bool {
    let variable = &description.variables[place];
    variable.base == Some(BaseType::Real)
        && variable.variability == "continuous"
        && variable.size == Some(1)
        && !variable.clocked
}

/// What can be asked for: outputs, and in Model Exchange derivatives.
fn unknowns(description: &Description, interface: Interface) -> Vec<usize> {
    let derivatives: &[_] =
        if interface == Interface::ModelExchange { &description.derivatives } else { &[] };
    let listed = description.outputs.iter().chain(derivatives).map(|unknown| unknown.variable);
    let mut found: Vec<usize> = listed.filter(|place| continuous(description, *place)).collect();
    found.dedup();
    found.truncate(200);
    found
}

/// With respect to what: inputs, and in Model Exchange states.
fn knowns(description: &Description, interface: Interface) -> Vec<usize> {
    let inputs =
        (0..description.variables.len()).filter(|place| description.variables[*place].causality == "input");
    let states = if interface == Interface::ModelExchange { description.states() } else { Vec::new() };
    inputs.chain(states).filter(|place| continuous(description, *place)).collect()
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

/// Where partial derivatives are asked for: amid the course, where it is not in an event.
fn amid(writer: &mut Writer, course: &Course) -> Vec<f64> {
    let to = course.points.len() / 2;
    writer.begin(0, course);
    let mut states = Vec::new();
    for point in &course.points[..to] {
        writer.point(0, course, point);
        if !point.states.is_empty() {
            states.clone_from(&point.states);
        }
    }
    states
}

/// Each column against differences, the transposed against the adjoint, a sum of seeds against the sum.
pub fn directional(checker: &Checker) -> anyhow::Result<()> {
    for course in &checker.courses {
        let interface = course.interface;
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
        let reference = |places: &[usize]| -> Vec<u32> {
            places.iter().map(|place| description.variables[*place].reference).collect()
        };
        let (of_unknowns, of_knowns) = (reference(&unknowns), reference(&knowns));
        let mut writer = checker.writer();
        amid(&mut writer, course);
        let first = writer.read(0);
        let unit = |place: usize, count: usize| -> Vec<f64> {
            (0..count).map(|at| f64::from(u8::from(at == place))).collect()
        };
        let columns: Vec<u32> = if has_directional {
            (0..knowns.len())
                .map(|place| {
                    derivative(
                        &mut writer,
                        "GetDirectionalDerivative",
                        &of_unknowns,
                        &of_knowns,
                        &unit(place, knowns.len()),
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
                .map(|place| {
                    derivative(
                        &mut writer,
                        "GetAdjointDerivative",
                        &of_unknowns,
                        &of_knowns,
                        &unit(place, unknowns.len()),
                        knowns.len(),
                    )
                })
                .collect()
        } else {
            Vec::new()
        };
        let last = writer.read(0);
        let names: Vec<String> =
            unknowns.iter().map(|place| description.variables[*place].name.clone()).collect();
        let knows: Vec<String> =
            knowns.iter().map(|place| description.variables[*place].name.clone()).collect();
        let script = writer.script.clone();

        // Asking changes nothing.
        let model = description.clone();
        let judge: Judge = Arc::new(move |run| {
            let (name, before, after) = crate::writer::difference(&model, run, &first, &last)?;
            Some(format!("{name} was {before}, after derivatives were asked for it is {after}"))
        });
        let run = checker.judge("derivatives.changed", script.clone(), judge)?;
        if run.end != crate::script::End::Done {
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
            checker.keep("derivatives.linear", &run, &script, judge);
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
                if checker.keep(name, &run, &script, judge) {
                    break;
                }
            }
        }
        if has_directional {
            order(checker, course, &of_unknowns, &of_knowns)?;
        }
        let by_column = has_directional;
        differences(checker, course, &unknowns, &knowns, by_column)?;
    }
    Ok(())
}

/// The same derivatives in another order of unknowns and knowns.
fn order(checker: &Checker, course: &Course, unknowns: &[u32], knowns: &[u32]) -> anyhow::Result<()> {
    let reversed = |list: &[u32]| list.iter().rev().copied().collect::<Vec<_>>();
    let seed: Vec<f64> = (1..=knowns.len()).map(|number| number as f64).collect();
    let back: Vec<f64> = seed.iter().rev().copied().collect();
    let mut writer = checker.writer();
    amid(&mut writer, course);
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
    checker.judge("derivatives.order", writer.script, judge)?;
    Ok(())
}

/// Sets one known and reads what depends on it.
fn moved(writer: &mut Writer, states: &[f64], course: &Course, known: usize, value: f64) {
    let description = writer.description;
    match description.states().iter().position(|place| *place == known) {
        Some(at) if course.interface == Interface::ModelExchange => {
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
    course: &Course,
    unknowns: &[usize],
    knowns: &[usize],
    by_column: bool,
) -> anyhow::Result<()> {
    let description = &checker.description;
    if course.interface == Interface::ModelExchange
        && description.states().len() != description.states_count().unwrap_or(0)
    {
        return Ok(());
    }
    let reference = |places: &[usize]| -> Vec<u32> {
        places.iter().map(|place| description.variables[*place].reference).collect()
    };
    let of_unknowns = reference(unknowns);
    // Where the values are now is needed to move them.
    let mut writer = checker.writer();
    amid(&mut writer, course);
    let read = writer.read_these(0, knowns);
    let count = description.states_count().unwrap_or(0);
    let of_states = (course.interface == Interface::ModelExchange && count > 0)
        .then(|| writer.vector(0, "GetContinuousStates", count));
    let run = checker.play(&writer.script)?;
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
        amid(&mut writer, course);
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
            moved(&mut writer, &states, course, *known, value + by);
            reads.push(writer.read_these(0, unknowns));
        }
        moved(&mut writer, &states, course, *known, value);
        let back = writer.read_these(0, unknowns);
        let same: Vec<usize> = description.aliases(*known).collect();
        let stepped = course.interface == Interface::CoSimulation;
        let (unknowns, model, known_name) = (unknowns.to_vec(), description.clone(), variable.name.clone());
        let compare = Arc::new(move |run: &Run, tolerance: f64| {
            for (row, unknown) in unknowns.iter().enumerate() {
                // Of a state by itself: the standard does not say.
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
                // What the FMU does not show until its next step has no differences here.
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
        let script = writer.script.clone();
        let run = checker.judge(
            "derivatives.directional",
            script.clone(),
            Arc::new(move |run| compare(run, 1e-4)),
        )?;
        let judge: Judge = Arc::new(move |run| precise(run, 2e-7));
        if !checker.has("derivatives.directional") {
            checker.keep("derivatives.precision", &run, &script, judge);
        }
    }
    Ok(())
}

/// The vectors of states and derivatives are the values of their variables, in the order of the model structure.
pub fn vectors(checker: &Checker) -> anyhow::Result<()> {
    let Some(course) = checker.courses.iter().find(|course| course.interface == Interface::ModelExchange)
    else {
        return Ok(());
    };
    let description = &checker.description;
    let count = description.states_count().unwrap_or(0);
    if count == 0 || description.states().len() != description.derivatives.len() {
        return Ok(());
    }
    let mut writer = checker.writer();
    writer.begin(0, course);
    let derivatives: Vec<usize> = description.derivatives.iter().map(|unknown| unknown.variable).collect();
    let states = description.states();
    let mut asked = Vec::new();
    let mut nominals = None;
    for point in &course.points {
        writer.point(0, course, point);
        nominals = Some(writer.vector(0, "GetNominalsOfContinuousStates", count));
        asked.push([
            (writer.vector(0, "GetContinuousStates", count), writer.read_these(0, &states), states.clone()),
            (writer.derivatives(0, count), writer.read_these(0, &derivatives), derivatives.clone()),
        ]);
    }
    let model = description.clone();
    let judge: Judge = Arc::new(move |run| {
        for (vector, reads, places) in asked.iter().flatten() {
            if run.status(*vector).is_none_or(|status| status > 1) {
                continue;
            }
            let numbers = run.written(*vector)?.numbers();
            let of_variables: Vec<f64> = places
                .iter()
                .filter_map(|place| value_of(run, reads, *place))
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
                let name = model.variables[places[at.min(places.len() - 1)]].name.clone();
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
    let run = checker.judge("derivatives.vectors", writer.script.clone(), judge)?;
    let judge: Judge = Arc::new(move |run| {
        let numbers =
            run.written(nominals?).filter(|_| run.status(nominals.unwrap_or(0)) == Some(0))?.numbers();
        let bad = numbers.iter().find(|number| !(**number > 0.0 && number.is_finite()))?;
        Some(format!("a nominal value is {bad:?}"))
    });
    checker.keep("derivatives.nominals", &run, &writer.script, judge);
    Ok(())
}

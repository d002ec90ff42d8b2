//! Start values are what the description says; what is set is what is read; values are of their types and within their
//! ranges.

use crate::call_sequence::Written;
use crate::checker::Checker;
use crate::description::Variable;
use crate::finding::Judge;
use crate::values::{Value, is_read, other_values};
use crate::worker::FILL;
use crate::writer::{Trajectory, Writer, readable, sample, value_of};
use fmi_abi::{BaseType, Interface};
use std::sync::Arc;

/// The values of the variables in Initialization Mode, before anything is set.
pub fn starts(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in &checker.trajectories {
        let description = &checker.description;
        let mut writer = checker.writer();
        writer.make(0, trajectory.interface);
        writer.enter(0);
        let reads = writer.read_these(0, &sample(description, 10_000));
        let all = reads.clone();
        let model = Arc::clone(&checker.description);
        let judge: Judge = Arc::new(move |run| {
            for (index, _) in all.iter().flat_map(|read| read.of.iter().copied()) {
                let variable = &model.variables[index];
                let fixed = variable.initial == "exact" || variable.causality == "input";
                let (true, Some(base)) =
                    (fixed && !variable.start.is_empty() && !variable.clocked, variable.base)
                else {
                    continue;
                };
                // A parameter may be the start of a state that has the same reference: a start value for each is not known.
                let Some(value) = value_of(run, &all, index) else { continue };
                let wrong = match &value {
                    Written::Texts(texts) if base == BaseType::String => texts
                        .iter()
                        .zip(&variable.start)
                        .any(|(text, start)| text.as_deref() != Some(start.as_bytes())),
                    Written::Texts(_) => false,
                    Written::Numbers(kind, bits) => {
                        let starts = variable.starts();
                        starts.len() == bits.len()
                            && bits.iter().zip(&starts).any(|(bits, start)| {
                                let (is, must) = (kind.number(*bits), kind.number(kind.bits(*start)));
                                // The text may have fewer digits than the number.
                                (is - must).abs() > 1e-9 * must.abs() || is.is_nan() != must.is_nan()
                            })
                    }
                };
                if wrong {
                    return Some(format!(
                        "{} starts with {}, the description says {}",
                        variable.name,
                        value.show(0),
                        variable.start.join(" ")
                    ));
                }
            }
            None
        });
        checker.judge("start_values.start", writer.sequence.clone(), judge)?;
        values(checker, trajectory)?;
        constants(checker, trajectory)?;
    }
    Ok(())
}

/// Tests a value of a variable; returns a description of the error.
type ValueTest = fn(&Variable, &Written) -> Option<String>;

/// The rules for each value that is read.
const VALUE_TESTS: [(&str, ValueTest); 5] = [
    ("start_values.unwritten", |_, value| {
        let Written::Numbers(kind, bits) = value else { return None };
        let untouched = u64::from_ne_bytes([FILL; 8]) >> (64 - 8 * kind.size());
        (kind.size() >= 4 && bits.contains(&untouched)).then(|| "has not been written".to_owned())
    }),
    ("start_values.boolean", |variable, value| {
        let wrong = variable.base == Some(BaseType::Boolean)
            && value.numbers().iter().any(|number| ![0.0, 1.0].contains(number));
        wrong.then(|| format!("is {}", value.show(0)))
    }),
    ("start_values.range", |variable, value| {
        let whole = variable.base.is_some_and(|base| !base.is_float())
            && ["local", "output"].contains(&variable.causality.as_str());
        let (min, max) = (variable.min.unwrap_or(f64::NEG_INFINITY), variable.max.unwrap_or(f64::INFINITY));
        let wrong = whole && value.numbers().iter().any(|number| *number < min || *number > max);
        wrong.then(|| format!("is {}, outside of {min} to {max}", value.show(0)))
    }),
    ("start_values.text", |variable, value| {
        let wrong = variable.base == Some(BaseType::String)
            && matches!(value, Written::Texts(texts) if texts.contains(&None));
        wrong.then(|| "is NULL".to_owned())
    }),
    ("results.not-finite", |variable, value| {
        let wrong = variable.is_float() && value.numbers().iter().any(|number| !number.is_finite());
        wrong.then(|| format!("is {}", value.show(0)))
    }),
];

/// Each value that is read along the trajectory is written, valid for its type and within its range.
fn values(checker: &Checker, trajectory: &crate::writer::Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    writer.begin(0, trajectory);
    let mut reads = vec![writer.read(0)];
    for point in &trajectory.points {
        writer.point(0, trajectory, point);
        reads.push(writer.read(0));
    }
    let model = Arc::clone(&checker.description);
    let run = checker.play(&writer.sequence)?;
    checker.keep_always(&writer.sequence, &run);
    for (name, test) in VALUE_TESTS {
        let (model, reads) = (Arc::clone(&model), reads.clone());
        let judge: Judge = Arc::new(move |run| {
            for reads in &reads {
                for (index, _) in reads.iter().flat_map(|read| read.of.iter().copied()) {
                    let variable = &model.variables[index];
                    if variable.clocked {
                        continue;
                    }
                    if let Some(value) = value_of(run, reads, index)
                        && let Some(why) = test(variable, &value)
                    {
                        return Some(format!("{} {why}", variable.name));
                    }
                }
            }
            None
        });
        checker.keep(name, &run, &writer.sequence, judge);
    }
    Ok(())
}

/// Constants and fixed parameters do not change while time goes on.
fn constants(checker: &Checker, trajectory: &crate::writer::Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let fixed: Vec<usize> = readable(description)
        .into_iter()
        .filter(|index| {
            let variable = &description.variables[*index];
            let tunable = description.variables.iter().any(|other| {
                other.variability == "tunable" || other.causality == "input" && other.variability == "fixed"
            });
            variable.variability == "constant"
                || !tunable && variable.variability == "fixed" && variable.causality != "input"
                || variable.causality == "parameter"
        })
        .collect();
    if fixed.is_empty() || trajectory.points.is_empty() {
        return Ok(());
    }
    let mut writer = checker.writer();
    writer.begin(0, trajectory);
    let first = writer.read_these(0, &fixed);
    for point in &trajectory.points {
        writer.point(0, trajectory, point);
    }
    let last = writer.read_these(0, &fixed);
    let description = description.clone();
    let judge: Judge = Arc::new(move |run| {
        let (name, before, after) = crate::writer::difference(&description, run, &first, &last)?;
        Some(format!("{name} was {before} and has become {after}"))
    });
    checker.judge("start_values.fixed", writer.sequence, judge)?;
    Ok(())
}

/// Values that are set are read back: before and in Initialization Mode, during the simulation and after it.
pub fn set(checker: &Checker) -> anyhow::Result<()> {
    let description = &checker.description;
    for trajectory in &checker.trajectories {
        let indices: Vec<usize> = readable(description)
            .into_iter()
            .filter(|index| {
                let variable = &description.variables[*index];
                let settable = variable.causality == "input"
                    || variable.initial == "exact" && variable.variability != "constant";
                settable
                    && !variable.clocked
                    && !variable.start.is_empty()
                    && description.aliases(*index).count() == 1
            })
            .collect();
        let near: Vec<(usize, Value)> = indices
            .iter()
            .filter(|index| description.variables[**index].is_float())
            .filter_map(|index| Some((*index, other_values(description, *index)?)))
            .collect();
        when(checker, trajectory, &near)?;
        // Together what every model takes; alone what it may refuse.
        let alone = indices
            .iter()
            .filter(|index| !description.variables[**index].is_float())
            .take(checker.most(40))
            .flat_map(|index| {
                // Longer than buffers are.
                let long =
                    Value::Texts(vec![b"long ".repeat(100); description.variables[*index].start.len()]);
                let long = (description.variables[*index].base == Some(BaseType::String)).then_some(long);
                other_values(description, *index).into_iter().chain(long).map(|value| vec![(*index, value)])
            });
        for values in std::iter::once(near).filter(|near| !near.is_empty()).chain(alone) {
            for within in [true, false] {
                let mut writer = checker.writer();
                writer.make(0, trajectory.interface);
                if within {
                    writer.enter(0);
                }
                let sets = writer.set(0, &values);
                if !within {
                    writer.enter(0);
                }
                what_was_set(checker, writer, values.clone(), sets)?;
            }
        }
        // At a communication point, where event modes are not needed for it.
        for index in indices.into_iter().take(checker.most(400)) {
            let variable = &description.variables[index];
            let late = match trajectory.interface {
                Interface::CoSimulation => variable.causality == "input" || variable.variability == "tunable",
                Interface::ModelExchange => variable.causality == "input" && variable.is_float(),
            };
            let late = late && (variable.is_float() || variable.variability != "discrete");
            if let Some(value) =
                other_values(description, index).filter(|_| late && !variable.once_per_instant)
            {
                let values = vec![(index, value)];
                let mut writer = checker.writer();
                writer.begin(0, trajectory);
                for point in trajectory.points.iter().take(2) {
                    writer.point(0, trajectory, point);
                }
                let sets = writer.set(0, &values);
                what_was_set(checker, writer, values, sets)?;
            }
        }
        inputs(checker, trajectory)?;
    }
    Ok(())
}

/// Start values count, whether they are set before Initialization Mode or in it, and whatever is read in between.
fn when(checker: &Checker, trajectory: &Trajectory, values: &[(usize, Value)]) -> anyhow::Result<()> {
    if values.is_empty() {
        return Ok(());
    }
    let mut writer = checker.writer();
    let (mut sets, mut reads) = (Vec::new(), [Vec::new(), Vec::new()]);
    for (of, reads) in reads.iter_mut().enumerate() {
        writer.make(of, trajectory.interface);
        if of == 1 {
            writer.enter(of);
            writer.read(of);
        }
        sets.extend(writer.set(of, values));
        if of == 0 {
            writer.enter(of);
        }
        reads.extend(writer.read(of));
        writer.leave(of, trajectory);
        reads.extend(writer.ask(of, trajectory.interface));
        writer.free(of);
    }
    let [before, within] = reads;
    let description = checker.description.clone();
    let judge: Judge = Arc::new(move |run| {
        if sets.iter().any(|id| run.status(*id).is_none_or(|status| status > 1)) {
            return None;
        }
        let (name, one, other) = crate::writer::difference(&description, run, &before, &within)?;
        Some(format!(
            "{name} is {one} with values set before Initialization Mode, {other} with those set in it"
        ))
    });
    checker.judge("start_values.when", writer.sequence, judge)?;
    Ok(())
}

fn what_was_set(
    checker: &Checker,
    mut writer: Writer<'_>,
    values: Vec<(usize, Value)>,
    sets: Vec<u32>,
) -> anyhow::Result<()> {
    let indices: Vec<usize> = values.iter().map(|(index, _)| *index).collect();
    let reads = writer.read_these(0, &indices);
    let description = checker.description.clone();
    let judge: Judge = Arc::new(move |run| {
        if sets.iter().any(|id| run.status(*id).is_none_or(|status| status > 1)) {
            return None;
        }
        values.iter().find_map(|(index, value)| {
            let read = value_of(run, &reads, *index).filter(|read| !is_read(read, value))?;
            let name = &description.variables[*index].name;
            Some(format!("{name} was set to {} and reads {}", value.show(), read.show(0)))
        })
    });
    checker.judge("start_values.set", writer.sequence, judge)?;
    Ok(())
}

/// Inputs keep their values through steps and events.
fn inputs(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    writer.begin(0, trajectory);
    let mut asked = Vec::new();
    for point in &trajectory.points {
        let ids = writer.point(0, trajectory, point);
        let indices: Vec<usize> = point.inputs.iter().map(|(index, _)| *index).collect();
        asked.push((ids, writer.read_these(0, &indices), point.inputs.clone()));
    }
    let description = checker.description.clone();
    let judge: Judge = Arc::new(move |run| {
        asked.iter().find_map(|(ids, reads, inputs)| {
            if ids.iter().any(|id| run.status(*id).is_none_or(|status| status > 1)) {
                return None;
            }
            inputs.iter().find_map(|(index, value)| {
                let read = value_of(run, reads, *index).filter(|read| !is_read(read, value))?;
                let name = &description.variables[*index].name;
                Some(format!("{name} was set to {} and has become {}", value.show(), read.show(0)))
            })
        })
    });
    checker.judge("start_values.inputs", writer.sequence, judge)?;
    Ok(())
}

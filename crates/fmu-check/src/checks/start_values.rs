//! Start values are what the description says; what is set is what is read; values are of their types and within their
//! ranges.

use crate::checker::Checker;
use crate::finding::Judge;
use crate::script::Written;
use crate::values::{Value, is_read, other_values};
use crate::worker::FILL;
use crate::writer::{Course, Writer, readable, sample, value_of};
use fmi_abi::{BaseType, Interface};
use std::sync::Arc;

/// The values of the variables in Initialization Mode, before anything is set.
pub fn starts(checker: &Checker) -> anyhow::Result<()> {
    for course in &checker.courses {
        let description = &checker.description;
        let mut writer = checker.writer();
        writer.make(0, course.interface);
        writer.enter(0);
        let reads = writer.read_these(0, &sample(description, 10_000));
        let all = reads.clone();
        let model = Arc::clone(&checker.description);
        let judge: Judge = Arc::new(move |run| {
            for (place, _) in all.iter().flat_map(|read| read.of.iter().copied()) {
                let variable = &model.variables[place];
                let fixed = variable.initial == "exact" || variable.causality == "input";
                let (true, Some(base)) =
                    (fixed && !variable.start.is_empty() && !variable.clocked, variable.base)
                else {
                    continue;
                };
                // A parameter may be the start of a state that has the same reference: a start value for each is not known.
                let Some(value) = value_of(run, &all, place) else { continue };
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
        checker.judge("start_values.start", writer.script.clone(), judge)?;
        values(checker, course)?;
        constants(checker, course)?;
    }
    Ok(())
}

/// What is read in the whole course is written at all, of its type and within its range.
fn values(checker: &Checker, course: &crate::writer::Course) -> anyhow::Result<()> {
    let description = &checker.description;
    let mut writer = checker.writer();
    writer.begin(0, course);
    let mut reads = vec![writer.read(0)];
    for point in &course.points {
        writer.point(0, course, point);
        reads.push(writer.read(0));
    }
    let model = Arc::clone(&checker.description);
    let standard = description.standard;
    type Test = Arc<dyn Fn(&crate::description::Variable, &Written) -> Option<String> + Send + Sync>;
    let tests: [(&str, Test); 5] = [
        (
            "start_values.unwritten",
            Arc::new(|_, value| {
                let Written::Numbers(kind, bits) = value else { return None };
                let untouched = u64::from_ne_bytes([FILL; 8]) >> (64 - 8 * kind.size());
                (kind.size() >= 4 && bits.contains(&untouched)).then(|| "has not been written".to_owned())
            }),
        ),
        (
            "start_values.boolean",
            Arc::new(|variable, value| {
                let wrong = variable.base == Some(BaseType::Boolean)
                    && value.numbers().iter().any(|number| ![0.0, 1.0].contains(number));
                wrong.then(|| format!("is {}", value.show(0)))
            }),
        ),
        (
            "start_values.range",
            Arc::new(|variable, value| {
                let whole = variable.base.is_some_and(|base| !base.is_float())
                    && ["local", "output"].contains(&variable.causality.as_str());
                let (min, max) =
                    (variable.min.unwrap_or(f64::NEG_INFINITY), variable.max.unwrap_or(f64::INFINITY));
                let wrong = whole && value.numbers().iter().any(|number| *number < min || *number > max);
                wrong.then(|| format!("is {}, outside of {min} to {max}", value.show(0)))
            }),
        ),
        (
            "start_values.text",
            Arc::new(|variable, value| {
                let wrong = variable.base == Some(BaseType::String)
                    && matches!(value, Written::Texts(texts) if texts.contains(&None));
                wrong.then(|| "is NULL".to_owned())
            }),
        ),
        (
            "results.not-finite",
            Arc::new(|variable, value| {
                let wrong = variable.is_float() && value.numbers().iter().any(|number| !number.is_finite());
                wrong.then(|| format!("is {}", value.show(0)))
            }),
        ),
    ];
    let _ = standard;
    let run = checker.play(&writer.script)?;
    checker.keep_always(&writer.script, &run);
    for (name, test) in tests {
        let (model, reads) = (Arc::clone(&model), reads.clone());
        let judge: Judge = Arc::new(move |run| {
            for reads in &reads {
                for (place, _) in reads.iter().flat_map(|read| read.of.iter().copied()) {
                    let variable = &model.variables[place];
                    if variable.clocked {
                        continue;
                    }
                    if let Some(value) = value_of(run, reads, place)
                        && let Some(why) = test(variable, &value)
                    {
                        return Some(format!("{} {why}", variable.name));
                    }
                }
            }
            None
        });
        checker.keep(name, &run, &writer.script, judge);
    }
    Ok(())
}

/// Constants and fixed parameters do not change while time goes on.
fn constants(checker: &Checker, course: &crate::writer::Course) -> anyhow::Result<()> {
    let description = &checker.description;
    let fixed: Vec<usize> = readable(description)
        .into_iter()
        .filter(|place| {
            let variable = &description.variables[*place];
            let tunable = description.variables.iter().any(|other| {
                other.variability == "tunable" || other.causality == "input" && other.variability == "fixed"
            });
            variable.variability == "constant"
                || !tunable && variable.variability == "fixed" && variable.causality != "input"
                || variable.causality == "parameter"
        })
        .collect();
    if fixed.is_empty() || course.points.is_empty() {
        return Ok(());
    }
    let mut writer = checker.writer();
    writer.begin(0, course);
    let first = writer.read_these(0, &fixed);
    for point in &course.points {
        writer.point(0, course, point);
    }
    let last = writer.read_these(0, &fixed);
    let description = description.clone();
    let judge: Judge = Arc::new(move |run| {
        let (name, before, after) = crate::writer::difference(&description, run, &first, &last)?;
        Some(format!("{name} was {before} and has become {after}"))
    });
    checker.judge("start_values.fixed", writer.script, judge)?;
    Ok(())
}

/// What is set is what is read: before and in Initialization Mode, amid the simulation, and after it.
pub fn set(checker: &Checker) -> anyhow::Result<()> {
    let description = &checker.description;
    for course in &checker.courses {
        let places: Vec<usize> = readable(description)
            .into_iter()
            .filter(|place| {
                let variable = &description.variables[*place];
                let settable = variable.causality == "input"
                    || variable.initial == "exact" && variable.variability != "constant";
                settable
                    && !variable.clocked
                    && !variable.start.is_empty()
                    && description.aliases(*place).count() == 1
            })
            .collect();
        let near: Vec<(usize, Value)> = places
            .iter()
            .filter(|place| description.variables[**place].is_float())
            .filter_map(|place| Some((*place, other_values(description, *place)?)))
            .collect();
        when(checker, course, &near)?;
        // Together what every model takes; alone what it may refuse.
        let alone = places
            .iter()
            .filter(|place| !description.variables[**place].is_float())
            .take(checker.most(40))
            .flat_map(|place| {
                // Longer than buffers are.
                let long =
                    Value::Texts(vec![b"long ".repeat(100); description.variables[*place].start.len()]);
                let long = (description.variables[*place].base == Some(BaseType::String)).then_some(long);
                other_values(description, *place).into_iter().chain(long).map(|value| vec![(*place, value)])
            });
        for values in std::iter::once(near).filter(|near| !near.is_empty()).chain(alone) {
            for within in [true, false] {
                let mut writer = checker.writer();
                writer.make(0, course.interface);
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
        for place in places.into_iter().take(checker.most(400)) {
            let variable = &description.variables[place];
            let late = match course.interface {
                Interface::CoSimulation => variable.causality == "input" || variable.variability == "tunable",
                Interface::ModelExchange => variable.causality == "input" && variable.is_float(),
            };
            let late = late && (variable.is_float() || variable.variability != "discrete");
            if let Some(value) =
                other_values(description, place).filter(|_| late && !variable.once_per_instant)
            {
                let values = vec![(place, value)];
                let mut writer = checker.writer();
                writer.begin(0, course);
                for point in course.points.iter().take(2) {
                    writer.point(0, course, point);
                }
                let sets = writer.set(0, &values);
                what_was_set(checker, writer, values, sets)?;
            }
        }
        inputs(checker, course)?;
    }
    Ok(())
}

/// Start values count, whether they are set before Initialization Mode or in it, and whatever is read in between.
fn when(checker: &Checker, course: &Course, values: &[(usize, Value)]) -> anyhow::Result<()> {
    if values.is_empty() {
        return Ok(());
    }
    let mut writer = checker.writer();
    let (mut sets, mut reads) = (Vec::new(), [Vec::new(), Vec::new()]);
    for (of, reads) in reads.iter_mut().enumerate() {
        writer.make(of, course.interface);
        if of == 1 {
            writer.enter(of);
            writer.read(of);
        }
        sets.extend(writer.set(of, values));
        if of == 0 {
            writer.enter(of);
        }
        reads.extend(writer.read(of));
        writer.leave(of, course);
        reads.extend(writer.ask(of, course.interface));
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
    checker.judge("start_values.when", writer.script, judge)?;
    Ok(())
}

fn what_was_set(
    checker: &Checker,
    mut writer: Writer<'_>,
    values: Vec<(usize, Value)>,
    sets: Vec<u32>,
) -> anyhow::Result<()> {
    let places: Vec<usize> = values.iter().map(|(place, _)| *place).collect();
    let reads = writer.read_these(0, &places);
    let description = checker.description.clone();
    let judge: Judge = Arc::new(move |run| {
        if sets.iter().any(|id| run.status(*id).is_none_or(|status| status > 1)) {
            return None;
        }
        values.iter().find_map(|(place, value)| {
            let read = value_of(run, &reads, *place).filter(|read| !is_read(read, value))?;
            let name = &description.variables[*place].name;
            Some(format!("{name} was set to {} and reads {}", value.show(), read.show(0)))
        })
    });
    checker.judge("start_values.set", writer.script, judge)?;
    Ok(())
}

/// What inputs were set to stays, through steps and events.
fn inputs(checker: &Checker, course: &Course) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    writer.begin(0, course);
    let mut asked = Vec::new();
    for point in &course.points {
        let ids = writer.point(0, course, point);
        let places: Vec<usize> = point.inputs.iter().map(|(place, _)| *place).collect();
        asked.push((ids, writer.read_these(0, &places), point.inputs.clone()));
    }
    let description = checker.description.clone();
    let judge: Judge = Arc::new(move |run| {
        asked.iter().find_map(|(ids, reads, inputs)| {
            if ids.iter().any(|id| run.status(*id).is_none_or(|status| status > 1)) {
                return None;
            }
            inputs.iter().find_map(|(place, value)| {
                let read = value_of(run, reads, *place).filter(|read| !is_read(read, value))?;
                let name = &description.variables[*place].name;
                Some(format!("{name} was set to {} and has become {}", value.show(), read.show(0)))
            })
        })
    });
    checker.judge("start_values.inputs", writer.script, judge)?;
    Ok(())
}

//! Reset equals new.

use crate::checker::Checker;
use crate::finding::Judge;
use crate::finding::refused;
use crate::writer::difference;
use std::sync::Arc;

/// After a course and a reset, what is read and what the course gives are those of a new instance.
pub fn reset(checker: &Checker) -> anyhow::Result<()> {
    for course in &checker.courses {
        // A reset instance in one process, a new one in another.
        for terminated in [true, false] {
            let mut writer = checker.writer();
            let ask = |writer: &mut crate::writer::Writer, of: usize| {
                let mut reads = writer.read(of);
                writer.leave(of, course);
                for point in &course.points {
                    writer.point(of, course, point);
                    reads.extend(writer.ask(of, course.interface));
                }
                reads
            };
            writer.make(0, course.interface);
            writer.enter(0);
            let first = ask(&mut writer, 0);
            if terminated {
                writer.call(0, "Terminate", vec![]);
            }
            let reset = writer.call(0, "Reset", vec![]);
            let enter = writer.enter(0);
            let second = ask(&mut writer, 0);
            let (description, script) = (checker.description.clone(), writer.script.clone());
            let judge: Judge = Arc::new(move |run| {
                if let Some(why) = refused(&script, run, &[reset, enter]) {
                    return Some(why);
                }
                let (name, before, after) = difference(&description, run, &first, &second)?;
                Some(format!("{name} of the new instance was {before}, after the reset it is {after}"))
            });
            checker.judge("reset.incomplete", writer.script, judge)?;
        }
        changed(checker, course)?;
    }
    Ok(())
}

/// What was set before the reset is gone after it.
fn changed(checker: &Checker, course: &crate::writer::Course) -> anyhow::Result<()> {
    let description = &checker.description;
    let (mut values, mut others) = (Vec::new(), Vec::new());
    for place in crate::writer::readable(description) {
        let variable = &description.variables[place];
        let settable = variable.initial == "exact" && variable.variability != "constant"
            || variable.causality == "input";
        if settable && !variable.clocked && !variable.start.is_empty() {
            let list = if variable.is_float() { &mut values } else { &mut others };
            list.extend(crate::values::other_values(description, place).map(|value| (place, value)));
        }
    }
    // What a model may refuse apart, and not for long.
    after_values(checker, course, &values, true)?;
    for other in others.chunks(1).take(checker.most(40)) {
        after_values(checker, course, other, false)?;
    }
    Ok(())
}

fn after_values(
    checker: &Checker,
    course: &crate::writer::Course,
    values: &[(usize, crate::values::Value)],
    initialized: bool,
) -> anyhow::Result<()> {
    let description = &checker.description;
    let mut writer = checker.writer();
    writer.make(0, course.interface);
    writer.enter(0);
    let first = writer.read(0);
    writer.call(0, "Reset", vec![]);
    writer.set(0, values);
    if initialized {
        writer.enter(0);
        writer.leave(0, course);
    }
    writer.call(0, "Reset", vec![]);
    writer.enter(0);
    let second = writer.read(0);
    let description = description.clone();
    let judge: Judge = Arc::new(move |run| {
        let (name, before, after) = difference(&description, run, &first, &second)?;
        Some(format!(
            "{name} of the new instance was {before}, after values were set and a reset it is {after}"
        ))
    });
    checker.judge("reset.values", writer.script, judge)?;
    Ok(())
}

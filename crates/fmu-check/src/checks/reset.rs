//! Reset equals new.

use crate::checker::Checker;
use crate::finding::Judge;
use crate::finding::refused;
use crate::writer::difference;
use std::sync::Arc;

/// After a trajectory and a reset, what is read and what the trajectory gives are those of a new instance.
pub fn reset(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in &checker.trajectories {
        // A reset instance in one process, a new one in another.
        for terminated in [true, false] {
            let mut writer = checker.writer();
            let ask = |writer: &mut crate::writer::Writer, of: usize| {
                let mut reads = writer.read(of);
                writer.leave(of, trajectory);
                for point in &trajectory.points {
                    writer.point(of, trajectory, point);
                    reads.extend(writer.ask(of, trajectory.interface));
                }
                reads
            };
            writer.make(0, trajectory.interface);
            writer.enter(0);
            let first = ask(&mut writer, 0);
            if terminated {
                writer.call(0, "Terminate", vec![]);
            }
            let reset = writer.call(0, "Reset", vec![]);
            let enter = writer.enter(0);
            let second = ask(&mut writer, 0);
            let (description, sequence) = (checker.description.clone(), writer.sequence.clone());
            let judge: Judge = Arc::new(move |run| {
                if let Some(why) = refused(&sequence, run, &[reset, enter]) {
                    return Some(why);
                }
                let (name, before, after) = difference(&description, run, &first, &second)?;
                Some(format!("{name} of the new instance was {before}, after the reset it is {after}"))
            });
            checker.judge("reset.incomplete", writer.sequence, judge)?;
        }
        changed(checker, trajectory)?;
    }
    Ok(())
}

/// Values that were set before the reset have their start values after it.
fn changed(checker: &Checker, trajectory: &crate::writer::Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let (mut values, mut others) = (Vec::new(), Vec::new());
    for index in crate::writer::readable(description) {
        let variable = &description.variables[index];
        let settable = variable.initial == "exact" && variable.variability != "constant"
            || variable.causality == "input";
        if settable && !variable.clocked && !variable.start.is_empty() {
            let list = if variable.is_float() { &mut values } else { &mut others };
            list.extend(crate::values::other_values(description, index).map(|value| (index, value)));
        }
    }
    // A model may reject any of these, so they are set one at a time, at most 40.
    after_values(checker, trajectory, &values, true)?;
    for other in others.chunks(1).take(checker.most(40)) {
        after_values(checker, trajectory, other, false)?;
    }
    Ok(())
}

fn after_values(
    checker: &Checker,
    trajectory: &crate::writer::Trajectory,
    values: &[(usize, crate::values::Value)],
    initialized: bool,
) -> anyhow::Result<()> {
    let description = &checker.description;
    let mut writer = checker.writer();
    writer.make(0, trajectory.interface);
    writer.enter(0);
    let first = writer.read(0);
    writer.call(0, "Reset", vec![]);
    writer.set(0, values);
    if initialized {
        writer.enter(0);
        writer.leave(0, trajectory);
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
    checker.judge("reset.values", writer.sequence, judge)?;
    Ok(())
}

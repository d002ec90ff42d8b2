//! Saved states: what follows a restored one is what followed the first time, in the same instance, after a reset, from
//! bytes, and in a fresh process.

use crate::call_sequence::{Step, Written};
use crate::checker::Checker;
use crate::finding::Judge;
use crate::finding::refused;
use crate::writer::{Read, Trajectory, Writer, difference};
use std::sync::Arc;

/// The points at which states are saved: the first, one in the middle, one near the end.
fn indices(trajectory: &Trajectory) -> Vec<usize> {
    let count = trajectory.points.len();
    let mut indices = vec![0, 1, count / 2, count.saturating_sub(2)];
    indices.retain(|index| *index < count);
    indices.sort_unstable();
    indices.dedup();
    indices
}

/// Continues from a point of the trajectory to its end and reads after each point.
fn rest(writer: &mut Writer, of: usize, trajectory: &Trajectory, from: usize) -> (Vec<u32>, Vec<Read>) {
    let (mut ids, mut reads) = (Vec::new(), Vec::new());
    for point in &trajectory.points[from..] {
        ids.extend(writer.point(of, trajectory, point));
        reads.extend(writer.ask(of, trajectory.interface));
    }
    (ids, reads)
}

fn up_to(writer: &mut Writer, of: usize, trajectory: &Trajectory, to: usize) {
    writer.begin(of, trajectory);
    for point in &trajectory.points[..to] {
        writer.point(of, trajectory, point);
    }
}

fn same(checker: &Checker, what: &'static str, one: Vec<Read>, other: Vec<Read>) -> Judge {
    let description = checker.description.clone();
    Arc::new(move |run| {
        let (name, before, after) = difference(&description, run, &one, &other)?;
        Some(format!("{name} was {before}, {what} it is {after}"))
    })
}

/// Saved, gone on, restored, gone on: the same; twice; and saving changes nothing.
pub fn restore(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in checker.trajectories.iter().filter(|trajectory| checker.saves(trajectory.interface)) {
        for index in indices(trajectory) {
            let mut writer = checker.writer();
            up_to(&mut writer, 0, trajectory, index);
            let before = writer.ask(0, trajectory.interface);
            writer.save(0, 0);
            let after = writer.ask(0, trajectory.interface);
            let (_, first) = rest(&mut writer, 0, trajectory, index);
            writer.restore(0, 0);
            let at_once = writer.ask(0, trajectory.interface);
            let (_, second) = rest(&mut writer, 0, trajectory, index);
            writer.restore(0, 0);
            let (_, third) = rest(&mut writer, 0, trajectory, index);
            let sequence = writer.sequence;
            let run = checker.judge(
                "states.changed-by-saving",
                sequence.clone(),
                same(checker, "after the state was saved", before.clone(), after),
            )?;
            let judges = [
                ("states.restore-values", same(checker, "after the state was restored", before, at_once)),
                ("states.restore", same(checker, "from the restored state", first.clone(), second)),
                ("states.twice", same(checker, "from the state restored a second time", first, third)),
            ];
            for (name, judge) in judges {
                if checker.keep(name, &run, &sequence, judge) {
                    break;
                }
            }
        }
        modes(checker, trajectory)?;
        reused(checker, trajectory)?;
        free_null(checker, trajectory)?;
    }
    Ok(())
}

/// A state of one mode, restored in another.
fn modes(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    writer.make(0, trajectory.interface);
    writer.save(0, 0);
    writer.enter(0);
    writer.save(0, 1);
    writer.leave(0, trajectory);
    let (_, first) = rest(&mut writer, 0, trajectory, 0);
    writer.call(0, "Terminate", vec![]);
    // Back to the initialization, then to the beginning.
    let back = writer.restore(0, 1);
    let mut ids = writer.leave(0, trajectory);
    let (more, second) = rest(&mut writer, 0, trajectory, 0);
    ids.extend(more);
    let again = writer.restore(0, 0);
    writer.enter(0);
    writer.leave(0, trajectory);
    let (more, third) = rest(&mut writer, 0, trajectory, 0);
    ids.extend(more);
    ids.extend([back, again]);
    let (sequence, one) = (
        writer.sequence.clone(),
        same(checker, "from the state of Initialization Mode", first.clone(), second),
    );
    let two = same(checker, "from the state of the new instance", first, third);
    let judge: Judge =
        Arc::new(move |run| refused(&sequence, run, &ids).or_else(|| one(run)).or_else(|| two(run)));
    checker.judge("states.modes", writer.sequence, judge)?;
    Ok(())
}

/// A handle that is used for another state, and two states side by side.
fn reused(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let count = trajectory.points.len();
    if count < 3 {
        return Ok(());
    }
    let mut writer = checker.writer();
    up_to(&mut writer, 0, trajectory, 1);
    writer.save(0, 0);
    writer.save(0, 1);
    writer.point(0, trajectory, &trajectory.points[1]);
    let values = writer.ask(0, trajectory.interface);
    writer.save(0, 1);
    let (_, first) = rest(&mut writer, 0, trajectory, 2);
    writer.restore(0, 0);
    writer.restore(0, 1);
    let again = writer.ask(0, trajectory.interface);
    let (_, second) = rest(&mut writer, 0, trajectory, 2);
    writer.restore(0, 0);
    writer.point(0, trajectory, &trajectory.points[1]);
    let from_first = writer.ask(0, trajectory.interface);
    writer.drop_state(0, 0);
    writer.drop_state(0, 1);
    let judges = [
        same(checker, "from the state in a used handle", values.clone(), again),
        same(checker, "from the state in a used handle", first, second),
        same(checker, "from the other state", values, from_first),
    ];
    let judge: Judge = Arc::new(move |run| judges.iter().find_map(|judge| judge(run)));
    checker.judge("states.several", writer.sequence, judge)?;
    Ok(())
}

/// NULL is ignored, and a freed state leaves NULL.
fn free_null(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    writer.begin(0, trajectory);
    writer.save(0, 0);
    let freed = writer.drop_state(0, 0);
    let nothing = writer.drop_state(0, 1);
    let judge: Judge = Arc::new(move |run| {
        if run.status(nothing).is_some_and(|status| status > 1) {
            return Some("freeing a state that is NULL is refused".to_owned());
        }
        let left = run.status(freed) == Some(0) && run.written(freed)?.numbers() != [0.0];
        left.then(|| "the handle of a freed state is not NULL".to_owned())
    });
    checker.judge("states.free", writer.sequence, judge)?;
    Ok(())
}

/// Deserializes a state in the same instance, in a new one and in a fresh process.
pub fn serialized(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in
        checker.trajectories.iter().filter(|trajectory| checker.serializes(trajectory.interface))
    {
        for index in indices(trajectory) {
            for fresh in [false, true] {
                let mut writer = checker.writer();
                up_to(&mut writer, 0, trajectory, index);
                let before = writer.ask(0, trajectory.interface);
                writer.save(0, 0);
                let [size, bytes] = writer.serialize(0, 0);
                let (_, first) = rest(&mut writer, 0, trajectory, index);
                if fresh {
                    writer.add(Step::FreshProcess);
                } else {
                    writer.drop_state(0, 0);
                    writer.free(0);
                }
                // States may be set in two situations that importers use: after instantiation and after initialization.
                if index == 0 && fresh {
                    writer.make(1, trajectory.interface);
                } else {
                    writer.begin(1, trajectory);
                }
                let read = writer.deserialize(1, 0, 1);
                let set = writer.restore(1, 1);
                let at_once = writer.ask(1, trajectory.interface);
                let (_, second) = rest(&mut writer, 1, trajectory, index);
                let sequence = writer.sequence.clone();
                let name = if fresh { "states.fresh-process" } else { "states.serialized" };
                let one = same(checker, "from the bytes", before, at_once);
                let two = same(checker, "from the bytes", first, second);
                let judge: Judge = Arc::new(move |run| {
                    if run.status(bytes).is_none_or(|status| status > 1)
                        || run.status(size).is_none_or(|status| status > 1)
                    {
                        return None;
                    }
                    refused(&sequence, run, &[read, set]).or_else(|| one(run)).or_else(|| two(run))
                });
                checker.judge(name, writer.sequence, judge)?;
            }
        }
        again(checker, trajectory)?;
    }
    Ok(())
}

/// Serializing twice gives the same bytes, and serializing what was read gives them, too.
fn again(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    up_to(&mut writer, 0, trajectory, trajectory.points.len() / 2);
    writer.save(0, 0);
    let [_, first] = writer.serialize(0, 0);
    writer.deserialize(0, 0, 1);
    let [_, second] = writer.serialize(0, 1);
    let judge: Judge = Arc::new(move |run| {
        let (one, two) = (run.written(first)?, run.written(second)?);
        match (one, two) {
            (Written::Numbers(_, one), Written::Numbers(_, two)) if one.len() != two.len() => {
                Some(format!("{} bytes, and {} of the same state", one.len(), two.len()))
            }
            _ => one.differ(two).map(|index| format!("byte {index} of {} differs", one.numbers().len())),
        }
    });
    checker.judge("states.bytes", writer.sequence, judge)?;
    Ok(())
}

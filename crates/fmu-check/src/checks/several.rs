//! Checks that freeing an instance does not affect others, that the library can be unloaded and loaded again, and that the
//! process exits after two instances.

use crate::call_sequence::Action;
use crate::checker::Checker;
use crate::finding::any;
use crate::writer::Part::{Begin, Call, Free, ReadAll, Run};
use crate::writer::Trajectory;

/// Checks that an instance has the same results as a single one although two others are freed during its simulation. Instance 1 was made
/// before it, and instance 3 after it. Then checks a simulation after the library was unloaded and loaded again.
pub fn freed(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let points = &trajectory.points;
    let half = points.len() / 2;
    let mut writer = checker.writer(trajectory);
    let [start, rest] = writer.groups(0, &[Begin, ReadAll, Run(0)]);
    let single = [start, rest].concat();
    writer.write(0, &[Free]);
    writer.write(1, &[Begin, Call("Terminate")]);
    let mut middle = writer.write(2, &[Begin, ReadAll]).reads;
    writer.write(3, &[Begin]);
    for (number, point) in points.iter().enumerate() {
        writer.point(2, point);
        middle.extend(writer.read_all(2));
        if number == half / 2 {
            writer.write(1, &[Free]);
        }
        if number == half {
            writer.point(3, &points[0]);
            writer.write(3, &[Free]);
        }
    }
    // A simulation without points has freed neither of the two.
    let mut remaining: Vec<usize> = Vec::new();
    remaining.extend((half / 2 >= points.len()).then_some(1));
    remaining.extend((half >= points.len()).then_some(3));
    remaining.push(2);
    remaining.into_iter().for_each(|instance| drop(writer.write(instance, &[Free])));
    writer.add(Action::Unload);
    let again = writer.write(0, &[Begin, ReadAll, Run(0), Free]).reads;
    writer.add(Action::Unload);
    let criteria = [
        checker.differ(&single, &middle, "{} is {}, after other instances were freed {}"),
        checker.differ(&single, &again, "{} is {}, after the library was unloaded and loaded again {}"),
    ];
    checker.check("results.instances", writer.sequence.clone(), any(criteria))?;
    quit(checker, trajectory)
}

/// Checks that the process exits after two instances were freed.
fn quit(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    writer.write(1, &[Begin]);
    writer.write(2, &[Begin]);
    writer.write(1, &[Free]);
    writer.write(2, &[Free]);
    writer.add(Action::Quit);
    checker.check("life_cycle.exit", writer.sequence, |_| None)
}

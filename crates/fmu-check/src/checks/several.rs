//! Checks instances that are freed next to others, and the unloading of the library afterwards.

use crate::call_sequence::Step;
use crate::checker::Checker;
use crate::finding::any;
use crate::writer::Part::{Begin, Call, Free, ReadAll, Run};
use crate::writer::Trajectory;

/// Checks that an instance continues as a single one does after others were freed: one that was made before and one that was made
/// after it. Then the library is unloaded and loaded again.
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
        // The older one in a third of the simulation, the newer one in the middle.
        if number == half / 2 {
            writer.write(1, &[Free]);
        }
        if number == half {
            writer.point(3, &points[0]);
            writer.write(3, &[Free]);
        }
    }
    let mut left: Vec<usize> = Vec::new();
    left.extend((half / 2 >= points.len()).then_some(1));
    left.extend((half >= points.len()).then_some(3));
    left.push(2);
    left.into_iter().for_each(|instance| drop(writer.write(instance, &[Free])));
    writer.add(Step::Unload);
    let again = writer.write(0, &[Begin, ReadAll, Run(0), Free]).reads;
    writer.add(Step::Unload);
    let criteria = [
        checker.differ(&single, &middle, "{} is {}, after other instances were freed {}"),
        checker.differ(&single, &again, "{} is {}, after the library was unloaded and loaded again {}"),
    ];
    checker.check("results.instances", writer.sequence.clone(), any(criteria))?;
    quit(checker, trajectory)
}

/// Checks the exit of the process while two instances exist, which an importer that fails may leave.
fn quit(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    writer.write(1, &[Begin]);
    writer.write(2, &[Begin]);
    writer.write(1, &[Free]);
    writer.write(2, &[Free]);
    writer.add(Step::Quit);
    checker.check("life_cycle.exit", writer.sequence, |_| None)
}

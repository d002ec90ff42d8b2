//! Checks that an instance after a reset behaves like a new one.

use crate::call_sequence::Values;
use crate::checker::Checker;
use crate::finding::{any, fails};
use crate::values::other_values;
use crate::writer::Part::{Call, Enter, Leave, Make, Read, Run};
use crate::writer::Trajectory;

/// Checks that an instance has the same values and the same simulation after a reset as when it was new. Resets it once after Terminate,
/// and once without Terminate.
pub fn reset(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    for before_reset in [&[Call("Terminate")][..], &[]] {
        let mut writer = checker.writer(trajectory);
        let first = writer.write(0, &[Make, Enter, Read, Leave, Run(0)]).reads;
        writer.write(0, before_reset);
        let ids = writer.write(0, &[Call("Reset"), Enter]).ids;
        let second = writer.write(0, &[Read, Leave, Run(0)]).reads;
        let message = "{} of the new instance was {}, after the reset it is {}";
        let criteria = [fails(&writer.sequence, ids), checker.differ(&first, &second, message)];
        checker.check("reset.incomplete", writer.sequence, any(criteria))?;
    }
    start_values(checker, trajectory)
}

/// Checks that a reset restores the start values of variables that were set.
fn start_values(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let (mut floats, mut others) = (Vec::new(), Vec::new());
    for index in checker.readable.iter().copied() {
        let variable = &description.variables[index];
        if variable.is_settable() && !variable.clocked && !variable.start.is_empty() {
            let list = if variable.is_float() { &mut floats } else { &mut others };
            list.extend(other_values(description, index).map(|value| (index, value)));
        }
    }
    after_values(checker, trajectory, &floats, true)?;
    // A model may reject new values of integers, Booleans and strings, so these variables are set one at a time.
    let mut others = others.chunks(1).take(checker.at_most(40));
    others.try_for_each(|other| after_values(checker, trajectory, other, false))
}

/// Checks a reset after these values were set. If `initialized` is true, the instance is initialized after they were set and
/// before the reset.
fn after_values(
    checker: &Checker,
    trajectory: &Trajectory,
    values: &[(usize, Values)],
    initialized: bool,
) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let first = writer.write(0, &[Make, Enter, Read, Leave, Read, Call("Reset")]).reads;
    writer.set(0, values);
    if initialized {
        writer.write(0, &[Enter, Leave]);
    }
    let second = writer.write(0, &[Call("Reset"), Enter, Read, Leave, Read]).reads;
    let message = "{} of the new instance was {}, after values were set and a reset it is {}";
    checker.check("reset.values", writer.sequence, checker.differ(&first, &second, message))
}

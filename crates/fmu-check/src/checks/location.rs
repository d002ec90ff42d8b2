//! Checks that an FMU runs in directories whose names have a space or other characters that a URI must encode.

use crate::call_sequence::{Action, Run};
use crate::checker::Checker;
use crate::finding::failure;
use crate::writer::Part::{Begin, ReadAll, Run as RunFrom};
use crate::writer::Trajectory;

/// Names of directories: one with a space, and one with other characters that a URI must encode, among them `%`.
const NAMES: [&str; 2] = ["two words", "Größe+#%41"];

/// Checks that a simulation has the same results if the FMU is in a directory of another name. FMI 2.0 passes the location of the resources
/// as a URI, which the FMU must decode, and FMI 3.0 passes a path, which it must not decode.
pub fn location(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    for name in NAMES {
        let mut writer = checker.writer(trajectory);
        let usual = writer.write(0, &[Begin, ReadAll, RunFrom(0)]);
        writer.add(Action::FreshProcess);
        writer.add(Action::Elsewhere(name.to_owned()));
        let moved = writer.write(0, &[Begin, ReadAll, RunFrom(0)]);
        let sequence = writer.sequence.clone();
        // Strings may contain the path.
        let [one, other] = [usual.reads, moved.reads].map(|reads| checker.numeric(reads));
        let differs = checker.differ(&one, &other, "{} is {}, in this directory {}");
        checker.check("results.location", writer.sequence, move |run: &Run| {
            if failure(&sequence, run, &usual.ids).is_some() {
                return None;
            }
            let why = failure(&sequence, run, &moved.ids).or_else(|| differs(run))?;
            Some(format!("in a directory called {name:?}: {why}"))
        })?;
    }
    Ok(())
}

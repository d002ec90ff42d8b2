//! Checks that the FMU logs nothing while logging is off, and does not log a message in each step.

use crate::call_sequence::Arg;
use crate::checker::Checker;
use crate::writer::Part::{Begin, Call, Enter, Free, Leave, Points, ReadAll};
use crate::writer::Trajectory;

/// Checks that successful calls log no message if logging is off at the instantiation, or was switched off by `SetDebugLogging`.
/// In FMI 2.0, messages about errors are allowed.
pub fn switches(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let fmi3 = checker.fmi3();
    for by_call in [false, true] {
        let mut writer = checker.writer(trajectory);
        let mut ids = vec![writer.make_with(0, |make| make.logging = by_call)];
        if by_call {
            writer.call(0, "SetDebugLogging", vec![Arg::Integer(0), Arg::Integer(0), Arg::Null]);
            // Messages are allowed until logging is switched off.
            ids.clear();
        }
        let calls = writer.write(0, &[Enter, Leave, Points(usize::MAX), ReadAll, Call("Terminate"), Free]);
        ids.extend(calls.ids);
        ids.extend(calls.reads.iter().map(|read| read.id));
        checker.check("logs.off", writer.sequence, move |run| {
            let message = ids.iter().find_map(|id| {
                // For a rejected call, one section of FMI 3.0 requires a message, and another section forbids it.
                let outcome =
                    run.outcome(*id).filter(|outcome| outcome.status.is_none_or(|status| status < 2))?;
                // In FMI 2.0, errors may still be logged, because `loggingOn` switches off only debug messages.
                outcome.log.iter().find(|message| fmi3 || message.status < 2)
            })?;
            let text = String::from_utf8_lossy(message.text.as_deref().unwrap_or_default()).into_owned();
            Some(format!("{text:?}"))
        })?;
    }
    Ok(())
}

/// Fewest steps whose messages are too many.
const MANY: usize = 5;

/// Checks that not each step logs a message.
pub fn each_step(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    writer.write(0, &[Begin]);
    let points: Vec<Vec<u32>> = trajectory.points.iter().map(|point| writer.point(0, point)).collect();
    writer.write(0, &[Free]);
    checker.check("logs.each-step", writer.sequence, move |run| {
        let message = |ids: &Vec<u32>| {
            let outcomes = ids.iter().filter_map(|id| run.outcome(*id));
            outcomes.flat_map(|outcome| &outcome.log).find_map(|message| message.text.clone())
        };
        let messages: Vec<Vec<u8>> = points.iter().map_while(message).collect();
        let (all, first) = (points.len(), messages.first()?);
        let is_each = all >= MANY && messages.len() == all;
        is_each.then(|| {
            format!("each of {all} steps logs a message; the first is {:?}", String::from_utf8_lossy(first))
        })
    })
}

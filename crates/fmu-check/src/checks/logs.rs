//! Messages with logging off and on.

use crate::call_sequence::{Arg, Step};
use crate::checker::Checker;
use crate::finding::Judge;
use std::sync::Arc;

/// With logging off there is no message; logging can be switched at any time.
pub fn switches(checker: &Checker) -> anyhow::Result<()> {
    let fmi3 = checker.fmi3();
    for trajectory in &checker.trajectories {
        for by_call in [false, true] {
            let mut writer = checker.writer();
            let mut how = writer.how(trajectory.interface);
            how.logging = by_call;
            let mut ids = vec![writer.add(Step::Make(0, how))];
            if by_call {
                writer.call(0, "SetDebugLogging", vec![Arg::Whole(0), Arg::Whole(0), Arg::Null]);
                ids.clear();
            }
            ids.push(writer.enter(0));
            ids.extend(writer.leave(0, trajectory));
            for point in &trajectory.points {
                ids.extend(writer.point(0, trajectory, point));
            }
            ids.extend(writer.ask(0, trajectory.interface).iter().map(|read| read.id));
            ids.push(writer.call(0, "Terminate", vec![]));
            ids.push(writer.free(0));
            let judge: Judge = Arc::new(move |run| {
                let message = ids.iter().find_map(|id| {
                    // For a rejected call, FMI 3.0 requires a message in one place and forbids it in another.
                    let of = run.of(*id).filter(|of| of.status.is_none_or(|status| status < 2))?;
                    // In FMI 2.0 it is debug messages that are off.
                    of.log.iter().find(|message| fmi3 || message.status < 2)
                })?;
                let text = String::from_utf8_lossy(message.text.as_deref().unwrap_or_default()).into_owned();
                Some(format!("{text:?}"))
            });
            checker.judge("logs.off", writer.sequence, judge)?;
        }
    }
    Ok(())
}

//! Checks that results do not depend on the environment of the process, on the thread, or on what the importer announces, and that
//! the results remain after the end of the simulation.

use crate::call_sequence::{Action, Arg, Run};
use crate::checker::Checker;
use crate::writer::Part::{Begin, Call, Free, Points, Read, ReadAll, Run as RunFrom};
use crate::writer::{Part, Trajectory, value_of, values_of};

/// Simulation that reads all variables and vectors at every point.
const COMPLETE: &[Part] = &[Begin, ReadAll, RunFrom(0)];

/// Checks that a simulation has the same results in another process with another working directory, home directory, language and time
/// zone. Strings are not compared, because they may contain paths.
pub fn environment(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let usual = checker.numeric(writer.write(0, COMPLETE).reads);
    writer.add(Action::FreshProcess);
    writer.add(Action::Environment);
    let changed = checker.numeric(writer.write(0, COMPLETE).reads);
    let criterion = checker.differ(&usual, &changed, "{} is {}, in another environment {}");
    checker.check("results.environment", writer.sequence, criterion)
}

/// Checks that an instance can be called on another thread than the one that created it, as importers with a thread pool do.
pub fn other_thread(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let usual = writer.write(0, COMPLETE).reads;
    writer.free(0);
    writer.begin(1);
    let mut thread = writer.thread();
    let moved = thread.write(1, &COMPLETE[1..]).reads;
    writer.join(vec![thread]);
    writer.free(1);
    let criterion = checker.differ(&usual, &moved, "{} is {}, on another thread than the instantiation {}");
    checker.check("results.other-thread", writer.sequence, criterion)
}

/// Checks that results do not depend on the announcement that the importer will restore no earlier state.
pub fn no_earlier_state(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let usual = writer.write(0, COMPLETE).reads;
    writer.free(0);
    let begin = writer.sequence.len();
    let announced = writer.write(0, COMPLETE).reads;
    for numbered in &mut writer.sequence[begin..] {
        if let Action::Call { function, args, .. } = &mut numbered.action {
            let index = match &function[4..] {
                "DoStep" => 2,
                "CompletedIntegratorStep" => 0,
                _ => continue,
            };
            args[index] = Arg::Integer(1);
        }
    }
    let message = "{} is {}, with noSetFMUStatePriorToCurrentPoint {}";
    let criterion = checker.differ(&usual, &announced, message);
    checker.check("results.no-earlier-state", writer.sequence, criterion)
}

/// Checks that results do not change when logging is switched off during the simulation.
pub fn logging(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let mut simulate = |switches: bool| {
        writer.write(0, &[Begin, Points(2)]);
        if switches {
            writer.call(0, "SetDebugLogging", vec![Arg::Integer(0), Arg::Integer(0), Arg::Null]);
        }
        let rest = RunFrom(trajectory.points.len().min(2));
        checker.numeric(writer.write(0, &[ReadAll, rest, Free]).reads)
    };
    let (usual, switched) = (simulate(false), simulate(true));
    let criterion = checker.differ(&usual, &switched, "{} is {}, after logging was switched off {}");
    checker.check("results.logging", writer.sequence, criterion)
}

/// Checks that getters still return the values at the end of the simulation after it was terminated.
pub fn terminated(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let [before, after] = writer.groups(0, &[Begin, Points(usize::MAX), Read, Call("Terminate"), Read, Free]);
    let description = checker.description.clone();
    checker.check("results.terminated", writer.sequence, move |run: &Run| {
        values_of(run, &after).find_map(|(index, last)| {
            let value = value_of(run, &before, index)?;
            let at = value.differ(&last)?;
            let name = &description.variables[index].name;
            Some(format!(
                "{name} is {}, after the simulation was terminated {}",
                value.show(at),
                last.show(at)
            ))
        })
    })
}

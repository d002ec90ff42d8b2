//! Checks that an FMU leaks no memory, threads or files, changes no settings of the process, and prints nothing.

use crate::call_sequence::{Action, End, Measured, Run, Values};
use crate::checker::Checker;
use crate::finding::failure;
use crate::worker::{EVALUATED, changed_setting, tolerated_growth};
use crate::writer::Part::{Begin, Call, Drop, Enter, Free, Leave, Make, Points, ReadAll, Restore, Save};
use crate::writer::{Part, Trajectory, Writer};
use fmi_abi::{BaseType, Causality, Initial};

/// Checks for leaks by repeating simulations, string setters, resets and saved states. Then checks the settings and the output of the process.
pub fn cycles(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let repeat = |what: &'static str, before: &[Part], cycle: &dyn Fn(&mut Writer)| {
        let mut writer = checker.writer(trajectory);
        writer.write(0, before);
        check_leaks(checker, writer, what, cycle)
    };
    repeat("instances made, run and freed", &[], &|writer| {
        writer.write(0, &[Begin, Points(3), ReadAll, Call("Terminate"), Free]);
    })?;
    let variables = checker.description.variables.iter().enumerate();
    let strings: Vec<(usize, Values)> = variables
        .filter(|(_, variable)| {
            variable.base == Some(BaseType::String) && variable.size == Some(1) && !variable.clocked
        })
        .filter(|(_, variable)| {
            variable.causality == Causality::Input
                || variable.causality == Causality::Parameter && variable.initial == Some(Initial::Exact)
        })
        .filter_map(|(index, variable)| Some((index, Values::strings(variable.start.first()?.as_bytes(), 1))))
        .collect();
    if !strings.is_empty() {
        repeat("strings set", &[Make], &|writer| {
            writer.set(0, &strings);
        })?;
    }
    repeat("resets", &[Make], &|writer| {
        writer.write(0, &[Enter, Leave, Points(2), ReadAll, Call("Reset")]);
    })?;
    if checker.saves(trajectory.interface) {
        repeat("states saved and freed", &[Begin, Points(2)], &|writer| {
            writer.write(0, &[Save(0), Save(0), Restore(0)]);
            if checker.serializes(trajectory.interface) {
                writer.serialize(0, 0);
                writer.deserialize(0, 0, 1);
                writer.write(0, &[Restore(1), Drop(1)]);
            }
            writer.write(0, &[ReadAll, Drop(0)]);
        })?;
    }
    settings(checker, trajectory)?;
    printed(checker, trajectory)
}

/// Maximum number of repetitions before the first measurement. They are needed because the first cycles may allocate memory that
/// later ones use.
const WARM_UP: usize = 200;

/// Maximum number of repetitions between the measurements.
const REPETITIONS: usize = 10_000;

/// Numbers of the actions of a check for leaks.
#[derive(Clone, Copy)]
struct Measurements {
    warm_up: u32,
    before: u32,
    repetitions: u32,
    after: u32,
}

impl Measurements {
    /// Returns both measurements, and the number of repetitions between them; `None` if there were too few repetitions.
    fn results(self, run: &Run) -> Option<(Measured, Measured, usize)> {
        let measured = |id| run.outcome(id)?.measured.clone();
        let (warm_up, times) = (measured(self.warm_up)?.times, measured(self.repetitions)?.times);
        let is_enough = warm_up >= EVALUATED && times >= EVALUATED;
        is_enough.then_some((measured(self.before)?, measured(self.after)?, times))
    }
}

/// Repeats a cycle of calls, and compares memory, threads and open files before and after the repetitions. `what` names the objects of the
/// cycles in messages.
fn check_leaks(
    checker: &Checker,
    mut writer: Writer,
    what: &'static str,
    cycle: &dyn Fn(&mut Writer),
) -> anyhow::Result<()> {
    let begin = writer.sequence.len();
    cycle(&mut writer);
    let cycle = writer.sequence.split_off(begin);
    let measurements = Measurements {
        warm_up: writer.add(Action::Repeat(WARM_UP, cycle.clone())),
        before: writer.add(Action::Measure),
        repetitions: writer.add(Action::Repeat(REPETITIONS, cycle.clone())),
        after: writer.add(Action::Measure),
    };
    let sequence = writer.sequence;
    let run = checker.execute_for(&sequence, checker.setting.repetitions * 8.0 + checker.limit)?;
    if run.end != End::Done {
        return checker.check("resources.cycles", sequence, |_| None);
    }
    checker.record_always(&sequence, &run);
    checker.record("resources.memory", &run, &sequence, move |run| {
        leaked_memory(measurements.results(run)?, what)
    });
    type Count = fn(&Measured) -> usize;
    let counts: [(&str, Count, &str); 2] = [
        ("resources.threads", |measured| measured.threads, "threads remain"),
        ("resources.files", |measured| measured.files, "files remain open"),
    ];
    for (name, count, are_left) in counts {
        checker.record(name, &run, &sequence, move |run| {
            let (before, after, times) = measurements.results(run)?;
            let more = count(&after).checked_sub(count(&before)).filter(|more| *more > 2)?;
            Some(format!("{more} {are_left} after {times} {what}"))
        });
    }
    let ids: Vec<u32> = cycle.iter().map(|numbered| numbered.id).collect();
    checker.record("resources.cycles", &run, &sequence, move |run| {
        let times = run.outcome(measurements.repetitions)?.measured.as_ref()?.times;
        let why = failure(&cycle, run, &ids)?;
        (times > 1).then(|| format!("after {} {what}: {why}", times - 1))
    });
    Ok(())
}

/// Describes memory that remains after the repetitions.
fn leaked_memory((before, after, times): (Measured, Measured, usize), what: &str) -> Option<String> {
    let grown = after.memory.saturating_sub(before.memory);
    (grown > tolerated_growth(&before, times))
        .then(|| format!("{grown} bytes remain after {times} {what}: {} for each", grown / times as u64))
}

/// Checks that a simulation changes no settings of the process.
fn settings(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    writer.add(checker.version());
    let first = writer.add(Action::Measure);
    writer.write(0, &[Begin, Points(usize::MAX), ReadAll]);
    let alive = writer.add(Action::Measure);
    writer.write(0, &[Call("Terminate"), Free]);
    let freed = writer.add(Action::Measure);
    checker.check("resources.settings", writer.sequence, move |run| {
        let measured = |id| run.outcome(id)?.measured.as_ref();
        let before = measured(first)?;
        let while_alive = measured(alive).and_then(|alive| changed_setting(before, alive, false));
        while_alive.or_else(|| changed_setting(before, measured(freed)?, true))
    })
}

/// Checks that nothing is printed until the library is unloaded. This is not a part of [`settings`], because a library that leaves a
/// thread may crash when it is unloaded, which would hide a changed setting.
fn printed(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    writer.write(0, &[Begin, Points(usize::MAX), ReadAll, Call("Terminate"), Free]);
    writer.add(Action::Unload);
    // A crash while it is unloaded is a finding of this topic.
    let run = checker.evaluate("resources.settings", writer.sequence.clone(), |_| None)?;
    checker.record("logs.printed", &run, &writer.sequence, |run| {
        let line = run.output.lines().find(|line| !line.trim().is_empty())?;
        (run.end == End::Done).then(|| format!("{:?}", line.chars().take(80).collect::<String>()))
    });
    Ok(())
}

//! Checks that instances accept the call sequences that the standard allows.

use super::Fits::{self, Always, Integrated, Several, Stepped};
use crate::call_sequence::{Arg, NULL_INSTANCE, Step};
use crate::checker::Checker;
use crate::finding::{event, first_failure};
use crate::random::Random;
use crate::worker::MOST_UPDATES;
use crate::writer::Part::{
    self, Begin, Call, Drop, Enter, Free, Leave, Make, Points, ReadAll, Restore, Save,
};
use crate::writer::{LONG_NAME, Point, Trajectory, Writer};

fn check_sequence(checker: &Checker, writer: Writer) -> anyhow::Result<()> {
    let copy = writer.sequence.clone();
    // Discard is allowed: the FMU may need a smaller step.
    checker.check("life_cycle.rejected", writer.sequence, move |run| first_failure(&copy, run, 2))
}

const ALL: Part = Points(usize::MAX);
const TERMINATE: Part = Call("Terminate");
const RESET: Part = Call("Reset");

/// Call sequences of one instance.
const SEQUENCES: &[&[Part]] = &[
    &[Make, Free],
    &[Make, Enter, ReadAll, Free],
    &[Begin, TERMINATE, ReadAll, Free],
    &[Begin, ALL, TERMINATE, ReadAll, RESET, Enter, Leave, ALL, ReadAll, Free],
    &[Make, RESET, Enter, RESET, RESET, Enter, Leave, RESET, Enter, Leave, Points(2), Free],
];

/// Writes a call sequence that cannot be expressed as a list of `Part`.
type WriteSequence = fn(&mut Writer, &Trajectory);

/// Call sequences that a function writes, each with the condition on the simulation.
const WRITTEN_SEQUENCES: &[(Fits, WriteSequence)] = &[
    (Several, many),
    (Always, long_name),
    (Stepped, up_to_the_stop),
    (Always, logging),
    (Integrated, events_everywhere),
    (Fits::EventMode, event_mode),
];

/// Makes twenty instances, more than a fixed pool may have. Four of them run and are freed in a different order.
fn many(writer: &mut Writer, _: &Trajectory) {
    (4..20).for_each(|instance| drop(writer.write(instance, &[Make])));
    (0..4).for_each(|instance| drop(writer.write(instance, &[Begin])));
    (4..20).for_each(|instance| drop(writer.write(instance, &[Free])));
    let two = Points(2);
    for (instance, part) in [(0, Free), (1, two), (3, Free), (2, two), (2, Free), (1, Free)] {
        writer.write(instance, &[part]);
    }
}

/// Runs an instance whose name has spaces and characters beyond ASCII, with a stop time and a tolerance.
fn long_name(writer: &mut Writer, trajectory: &Trajectory) {
    writer.make_with(0, |how| how.name = LONG_NAME.to_owned());
    let stop = trajectory.end + 1.0 + trajectory.end.abs();
    writer.enter_with(0, Some(1e-6), writer.description.start_time, Some(stop));
    writer.write(0, &[Leave, Points(3), Free]);
}

/// Runs up to the stop time, where the last step ends.
fn up_to_the_stop(writer: &mut Writer, trajectory: &Trajectory) {
    writer.make(0);
    writer.enter_with(0, None, writer.description.start_time, Some(trajectory.end));
    writer.write(0, &[Leave, ALL, Free]);
}

/// Enables all log categories together and one at a time: after instantiation, in Initialization Mode, after it, and after two steps.
fn logging(writer: &mut Writer, _: &Trajectory) {
    let categories: Vec<Option<Vec<u8>>> =
        writer.description.log_categories.iter().map(|name| Some(name.clone().into_bytes())).collect();
    for part in [Make, Enter, Leave, Points(2)] {
        writer.write(0, &[part]);
        writer.call(0, "SetDebugLogging", vec![Arg::Integer(1), Arg::Integer(0), Arg::Null]);
        let all = std::iter::once(categories.clone()).filter(|all| !all.is_empty());
        for some in all.chain(categories.iter().map(|category| vec![category.clone()])) {
            let count = Arg::Integer(some.len() as i64);
            writer.call(0, "SetDebugLogging", vec![Arg::Integer(1), count, Arg::Strings(some)]);
        }
    }
    writer.free(0);
}

/// Enters Event Mode at every point, which importers may do at any time.
fn events_everywhere(writer: &mut Writer, trajectory: &Trajectory) {
    writer.begin(0);
    for point in &trajectory.points {
        writer.point(0, point);
        if !point.event {
            writer.event(0);
        }
    }
    writer.write(0, &[ReadAll, Free]);
}

fn event_mode(writer: &mut Writer, trajectory: &Trajectory) {
    writer.make_with(0, |how| how.event_mode = true);
    writer.write(0, &[Enter, Call("ExitInitializationMode"), Part::Update, Call("EnterStepMode")]);
    let size = trajectory.points.first().map_or(1e-3, |point| point.size);
    writer.step(0, writer.description.start_time, size);
    writer.event(0);
    writer.write(0, &[ReadAll, TERMINATE, Free]);
}

/// Checks the call sequences of `SEQUENCES` and `WRITTEN_SEQUENCES`, a wrong token, unloading the library, the exit of the process
/// and a step beyond the stop time.
pub fn sequences(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    for parts in SEQUENCES {
        let mut writer = checker.writer(trajectory);
        writer.write(0, parts);
        check_sequence(checker, writer)?;
    }
    for (_, write) in WRITTEN_SEQUENCES.iter().filter(|(fits, _)| fits.fit(checker, trajectory)) {
        let mut writer = checker.writer(trajectory);
        write(&mut writer, trajectory);
        check_sequence(checker, writer)?;
    }
    token(checker, trajectory)?;
    unload(checker, trajectory)?;
    beyond(checker, trajectory)
}

/// Checks that FreeInstance ignores NULL.
pub fn free_null(checker: &Checker) -> anyhow::Result<()> {
    checker.check("life_cycle.free-null", checker.step(Step::Free(NULL_INSTANCE), true), |_| None)
}

/// Checks that a step beyond the stop time fails.
fn beyond(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let Some(last) = trajectory.points.last().filter(|_| trajectory.is_stepped()) else { return Ok(()) };
    let mut writer = checker.writer(trajectory);
    writer.make(0);
    writer.enter_with(0, None, checker.description.start_time, Some(trajectory.end));
    let ids = writer.write(0, &[Leave, ALL]).ids;
    writer.forbidden = true;
    let id = writer.step(0, trajectory.end, last.size);
    let end = trajectory.end;
    checker.check("life_cycle.stop-time", writer.sequence, move |run| {
        let succeeded = ids.iter().chain([&id]).all(|id| run.succeeds(*id));
        succeeded.then(|| format!("a step that starts at the stop time {end:?} succeeds"))
    })
}

/// Checks that the library can be unloaded and loaded again, and the process can exit, after all instances were freed.
fn unload(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    for (name, step, times) in [("life_cycle.unload", Step::Unload, 2), ("life_cycle.exit", Step::Quit, 1)] {
        let mut writer = checker.writer(trajectory);
        for _ in 0..times {
            writer.write(0, &[Begin, Points(2), TERMINATE, Free]);
            writer.add(step.clone());
        }
        checker.check(name, writer.sequence, |_| None)?;
    }
    Ok(())
}

/// Checks that instantiation fails for a wrong guid or instantiationToken.
fn token(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    writer.forbidden = true;
    let id = writer.make_with(0, |how| how.token = "no token of this FMU".to_owned());
    checker.check("life_cycle.token", writer.sequence, move |run| {
        (run.status(id) == Some(1))
            .then(|| "instantiation succeeds with the token \"no token of this FMU\"".to_owned())
    })
}

/// Checks random sequences of allowed calls.
pub fn random(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut random = Random::new(checker.seed);
    for _ in 0..checker.at_most(20) {
        let mut writer = checker.writer(trajectory);
        // Mode: 0 instantiated, 1 initialization, 2 at a point of the trajectory, 3 terminated.
        let (mut mode, mut at) = (0, 0);
        let mut saved: Option<(i32, usize)> = None;
        writer.make(0);
        for _ in 0..40 {
            let part = match (mode, random.below(10)) {
                (0, 0..=6) => {
                    mode = 1;
                    Enter
                }
                (1, 0..=4) => {
                    (mode, at) = (2, 0);
                    Leave
                }
                (2, 0..=4) if at < trajectory.points.len() => {
                    writer.point(0, &trajectory.points[at]);
                    at += 1;
                    continue;
                }
                (2, 5) => {
                    mode = 3;
                    TERMINATE
                }
                (_, 6) if random.below(3) == 0 => {
                    (mode, at) = (0, 0);
                    RESET
                }
                (_, 7) if checker.saves(trajectory.interface) => {
                    saved = Some((mode, at));
                    Save(0)
                }
                (_, 8) if saved.is_some() => {
                    (mode, at) = saved.unwrap_or((mode, at));
                    Restore(0)
                }
                (1..=3, _) => ReadAll,
                _ => continue,
            };
            writer.write(0, &[part]);
        }
        if saved.is_some() && random.below(2) == 0 {
            writer.write(0, &[Drop(0)]);
        }
        writer.free(0);
        check_sequence(checker, writer)?;
    }
    Ok(())
}

/// Checks that the next time event is in the future, also if the importer has skipped time events; that event iterations end; and
/// that changed states are reported.
pub fn events(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    changed_states(checker, trajectory)?;
    let fmi3 = checker.fmi3();
    let mut writer = checker.writer(trajectory);
    let ids = writer.begin(0);
    let mut points = vec![(ids, checker.description.start_time)];
    for point in &trajectory.points {
        let mut ids = writer.point(0, point);
        if !point.event {
            ids.extend(writer.event(0));
        }
        points.push((ids, point.time));
    }
    checker.check("life_cycle.next-event-time", writer.sequence, move |run| {
        let mut all = points.iter().flat_map(|(ids, time)| ids.iter().map(move |id| (*id, *time)));
        all.find_map(|(id, time)| {
            let event = event(run, id, fmi3)?;
            let past = !event.again && event.next? <= time;
            past.then(|| format!("at {time:?} the next event is at {:?}", event.next.unwrap_or_default()))
        })
    })?;
    // The importer has skipped time events.
    let late = trajectory.end.abs() * 10.0 + 10.0;
    let mut writer = checker.writer(trajectory);
    writer.begin(0);
    writer.forbidden = true;
    writer.call(0, "SetTime", vec![Arg::real(late)]);
    let ids = writer.write(0, &[Call("EnterEventMode"), Part::Update]).ids;
    checker.check("life_cycle.late-event", writer.sequence, move |run| {
        let event = event(run, *ids.last()?, fmi3)?;
        let next = event.next.filter(|next| !event.again && *next <= late)?;
        Some(format!("after time events were skipped, at {late:?} the next event is at {next:?}"))
    })?;
    let mut writer = checker.writer(trajectory);
    writer.write(0, &[Make, Enter, Call("ExitInitializationMode")]);
    let id = writer.update(0);
    checker.check("life_cycle.event-iteration", writer.sequence, move |run| {
        let again = event(run, id, fmi3)?.again;
        again.then(|| format!("after {MOST_UPDATES} updates of the discrete states another one is needed"))
    })
}

/// Checks that an event that changes states reports it; otherwise importers continue with the old states.
fn changed_states(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let count = checker.description.states_count().unwrap_or(0);
    if count == 0 {
        return Ok(());
    }
    let mut writer = checker.writer(trajectory);
    writer.begin(0);
    let mut points = Vec::new();
    for point in &trajectory.points {
        writer.point(0, &Point { event: false, ..point.clone() });
        let before = writer.vector(0, "GetContinuousStates", count);
        // Event Mode may be entered without an event.
        let updates = writer.event(0);
        let after = writer.vector(0, "GetContinuousStates", count);
        points.push((point.time, before, updates, after));
    }
    let fmi3 = checker.fmi3();
    checker.check("life_cycle.states-changed", writer.sequence, move |run| {
        points.iter().find_map(|(time, before, updates, after)| {
            // A call that fails is a separate finding.
            let updates = &updates[1..updates.len() - 1];
            let is_reported = |id: &u32| event(run, *id, fmi3).is_none_or(|event| event.states_changed);
            let (was, is) = (run.written(*before)?, run.written(*after)?);
            let succeeded = [before, after].iter().all(|id| run.succeeds(**id));
            let index = was.differ(is).filter(|_| succeeded && !updates.iter().any(is_reported))?;
            let (was, is) = (was.show(index), is.show(index));
            Some(format!("at {time:?} state {} was {was}, after the event it is {is}", index + 1))
        })
    })
}

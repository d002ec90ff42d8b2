//! Checks that instances accept the call sequences that the standard allows, and reject a wrong token and a step beyond the stop
//! time. Also checks the events of Model Exchange.

use super::Fits::{self, Always, Integrated, Several, Stepped};
use crate::call_sequence::{Action, Arg, NULL_INSTANCE, Run};
use crate::checker::Checker;
use crate::description::Variable;
use crate::finding::{event, first_failure};
use crate::worker::MOST_UPDATES;
use crate::writer::Part::{
    self, Begin, Call, Drop, Enter, Free, Leave, Make, Points, ReadAll, Restore, Save,
};
use crate::writer::{LONG_NAME, Point, Trajectory, Writer};
use fmi_abi::calls::Random;
use std::sync::Arc;

/// Checks that all calls of a sequence succeed.
fn check_sequence(checker: &Checker, writer: Writer) -> anyhow::Result<()> {
    let copy = writer.sequence.clone();
    // The FMU may return Discard (2), because it may need a smaller step.
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

/// Function that writes a call sequence that cannot be expressed as a list of `Part`.
type WriteSequence = fn(&mut Writer, &Trajectory);

/// Functions that write call sequences, each with the condition that the simulation must meet.
const WRITTEN_SEQUENCES: &[(Fits, WriteSequence)] = &[
    (Several, many),
    (Always, long_name),
    (Stepped, up_to_the_stop),
    (Always, logging),
    (Integrated, events_everywhere),
    (Fits::EventMode, event_mode),
];

/// Makes twenty instances, because some FMUs support only a fixed number of them. Four are initialized, two of these are
/// simulated, and all four are freed in an order other than the order of their instantiation.
fn many(writer: &mut Writer, _: &Trajectory) {
    (4..20).for_each(|instance| drop(writer.write(instance, &[Make])));
    (0..4).for_each(|instance| drop(writer.write(instance, &[Begin])));
    (4..20).for_each(|instance| drop(writer.write(instance, &[Free])));
    let two = Points(2);
    for (instance, part) in [(0, Free), (1, two), (3, Free), (2, two), (2, Free), (1, Free)] {
        writer.write(instance, &[part]);
    }
}

/// Simulates an instance whose name has spaces and characters beyond ASCII, with a stop time and a tolerance.
fn long_name(writer: &mut Writer, trajectory: &Trajectory) {
    writer.make_with(0, |make| make.name = LONG_NAME.to_owned());
    let stop = trajectory.end + 1.0 + trajectory.end.abs();
    writer.enter_with(0, Some(1e-6), writer.description.start_time, Some(stop));
    writer.write(0, &[Leave, Points(3), Free]);
}

/// Simulates up to the stop time, where the last step ends.
fn up_to_the_stop(writer: &mut Writer, trajectory: &Trajectory) {
    writer.make(0);
    writer.enter_with(0, None, writer.description.start_time, Some(trajectory.end));
    writer.write(0, &[Leave, ALL, Free]);
}

/// Enables all log categories together and one at a time: after instantiation, in Initialization Mode, after it, and after two steps.
fn logging(writer: &mut Writer, _: &Trajectory) {
    let categories: Vec<Option<Vec<u8>>> =
        writer.description.log_categories.iter().map(|of| Some(of.name.clone().into_bytes())).collect();
    for part in [Make, Enter, Leave, Points(2)] {
        writer.write(0, &[part]);
        writer.call(0, "SetDebugLogging", vec![Arg::Integer(1), Arg::Integer(0), Arg::Null]);
        let all = std::iter::once(categories.clone()).filter(|all| !all.is_empty());
        for enabled in all.chain(categories.iter().map(|category| vec![category.clone()])) {
            let count = Arg::Integer(enabled.len() as i64);
            writer.call(0, "SetDebugLogging", vec![Arg::Integer(1), count, Arg::Strings(enabled)]);
        }
    }
    writer.free(0);
}

/// Enters Event Mode at every point, because importers may enter it at any time.
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

/// Enters Event Mode after a step, with `eventModeUsed`.
fn event_mode(writer: &mut Writer, trajectory: &Trajectory) {
    writer.make_with(0, |make| make.event_mode = true);
    writer.write(0, &[Enter, Call("ExitInitializationMode"), Part::Update, Call("EnterStepMode")]);
    let size = trajectory.points.first().map_or(1e-3, |point| point.size);
    writer.step(0, writer.description.start_time, size);
    writer.event(0);
    writer.write(0, &[ReadAll, TERMINATE, Free]);
}

/// Checks the call sequences of `SEQUENCES` and `WRITTEN_SEQUENCES`, then a wrong token, the unloading of the library, the exit of the
/// process, and a step beyond the stop time.
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
    beyond_stop_time(checker, trajectory)
}

/// Checks that FreeInstance ignores NULL.
pub fn free_null(checker: &Checker) -> anyhow::Result<()> {
    checker.check("life_cycle.free-null", checker.only(Action::Free(NULL_INSTANCE), true), |_| None)
}

/// Checks that a step beyond the stop time fails.
fn beyond_stop_time(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
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

/// Checks that, after all instances were freed, the library can be unloaded and loaded again, and the process can exit.
fn unload(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    for (name, action, times) in
        [("life_cycle.unload", Action::Unload, 2), ("life_cycle.exit", Action::Quit, 1)]
    {
        let mut writer = checker.writer(trajectory);
        for _ in 0..times {
            writer.write(0, &[Begin, Points(2), TERMINATE, Free]);
            writer.add(action.clone());
        }
        checker.check(name, writer.sequence, |_| None)?;
    }
    Ok(())
}

/// Checks that instantiation fails for a wrong guid or instantiationToken.
fn token(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    writer.forbidden = true;
    let id = writer.make_with(0, |make| make.token = "no token of this FMU".to_owned());
    checker.check("life_cycle.token", writer.sequence, move |run| {
        (run.status(id) == Some(1))
            .then(|| "instantiation succeeds with the token \"no token of this FMU\"".to_owned())
    })
}

/// State of an instance in a random call sequence.
#[derive(Clone, Copy)]
enum State {
    Instantiated,
    Initializing,
    /// Before the point of the trajectory with this index, or after the last one.
    AtPoint(usize),
    Terminated,
}

/// State of the instance, and the state that was last saved.
struct RandomCalls {
    state: State,
    saved: Option<State>,
}

impl RandomCalls {
    /// Adds a random part that the state allows, or nothing.
    fn add(&mut self, writer: &mut Writer, random: &mut Random, can_save: bool) {
        let trajectory = writer.trajectory;
        let part = match (self.state, random.below(10)) {
            (State::Instantiated, 0..=6) => {
                self.state = State::Initializing;
                Enter
            }
            (State::Initializing, 0..=4) => {
                self.state = State::AtPoint(0);
                Leave
            }
            (State::AtPoint(index), 0..=4) if index < trajectory.points.len() => {
                self.state = State::AtPoint(index + 1);
                writer.point(0, &trajectory.points[index]);
                return;
            }
            (State::AtPoint(_), 5) => {
                self.state = State::Terminated;
                TERMINATE
            }
            (_, 6) if random.below(3) == 0 => {
                self.state = State::Instantiated;
                RESET
            }
            (_, 7) if can_save => {
                self.saved = Some(self.state);
                Save(0)
            }
            (_, 8) if self.saved.is_some() => {
                self.state = self.saved.unwrap_or(self.state);
                Restore(0)
            }
            (State::Instantiated, _) => return,
            _ => ReadAll,
        };
        writer.write(0, &[part]);
    }
}

/// Checks random sequences of allowed calls.
pub fn random(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut random = Random::mixed(checker.seed);
    let can_save = checker.saves(trajectory.interface);
    for _ in 0..checker.at_most(20) {
        let mut writer = checker.writer(trajectory);
        let mut calls = RandomCalls { state: State::Instantiated, saved: None };
        writer.make(0);
        for _ in 0..40 {
            calls.add(&mut writer, &mut random, can_save);
        }
        // In about half of these sequences, the instance is freed although it still has a saved state.
        if calls.saved.is_some() && random.below(2) == 0 {
            writer.write(0, &[Drop(0)]);
        }
        writer.free(0);
        check_sequence(checker, writer)?;
    }
    Ok(())
}

/// Checks events of Model Exchange: changed states are reported, the next time event is in the future, and the event iteration
/// after the initialization ends.
pub fn events(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    changed_states(checker, trajectory)?;
    next_event_time(checker, trajectory)?;
    late_event(checker, trajectory)?;
    event_iteration(checker, trajectory)
}

/// Checks that the next time event is in the future after Event Mode at each point.
fn next_event_time(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
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
            let is_past = !event.again && event.next? <= time;
            is_past.then(|| format!("at {time:?} the next event is at {:?}", event.next.unwrap_or_default()))
        })
    })
}

/// Checks that the next time event is in the future after an importer has skipped time events, although the standard forbids
/// skipping them.
fn late_event(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let fmi3 = checker.fmi3();
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
    })
}

/// Checks that the event iteration after the initialization ends.
fn event_iteration(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let fmi3 = checker.fmi3();
    let mut writer = checker.writer(trajectory);
    writer.write(0, &[Make, Enter, Call("ExitInitializationMode")]);
    let id = writer.update(0);
    checker.check("life_cycle.event-iteration", writer.sequence, move |run| {
        let again = event(run, id, fmi3)?.again;
        again.then(|| format!("after {MOST_UPDATES} updates of the discrete states another one is needed"))
    })
}

/// Checks that an event that changes states reports the change, because importers otherwise continue with the old states, and that the
/// description declares which states events change, because importers may treat the others as continuous.
fn changed_states(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let count = checker.description.states_count();
    if count == 0 {
        return Ok(());
    }
    let mut writer = checker.writer(trajectory);
    writer.begin(0);
    let mut points = Vec::new();
    for point in &trajectory.points {
        writer.point(0, &Point { event: false, ..point.clone() });
        let before = writer.vector(0, "GetContinuousStates", count);
        // Importers may enter Event Mode without an event.
        let updates = writer.event(0);
        let after = writer.vector(0, "GetContinuousStates", count);
        points.push((point.time, before, updates, after));
    }
    let fmi3 = checker.fmi3();
    // The variable of each element of the state vector.
    let states = checker.description.states().into_iter();
    let states: Vec<Variable> = states
        .map(|index| checker.description.variables[index].clone())
        .flat_map(|state| vec![state.clone(); state.size.unwrap_or(1)])
        .collect();
    let change = move |run: &Run, is_wrong: &dyn Fn(bool, Option<&Variable>) -> bool| {
        points.iter().find_map(|(time, before, updates, after)| {
            // The first and the last call enter and leave Event Mode. A failed update counts as reported, because it is another finding.
            let updates = &updates[1..updates.len() - 1];
            let is_reported = |id: &u32| event(run, *id, fmi3).is_none_or(|event| event.states_changed);
            let is_reported = updates.iter().any(is_reported);
            let [was, is] = [before, after].map(|id| run.written(*id).filter(|_| run.succeeds(*id)));
            let (was, is) = (was?, is?);
            let differs = |index: &usize| was.part(*index, 1) != is.part(*index, 1);
            let index = (0..count).filter(differs).find(|index| is_wrong(is_reported, states.get(*index)))?;
            let name = states.get(index).map_or_else(|| format!("state {}", index + 1), |of| of.name.clone());
            Some(format!(
                "at {time:?} {name} was {}, after the event it is {}",
                was.show(index),
                is.show(index)
            ))
        })
    };
    let change = Arc::new(change);
    let silent = Arc::clone(&change);
    let run = checker.evaluate("life_cycle.states-changed", writer.sequence.clone(), move |run| {
        silent(run, &|is_reported, _| !is_reported)
    })?;
    checker.record("life_cycle.reinit", &run, &writer.sequence, move |run| {
        change(run, &|is_reported, state| is_reported && state.is_some_and(|state| !state.reinit))
    });
    Ok(())
}

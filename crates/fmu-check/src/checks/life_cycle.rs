//! The life of an instance in every order that the standard allows.

use crate::call_sequence::{Arg, Step};
use crate::checker::Checker;
use crate::finding::Judge;
use crate::finding::{event, refused, refused_one};
use crate::writer::{Point, Trajectory, Writer};
use fmi_abi::Interface;
use std::sync::Arc;

fn play(checker: &Checker, writer: Writer) -> anyhow::Result<()> {
    let sequence = writer.sequence;
    let copy = sequence.clone();
    let judge: Judge = Arc::new(move |run| {
        let ids: Vec<u32> = copy
            .iter()
            .filter(|numbered| matches!(numbered.step, Step::Call { .. }))
            .map(|numbered| numbered.id)
            .collect();
        let makes = copy.iter().filter(|numbered| matches!(numbered.step, Step::Make(..)));
        // Discard is an answer for what needs a smaller step.
        let error = |id: &&u32| run.status(**id).is_some_and(|status| status > 2);
        makes
            .filter_map(|numbered| refused_one(&copy, run, numbered.id))
            .next()
            .or_else(|| ids.iter().find(error).and_then(|id| refused(&copy, run, &[*id])))
    });
    checker.judge("life_cycle.refused", sequence, judge)?;
    Ok(())
}

/// An order of calls, and whether it is one for a trajectory.
type Order = (fn(&Checker, &Trajectory) -> bool, fn(&mut Writer, &Trajectory));

/// Orders that importers are observed to use, and those at the edges.
const ORDERS: &[Order] = &[
    (always, made_only),
    (always, initialized_only),
    (always, ended_at_once),
    (always, run_twice),
    (always, reset_everywhere),
    (several, many),
    (always, long_name),
    (stepped, up_to_the_stop),
    (always, logging),
    (integrated, events_everywhere),
    (with_event_mode, event_mode),
];

fn always(_: &Checker, _: &Trajectory) -> bool {
    true
}

fn several(checker: &Checker, trajectory: &Trajectory) -> bool {
    checker.several(trajectory.interface)
}

fn stepped(_: &Checker, trajectory: &Trajectory) -> bool {
    trajectory.interface == Interface::CoSimulation
}

fn integrated(_: &Checker, trajectory: &Trajectory) -> bool {
    trajectory.interface == Interface::ModelExchange
}

fn with_event_mode(checker: &Checker, trajectory: &Trajectory) -> bool {
    stepped(checker, trajectory) && checker.fmi3() && checker.can(trajectory.interface, &["hasEventMode"])
}

fn points(writer: &mut Writer, of: usize, trajectory: &Trajectory, count: usize) {
    for point in trajectory.points.iter().take(count) {
        writer.point(of, trajectory, point);
    }
}

fn made_only(writer: &mut Writer, trajectory: &Trajectory) {
    writer.make(0, trajectory.interface);
    writer.free(0);
}

fn initialized_only(writer: &mut Writer, trajectory: &Trajectory) {
    writer.make(0, trajectory.interface);
    writer.enter(0);
    writer.ask(0, trajectory.interface);
    writer.free(0);
}

fn ended_at_once(writer: &mut Writer, trajectory: &Trajectory) {
    writer.begin(0, trajectory);
    writer.call(0, "Terminate", vec![]);
    writer.ask(0, trajectory.interface);
    writer.free(0);
}

fn run_twice(writer: &mut Writer, trajectory: &Trajectory) {
    writer.begin(0, trajectory);
    points(writer, 0, trajectory, usize::MAX);
    writer.call(0, "Terminate", vec![]);
    writer.ask(0, trajectory.interface);
    writer.call(0, "Reset", vec![]);
    writer.enter(0);
    writer.leave(0, trajectory);
    points(writer, 0, trajectory, usize::MAX);
    writer.ask(0, trajectory.interface);
    writer.free(0);
}

fn reset_everywhere(writer: &mut Writer, trajectory: &Trajectory) {
    writer.make(0, trajectory.interface);
    writer.call(0, "Reset", vec![]);
    writer.enter(0);
    writer.call(0, "Reset", vec![]);
    writer.call(0, "Reset", vec![]);
    writer.enter(0);
    writer.leave(0, trajectory);
    writer.call(0, "Reset", vec![]);
    writer.enter(0);
    writer.leave(0, trajectory);
    points(writer, 0, trajectory, 2);
    writer.free(0);
}

/// More instances than a pool may have, and four that are freed in another order.
fn many(writer: &mut Writer, trajectory: &Trajectory) {
    for of in 4..20 {
        writer.make(of, trajectory.interface);
    }
    for of in 0..4 {
        writer.begin(of, trajectory);
    }
    for of in 4..20 {
        writer.free(of);
    }
    writer.free(0);
    points(writer, 1, trajectory, 2);
    writer.free(3);
    points(writer, 2, trajectory, 2);
    writer.free(2);
    writer.free(1);
}

/// A name with spaces and letters beyond ASCII; a stop time and a tolerance.
fn long_name(writer: &mut Writer, trajectory: &Trajectory) {
    let mut how = writer.how(trajectory.interface);
    how.name = Some("a long name, with Gödel in it %s #1#".to_owned());
    writer.add(Step::Make(0, how));
    let stop = trajectory.end + 1.0 + trajectory.end.abs();
    writer.enter_with(0, Some(1e-6), writer.description.start_time, Some(stop));
    writer.leave(0, trajectory);
    points(writer, 0, trajectory, 3);
    writer.free(0);
}

/// The last step meets the stop time.
fn up_to_the_stop(writer: &mut Writer, trajectory: &Trajectory) {
    writer.make(0, trajectory.interface);
    writer.enter_with(0, None, writer.description.start_time, Some(trajectory.end));
    writer.leave(0, trajectory);
    points(writer, 0, trajectory, usize::MAX);
    writer.free(0);
}

/// Categories, all and each, in every mode.
fn logging(writer: &mut Writer, trajectory: &Trajectory) {
    let categories: Vec<Option<Vec<u8>>> =
        writer.description.log_categories.iter().map(|name| Some(name.clone().into_bytes())).collect();
    let log = |writer: &mut Writer| {
        writer.call(0, "SetDebugLogging", vec![Arg::Whole(1), Arg::Whole(0), Arg::Null]);
        let all = std::iter::once(categories.clone()).filter(|all| !all.is_empty());
        for some in all.chain(categories.iter().map(|category| vec![category.clone()])) {
            let count = Arg::Whole(some.len() as i64);
            writer.call(0, "SetDebugLogging", vec![Arg::Whole(1), count, Arg::Texts(some)]);
        }
    };
    writer.make(0, trajectory.interface);
    log(writer);
    writer.enter(0);
    log(writer);
    writer.leave(0, trajectory);
    log(writer);
    points(writer, 0, trajectory, 2);
    log(writer);
    writer.free(0);
}

/// An event at every point: importers may enter Event Mode at any time.
fn events_everywhere(writer: &mut Writer, trajectory: &Trajectory) {
    writer.begin(0, trajectory);
    for point in &trajectory.points {
        writer.point(0, trajectory, point);
        if point.updates == 0 {
            writer.call(0, "EnterEventMode", vec![]);
            // Whether more are needed is not known here: as many as an event needs.
            writer.update(0, 3);
            writer.call(0, "EnterContinuousTimeMode", vec![]);
        }
    }
    writer.ask(0, trajectory.interface);
    writer.free(0);
}

fn event_mode(writer: &mut Writer, trajectory: &Trajectory) {
    let mut how = writer.how(trajectory.interface);
    how.event_mode = true;
    writer.add(Step::Make(0, how));
    writer.enter(0);
    writer.call(0, "ExitInitializationMode", vec![]);
    writer.update(0, 3);
    writer.call(0, "EnterStepMode", vec![]);
    let start = writer.description.start_time;
    let size = trajectory.points.first().map_or(1e-3, |point| point.size);
    writer.step(0, start, size);
    writer.call(0, "EnterEventMode", vec![]);
    writer.update(0, 3);
    writer.call(0, "EnterStepMode", vec![]);
    writer.ask(0, trajectory.interface);
    writer.call(0, "Terminate", vec![]);
    writer.free(0);
}

/// All orders of the table, and the edges of a life.
pub fn orders(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in &checker.trajectories {
        for (_, write) in ORDERS.iter().filter(|(fits, _)| fits(checker, trajectory)) {
            let mut writer = checker.writer();
            write(&mut writer, trajectory);
            play(checker, writer)?;
        }
        token(checker, trajectory)?;
        unload(checker, trajectory)?;
        beyond(checker, trajectory)?;
    }
    super::hostile::free_null(checker)
}

/// A step that goes beyond the stop time fails.
fn beyond(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let Some(last) = trajectory.points.last().filter(|_| trajectory.interface == Interface::CoSimulation)
    else {
        return Ok(());
    };
    let mut writer = checker.writer();
    writer.make(0, trajectory.interface);
    writer.enter_with(0, None, checker.description.start_time, Some(trajectory.end));
    let mut ids = writer.leave(0, trajectory);
    for point in &trajectory.points {
        ids.extend(writer.point(0, trajectory, point));
    }
    writer.forbidden = true;
    let id = writer.step(0, trajectory.end, last.size);
    let end = trajectory.end;
    let judge: Judge = Arc::new(move |run| {
        let good = |id: &u32| run.status(*id).is_some_and(|status| status <= 1);
        (ids.iter().all(good) && good(&id)).then(|| format!("a step from the stop time {end:?} on succeeds"))
    });
    checker.judge("life_cycle.stop-time", writer.sequence, judge)?;
    Ok(())
}

/// After all instances were freed, the library can be unloaded and loaded again, and the process can exit.
fn unload(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    for (name, step) in [("life_cycle.unload", Step::Unload), ("life_cycle.exit", Step::Quit)] {
        let mut writer = checker.writer();
        for _ in 0..2 {
            writer.begin(0, trajectory);
            for point in trajectory.points.iter().take(2) {
                writer.point(0, trajectory, point);
            }
            writer.call(0, "Terminate", vec![]);
            writer.free(0);
            writer.add(step.clone());
            if step == Step::Quit {
                break;
            }
        }
        let nothing: Judge = Arc::new(|_| None);
        checker.judge(name, writer.sequence, nothing)?;
    }
    Ok(())
}

/// The library of another description is not this one's.
fn token(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    let mut how = writer.how(trajectory.interface);
    how.token = Some("no token of this FMU".to_owned());
    writer.forbidden = true;
    let id = writer.add(Step::Make(0, how));
    let judge: Judge = Arc::new(move |run| {
        (run.status(id) == Some(1)).then(|| "an instance is made for another one".to_owned())
    });
    checker.judge("life_cycle.token", writer.sequence, judge)?;
    Ok(())
}

/// Calls in an order that chance chooses among what is allowed.
pub fn random(checker: &Checker) -> anyhow::Result<()> {
    let mut state = checker.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut pick = |below: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % below
    };
    for trajectory in &checker.trajectories {
        for _ in 0..checker.most(20) {
            let mut writer = checker.writer();
            // Instantiated, in Initialization Mode, at a point of the trajectory, terminated.
            let (mut mode, mut at) = (0, 0);
            let mut saved: Option<(i32, usize)> = None;
            writer.make(0, trajectory.interface);
            for _ in 0..40 {
                match (mode, pick(10)) {
                    (0, 0..=6) => {
                        writer.enter(0);
                        mode = 1;
                    }
                    (1, 0..=4) => {
                        writer.leave(0, trajectory);
                        (mode, at) = (2, 0);
                    }
                    (2, 0..=4) if at < trajectory.points.len() => {
                        writer.point(0, trajectory, &trajectory.points[at]);
                        at += 1;
                    }
                    (2, 5) => {
                        writer.call(0, "Terminate", vec![]);
                        mode = 3;
                    }
                    (_, 6) if pick(3) == 0 => {
                        writer.call(0, "Reset", vec![]);
                        (mode, at) = (0, 0);
                    }
                    (_, 7) if checker.saves(trajectory.interface) => {
                        writer.save(0, 0);
                        saved = Some((mode, at));
                    }
                    (_, 8) => {
                        if let Some(of) = saved {
                            writer.restore(0, 0);
                            (mode, at) = of;
                        }
                    }
                    (1..=3, _) => {
                        writer.ask(0, trajectory.interface);
                    }
                    _ => {}
                }
            }
            if saved.is_some() && pick(2) == 0 {
                writer.drop_state(0, 0);
            }
            writer.free(0);
            play(checker, writer)?;
        }
    }
    Ok(())
}

/// Time events lie ahead, and come to an end.
pub fn events(checker: &Checker) -> anyhow::Result<()> {
    let Some(trajectory) =
        checker.trajectories.iter().find(|trajectory| trajectory.interface == Interface::ModelExchange)
    else {
        return Ok(());
    };
    changed_states(checker, trajectory)?;
    let mut writer = checker.writer();
    let mut asked: Vec<(u32, f64)> = Vec::new();
    let of_updates = |writer: &Writer, ids: &[u32], time: f64| -> Vec<(u32, f64)> {
        let update = |id: &&u32| {
            writer.sequence.iter().any(|numbered| {
                numbered.id == **id && crate::finding::step_name(&numbered.step).ends_with("DiscreteStates")
            })
        };
        ids.iter().filter(update).map(|id| (*id, time)).collect()
    };
    let ids = writer.begin(0, trajectory);
    asked.extend(of_updates(&writer, &ids, checker.description.start_time));
    for point in &trajectory.points {
        let mut ids = writer.point(0, trajectory, point);
        if point.updates == 0 {
            writer.call(0, "EnterEventMode", vec![]);
            ids.extend(writer.update(0, 3));
            writer.call(0, "EnterContinuousTimeMode", vec![]);
        }
        asked.extend(of_updates(&writer, &ids, point.time));
    }
    let fmi3 = checker.fmi3();
    let judge: Judge = Arc::new(move |run| {
        asked.iter().find_map(|(id, time)| {
            let event = event(run, *id, fmi3)?;
            let past = !event.again && event.next? <= *time;
            past.then(|| format!("at {time:?} the next event is at {:?}", event.next.unwrap_or_default()))
        })
    });
    checker.judge("life_cycle.next-event-time", writer.sequence, judge)?;
    // One who comes late, too, is told of an event that lies ahead.
    let late = trajectory.end.abs() * 10.0 + 10.0;
    let mut writer = checker.writer();
    writer.begin(0, trajectory);
    writer.forbidden = true;
    writer.call(0, "SetTime", vec![Arg::real(late)]);
    writer.call(0, "EnterEventMode", vec![]);
    let ids = writer.update(0, 3);
    let judge: Judge = Arc::new(move |run| {
        let last = *ids.last()?;
        let event = event(run, last, fmi3)?;
        let past = !event.again && event.next? <= late;
        past.then(|| {
            format!(
                "after events were passed by, at {late:?} the next event is at {:?}",
                event.next.unwrap_or_default()
            )
        })
    });
    checker.judge("life_cycle.late-event", writer.sequence, judge)?;
    // An event that needs more and more updates never ends.
    let mut writer = checker.writer();
    writer.make(0, trajectory.interface);
    writer.enter(0);
    writer.call(0, "ExitInitializationMode", vec![]);
    let ids = writer.update(0, 100);
    let judge: Judge = Arc::new(move |run| {
        let all = ids.iter().all(|id| event(run, *id, fmi3).is_some_and(|event| event.again));
        all.then(|| "after 100 updates of the discrete states another one is needed".to_owned())
    });
    checker.judge("life_cycle.event-iteration", writer.sequence, judge)?;
    Ok(())
}

/// An event that changes states says so: else importers go on with those that they have.
fn changed_states(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let count = checker.description.states_count().unwrap_or(0);
    if count == 0 {
        return Ok(());
    }
    let mut writer = checker.writer();
    writer.begin(0, trajectory);
    let mut asked = Vec::new();
    for point in &trajectory.points {
        writer.point(0, trajectory, &Point { updates: 0, ..point.clone() });
        let before = writer.vector(0, "GetContinuousStates", count);
        writer.call(0, "EnterEventMode", vec![]);
        // Entering Event Mode where nothing happens is allowed, too.
        let updates = writer.update(0, point.updates.max(3));
        writer.call(0, "EnterContinuousTimeMode", vec![]);
        let after = writer.vector(0, "GetContinuousStates", count);
        asked.push((point.time, before, updates, after));
    }
    let fmi3 = checker.fmi3();
    let judge: Judge = Arc::new(move |run| {
        asked.iter().find_map(|(time, before, updates, after)| {
            // A call that fails is a separate finding.
            let said = |id: &u32| event(run, *id, fmi3).is_none_or(|event| event.states_changed);
            let (was, is) = (run.written(*before)?, run.written(*after)?);
            let good = [before, after].iter().all(|id| run.status(**id).is_some_and(|status| status <= 1));
            let index = was.differ(is).filter(|_| good && !updates.iter().any(said))?;
            let (was, is) = (was.show(index), is.show(index));
            Some(format!("at {time:?} state {} was {was}, after the event it is {is}", index + 1))
        })
    });
    checker.judge("life_cycle.states-changed", writer.sequence, judge)?;
    Ok(())
}

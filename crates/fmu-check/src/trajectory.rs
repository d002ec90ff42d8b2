//! Finds a successful simulation, which most checks vary.

use crate::call_sequence::{Action, CallSequence, End, Run, Values, action_name, action_of};
use crate::checker::Checker;
use crate::description::Description;
use crate::finding::{Event, ending, failure, failure_of};
use crate::values::input_values;
use crate::writer::{Part, Point, Trajectory, Writer};
use fmi_abi::Interface;
use std::time::{Duration, Instant};

/// Maximum duration of a simulation with long steps, because checks repeat the simulation many times. The search for points in
/// Model Exchange may take 16 times as long.
const LONG: Duration = Duration::from_millis(250);

/// Reason why a simulation failed, and its call sequence.
#[derive(Debug)]
pub struct NoTrajectory(pub String, pub CallSequence);

impl std::fmt::Display for NoTrajectory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for NoTrajectory {}

/// Returns a successful simulation: in Co-Simulation steps with changing inputs, in Model Exchange an integration by Euler's
/// method with events.
///
/// # Errors
/// Fails with [`NoTrajectory`] if no simulation succeeds, or with [`Stop`](crate::run::Stop) if the check is stopped.
pub fn find_trajectory(checker: &Checker, interface: Interface) -> anyhow::Result<Trajectory> {
    let start = checker.description.start_time;
    let trajectory = Trajectory { interface, points: Vec::new(), end: start };
    match interface {
        Interface::CoSimulation if checker.description.event_mode() => with_events(checker, trajectory),
        Interface::CoSimulation => in_steps(checker, trajectory),
        Interface::ModelExchange => integrated(checker, trajectory),
    }
}

/// Returns the duration of the default experiment; 1 s if it has no stop time.
pub fn range(description: &Description) -> f64 {
    description.stop_time.map_or(1.0, |stop| stop - description.start_time).max(1e-6)
}

/// Returns the step size of the default experiment, or 1 % of its duration. It is rounded to a multiple of
/// `fixedInternalStepSize` if there is one (section 4.4.1 of FMI 3.0).
pub fn step_size(description: &Description) -> f64 {
    let size = description.step_size.unwrap_or(range(description) / 100.0);
    let internal = description.co_simulation.as_ref().and_then(|offer| offer.fixed_internal_step_size());
    internal.map_or(size, |internal| internal * (size / internal).round().clamp(1.0, 100.0))
}

/// Shortens a trajectory to its first `succeeded` points.
fn up_to(mut trajectory: Trajectory, succeeded: usize) -> Trajectory {
    trajectory.points.truncate(succeeded);
    if let Some(last) = trajectory.points.last() {
        trajectory.end = last.time + last.size;
    }
    trajectory
}

/// Finds successful steps without Event Mode. If the FMU allows several step sizes and is fast enough, the steps have two sizes
/// and reach the end of the default experiment, otherwise they have one size. Boolean inputs change, unless the steps succeed
/// only if they are constant.
fn in_steps(checker: &Checker, trajectory: Trajectory) -> anyhow::Result<Trajectory> {
    let description = &checker.description;
    let size = step_size(description);
    // A default experiment of less than 12 steps is too short for longer steps.
    let times = ((range(description) / size - 4.0) / 8.0).round().max(1.0);
    let far = checker.can(trajectory.interface, &["canHandleVariableCommunicationStepSize"]) && times > 1.0;
    for (reach, discrete) in [(times, true), (times, false), (1.0, true), (1.0, false)] {
        if reach > 1.0 && !far {
            continue;
        }
        let sizes: Vec<f64> = (0..12).map(|number| if number < 4 { size } else { reach * size }).collect();
        let points = steps(description, description.start_time, &sizes, discrete);
        let trajectory = Trajectory { points, ..trajectory.clone() };
        let mut writer = checker.writer(&trajectory);
        let ids = writer.write(0, &[Part::Begin, Part::Points(usize::MAX)]).ids;
        let begin = Instant::now();
        let run = checker.execute(&writer.sequence)?;
        if reach > 1.0 && (run.end != End::Done || begin.elapsed() > LONG) {
            continue;
        }
        made(checker, &run, &writer, ids[0])?;
        let (succeeded, discarded) = successful_steps(checker, &run, &writer.sequence);
        match failure(&writer.sequence, &run, &ids) {
            None => return Ok(up_to(trajectory, succeeded)),
            // The model has ended the simulation with Discard.
            Some(_) if discarded && succeeded >= 2 => return Ok(up_to(trajectory, succeeded)),
            Some(why) if !discrete && reach == 1.0 || is_fatal(&run, &ids) => {
                return Err(NoTrajectory(why, writer.sequence).into());
            }
            Some(_) => {}
        }
    }
    Ok(trajectory)
}

/// Returns whether one of these calls returned Fatal, which no value of an input excuses.
fn is_fatal(run: &Run, ids: &[u32]) -> bool {
    ids.iter().any(|id| run.status(*id) == Some(4))
}

/// Returns the number of steps before the first that fails, has an event, returns early or ends the simulation, and whether that
/// step returned Discard.
fn successful_steps(checker: &Checker, run: &Run, sequence: &CallSequence) -> (usize, bool) {
    let is_step =
        |action: &Action| matches!(action, Action::Call { function, .. } if function.ends_with("DoStep"));
    let ids = sequence.iter().filter(|numbered| is_step(&numbered.action)).map(|numbered| numbered.id);
    let mut succeeded = 0;
    for id in ids {
        let flags = run.outcome(id).map_or(&[][..], |outcome| &outcome.written);
        let flag = |index: usize| flags.get(index).is_some_and(|flag| flag.numbers().first() == Some(&1.0));
        // After an early return, the next step would have to begin at lastSuccessfulTime.
        if run.status(id).is_none_or(|status| status > 1) || checker.fmi3() && (0..3).any(flag) {
            return (succeeded, run.status(id) == Some(2));
        }
        succeeded += 1;
    }
    (succeeded, false)
}

/// Fails if the library cannot be loaded, the process ended before the last step returned, or the instantiation failed.
fn made(checker: &Checker, run: &Run, writer: &Writer, make: u32) -> anyhow::Result<()> {
    match checker
        .lacks(run)
        .or_else(|| ending(run, &writer.sequence))
        .or_else(|| failure_of(&writer.sequence, run, make))
    {
        Some(why) => Err(NoTrajectory(why, writer.sequence.clone()).into()),
        None => Ok(()),
    }
}

/// Initializes an instance; returns the result of the event iteration after the initialization.
fn initialized(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<Option<Event>> {
    let mut writer = checker.writer(trajectory);
    let ids =
        writer.write(0, &[Part::Make, Part::Enter, Part::Call("ExitInitializationMode"), Part::Update]).ids;
    let run = checker.execute(&writer.sequence)?;
    made(checker, &run, &writer, ids[0])?;
    match failure(&writer.sequence, &run, &ids[1..]) {
        Some(why) => Err(NoTrajectory(why, writer.sequence).into()),
        None => Ok(ids.last().and_then(|id| checker.event(&run, *id))),
    }
}

/// Results at a point; `slopes` are the derivatives.
#[derive(Default)]
struct Reached {
    states: Vec<f64>,
    slopes: Vec<f64>,
    indicators: Vec<f64>,
    /// Result of the event iteration at the point.
    event: Option<Event>,
    /// Whether the model ends the simulation or the step returns early.
    ends: bool,
}

/// Executes the trajectory and then `point`. If the FMU reports an event there, sets `point.event` and starts again. Returns
/// `None` if a call fails after at least three points.
fn reached(checker: &Checker, trajectory: &Trajectory, point: &mut Point) -> anyhow::Result<Option<Reached>> {
    loop {
        let mut writer = checker.writer(trajectory);
        let before = writer.write(0, &[Part::Begin, Part::Points(usize::MAX)]).ids;
        let here = writer.point(0, point);
        let vectors = if trajectory.is_stepped() { [None; 3] } else { writer.vectors(0) };
        let run = checker.execute(&writer.sequence)?;
        made(checker, &run, &writer, before[0])?;
        if let Some(why) = failure(&writer.sequence, &run, &[&before[1..], &here].concat()) {
            let few = trajectory.points.len() < 3 || is_fatal(&run, &here);
            return if few { Err(NoTrajectory(why, writer.sequence).into()) } else { Ok(None) };
        }
        let advances = |id: &&u32| {
            let name = action_of(&writer.sequence, **id).map(|numbered| action_name(&numbered.action));
            name.is_some_and(|name| name.ends_with("DoStep") || name.ends_with("CompletedIntegratorStep"))
        };
        // The results are flags for an event, the end of the simulation and, in Co-Simulation, an early return.
        let outputs = here
            .iter()
            .find(advances)
            .and_then(|id| run.outcome(*id))
            .map_or(&[][..], |outcome| &outcome.written);
        let flag = |index| {
            outputs.get(index).is_some_and(|outcome: &Values| outcome.numbers().first() == Some(&1.0))
        };
        if flag(1) || flag(2) {
            return Ok(Some(Reached { ends: true, ..Reached::default() }));
        }
        let event = here.iter().rev().find_map(|id| checker.event(&run, *id));
        if !point.event && flag(0) {
            point.event = true;
            continue;
        }
        let [states, slopes, indicators] =
            vectors.map(|id| id.and_then(|id| run.written(id)).map(Values::numbers).unwrap_or_default());
        return Ok(Some(Reached { states, slopes, indicators, event, ends: false }));
    }
}

/// Finds successful steps of Co-Simulation with Event Mode, and handles the events that they report.
fn with_events(checker: &Checker, mut trajectory: Trajectory) -> anyhow::Result<Trajectory> {
    initialized(checker, &trajectory)?;
    let description = &checker.description;
    for mut point in steps(description, description.start_time, &[step_size(description); 12], false) {
        let reached = reached(checker, &trajectory, &mut point)?;
        if reached.is_none_or(|reached| reached.ends) {
            break;
        }
        trajectory.end = point.time + point.size;
        trajectory.points.push(point);
    }
    Ok(trajectory)
}

/// Integrates by Euler's method, at most to about the end of the default experiment. The trajectory contains the first points,
/// then every twentieth point and all points with events, at most 21 points.
fn integrated(checker: &Checker, mut trajectory: Trajectory) -> anyhow::Result<Trajectory> {
    let description = &checker.description;
    let (count, range) = (description.states_count(), range(description));
    let small = match count {
        0 => range / 10.0,
        _ => (range / 500.0).min(description.step_size.unwrap_or(f64::INFINITY)),
    };
    let (near, far, count_max) = if count > 0 { (6, range / 160.0, 166) } else { (14, small, 14) };
    let mut next_event = initialized(checker, &trajectory)?.and_then(|event| event.next);
    let (mut states, mut slopes, mut before) = (Vec::new(), Vec::<f64>::new(), Vec::<f64>::new());
    let (mut time, mut event_now) = (description.start_time, false);
    let begin = Instant::now();
    for number in 0..count_max {
        if trajectory.points.len() > 20 || number >= near && begin.elapsed() > 16 * LONG {
            break;
        }
        // The first point is the start of the integration.
        let mut size = if number == 0 { 0.0 } else { [far, small][usize::from(number < near)] };
        if let Some(next) = next_event.filter(|next| *next > time) {
            // Without states, every third point is the next time event.
            if next <= time + size || count == 0 && number > 0 && number % 3 == 0 {
                size = next - time;
                event_now = true;
            }
        }
        time += size;
        for (state, slope) in states.iter_mut().zip(&slopes) {
            *state += size * slope;
        }
        let phase = if number < near { number } else { near + number / 20 };
        let (inputs, event) = (input_values(description, phase, false), event_now);
        let mut point = Point { time, size, inputs, states: states.clone(), event };
        let Some(reached) = reached(checker, &trajectory, &mut point)? else { return Ok(trajectory) };
        if reached.ends || reached.event.is_some_and(|event| event.terminate) {
            break;
        }
        next_event = reached.event.map_or(next_event, |event| event.next);
        (states, slopes) = (reached.states, reached.slopes);
        event_now =
            before.iter().zip(&reached.indicators).any(|(before, now)| (*before > 0.0) != (*now > 0.0));
        before = reached.indicators;
        if number < near || number % 20 == 0 || point.event {
            trajectory.points.push(point);
            trajectory.end = time;
        }
        if states.iter().chain(&slopes).any(|number| !number.is_finite() || number.abs() > 1e100) {
            break;
        }
    }
    Ok(trajectory)
}

/// Returns points for consecutive steps of these sizes, with inputs that change at each point.
pub fn steps(description: &Description, start: f64, sizes: &[f64], discrete: bool) -> Vec<Point> {
    let mut time = start;
    let points = sizes.iter().enumerate();
    points
        .map(|(number, &size)| {
            let point =
                Point { time, size, inputs: input_values(description, number, discrete), ..Point::default() };
            time += size;
            point
        })
        .collect()
}

//! Integrates Model Exchange with larger inputs, which cause more events than the usual simulation.

use crate::call_sequence::Values;
use crate::checker::Checker;
use crate::trajectory::step_size;
use crate::values::inputs_by;
use crate::writer::{Point, Trajectory};

/// Integration, and the points at which checks compare values.
pub struct Integrated {
    pub trajectory: Trajectory,
    /// Indices of at most `POINTS` points: first points with state events, then one with a time event, then points without events.
    pub chosen: Vec<usize>,
}

/// Maximum number of points of an integration at which checks compare values.
const POINTS: usize = 4;

/// Number of intervals of the integration.
const INTERVALS: usize = 40;

/// Integrates Model Exchange from the start of the default experiment. The points are the ends of the intervals and the time
/// events. A point has an event if the integration has handled one since the point before. So state events come somewhat late, as
/// in an importer that does not locate them. If fewer than two intervals succeed, returns the usual simulation.
pub fn integrate_with_events(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<Integrated> {
    let description = &checker.description;
    let size = step_size(description);
    // Events are unlikely at these ends of intervals, because the fraction is unusual.
    let end = |number: usize| description.start_time + (number as f64 + 0.381_966) * size;
    let ends: Vec<f64> = (0..INTERVALS).map(end).collect();
    let first = integrate(checker, trajectory, &ends)?;
    let time_events = first.iter().filter(|reached| reached.event.is_some() && !reached.is_state_event);
    let mut times: Vec<f64> =
        ends.into_iter().take(first.len()).chain(time_events.filter_map(|of| of.event)).collect();
    times.sort_by(f64::total_cmp);
    // The second integration ends intervals at the time events, too.
    let second = integrate(checker, trajectory, &times)?;
    if second.len() < 2 {
        let chosen = (0..trajectory.points.len()).take(POINTS).collect();
        return Ok(Integrated { trajectory: trajectory.clone(), chosen });
    }
    let kind = |reached: &Reached| (reached.event.is_some(), reached.is_state_event);
    let kinds: Vec<(bool, bool)> = second.iter().map(kind).collect();
    let of_kind = |kind: (bool, bool), count: usize| {
        kinds.iter().enumerate().filter(move |(_, of)| **of == kind).map(|(index, _)| index).take(count)
    };
    let mut chosen: Vec<usize> =
        of_kind((true, true), 2).chain(of_kind((true, false), 1)).chain(of_kind((false, false), 3)).collect();
    chosen.truncate(POINTS);
    let inputs = inputs_by(description, 0.5);
    let mut points: Vec<Point> = Vec::new();
    for (reached, time) in second.into_iter().zip(times) {
        let event = reached.event.is_some();
        let size = time - points.last().map_or(description.start_time, |point| point.time);
        points.push(Point { time, size, inputs: inputs.clone(), states: reached.states, event });
    }
    let end = points.last().map_or(trajectory.end, |point| point.time);
    Ok(Integrated { trajectory: Trajectory { interface: trajectory.interface, points, end }, chosen })
}

/// Result of the integration of an interval.
struct Reached {
    /// States at the end of the interval.
    states: Vec<f64>,
    /// Time of the first event, if there is one.
    event: Option<f64>,
    /// Whether the interval has an event other than a time event.
    is_state_event: bool,
}

/// Integrates intervals that end at these times. Returns the results of the intervals before the first one that fails.
fn integrate(checker: &Checker, trajectory: &Trajectory, times: &[f64]) -> anyhow::Result<Vec<Reached>> {
    let description = &checker.description;
    let states = description.states_count();
    let mut writer = checker.writer(trajectory);
    writer.begin_with(0, &inputs_by(description, 0.5));
    let mut begin = description.start_time;
    let mut calls = Vec::new();
    for end in times {
        let id = writer.integrate(0, begin, *end);
        calls.push((id, (states > 0).then(|| writer.vector(0, "GetContinuousStates", states))));
        begin = *end;
    }
    let run = checker.execute(&writer.sequence)?;
    let reached = |(id, vector): (u32, Option<u32>)| {
        let numbers = run.written(id).filter(|_| run.status(id) == Some(0))?.numbers();
        let states = match vector {
            Some(id) => run.written(id).filter(|_| run.succeeds(id)).map(Values::numbers)?,
            None => Vec::new(),
        };
        let is_finite = states.iter().all(|state| state.is_finite());
        let event = numbers.first().copied().filter(|time| time.is_finite());
        is_finite.then_some(Reached { states, event, is_state_event: numbers.get(2) != Some(&0.0) })
    };
    Ok(calls.into_iter().map_while(reached).collect())
}

//! Checks what `fmi3DoStep` returns at events, with `eventModeUsed` and with `earlyReturnAllowed`.

use crate::call_sequence::Run;
use crate::checker::Checker;
use crate::values::is_other_time;
use crate::writer::{Read, Trajectory, Writer, number_of};
use std::sync::Arc;

/// Checks steps with `eventModeUsed`, with `earlyReturnAllowed` and with both. A step may report an event or return early only if the
/// importer has agreed to it at the instantiation. The time that a step returns must be the value of the independent variable. A step
/// that stops at an event before its requested end must report an early return.
pub fn steps(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let time = checker.description.independent();
    let has_events = checker.can(trajectory.interface, &["hasEventMode"]);
    for (event_mode, early_return) in [(true, true), (true, false), (false, true)] {
        // An FMU with clocks needs Event Mode, and one that lacks Event Mode cannot use it.
        if event_mode && !has_events || !event_mode && checker.description.event_mode() {
            continue;
        }
        let mut writer = checker.writer(trajectory);
        let steps = Arc::new(execute_steps(checker, &mut writer, time, event_mode, early_return)?);
        let same_steps = Arc::clone(&steps);
        let run = checker.evaluate("results.early-return", writer.sequence.clone(), move |run| {
            same_steps.iter().find_map(|step| {
                let Returned { event, early, reached, .. } = returned_by(step, &same_steps, run)?;
                if early && !early_return {
                    return Some("a step returns early although earlyReturnAllowed is false".to_owned());
                }
                if event && !event_mode {
                    return Some(
                        "a step reports eventHandlingNeeded although eventModeUsed is false".to_owned(),
                    );
                }
                let now = number_of(run, &step.values, time?)?;
                let end = step.end;
                is_other_time(reached, now).then(|| {
                    format!("a step to {end:?} returned the lastSuccessfulTime {reached:?}, but the independent variable is {now:?}")
                })
            })
        })?;
        checker.record("results.early-unreported", &run, &writer.sequence, move |run| {
            steps.iter().find_map(|step| {
                let Returned { event, early, reached, .. } = returned_by(step, &steps, run)?;
                let end = step.end;
                let is_short = reached < end && is_other_time(reached, end);
                (is_short && event && !early).then(|| {
                    format!(
                        "a step to {end:?} ends at an event at {reached:?} and does not report earlyReturn"
                    )
                })
            })
        });
    }
    Ok(())
}

/// Step of a simulation.
struct ExecutedStep {
    /// Number of the call.
    id: u32,
    /// Reads of the independent variable after the step.
    values: Vec<Read>,
    /// Requested end of the step.
    end: f64,
    /// Number of the call that enters Event Mode after the step.
    event: Option<u32>,
}

/// Values that a successful `fmi3DoStep` returns.
struct Returned {
    /// Value of `eventHandlingNeeded`.
    event: bool,
    /// Value of `terminateSimulation`.
    terminate: bool,
    /// Value of `earlyReturn`.
    early: bool,
    /// Value of `lastSuccessfulTime`.
    reached: f64,
}

impl Returned {
    fn new(run: &Run, id: u32) -> Option<Self> {
        let outcome = run.outcome(id).filter(|_| run.succeeds(id))?;
        let reached = outcome.written.get(3)?.numbers()[0];
        let [event, terminate, early] = [0, 1, 2].map(|index| outcome.written[index].numbers() == [1.0]);
        Some(Self { event, terminate, early, reached })
    }
}

/// Writes and executes the steps of the trajectory. Steps may end at events between the points of the trajectory, so each step is executed
/// before the next one is written.
fn execute_steps(
    checker: &Checker,
    writer: &mut Writer<'_>,
    time: Option<usize>,
    event_mode: bool,
    early_return: bool,
) -> anyhow::Result<Vec<ExecutedStep>> {
    writer.make_with(0, |make| (make.event_mode, make.early_return) = (event_mode, early_return));
    writer.enter(0);
    writer.call(0, "ExitInitializationMode", vec![]);
    let mut next_event = None;
    if event_mode {
        next_event = leave_event_mode(checker, writer)?;
    }
    let mut steps: Vec<ExecutedStep> = Vec::new();
    let points = &writer.trajectory.points;
    let (mut now, mut number) = (checker.description.start_time, 0);
    while number < points.len() && steps.len() < 30 {
        let point = &points[number];
        let end = point.time + point.size;
        // Without early return, the step must end at the next event time, at which the importer enters Event Mode (section 4.2.1).
        let goal = next_event.filter(|next| !early_return && *next > now && *next < end).unwrap_or(end);
        let size = goal - now;
        if size <= 1e-9 * point.size {
            number += 1;
            continue;
        }
        let id = writer.step(0, now, size);
        let values = writer.read_these(0, time.as_slice());
        let run = checker.execute(&writer.sequence)?;
        steps.push(ExecutedStep { id, values, end: goal, event: None });
        let Some(Returned { event, terminate, early, reached }) = Returned::new(&run, id) else { break };
        // A step that reports no event and does not advance would not advance if it were repeated.
        if terminate || !(reached > now || event && reached == now) || reached > goal + point.size {
            break;
        }
        now = if early { reached } else { goal };
        if event_mode && (event || next_event.is_some_and(|next| now >= next)) {
            let event = writer.call(0, "EnterEventMode", vec![]);
            steps.iter_mut().rev().take(1).for_each(|step| step.event = Some(event));
            next_event = leave_event_mode(checker, writer)?;
        }
    }
    Ok(steps)
}

/// Returns the values that a successful step returned. Returns `None` if a shortened call sequence lacks the call that enters Event Mode
/// after an earlier step, because the standard requires this call.
fn returned_by(step: &ExecutedStep, steps: &[ExecutedStep], run: &Run) -> Option<Returned> {
    let mut earlier = steps.iter().take_while(|other| other.id != step.id);
    let lacks_event = |step: &ExecutedStep| {
        run.outcome(step.id).is_some() && step.event.is_some_and(|event| run.outcome(event).is_none())
    };
    let returned = Returned::new(run, step.id)?;
    (!earlier.any(lacks_event)).then_some(returned)
}

/// Updates the discrete states and enters Step Mode. Returns the time of the next event.
fn leave_event_mode(checker: &Checker, writer: &mut Writer<'_>) -> anyhow::Result<Option<f64>> {
    let id = writer.update(0);
    let run = checker.execute(&writer.sequence)?;
    writer.call(0, "EnterStepMode", vec![]);
    Ok(checker.event(&run, id).and_then(|event| event.next))
}

//! Checks Event Mode and early returns in Co-Simulation of FMI 3.0.

use crate::call_sequence::Run;
use crate::checker::Checker;
use crate::values::is_other_time;
use crate::writer::{Read, Trajectory, Writer, value_of};
use std::sync::Arc;

/// Checks the outputs of `fmi3DoStep` at events, with `eventModeUsed`, with `earlyReturnAllowed` and with both.
pub fn steps(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let time = checker.description.variables.iter().position(|variable| variable.causality == "independent");
    let has_events = checker.can(trajectory.interface, &["hasEventMode"]);
    for (event_mode, early_return) in [(true, true), (true, false), (false, true)] {
        if event_mode && !has_events || !event_mode && checker.description.event_mode() {
            continue;
        }
        let mut writer = checker.writer(trajectory);
        let steps = Arc::new(run_steps(checker, &mut writer, time, event_mode, early_return)?);
        let again = Arc::clone(&steps);
        let run = checker.evaluate("results.early-return", writer.sequence.clone(), move |run| {
            again.iter().find_map(|step| {
                let (event, early, reached) = ended(&again, run, step.id)?;
                if early && !early_return {
                    return Some("a step returns early, where earlyReturnAllowed is false".to_owned());
                }
                if event && !event_mode {
                    return Some(
                        "a step reports eventHandlingNeeded, where eventModeUsed is false".to_owned(),
                    );
                }
                let now = *value_of(run, &step.values, time?)?.numbers().first()?;
                let end = step.end;
                is_other_time(reached, now).then(|| {
                    format!("a step to {end:?} returned the lastSuccessfulTime {reached:?}, but the independent variable is {now:?}")
                })
            })
        })?;
        checker.record("results.early-unreported", &run, &writer.sequence, move |run| {
            steps.iter().find_map(|step| {
                let (event, early, reached) = ended(&steps, run, step.id)?;
                let end = step.end;
                let short = reached < end && is_other_time(reached, end);
                (short && event && !early).then(|| {
                    format!(
                        "a step to {end:?} ends at an event at {reached:?} and does not report earlyReturn"
                    )
                })
            })
        });
    }
    Ok(())
}

/// Step: its number, the reads after it, its requested end, and the number of the call that enters Event Mode after it.
struct Stepped {
    id: u32,
    values: Vec<Read>,
    end: f64,
    event: Option<u32>,
}

/// Returns eventHandlingNeeded, terminateSimulation, earlyReturn and lastSuccessfulTime of a successful step.
fn outputs(run: &Run, id: u32) -> Option<([bool; 3], f64)> {
    let outcome = run.outcome(id).filter(|_| run.succeeds(id))?;
    let reached = outcome.written.get(3)?.numbers()[0];
    Some(([0, 1, 2].map(|index| outcome.written[index].numbers() == [1.0]), reached))
}

/// Writes and executes the steps of the trajectory, which may end at events between its points.
fn run_steps(
    checker: &Checker,
    writer: &mut Writer<'_>,
    time: Option<usize>,
    event_mode: bool,
    early_return: bool,
) -> anyhow::Result<Vec<Stepped>> {
    writer.make_with(0, |how| (how.event_mode, how.early_return) = (event_mode, early_return));
    writer.enter(0);
    writer.call(0, "ExitInitializationMode", vec![]);
    let mut next = None;
    if event_mode {
        next = over_event(checker, writer)?;
    }
    let mut steps = Vec::new();
    let points = &writer.trajectory.points;
    let (mut at, mut number) = (checker.description.start_time, 0);
    while number < points.len() && steps.len() < 30 {
        let point = &points[number];
        let end = point.time + point.size;
        // Section 4.2.1: the importer enters Event Mode at the next event time, or when the step requests it.
        let goal = next.filter(|next| !early_return && *next > at && *next < end).unwrap_or(end);
        let size = goal - at;
        if size <= 1e-9 * point.size {
            number += 1;
            continue;
        }
        let id = writer.step(0, at, size);
        let values = writer.read_these(0, time.as_slice());
        let run = checker.execute(&writer.sequence)?;
        steps.push(Stepped { id, values, end: goal, event: None });
        let Some(([event, terminate, early], reached)) = outputs(&run, id) else { break };
        // A step that did not advance, without an event, would not advance again.
        if terminate || !(reached > at || event && reached == at) || reached > goal + point.size {
            break;
        }
        at = if early { reached } else { goal };
        if event_mode && (event || next.is_some_and(|next| at >= next)) {
            let event = writer.call(0, "EnterEventMode", vec![]);
            steps.iter_mut().rev().take(1).for_each(|step| step.event = Some(event));
            next = over_event(checker, writer)?;
        }
    }
    Ok(steps)
}

/// Returns eventHandlingNeeded, earlyReturn and lastSuccessfulTime of a successful step; `None` if a shortened call sequence
/// lacks Event Mode after an earlier step.
fn ended(steps: &[Stepped], run: &Run, id: u32) -> Option<(bool, bool, f64)> {
    let mut before = steps.iter().take_while(|step| step.id != id);
    let is_skipped = |step: &Stepped| {
        run.outcome(step.id).is_some() && step.event.is_some_and(|event| run.outcome(event).is_none())
    };
    let ([event, _, early], reached) = outputs(run, id)?;
    (!before.any(is_skipped)).then_some((event, early, reached))
}

/// Updates the discrete states and enters Step Mode. Returns the time of the next event.
fn over_event(checker: &Checker, writer: &mut Writer<'_>) -> anyhow::Result<Option<f64>> {
    let id = writer.update(0);
    let run = checker.execute(&writer.sequence)?;
    writer.call(0, "EnterStepMode", vec![]);
    Ok(checker.event(&run, id).and_then(|event| event.next))
}

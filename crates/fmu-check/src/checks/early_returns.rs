//! Event Mode and early returns of FMI 3.0 in Co-Simulation.

use crate::call_sequence::{Run, Step};
use crate::checker::Checker;
use crate::finding::Judge;
use crate::writer::{Writer, value_of};
use fmi_abi::Interface;
use std::sync::Arc;

/// Steps over events in FMI 3.0, by importers that handle them, that let steps return early, or both: what a step says of
/// where it ended and why is so.
pub fn told(checker: &Checker) -> anyhow::Result<()> {
    let trajectory =
        checker.trajectories.iter().find(|trajectory| trajectory.interface == Interface::CoSimulation);
    let (true, Some(trajectory)) = (checker.fmi3(), trajectory) else { return Ok(()) };
    let time = checker.description.variables.iter().position(|variable| variable.causality == "independent");
    let has_events = checker.can(Interface::CoSimulation, &["hasEventMode"]);
    for (event_mode, early_return) in [(true, true), (true, false), (false, true)] {
        if event_mode && !has_events || !event_mode && checker.description.event_mode() {
            continue;
        }
        let mut writer = checker.writer();
        let mut how = writer.how(Interface::CoSimulation);
        (how.event_mode, how.early_return) = (event_mode, early_return);
        writer.add(Step::Make(0, how));
        writer.enter(0);
        writer.call(0, "ExitInitializationMode", vec![]);
        let mut next = None;
        if event_mode {
            next = over_event(checker, &mut writer)?;
            writer.call(0, "EnterStepMode", vec![]);
        }
        let (mut steps, mut handled) = (Vec::new(), Vec::new());
        let (mut at, mut number) = (checker.description.start_time, 0);
        // Steps of the trajectory, which may now end at events between its points.
        while number < trajectory.points.len() && steps.len() < 30 {
            let point = &trajectory.points[number];
            let end = point.time + point.size;
            // Section 4.2.1: Event Mode at the time that was told, or where the step says so; none is passed by.
            let goal = next.filter(|next| !early_return && *next > at && *next < end).unwrap_or(end);
            let size = goal - at;
            if size <= 1e-9 * point.size {
                number += 1;
                continue;
            }
            let id = writer.step(0, at, size);
            let values = writer.read_these(0, time.as_slice());
            let run = checker.play(&writer.sequence)?;
            steps.push((id, values, goal));
            handled.push(None);
            let Some(outcome) = run.of(id).filter(|of| of.status.is_some_and(|status| status <= 1)) else {
                break;
            };
            let flag = |index: usize| outcome.written[index].numbers() == [1.0];
            let reached = outcome.written[3].numbers()[0];
            // A step that went nowhere, without an event, would do so again.
            if flag(1) || !(reached > at || flag(0) && reached == at) || reached > goal + point.size {
                break;
            }
            at = if flag(2) { reached } else { goal };
            if event_mode && (flag(0) || next.is_some_and(|next| at >= next)) {
                let id = writer.call(0, "EnterEventMode", vec![]);
                handled.pop();
                handled.push(Some(id));
                next = over_event(checker, &mut writer)?;
                writer.call(0, "EnterStepMode", vec![]);
            }
        }
        // In a shortened call sequence, the required events were still handled.
        let ids: Vec<u32> = steps.iter().map(|(id, ..)| *id).collect();
        let ended = move |run: &Run, id: u32| {
            let before = ids.iter().zip(&handled).take_while(|(step, _)| **step != id);
            let passed_by = |(step, event): (&u32, &Option<u32>)| {
                run.of(*step).is_some() && event.is_some_and(|event| run.of(event).is_none())
            };
            let outcome = run.of(id).filter(|of| of.status.is_some_and(|status| status <= 1))?;
            let flag = |index: usize| outcome.written[index].numbers() == [1.0];
            let reached = outcome.written.get(3)?.numbers()[0];
            (!before.into_iter().any(passed_by)).then(|| (flag(0), flag(2), reached))
        };
        let (ended, again) = (Arc::new(ended), steps.clone());
        let told = Arc::clone(&ended);
        let judge: Judge = Arc::new(move |run| {
            again.iter().find_map(|(id, values, end)| {
                let (event, early, reached) = ended(run, *id)?;
                if early && !early_return {
                    return Some("a step returns early, where earlyReturnAllowed is false".to_owned());
                }
                if event && !event_mode {
                    return Some("a step says eventHandlingNeeded, where eventModeUsed is false".to_owned());
                }
                let now = *value_of(run, values, time?)?.numbers().first()?;
                let off = (now - reached).abs() > 1e-9 * (1.0 + now.abs());
                off.then(|| {
                    format!("lastSuccessfulTime is {reached:?} of a step to {end:?}, and the time is {now:?}")
                })
            })
        });
        let run = checker.judge("results.early-return", writer.sequence.clone(), judge)?;
        let judge: Judge = Arc::new(move |run| {
            steps.iter().find_map(|(id, _, end)| {
                let (event, early, reached) = told(run, *id)?;
                let short = reached < end - 1e-9 * (1.0 + end.abs());
                (short && event && !early).then(|| {
                    format!("a step to {end:?} ends at an event at {reached:?} and does not say earlyReturn")
                })
            })
        });
        checker.keep("results.early-unsaid", &run, &writer.sequence, judge);
    }
    Ok(())
}

/// Runs the updates to count how many the event needs; returns the next time event.
fn over_event(checker: &Checker, writer: &mut Writer<'_>) -> anyhow::Result<Option<f64>> {
    for _ in 0..10 {
        let ids = writer.update(0, 1);
        let run = checker.play(&writer.sequence)?;
        match checker.event(&run, ids[0]) {
            Some(event) if event.again => {}
            other => return Ok(other.and_then(|event| event.next)),
        }
    }
    Ok(None)
}

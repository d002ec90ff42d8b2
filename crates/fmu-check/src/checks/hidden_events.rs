//! Checks that Model Exchange announces the events that change its discrete states, and handles each event once.

use super::integration::integrate_with_events;
use crate::call_sequence::{Run, Values};
use crate::checker::Checker;
use crate::description::Description;
use crate::finding::event;
use crate::trajectory::step_size;
use crate::values::inputs_by;
use crate::writer::{Point, Read, Trajectory, Writer, value_of};
use fmi_abi::{Causality, Variability};
use std::sync::Arc;

/// Number of intervals of the integration.
const INTERVALS: usize = 40;

/// Maximum number of changes of a variable that is checked. A variable that changes more often may count how often Event Mode is entered.
const MOST_CHANGES: usize = INTERVALS / 4;

/// Returns the discrete outputs and local variables.
fn discrete(checker: &Checker) -> Vec<usize> {
    let mut indices = checker.readable.clone();
    indices.retain(|index| {
        let variable = &checker.description.variables[*index];
        variable.variability == Variability::Discrete
            && [Causality::Output, Causality::Local].contains(&variable.causality)
            && !variable.clocked
    });
    indices.truncate(200);
    indices
}

/// Calls at the end of an interval, where the check enters Event Mode.
struct IntervalEnd {
    time: f64,
    /// Number of the integration of the interval.
    integration: u32,
    /// Number of the update of the discrete states.
    update: u32,
    /// Reads of the event indicators before and after Event Mode; `None` if the FMU has none.
    indicators: [Option<u32>; 2],
    /// Reads of the discrete variables before and after Event Mode.
    reads: [Vec<Read>; 2],
}

/// Checks that discrete variables change only in events that the FMU announces: an event indicator changes its sign, the time of the next
/// event has come, or CompletedIntegratorStep requests Event Mode. The check enters Event Mode after each interval, because an importer may
/// do so at any time.
pub fn unannounced(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let indicators = description.indicators_count();
    let variables = discrete(checker);
    if variables.is_empty() {
        return Ok(());
    }
    let size = step_size(description);
    let mut writer = Writer::new(description, trajectory, &variables);
    writer.begin_with(0, &inputs_by(description, 0.5));
    let (mut ends, mut begin) = (Vec::new(), description.start_time);
    for number in 0..INTERVALS {
        // Events are unlikely at these ends of intervals, because the fraction is unusual.
        let end = description.start_time + (number as f64 + 0.381_966) * size;
        let integration = writer.integrate(0, begin, end);
        let read = |writer: &mut Writer| {
            let indicators = (indicators > 0).then(|| writer.vector(0, "GetEventIndicators", indicators));
            (indicators, writer.read(0))
        };
        let before = read(&mut writer);
        let update = writer.event(0)[1];
        let after = read(&mut writer);
        let (indicators, reads) = ([before.0, after.0], [before.1, after.1]);
        ends.push(IntervalEnd { time: end, integration, update, indicators, reads });
        begin = end;
    }
    let (description, fmi3) = (description.clone(), checker.fmi3());
    checker.check("dynamics.unannounced", writer.sequence, move |run| {
        let reached = |end: &&IntervalEnd| run.status(end.integration) == Some(0);
        let ends: Vec<&IntervalEnd> = ends.iter().take_while(reached).collect();
        variables.iter().find_map(|variable| unannounced_change(run, &description, &ends, *variable, fmi3))
    })
}

/// Describes an unannounced change of a variable.
fn unannounced_change(
    run: &Run,
    description: &Description,
    ends: &[&IntervalEnd],
    variable: usize,
    fmi3: bool,
) -> Option<String> {
    let values = |end: &IntervalEnd| -> Option<[Values; 2]> {
        let [before, after] = end.reads.each_ref().map(|reads| value_of(run, reads, variable));
        Some([before?, after?])
    };
    let changed = ends.iter().filter_map(|end| Some((end, values(end)?)));
    let changed: Vec<_> =
        changed.filter_map(|(end, [was, is])| Some((end, was.differ(&is)?, was, is))).collect();
    if changed.len() > MOST_CHANGES {
        return None;
    }
    let is_unannounced = |end: &IntervalEnd| -> Option<bool> {
        let at = ends.iter().position(|other| other.integration == end.integration)?;
        let before = ends[at.checked_sub(1)?];
        let no_event = run.written(end.integration)?.numbers().first()?.is_infinite();
        let next = event(run, before.update, fmi3)?.next;
        let is_due = next.is_some_and(|next| next <= end.time + 1e-3 * (end.time - before.time));
        let numbers = |id: Option<u32>| match id {
            Some(id) => run.written(id).filter(|_| run.succeeds(id)).map(Values::numbers),
            None => Some(Vec::new()),
        };
        let (then, now) = (numbers(before.indicators[1])?, numbers(end.indicators[0])?);
        let same_signs = then.iter().zip(&now).all(|(then, now)| (*then > 0.0) == (*now > 0.0));
        // With a hysteresis, a relation may change before its indicator changes its sign, so indicators near zero prove nothing.
        let is_far = then.iter().zip(&now).all(|(then, now)| then == now || now.abs() > 1e-6);
        Some(no_event && !is_due && same_signs && is_far)
    };
    let (end, element, was, is) = changed.into_iter().find(|(end, ..)| is_unannounced(end) == Some(true))?;
    let (name, was, is) = (&description.variables[variable].name, was.show(element), is.show(element));
    Some(format!(
        "in Event Mode at {:?} {name} changes from {was} to {is}, but no event indicator has changed its sign and no event was due",
        end.time
    ))
}

/// Reads of the discrete variables at a point: before Event Mode, after it, and after Event Mode was entered again at the same time.
struct TwoEntries {
    time: f64,
    is_event: bool,
    /// Numbers of the updates of the discrete states.
    updates: [u32; 2],
    reads: [Vec<Read>; 3],
}

/// Checks that an event is handled once: entering Event Mode again at the same time changes no discrete variable. Also looks for a variable
/// that changes, or an update that reports changed states, whenever Event Mode is entered.
pub fn repeated(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let variables = Arc::new(discrete(checker));
    if variables.is_empty() && description.states_count() == 0 {
        return Ok(());
    }
    let trajectory = &integrate_with_events(checker, trajectory)?.trajectory;
    let mut writer = Writer::new(description, trajectory, &variables);
    writer.begin(0);
    let mut all = Vec::new();
    for point in &trajectory.points {
        writer.point(0, &Point { event: false, ..point.clone() });
        let before = writer.read(0);
        let [(first_update, first), (second_update, second)] =
            [(); 2].map(|()| (writer.event(0)[1], writer.read(0)));
        let updates = [first_update, second_update];
        all.push(TwoEntries {
            time: point.time,
            is_event: point.event,
            updates,
            reads: [before, first, second],
        });
    }
    let all = Arc::new(all);
    let repeated = {
        let (description, all, variables) = (description.clone(), all.clone(), variables.clone());
        move |run: &Run| {
            variables.iter().find_map(|variable| changes_again(run, &description, &all, *variable))
        }
    };
    let run = checker.evaluate("dynamics.repeated-event", writer.sequence.clone(), repeated)?;
    let (description, fmi3) = (description.clone(), checker.fmi3());
    checker.record("dynamics.counted-entry", &run, &writer.sequence, move |run| {
        let elsewhere: Vec<&TwoEntries> = all.iter().filter(|point| !point.is_event).collect();
        if elsewhere.len() < LEAST_POINTS {
            return None;
        }
        let counts =
            variables.iter().find_map(|variable| counts_entries(run, &description, &elsewhere, *variable));
        counts.or_else(|| {
            let reports = |id: &u32| event(run, *id, fmi3).is_some_and(|event| event.states_changed);
            let always = elsewhere.iter().all(|point| point.updates.iter().all(reports));
            always.then(|| {
                "each update reports changed states, also if Event Mode is entered again at the same time"
                    .to_owned()
            })
        })
    });
    Ok(())
}

/// Minimum number of points without an event at which a variable must change.
const LEAST_POINTS: usize = 3;

/// Describes a variable that changes whenever Event Mode is entered at these points.
fn counts_entries(
    run: &Run,
    description: &Description,
    points: &[&TwoEntries],
    variable: usize,
) -> Option<String> {
    let mut first_change = None;
    for point in points {
        let [before, first, second] = point.reads.each_ref().map(|reads| value_of(run, reads, variable));
        let (before, first, second) = (before?, first?, second?);
        let at = before.differ(&first)?;
        first.differ(&second)?;
        first_change.get_or_insert_with(|| (point.time, [before.show(at), first.show(at), second.show(at)]));
    }
    let (time, [before, first, second]) = first_change?;
    let name = &description.variables[variable].name;
    Some(format!(
        "{name} changes whenever Event Mode is entered, although there is no event: at {time:?} from {before} to {first}, and again to {second}"
    ))
}

/// Describes an event in which a variable changes, and changes again when Event Mode is entered again.
fn changes_again(
    run: &Run,
    description: &Description,
    points: &[TwoEntries],
    variable: usize,
) -> Option<String> {
    let values = |point: &TwoEntries| -> Option<[Values; 3]> {
        let [before, first, second] = point.reads.each_ref().map(|reads| value_of(run, reads, variable));
        Some([before?, first?, second?])
    };
    let all: Vec<(&TwoEntries, [Values; 3])> =
        points.iter().map(|point| Some((point, values(point)?))).collect::<Option<_>>()?;
    let (at_events, elsewhere): (Vec<_>, Vec<_>) = all.iter().partition(|(point, _)| point.is_event);
    // A variable that changes without an event may count how often Event Mode is entered.
    let may_count = elsewhere
        .iter()
        .any(|(_, [before, first, second])| before.differ(first).is_some() || first.differ(second).is_some());
    if may_count || elsewhere.is_empty() {
        return None;
    }
    let (point, [_, first, second]) = at_events.into_iter().find(|(_, [before, first, second])| {
        before.differ(first).is_some() && first.differ(second).is_some()
    })?;
    let element = first.differ(second)?;
    Some(format!(
        "the event at {:?} makes {} {}; when Event Mode is entered again at the same time it becomes {}",
        point.time,
        description.variables[variable].name,
        first.show(element),
        second.show(element)
    ))
}

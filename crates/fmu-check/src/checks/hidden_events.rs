//! Checks that Model Exchange announces the events that change its discrete states, and handles each event once.

use super::excited::excited;
use crate::call_sequence::{Integration, Run, Step, Values};
use crate::checker::Checker;
use crate::description::Description;
use crate::finding::event;
use crate::trajectory::step_size;
use crate::values::inputs_by;
use crate::writer::Part::{Enter, Leave, Make};
use crate::writer::{Point, Read, Trajectory, Writer, value_of};

/// Number of intervals of the integration.
const INTERVALS: usize = 40;

/// Maximum number of changes that are a finding. A variable that changes more often may depend on how often Event Mode is entered.
const MOST_CHANGES: usize = INTERVALS / 4;

/// Returns the discrete outputs and local variables.
fn discrete(checker: &Checker) -> Vec<usize> {
    let mut indices = checker.readable.clone();
    indices.retain(|index| {
        let variable = &checker.description.variables[*index];
        variable.variability == "discrete"
            && ["output", "local"].contains(&variable.causality.as_str())
            && !variable.clocked
    });
    indices.truncate(200);
    indices
}

/// Calls in Event Mode, and the reads before and after it.
struct Entry {
    time: f64,
    integration: u32,
    update: u32,
    indicators: [u32; 2],
    reads: [Vec<Read>; 2],
}

/// Checks that discrete variables change only in events that the FMU announces: by an event indicator that changes its sign, by the time of
/// the next event, or after an integrator step. The check enters Event Mode after each interval, because an importer may do so at any time.
pub fn unannounced(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let states = description.states_count().unwrap_or(0);
    let indicators = description.event_indicators.unwrap_or(0);
    let variables = discrete(checker);
    if indicators == 0 || variables.is_empty() {
        return Ok(());
    }
    let size = step_size(description);
    let mut writer = Writer::new(description, trajectory, &variables);
    writer.write(0, &[Make]);
    writer.set(0, &inputs_by(description, 0.5));
    writer.write(0, &[Enter, Leave]);
    let (mut entries, mut begin) = (Vec::new(), description.start_time);
    for number in 0..INTERVALS {
        // The ends of the intervals are at no likely event.
        let end = description.start_time + (number as f64 + 0.381_966) * size;
        let how = Integration { begin, end, steps: 4, euler: states == 0, states, indicators };
        let integration = writer.add(Step::Integrate(0, how));
        let before = (writer.vector(0, "GetEventIndicators", indicators), writer.read(0));
        let update = writer.event(0)[1];
        let after = (writer.vector(0, "GetEventIndicators", indicators), writer.read(0));
        let (indicators, reads) = ([before.0, after.0], [before.1, after.1]);
        entries.push(Entry { time: end, integration, update, indicators, reads });
        begin = end;
    }
    let (description, fmi3) = (description.clone(), checker.fmi3());
    checker.check("dynamics.unannounced", writer.sequence, move |run| {
        let reached = |entry: &&Entry| run.status(entry.integration) == Some(0);
        let entries: Vec<&Entry> = entries.iter().take_while(reached).collect();
        variables.iter().find_map(|variable| hidden(run, &description, &entries, *variable, fmi3))
    })
}

/// Returns a description of an unannounced change of a variable.
fn hidden(
    run: &Run,
    description: &Description,
    entries: &[&Entry],
    variable: usize,
    fmi3: bool,
) -> Option<String> {
    let values = |entry: &Entry| -> Option<[Values; 2]> {
        let [before, after] = entry.reads.each_ref().map(|reads| value_of(run, reads, variable));
        Some([before?, after?])
    };
    let changed = entries.iter().filter_map(|entry| Some((entry, values(entry)?)));
    let changed: Vec<_> =
        changed.filter_map(|(entry, [was, is])| Some((entry, was.differ(&is)?, was, is))).collect();
    if changed.len() > MOST_CHANGES {
        return None;
    }
    let is_hidden = |entry: &Entry| -> Option<bool> {
        let at = entries.iter().position(|other| other.integration == entry.integration)?;
        let before = entries[at.checked_sub(1)?];
        let no_event = run.written(entry.integration)?.numbers().first()?.is_infinite();
        let next = event(run, before.update, fmi3)?.next;
        let is_due = next.is_some_and(|next| next <= entry.time + 1e-3 * (entry.time - before.time));
        let numbers = |id: u32| run.written(id).filter(|_| run.succeeds(id)).map(Values::numbers);
        let (then, now) = (numbers(before.indicators[1])?, numbers(entry.indicators[0])?);
        let same = then.iter().zip(&now).all(|(then, now)| (*then > 0.0) == (*now > 0.0));
        // Near zero, a relation and its indicator may differ by a hysteresis.
        let far = then.iter().zip(&now).all(|(then, now)| then == now || now.abs() > 1e-6);
        Some(no_event && !is_due && same && far)
    };
    let (entry, element, was, is) = changed.into_iter().find(|(entry, ..)| is_hidden(entry) == Some(true))?;
    let (name, was, is) = (&description.variables[variable].name, was.show(element), is.show(element));
    Some(format!(
        "in Event Mode at {:?} {name} changes from {was} to {is}, but no event indicator has changed its sign and no event was due",
        entry.time
    ))
}

/// Discrete variables before and after Event Mode, and after Event Mode was entered again at the same time.
struct Again {
    time: f64,
    is_event: bool,
    reads: [Vec<Read>; 3],
}

/// Checks that an event is handled once: entering Event Mode again at the same time changes no discrete variable.
pub fn repeated(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let variables = discrete(checker);
    if variables.is_empty() {
        return Ok(());
    }
    let trajectory = &excited(checker, trajectory)?.trajectory;
    let mut writer = Writer::new(description, trajectory, &variables);
    writer.begin(0);
    let mut all = Vec::new();
    for point in &trajectory.points {
        writer.point(0, &Point { event: false, ..point.clone() });
        let before = writer.read(0);
        let [first, second] = [(); 2].map(|()| {
            writer.event(0);
            writer.read(0)
        });
        all.push(Again { time: point.time, is_event: point.event, reads: [before, first, second] });
    }
    let description = description.clone();
    checker.check("dynamics.repeated-event", writer.sequence, move |run| {
        variables.iter().find_map(|variable| {
            let values = |again: &Again| -> Option<[Values; 3]> {
                let [before, first, second] =
                    again.reads.each_ref().map(|reads| value_of(run, reads, *variable));
                Some([before?, first?, second?])
            };
            let all: Vec<(&Again, [Values; 3])> =
                all.iter().map(|again| Some((again, values(again)?))).collect::<Option<_>>()?;
            // A variable that changes without an event may count how often Event Mode is entered.
            let counts = all.iter().any(|(again, [before, first, second])| {
                !again.is_event && (before.differ(first).is_some() || first.differ(second).is_some())
            });
            let has_quiet = all.iter().any(|(again, _)| !again.is_event);
            let (again, [_, first, second]) = all
                .iter()
                .filter(|_| !counts && has_quiet)
                .find(|(again, [before, first, second])| {
                    again.is_event && before.differ(first).is_some() && first.differ(second).is_some()
                })?;
            let element = first.differ(second)?;
            Some(format!(
                "the event at {:?} makes {} {}; when Event Mode is entered again at the same time it becomes {}",
                again.time,
                description.variables[*variable].name,
                first.show(element),
                second.show(element)
            ))
        })
    })
}

//! Checks simulations that start before zero and far from zero, with and without a stop time and a tolerance.

use super::late_outputs::is_continuous;
use crate::call_sequence::{CallSequence, End, Integration, Run, Step, Values};
use crate::checker::Checker;
use crate::description::Description;
use crate::finding::failure_of;
use crate::trajectory::step_size;
use crate::values::{inputs_by, is_other_time};
use crate::writer::Part::Make;
use crate::writer::{Read, Trajectory, Writer, value_of};
use std::sync::Arc;

/// Number of steps of a simulation.
const STEPS: usize = 12;

/// Number of steps before and after zero in which a clock is observed.
const CLOCK: usize = 30;

/// Fraction of a step by which communication points are shifted, so that they are unlikely to coincide with ticks of a clock.
const SHIFT: f64 = 0.381_966;

/// A simulation from a start time.
struct Simulation {
    start: f64,
    size: f64,
    /// Calls up to the mode in which time advances.
    begin: Vec<u32>,
    /// Each step, or integration of this duration, with the reads after it.
    steps: Vec<(u32, Vec<Read>)>,
}

impl Simulation {
    /// Writes a simulation of this many steps in the first interface, with inputs that differ from their start values.
    fn write(
        writer: &mut Writer,
        (start, size, count): (f64, f64, usize),
        tolerance: Option<f64>,
        stop: Option<f64>,
    ) -> Self {
        let description = writer.description;
        let mut begin = writer.write(0, &[Make]).ids;
        begin.extend(writer.set(0, &inputs_by(description, 0.5)));
        let first = writer.next;
        writer.enter_with(0, tolerance, start, stop);
        begin.extend(first..writer.next);
        begin.extend(writer.leave(0));
        let states = description.states_count().unwrap_or(0);
        let indicators = description.event_indicators.unwrap_or(0);
        let mut steps = Vec::new();
        for number in 0..count {
            let at = |number: usize| start + number as f64 * size;
            let id = if writer.trajectory.is_stepped() {
                writer.step(0, at(number), size)
            } else {
                let (begin, end) = (at(number), at(number + 1));
                let how = Integration { begin, end, steps: 4, euler: states == 0, states, indicators };
                writer.add(Step::Integrate(0, how))
            };
            steps.push((id, writer.read(0)));
        }
        writer.free(0);
        Self { start, size, begin, steps }
    }

    /// Returns whether all calls succeeded and all values are finite.
    fn succeeds(&self, run: &Run, description: &Description) -> bool {
        self.begin.iter().all(|id| run.succeeds(*id))
            && self
                .steps
                .iter()
                .all(|(id, reads)| run.succeeds(*id) && reads.iter().all(|read| run.succeeds(read.id)))
            && self.not_finite(run, description).is_none()
    }

    /// Returns the name and the value of a continuous variable that is not finite, and the time.
    fn not_finite(&self, run: &Run, description: &Description) -> Option<(String, f64, f64)> {
        self.steps.iter().zip(1..).find_map(|((_, reads), number)| {
            let time = self.start + f64::from(number) * self.size;
            reads.iter().flat_map(Read::parts).find_map(|(index, ..)| {
                let numbers = value_of(run, reads, index)?.numbers();
                let is = numbers.into_iter().find(|number| !number.is_finite())?;
                description.variables[index]
                    .is_float()
                    .then(|| (description.variables[index].name.clone(), is, time))
            })
        })
    }

    /// Returns the numbers of a scalar variable after each step.
    fn numbers(&self, run: &Run, variable: usize) -> Option<Vec<f64>> {
        let number =
            |(_, reads): &(u32, Vec<Read>)| value_of(run, reads, variable)?.numbers().first().copied();
        self.steps.iter().map(number).collect()
    }

    /// Returns the numbers of the steps in which a variable changes.
    fn changes(&self, run: &Run, variable: usize) -> Option<Vec<usize>> {
        let value = |(_, reads): &(u32, Vec<Read>)| value_of(run, reads, variable);
        let values: Vec<Values> = self.steps.iter().map(value).collect::<Option<_>>()?;
        let pairs = values.windows(2).zip(1..);
        Some(pairs.filter(|(pair, _)| pair[0].differ(&pair[1]).is_some()).map(|(_, number)| number).collect())
    }
}

/// Checks simulations from a time before zero and from a large one: the instance accepts the time, the steps succeed, values are finite,
/// and states with a derivative move, if all of that holds for a simulation from the start time of the default experiment.
pub fn starts(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    if checker.description.event_mode() {
        return Ok(());
    }
    let size = step_size(description);
    // Far from zero, the resolution of times is still a small part of a step.
    let far = (1e8 * size).min(1e6);
    let cases =
        [(-500.0 * size).max(-5.0), far].into_iter().flat_map(|start| [(start, false), (start, true)]);
    let variables: Vec<usize> = checker.readable.clone();
    for (start, limited) in cases {
        let tolerance = limited.then(|| description.tolerance());
        let stop = limited.then_some(start + (STEPS as f64 + 0.5) * size);
        let mut writer = Writer::new(description, trajectory, &variables);
        let usual = Simulation::write(&mut writer, (description.start_time, size, STEPS), None, None);
        let shifted = Simulation::write(&mut writer, (start, size, STEPS), tolerance, stop);
        let sequence = writer.sequence.clone();
        let copy = sequence.clone();
        let simulations = Arc::new((usual, shifted));
        let (rejected, failed, timed) =
            (Arc::clone(&simulations), Arc::clone(&simulations), Arc::clone(&simulations));
        let (begin, model, known) = (sequence.clone(), description.clone(), description.clone());
        let rejects = move |run: &Run| {
            let (usual, shifted) = &*rejected;
            let why = shifted.begin.iter().find_map(|id| failure_of(&begin, run, *id))?;
            usual.succeeds(run, &known).then(|| format!("with the start time {start:?}, {why}"))
        };
        // Some FMUs ignore the start time, and integrate from zero, which takes long.
        if start > 0.0 {
            let run = checker.workers.execute(&checker.setting, &sequence, checker.limit.min(5.0))?;
            if matches!(run.end, End::Hang(_)) {
                break;
            }
        }
        let run = checker.evaluate("dynamics.start-rejected", sequence.clone(), rejects)?;
        checker.record("dynamics.start-time", &run, &sequence, move |run| {
            let (usual, shifted) = &*failed;
            let accepted = shifted.begin.iter().all(|id| run.succeeds(*id));
            if !accepted || !usual.succeeds(run, &model) {
                return None;
            }
            fails(run, &copy, &model, shifted).or_else(|| stands(run, &model, usual, shifted))
        });
        let time = description.variables.iter().position(|variable| variable.causality == "independent");
        checker.record("results.time", &run, &sequence, move |run| {
            let (_, shifted) = &*timed;
            let numbers = shifted.numbers(run, time?)?;
            let all = shifted.begin.iter().all(|id| run.succeeds(*id))
                && shifted.steps.iter().all(|(id, _)| run.status(*id) == Some(0));
            numbers.into_iter().zip(1..).find_map(|(number, step)| {
                let time = shifted.start + f64::from(step) * shifted.size;
                (all && is_other_time(number, time))
                    .then(|| format!("the independent variable is {number:?} at {time:?}"))
            })
        });
    }
    clock(checker, trajectory)
}

/// Returns a description of a step that fails, or of a value that is not finite.
fn fails(
    run: &Run,
    sequence: &CallSequence,
    description: &Description,
    simulation: &Simulation,
) -> Option<String> {
    let start = simulation.start;
    let failed = simulation.steps.iter().zip(1..).find_map(|((id, _), number)| {
        // Discard is allowed.
        let status = run.status(*id).filter(|status| *status > 2)?;
        let why = failure_of(sequence, run, *id).unwrap_or_else(|| format!("it ends with status {status}"));
        Some(format!("started at {start:?}, step {number} fails: {why}"))
    });
    failed.or_else(|| {
        let (name, is, time) = simulation.not_finite(run, description)?;
        Some(format!("started at {start:?}, {name} is {is:?} at {time:?}"))
    })
}

/// Returns a description of a state that does not change, although its derivative is not zero.
fn stands(run: &Run, description: &Description, usual: &Simulation, shifted: &Simulation) -> Option<String> {
    let states = description.derivatives.iter().filter_map(|unknown| {
        Some((description.variables[unknown.variable].derivative_of?, unknown.variable))
    });
    states.filter(|(state, _)| is_continuous(description, *state)).find_map(|(state, derivative)| {
        let (numbers, slopes) = (shifted.numbers(run, state)?, shifted.numbers(run, derivative)?);
        let moved = usual.numbers(run, state)?.windows(2).any(|pair| pair[0] != pair[1]);
        let stands = numbers.windows(2).all(|pair| pair[0] == pair[1]);
        let least = slopes.iter().fold(f64::INFINITY, |least, slope| least.min(slope.abs()));
        let same_sign = slopes.windows(2).all(|pair| pair[0] * pair[1] > 0.0);
        let scale = numbers[0].abs().max(1e-3 * description.variables[state].nominal);
        let far = least * shifted.size > 1e-6 * scale;
        (moved && stands && same_sign && far).then(|| {
            let (name, value, slope) = (&description.variables[state].name, numbers[0], slopes[0]);
            let start = shifted.start;
            format!("started at {start:?}, {name} stays {value:?}, although its derivative is {slope:?}")
        })
    })
}

/// Checks a clock that ticks before and after zero: the interval across zero is as long as all others. Clocks that start at zero or
/// with the simulation are not accused.
fn clock(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let mut variables = checker.readable.clone();
    variables.retain(|index| {
        let variable = &description.variables[*index];
        variable.variability == "discrete" && variable.causality != "input" && !variable.clocked
    });
    variables.truncate(200);
    if variables.is_empty() || description.start_time < 0.0 {
        return Ok(());
    }
    let size = step_size(description);
    let mut writer = Writer::new(description, trajectory, &variables);
    let mut simulate = |start: f64| Simulation::write(&mut writer, (start, size, 2 * CLOCK), None, None);
    let usual = simulate(description.start_time + SHIFT * size);
    let across = simulate(-(CLOCK as f64 + SHIFT) * size);
    let description = description.clone();
    checker.check("dynamics.start-time", writer.sequence, move |run| {
        variables.iter().find_map(|variable| {
            let period = even(&usual.changes(run, *variable)?)?;
            let changes = across.changes(run, *variable)?;
            let (before, after) = changes.split_at(changes.partition_point(|number| *number < CLOCK));
            let gap = after.first()? - before.last()?;
            let is_even = even(before) == Some(period) && even(after) == Some(period);
            (is_even && gap != period).then(|| {
                format!(
                    "{} changes every {period} steps before and after the time 0, and {gap} steps apart across it",
                    description.variables[*variable].name
                )
            })
        })
    })
}

/// Returns the distance of at least three numbers that have equal distances.
fn even(numbers: &[usize]) -> Option<usize> {
    let distance = numbers.get(1)? - numbers[0];
    let is_even = numbers.len() > 2 && numbers.windows(2).all(|pair| pair[1] - pair[0] == distance);
    is_even.then_some(distance)
}

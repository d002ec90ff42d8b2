//! Checks simulations that start before zero and far from zero, with and without a stop time and a tolerance.

use super::late_outputs::is_continuous;
use crate::call_sequence::{CallSequence, End, Run, Values};
use crate::checker::Checker;
use crate::description::Description;
use crate::finding::failure_of;
use crate::trajectory::step_size;
use crate::values::{inputs_by, is_other_time};
use crate::writer::Part::Make;
use crate::writer::{Read, Trajectory, Writer, not_finite, number_of, value_of};
use fmi_abi::{Causality, Variability};
use std::sync::Arc;

/// Number of steps of a simulation.
const STEPS: usize = 12;

/// Number of steps before time zero, and after it, in which a periodic variable is observed.
const PERIODIC_STEPS: usize = 30;

/// Fraction of a step by which communication points are shifted, so that they are unlikely to coincide with periodic events.
const SHIFT: f64 = 0.381_966;

/// Simulation from a start time.
struct Simulation {
    start: f64,
    /// Step size.
    size: f64,
    /// Numbers of the calls up to the mode in which time advances.
    begin: Vec<u32>,
    /// Number of each step, or of each integration of the same duration, with the reads after it.
    steps: Vec<(u32, Vec<Read>)>,
}

impl Simulation {
    /// Writes a simulation of `count` steps with inputs that differ from their start values.
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
        let step = |number| (writer.advance(0, start, size, number), writer.read(0));
        let steps = (0..count).map(step).collect();
        writer.free(0);
        Self { start, size, begin, steps }
    }

    /// Returns the time at the end of a step; the first step has number 1.
    fn end_of_step(&self, number: u32) -> f64 {
        self.start + f64::from(number) * self.size
    }

    /// Returns whether the initialization succeeded.
    fn is_started(&self, run: &Run) -> bool {
        self.begin.iter().all(|id| run.succeeds(*id))
    }

    /// Returns whether all calls succeeded and all values are finite.
    fn succeeds(&self, run: &Run, description: &Description) -> bool {
        let mut steps = self.steps.iter();
        self.is_started(run)
            && steps.all(|(id, reads)| run.succeeds(*id) && reads.iter().all(|read| run.succeeds(read.id)))
            && self.not_finite(run, description).is_none()
    }

    /// Returns the name and the value of a floating-point variable that is not finite, and the time.
    fn not_finite(&self, run: &Run, description: &Description) -> Option<(String, f64, f64)> {
        self.steps.iter().zip(1..).find_map(|((_, reads), number)| {
            let (index, value) = not_finite(run, reads, description)?;
            Some((description.variables[index].name.clone(), value, self.end_of_step(number)))
        })
    }

    /// Returns the number of a scalar variable after each step.
    fn numbers(&self, run: &Run, variable: usize) -> Option<Vec<f64>> {
        self.steps.iter().map(|(_, reads)| number_of(run, reads, variable)).collect()
    }

    /// Returns the indices of the steps in which a variable changes.
    fn changes(&self, run: &Run, variable: usize) -> Option<Vec<usize>> {
        let value = |(_, reads): &(u32, Vec<Read>)| value_of(run, reads, variable);
        let values: Vec<Values> = self.steps.iter().map(value).collect::<Option<_>>()?;
        let pairs = values.windows(2).zip(1..);
        Some(pairs.filter(|(pair, _)| pair[0].differ(&pair[1]).is_some()).map(|(_, index)| index).collect())
    }
}

/// Checks simulations from a time before zero and from a large time. If a simulation from the start time of the default experiment
/// succeeds, these simulations must succeed, too. The FMU must accept the start time, steps must succeed, values must be finite, states
/// must move, and periodic variables must keep their period.
pub fn starts(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    if checker.description.event_mode() {
        return Ok(());
    }
    let size = step_size(&checker.description);
    let before_zero = (-500.0 * size).max(-5.0);
    // Far from zero, the resolution of times is still a small part of a step.
    let far = (1e8 * size).min(1e6);
    for (start, is_limited) in [(before_zero, false), (before_zero, true), (far, false), (far, true)] {
        if !check_start(checker, trajectory, start, is_limited)? {
            break;
        }
    }
    periodic_variables(checker, trajectory)
}

/// Checks a simulation from this start time, with a stop time and a tolerance if it `is_limited`. Returns false if further start times
/// should not be tried.
fn check_start(
    checker: &Checker,
    trajectory: &Trajectory,
    start: f64,
    is_limited: bool,
) -> anyhow::Result<bool> {
    let description = &checker.description;
    let size = step_size(description);
    let tolerance = is_limited.then(|| description.tolerance());
    let stop = is_limited.then_some(start + (STEPS as f64 + 0.5) * size);
    let mut writer = Writer::new(description, trajectory, &checker.readable);
    let usual = Simulation::write(&mut writer, (description.start_time, size, STEPS), None, None);
    let shifted = Simulation::write(&mut writer, (start, size, STEPS), tolerance, stop);
    let sequence = writer.sequence.clone();
    // Some FMUs ignore the start time and integrate from zero, which takes long.
    if start > 0.0 {
        let run = checker.workers.execute(&checker.setting, &sequence, checker.limit.min(5.0))?;
        if matches!(run.end, End::Hang(_)) {
            return Ok(false);
        }
    }
    let description = Arc::clone(description);
    let compared = Arc::new(Compared { description, sequence: sequence.clone(), usual, shifted });
    let [rejected, failed, with_time] = [(); 3].map(|()| Arc::clone(&compared));
    let rejection = move |run: &Run| rejected.rejection(run);
    let run = checker.evaluate("dynamics.start-rejected", sequence.clone(), rejection)?;
    checker.record("dynamics.start-time", &run, &sequence, move |run| failed.failure(run));
    checker.record("results.time", &run, &sequence, move |run| with_time.wrong_time(run));
    Ok(true)
}

/// Simulation from the start time of the default experiment, and the same simulation from another start time.
struct Compared {
    description: Arc<Description>,
    sequence: CallSequence,
    usual: Simulation,
    shifted: Simulation,
}

impl Compared {
    /// Describes a call that rejects the start time, if the usual simulation succeeds.
    fn rejection(&self, run: &Run) -> Option<String> {
        let why = self.shifted.begin.iter().find_map(|id| failure_of(&self.sequence, run, *id))?;
        let usual_succeeds = self.usual.succeeds(run, &self.description);
        usual_succeeds.then(|| format!("with the start time {:?}, {why}", self.shifted.start))
    }

    /// Describes a failure after the start time was accepted, if the usual simulation succeeds.
    fn failure(&self, run: &Run) -> Option<String> {
        if !self.shifted.is_started(run) || !self.usual.succeeds(run, &self.description) {
            return None;
        }
        let start = self.shifted.start;
        let not_finite = || {
            let (name, value, time) = self.shifted.not_finite(run, &self.description)?;
            Some(format!("started at {start:?}, {name} is {value:?} at {time:?}"))
        };
        self.failed_step(run).or_else(not_finite).or_else(|| self.constant_state(run))
    }

    /// Describes a step that fails.
    fn failed_step(&self, run: &Run) -> Option<String> {
        self.shifted.steps.iter().zip(1..).find_map(|((id, _), number)| {
            // Discard is allowed.
            let status = run.status(*id).filter(|status| *status > 2)?;
            let why = failure_of(&self.sequence, run, *id)
                .unwrap_or_else(|| format!("it ends with status {status}"));
            Some(format!("started at {:?}, step {number} fails: {why}", self.shifted.start))
        })
    }

    /// Describes a state that does not change although its derivative is not zero.
    fn constant_state(&self, run: &Run) -> Option<String> {
        let (description, shifted) = (&self.description, &self.shifted);
        let states = description.derivatives.iter().filter_map(|unknown| {
            Some((description.variables[unknown.variable].derivative_of?, unknown.variable))
        });
        states.filter(|(state, _)| is_continuous(description, *state)).find_map(|(state, derivative)| {
            let (numbers, slopes) = (shifted.numbers(run, state)?, shifted.numbers(run, derivative)?);
            let usual_moves = self.usual.numbers(run, state)?.windows(2).any(|pair| pair[0] != pair[1]);
            let is_constant = numbers.windows(2).all(|pair| pair[0] == pair[1]);
            let least = slopes.iter().fold(f64::INFINITY, |least, slope| least.min(slope.abs()));
            let same_sign = slopes.windows(2).all(|pair| pair[0] * pair[1] > 0.0);
            let scale = numbers[0].abs().max(1e-3 * description.variables[state].nominal());
            let must_move = same_sign && least * shifted.size > 1e-6 * scale;
            (usual_moves && is_constant && must_move).then(|| {
                let (name, value, slope) = (&description.variables[state].name, numbers[0], slopes[0]);
                let start = shifted.start;
                format!("started at {start:?}, {name} stays {value:?}, although its derivative is {slope:?}")
            })
        })
    }

    /// Describes a value of the independent variable that is not the time, if all steps return OK.
    fn wrong_time(&self, run: &Run) -> Option<String> {
        let numbers = self.shifted.numbers(run, self.description.independent()?)?;
        let succeeds = self.shifted.is_started(run)
            && self.shifted.steps.iter().all(|(id, _)| run.status(*id) == Some(0));
        numbers.into_iter().zip(1..).find_map(|(number, step)| {
            let time = self.shifted.end_of_step(step);
            (succeeds && is_other_time(number, time))
                .then(|| format!("the independent variable is {number:?} at {time:?}"))
        })
    }
}

/// Checks discrete variables that change periodically: the interval across time zero must be as long as all others. A variable may also
/// change for the first time at zero or at the start time. In the first case it does not change before zero and is not reported, in the
/// second case it keeps its period across zero.
fn periodic_variables(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let mut variables = checker.readable.clone();
    variables.retain(|index| {
        let variable = &description.variables[*index];
        variable.variability == Variability::Discrete
            && variable.causality != Causality::Input
            && !variable.clocked
    });
    variables.truncate(200);
    if variables.is_empty() || description.start_time < 0.0 {
        return Ok(());
    }
    let size = step_size(description);
    let mut writer = Writer::new(description, trajectory, &variables);
    let mut simulate =
        |start: f64| Simulation::write(&mut writer, (start, size, 2 * PERIODIC_STEPS), None, None);
    let usual = simulate(description.start_time + SHIFT * size);
    let across = simulate(-(PERIODIC_STEPS as f64 + SHIFT) * size);
    let description = description.clone();
    checker.check("dynamics.start-time", writer.sequence, move |run| {
        variables.iter().find_map(|variable| {
            let period = equal_distance(&usual.changes(run, *variable)?)?;
            let changes = across.changes(run, *variable)?;
            let is_before = |index: &usize| *index < PERIODIC_STEPS;
            let (before, after) = changes.split_at(changes.partition_point(is_before));
            let gap = after.first()? - before.last()?;
            let is_periodic =
                equal_distance(before) == Some(period) && equal_distance(after) == Some(period);
            (is_periodic && gap != period).then(|| {
                format!(
                    "{} changes every {period} steps before and after the time 0, and {gap} steps apart across it",
                    description.variables[*variable].name
                )
            })
        })
    })
}

/// Returns the distance between adjacent numbers; `None` if there are fewer than three numbers or the distances differ.
fn equal_distance(numbers: &[usize]) -> Option<usize> {
    let distance = numbers.get(1)? - numbers[0];
    let is_equal = numbers.len() > 2 && numbers.windows(2).all(|pair| pair[1] - pair[0] == distance);
    is_equal.then_some(distance)
}

//! Checks that small steps advance the state of Co-Simulation, also if their size is not a multiple of the solver's step size.

use super::late_outputs::{accepts_any_size, is_continuous};
use crate::call_sequence::Run;
use crate::checker::Checker;
use crate::description::Description;
use crate::values::inputs_by;
use crate::writer::{Read, Trajectory, Writer, value_of};

/// Number of small steps that are compared with one step.
const STEPS: usize = 8;

/// Number of usual steps before the small ones, after which the states are likely to move.
const BEFORE: usize = 4;

/// Returns small step sizes for a usual step size. They contain an irrational factor, so that they are not multiples of the step
/// size of a solver. Each size is less than `STEPS` times the next one. So for one of them, a single step is shorter than the
/// solver's step and `STEPS` steps together are longer, unless all sizes are longer than the solver's step.
fn sizes(usual: f64) -> impl Iterator<Item = f64> {
    (1..=6).map(move |number| 0.618_033_988_749_895 * usual * 10_f64.powf(-0.5 * f64::from(number)))
}

/// Reads before small steps, after them, and after one step of the same duration.
struct Compared {
    /// Size of the small steps.
    size: f64,
    before: Vec<Read>,
    small: Vec<Read>,
    one: Vec<Read>,
}

/// Compares small steps with one step of the same duration, for several sizes. The results of a solver with variable steps may differ
/// slightly, so only two observations are findings: no variable changes at all in small steps, or each small step advances as far as a
/// longer one.
pub fn small_steps(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    if !accepts_any_size(checker, trajectory) {
        return Ok(());
    }
    let variables: Vec<usize> =
        checker.readable.iter().copied().filter(|index| is_continuous(description, *index)).collect();
    let usual = trajectory.points[0].size;
    let mut writer = Writer::new(description, trajectory, &variables);
    let mut all = Vec::new();
    for size in sizes(usual) {
        let mut after = |steps: usize, size: f64| {
            writer.begin_with(0, &inputs_by(description, 0.5));
            let time = writer.steps(0, description.start_time, usual, BEFORE);
            let before = writer.read(0);
            writer.steps(0, time, size, steps);
            let after = writer.read(0);
            writer.free(0);
            (before, after)
        };
        let (before, small) = after(STEPS, size);
        let (_, one) = after(1, STEPS as f64 * size);
        all.push(Compared { size, before, small, one });
    }
    let description = description.clone();
    checker.check("dynamics.small-steps", writer.sequence, move |run| {
        let changes: Vec<(f64, Vec<Change>)> =
            all.iter().filter_map(|of| Some((of.size, of.changes(run, &variables)?))).collect();
        unchanged(&description, &changes).or_else(|| too_far(&description, &changes))
    })
}

/// Values of an element of a variable that one step changes: before, after small steps, and after one step.
struct Change {
    variable: usize,
    before: f64,
    small: f64,
    one: f64,
}

impl Compared {
    /// Returns the elements that one step changes; `None` if there are none, or if a value was not read or is not finite.
    fn changes(&self, run: &Run, variables: &[usize]) -> Option<Vec<Change>> {
        let mut changes = Vec::new();
        for variable in variables {
            let numbers = |reads: &[Read]| value_of(run, reads, *variable).map(|value| value.numbers());
            let [before, small, one] = [numbers(&self.before)?, numbers(&self.small)?, numbers(&self.one)?];
            for (element, before) in before.into_iter().enumerate() {
                let (small, one) = (*small.get(element)?, *one.get(element)?);
                if ![before, small, one].iter().all(|number| number.is_finite()) {
                    return None;
                }
                if (one - before).abs() > 1e-12 * before.abs().max(one.abs()) {
                    changes.push(Change { variable: *variable, before, small, one });
                }
            }
        }
        (!changes.is_empty()).then_some(changes)
    }
}

/// Describes small steps after which no variable has changed, although one step changes some.
fn unchanged(description: &Description, sizes: &[(f64, Vec<Change>)]) -> Option<String> {
    let are_unchanged = |changes: &[Change]| changes.iter().all(|of| of.small == of.before);
    let (size, changes) = sizes.iter().find(|(_, changes)| are_unchanged(changes))?;
    let of = &changes[0];
    Some(format!(
        "{} is {:?} before and after {STEPS} steps of {size:?}, after one step of the same duration {:?}",
        description.variables[of.variable].name, of.before, of.one
    ))
}

/// Describes small steps that advance too far: with two sizes, all variables advance equally far, and about `STEPS` times as far as in one
/// step of the same duration.
fn too_far(description: &Description, sizes: &[(f64, Vec<Change>)]) -> Option<String> {
    sizes.windows(2).find_map(|pair| {
        let [(_, larger), (size, smaller)] = pair else { return None };
        let alike = |one: f64, other: f64| (one - other).abs() < 0.01 * one.abs();
        let overshoots = |(one, other): (&Change, &Change)| {
            let [far, further] = [one, other].map(|of| of.small - of.before);
            let ratio = |of: &Change| (of.small - of.before) / (of.one - of.before);
            let repeats = [one, other].iter().all(|of| (0.75..1.25).contains(&(ratio(of) / STEPS as f64)));
            one.variable == other.variable && alike(far, further) && repeats
        };
        let all = larger.len() == smaller.len() && larger.iter().zip(smaller).all(overshoots);
        let of = smaller.first().filter(|_| all)?;
        Some(format!(
            "{} is {:?}, after {STEPS} steps of {size:?} {:?}, after one step of the same duration {:?}",
            description.variables[of.variable].name, of.before, of.small, of.one
        ))
    })
}

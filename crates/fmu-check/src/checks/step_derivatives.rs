//! Checks that short steps of Co-Simulation change each continuous state as its derivative states.
//!
//! An FMU may calculate its steps and its derivatives separately, and then one of them may have a wrong sign or factor, or use the wrong
//! state.

use crate::call_sequence::Run;
use crate::checker::Checker;
use crate::trajectory::step_size;
use crate::values::{inputs_by, other_numbers};
use crate::writer::{Read, Trajectory, Writer, values_of};
use fmi_abi::Causality;
use std::sync::Arc;

/// Numbers of steps after which a short step is compared.
const COMPARED_AFTER: [usize; 3] = [0, 1, 4];
/// Sizes of the short steps, as fractions of the usual step size. The smallest are for very fast states. The second one detects an FMU
/// that ignores the size of the step.
const SIZES: [f64; 8] = [1.0, 0.618, 0.25, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8];
/// Largest relative difference at which the change of a state agrees with its derivative. They must agree in the shortest step that can be
/// compared, or in two steps.
const TOLERANCE: f64 = 0.01;
/// Number of points at which a state must disagree. It is accepted if it agrees at any point.
const DISAGREEMENTS: usize = 3;

/// A short step: its size, the number of its call, and the reads before and after it.
struct ShortStep {
    size: f64,
    id: u32,
    reads: [Vec<Read>; 2],
}

/// Checks the states of an FMU whose derivatives can be read in Co-Simulation, with constant inputs: the start values, and other inputs
/// and parameters.
pub fn steps(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = Arc::clone(&checker.description);
    let derivatives: Vec<usize> = description.derivatives.iter().map(|unknown| unknown.variable).collect();
    let states = description.states();
    if states.is_empty() || states.len() != derivatives.len() {
        return Ok(());
    }
    let all = [&states[..], &derivatives].concat();
    let varied = checker.can(trajectory.interface, &["canHandleVariableCommunicationStepSize"]);
    let usual = step_size(&description);
    let mut writer = Writer::new(&description, trajectory, &all);
    let mut points = Vec::new();
    for values in [
        Vec::new(),
        inputs_by(&description, 0.5),
        other_numbers(&description, &[Causality::Input, Causality::Parameter]),
    ] {
        for before in COMPARED_AFTER {
            let mut steps = Vec::new();
            for size in &SIZES[..if varied { SIZES.len() } else { 1 }] {
                writer.begin_with(0, &values);
                let time = writer.steps(0, description.start_time, usual, before);
                let reads = writer.read(0);
                let id = writer.step(0, time, size * usual);
                let reads = [reads, writer.read(0)];
                // The sum of time and step size is rounded, so the step may have another size.
                steps.push(ShortStep { size: time + size * usual - time, id, reads });
                writer.free(0);
            }
            points.push(steps);
        }
    }
    let sequence = writer.sequence;
    let fmi3 = checker.fmi3();
    checker.check("dynamics.step-derivative", sequence, move |run| {
        let (states, derivatives) =
            (description.element_names(&states), description.element_names(&derivatives));
        let mut found = vec![Found::default(); states.len()];
        points.iter().for_each(|steps| compare(run, steps, fmi3, &mut found));
        let is_wrong = |found: &Found| found.agreed == 0 && found.disagreed >= DISAGREEMENTS;
        let number = found.iter().position(is_wrong)?;
        let [change, rate] = found[number].example;
        let (state, derivative) = (&states[number], &derivatives[number]);
        Some(format!(
            "{state} changes by {change:.6e} per second in a step, but its derivative {derivative} is {rate:.6e}"
        ))
    })
}

/// Results of the comparisons of a state with its derivative.
#[derive(Clone, Default)]
struct Found {
    agreed: usize,
    disagreed: usize,
    /// The change per second and the derivative in the first disagreement.
    example: [f64; 2],
}

/// Compares the change of each state in steps of several sizes with the mean of its derivatives before and after the step. Adds the
/// results to `found`.
fn compare(run: &Run, steps: &[ShortStep], fmi3: bool, found: &mut [Found]) {
    let count = found.len();
    // Whether the shortest step that can be compared agrees. It decides for very fast states.
    let (mut shortest, mut agreed) = (vec![false; count], vec![0; count]);
    let mut examples = vec![None; count];
    // Whether states move in some steps, and whether all of them stay in others. Both are true if the solver has internal steps and carries
    // the remainder of a step to the next one, so its steps cannot be compared.
    let mut moves = [false; 2];
    for ShortStep { size, id, reads } in steps {
        let [before, after] = reads.each_ref().map(|reads| -> Vec<f64> {
            values_of(run, reads).flat_map(|(_, value)| value.numbers()).collect()
        });
        let ends_early = |outcome: &crate::call_sequence::Outcome| {
            fmi3 && outcome.written.iter().take(3).any(|flag| flag.numbers() == [1.0])
        };
        if before.len() != 2 * count
            || after.len() != 2 * count
            || run.status(*id).is_none_or(|status| status > 1)
            || run.outcome(*id).is_none_or(ends_early)
        {
            continue;
        }
        for number in 0..count {
            let [state, later] = [before[number], after[number]];
            let slopes = [before[count + number], after[count + number]];
            let change = (later - state) / size;
            let rate = 0.5 * (slopes[0] + slopes[1]);
            let scale = change.abs().max(slopes[0].abs()).max(slopes[1].abs());
            let rounding = 8.0 * f64::EPSILON * state.abs().max(later.abs()) / size;
            // Rounding errors hide very small changes, so these cannot be compared. The negation also skips NaN.
            if !(rounding < 0.1 * TOLERANCE * scale && scale.is_finite()) {
                continue;
            }
            moves[usize::from(before[..count] == after[..count])] = true;
            shortest[number] = (change - rate).abs() <= TOLERANCE * scale;
            if shortest[number] {
                agreed[number] += 1;
            } else {
                examples[number] = Some([change, rate]);
            }
        }
    }
    for (number, found) in found.iter_mut().enumerate() {
        if agreed[number] > 1 || shortest[number] || moves == [true; 2] {
            found.agreed += 1;
        } else if let Some(example) = examples[number] {
            if found.disagreed == 0 {
                found.example = example;
            }
            found.disagreed += 1;
        }
    }
}

//! Checks that outputs after a step have the values at its end, not the values at its beginning.

use crate::call_sequence::{Run, Values};
use crate::checker::Checker;
use crate::description::{Description, Variable};
use crate::trajectory::{range, step_size};
use crate::values::inputs_by;
use crate::writer::{Read, Trajectory, Writer, value_of};
use fmi_abi::Causality;

/// Minimum and maximum number of steps.
const STEPS: [usize; 2] = [8, 24];

/// Step size, relative to the usual one. It is an unusual number, so that steps are unlikely to end at a periodic event.
const SIZE: f64 = 0.93;

/// Returns whether a variable is a continuous output or local variable.
pub fn is_continuous(description: &Description, index: usize) -> bool {
    let causality = description.variables[index].causality;
    description.is_continuous(index) && ![Causality::Input, Causality::Independent].contains(&causality)
}

/// Returns whether the steps of a simulation may have any size.
pub fn accepts_any_size(checker: &Checker, trajectory: &Trajectory) -> bool {
    let offer = checker.description.co_simulation.as_ref();
    trajectory.points.len() >= 4
        && checker.can(trajectory.interface, &["canHandleVariableCommunicationStepSize"])
        && offer.is_none_or(|offer| offer.fixed_internal_step_size().is_none())
        && !checker.description.event_mode()
}

/// Compares steps with steps of half the size. If an output is late by a step of any size, it equals the output of the half steps
/// one half step earlier. No error of a solver has this pattern. An FMU that does not accept steps of any size is compared with
/// its Model Exchange instead.
pub fn late(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let outputs = checker.outputs_and_states();
    if !accepts_any_size(checker, trajectory) {
        return compare_with_integration(checker, trajectory, outputs);
    }
    let size = SIZE * trajectory.points[0].size;
    let steps = (range(description) / size / 2.0) as usize * 2;
    let steps = steps.clamp(STEPS[0], STEPS[1]);
    let mut writer = Writer::new(description, trajectory, &outputs);
    let [full, half] = [steps, 2 * steps].map(|count| Series::write(&mut writer, size * steps as f64, count));
    let description = description.clone();
    checker.check("dynamics.late-output", writer.sequence, move |run| {
        outputs.iter().find_map(|output| late_by_step(run, &description, *output, &full, &half))
    })
}

/// Reads at the start and after each step of two simulations: with constant inputs, and with inputs that change in the middle.
struct Series {
    constant: Vec<Vec<Read>>,
    changed: Vec<Vec<Read>>,
}

impl Series {
    /// Writes the two simulations, each of which has `count` equal steps.
    fn write(writer: &mut Writer, duration: f64, count: usize) -> Self {
        let description = writer.description;
        let size = duration / count as f64;
        let [constant, changed] = [false, true]
            .map(|changes| write_steps(writer, (size, count), changes.then(|| inputs_by(description, 0.25))));
        Self { constant, changed }
    }
}

/// Describes an element of an output that is late by a step, or an effect of the changed inputs that is late by a step.
fn late_by_step(
    run: &Run,
    description: &Description,
    output: usize,
    full: &Series,
    half: &Series,
) -> Option<String> {
    let numbers = |series: &[Vec<Read>]| numbers(run, series, output);
    let (constant, half_constant) = (numbers(&full.constant)?, numbers(&half.constant)?);
    let (changed, half_changed) = (numbers(&full.changed)?, numbers(&half.changed)?);
    let variable = &description.variables[output];
    let name = &variable.name;
    (0..constant.first()?.len()).find_map(|element| {
        let (full, half) = (of_element(&constant, element)?, of_element(&half_constant, element)?);
        if let Some(step) = late_step(&full, &half, variable.is_float()) {
            let (late, earlier, now) = (full[step], half[2 * step - 1], half[2 * step]);
            return Some(format!(
                "{name} is {late:?} after {step} steps; after twice as many of half the size it is {now:?}, and {earlier:?} one \
                 step before: it is late by a step"
            ));
        }
        let effect = |changed: Vec<f64>, constant: &[f64]| -> Vec<f64> {
            changed.iter().zip(constant).map(|(one, other)| one - other).collect()
        };
        let full_effect = effect(of_element(&changed, element)?, &full);
        let half_effect = effect(of_element(&half_changed, element)?, &half);
        late_effect(&full_effect, &half_effect, variable.is_float()).map(|by| {
            format!(
                "an input that is set before a step changes {name} by {by:?}, but only after another step, of any size"
            )
        })
    })
}

/// Compares steps of the usual size with an integration of Model Exchange. An output that is late by a step equals the output of the
/// integration one step earlier.
fn compare_with_integration(
    checker: &Checker,
    stepped: &Trajectory,
    outputs: Vec<usize>,
) -> anyhow::Result<()> {
    let description = &checker.description;
    let Some(integrated) = checker.trajectories.iter().find(|trajectory| !trajectory.is_stepped()) else {
        return Ok(());
    };
    // The program that reproduces a finding loads only one library.
    if checker.setting.libraries[0] != checker.setting.libraries[1] || description.event_mode() {
        return Ok(());
    }
    let mut writer = Writer::new(description, stepped, &outputs);
    let [steps, integrations] = [stepped, integrated].map(|trajectory| {
        writer.trajectory = trajectory;
        write_steps(&mut writer, (step_size(description), STEPS[1]), None)
    });
    let description = description.clone();
    checker.check("dynamics.late-output", writer.sequence, move |run| {
        outputs.iter().find_map(|output| {
            late_against_integration(run, &description.variables[*output], *output, &steps, &integrations)
        })
    })
}

/// Writes a simulation with `count` steps of this size, or integrations of the same duration. If there are other inputs, sets them in the
/// middle. Returns the reads at the start and after each step.
fn write_steps(
    writer: &mut Writer,
    (size, count): (f64, usize),
    other_inputs: Option<Vec<(usize, Values)>>,
) -> Vec<Vec<Read>> {
    let description = writer.description;
    writer.begin_with(0, &inputs_by(description, 0.5));
    let mut reads = vec![writer.read(0)];
    for number in 0..count {
        if let Some(inputs) = other_inputs.as_ref().filter(|_| number == count / 2) {
            writer.set(0, inputs);
        }
        writer.advance(0, description.start_time, size, number);
        reads.push(writer.read(0));
    }
    writer.free(0);
    reads
}

/// Describes an element of an output that is late by a step in comparison with the integrations.
fn late_against_integration(
    run: &Run,
    variable: &Variable,
    index: usize,
    steps: &[Vec<Read>],
    integrations: &[Vec<Read>],
) -> Option<String> {
    let (steps, integrations) = (numbers(run, steps, index)?, numbers(run, integrations, index)?);
    (0..steps.first()?.len()).find_map(|element| {
        let (full, points) = (of_element(&steps, element)?, of_element(&integrations, element)?);
        // `late_step` compares with half steps. Here, each step is compared with two values of the integration: one step earlier, and at
        // its end.
        let pairs = points.windows(2).flatten().copied();
        let half: Vec<f64> = points.first().copied().into_iter().chain(pairs).collect();
        let step = late_step(&full, &half, variable.is_float())?;
        let (late, earlier, now) = (full[step], points[step - 1], points[step]);
        Some(format!(
            "{} is {late:?} after {step} steps; integrated in Model Exchange it is {now:?}, and {earlier:?} one step before: it \
             is late by a step",
            variable.name
        ))
    })
}

/// Returns the numbers of a variable in each read; `None` if a read failed or a number is not finite.
fn numbers(run: &Run, series: &[Vec<Read>], variable: usize) -> Option<Vec<Vec<f64>>> {
    let numbers = |reads: &Vec<Read>| {
        let numbers = value_of(run, reads, variable)?.numbers();
        numbers.iter().all(|number| number.is_finite()).then_some(numbers)
    };
    series.iter().map(numbers).collect()
}

/// Returns one element of each array.
fn of_element(series: &[Vec<f64>], element: usize) -> Option<Vec<f64>> {
    series.iter().map(|numbers| numbers.get(element).copied()).collect()
}

/// If an output is late by a step, returns the step with the largest difference. `full` and `half` are the values at the start and after
/// each step of full and half size.
fn late_step(full: &[f64], half: &[f64], is_float: bool) -> Option<usize> {
    let steps = 1..=full.len() - 1;
    let off = |step: usize| full[step] - half[2 * step];
    let off_if_late = |step: usize| full[step] - half[2 * step - 1];
    let sum = |of: &dyn Fn(usize) -> f64| steps.clone().map(|step| of(step).powi(2)).sum::<f64>();
    let scale = half.iter().fold(0.0_f64, |most, number| most.max(number.abs()));
    let differing = steps.clone().filter(|step| off(*step).abs() > 1e-9 * scale).count();
    let is_late = match is_float {
        true => differing >= steps.end() / 2 && sum(&off_if_late) < 0.01 * sum(&off),
        false => differing >= 2 && sum(&off_if_late) == 0.0,
    };
    steps.clone().filter(|_| is_late).max_by(|one, other| off(*one).abs().total_cmp(&off(*other).abs()))
}

/// If the effect of the changed inputs is late by a step of any size, returns the effect. Such an effect is zero after the first
/// step with the new inputs, and after the second step it is equal for both step sizes. A first-order solver also shows the
/// effect of an input on a state a step late, but this effect depends on the step size, so it is not reported.
fn late_effect(full: &[f64], half: &[f64], is_float: bool) -> Option<f64> {
    // The inputs change after this step.
    let at = (full.len() - 1) / 2;
    let (first, second) = (full[at + 1], full[at + 2]);
    let (half_first, half_second) = (half[2 * at + 1], half[2 * at + 2]);
    let tolerance = if is_float { 0.05 * second.abs() } else { 0.0 };
    let is_none = |effect: f64| effect.abs() <= tolerance;
    (is_none(first) && is_none(half_first) && is_none(second - half_second) && second != 0.0)
        .then_some(second)
}

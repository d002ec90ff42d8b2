//! Checks that outputs after a step have the values at its end, not those at its beginning.

use crate::call_sequence::{Integration, Run, Step};
use crate::checker::Checker;
use crate::description::Description;
use crate::trajectory::{range, step_size};
use crate::values::inputs_by;
use crate::writer::Part::{Enter, Free, Leave, Make};
use crate::writer::{Read, Trajectory, Writer, value_of};

/// Minimum and maximum number of steps; the inputs change in the middle.
const STEPS: [usize; 2] = [8, 24];

/// Size of a step, relative to the usual one. It is an unusual number, so that steps are unlikely to end when a clock ticks.
const SIZE: f64 = 0.93;

/// Returns whether a variable is continuous and changes with the state: an output or a local variable.
pub fn is_continuous(description: &Description, index: usize) -> bool {
    let variable = &description.variables[index];
    variable.is_float()
        && variable.variability == "continuous"
        && !variable.clocked
        && !["input", "independent"].contains(&variable.causality.as_str())
}

/// Returns whether the steps of a simulation may have any size.
pub fn accepts_any_size(checker: &Checker, trajectory: &Trajectory) -> bool {
    let offer = checker.description.co_simulation.as_ref();
    trajectory.points.len() >= 4
        && checker.can(trajectory.interface, &["canHandleVariableCommunicationStepSize"])
        && offer.is_none_or(|offer| offer.number("fixedInternalStepSize").is_none())
        && !checker.description.event_mode()
}

/// Reads at the start and after each step, with constant inputs and with inputs that change in the middle.
struct Series {
    constant: Vec<Vec<Read>>,
    changed: Vec<Vec<Read>>,
}

/// If an FMU allows only one step size, compares its steps with an integration of its Model Exchange: outputs that are late by a step equal
/// those of the integration one step earlier.
fn integrated(checker: &Checker, stepped: &Trajectory, outputs: Vec<usize>) -> anyhow::Result<()> {
    let description = &checker.description;
    let Some(integrated) = checker.trajectories.iter().find(|trajectory| !trajectory.is_stepped()) else {
        return Ok(());
    };
    // The program that shows a finding loads one library.
    if checker.setting.libraries[0] != checker.setting.libraries[1] || description.event_mode() {
        return Ok(());
    }
    let size = step_size(description);
    let states = description.states_count().unwrap_or(0);
    let indicators = description.event_indicators.unwrap_or(0);
    let mut writer = Writer::new(description, stepped, &outputs);
    let [steps, integrations] = [stepped, integrated].map(|trajectory| {
        let begin = (std::mem::take(&mut writer.sequence), writer.next);
        let mut each =
            Writer { sequence: begin.0, next: begin.1, ..Writer::new(description, trajectory, &outputs) };
        each.write(0, &[Make]);
        each.set(0, &inputs_by(description, 0.5));
        each.write(0, &[Enter, Leave]);
        let mut reads = vec![each.read(0)];
        for number in 0..STEPS[1] {
            let at = |number: usize| description.start_time + number as f64 * size;
            if trajectory.is_stepped() {
                each.step(0, at(number), size);
            } else {
                let (begin, end) = (at(number), at(number + 1));
                each.add(Step::Integrate(
                    0,
                    Integration { begin, end, steps: 4, euler: states == 0, states, indicators },
                ));
            }
            reads.push(each.read(0));
        }
        each.write(0, &[Free]);
        (writer.sequence, writer.next) = (each.sequence, each.next);
        reads
    });
    let description = description.clone();
    checker.check("dynamics.late-output", writer.sequence, move |run| {
        outputs.iter().find_map(|output| {
            let (steps, integrations) = (numbers(run, &steps, *output)?, numbers(run, &integrations, *output)?);
            let variable = &description.variables[*output];
            (0..steps.first()?.len()).find_map(|element| {
                let of = |series: &[Vec<f64>]| -> Option<Vec<f64>> {
                    series.iter().map(|numbers| numbers.get(element).copied()).collect()
                };
                let (whole, points) = (of(&steps)?, of(&integrations)?);
                // As half steps would have it that end one step earlier and at the same time.
                let pairs = points.windows(2).flatten().copied();
                let half: Vec<f64> = points.first().copied().into_iter().chain(pairs).collect();
                let step = is_late(&whole, &half, variable.is_float())?;
                let (late, earlier, now) = (whole[step], points[step - 1], points[step]);
                Some(format!(
                    "{} is {late:?} after {step} steps; integrated in Model Exchange it is {now:?}, and {earlier:?} one step before: it \
                     is late by a step",
                    variable.name
                ))
            })
        })
    })
}

/// Compares steps with steps of half the size. If an output is late by one step, half the step size halves the delay, so the output equals
/// the one of the half steps one step earlier. No error of a solver has this pattern.
pub fn late(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let outputs = checker.outputs_and_states();
    if !accepts_any_size(checker, trajectory) {
        return integrated(checker, trajectory, outputs);
    }
    let size = SIZE * trajectory.points[0].size;
    let steps = (range(description) / size / 2.0) as usize * 2;
    let steps = steps.clamp(STEPS[0], STEPS[1]);
    let mut writer = Writer::new(description, trajectory, &outputs);
    let mut series = |count: usize| {
        let size = size * steps as f64 / count as f64;
        let [constant, changed] = [false, true].map(|changes| {
            writer.write(0, &[Make]);
            writer.set(0, &inputs_by(description, 0.5));
            writer.write(0, &[Enter, Leave]);
            let mut reads = vec![writer.read(0)];
            for number in 0..count {
                if changes && number == count / 2 {
                    writer.set(0, &inputs_by(description, 0.25));
                }
                writer.step(0, description.start_time + number as f64 * size, size);
                reads.push(writer.read(0));
            }
            writer.write(0, &[Free]);
            reads
        });
        Series { constant, changed }
    };
    let (whole, half) = (series(steps), series(2 * steps));
    let description = description.clone();
    checker.check("dynamics.late-output", writer.sequence, move |run| {
        outputs.iter().find_map(|output| {
            let numbers = |series: &[Vec<Read>]| numbers(run, series, *output);
            let (constant, halves) = (numbers(&whole.constant)?, numbers(&half.constant)?);
            let (changed, changed_halves) = (numbers(&whole.changed)?, numbers(&half.changed)?);
            let variable = &description.variables[*output];
            let name = &variable.name;
            (0..constant.first()?.len()).find_map(|element| {
                let of = |series: &[Vec<f64>]| -> Option<Vec<f64>> {
                    series.iter().map(|numbers| numbers.get(element).copied()).collect()
                };
                let (whole, half) = (of(&constant)?, of(&halves)?);
                if let Some(step) = is_late(&whole, &half, variable.is_float()) {
                    let (late, earlier, now) = (whole[step], half[2 * step - 1], half[2 * step]);
                    return Some(format!(
                        "{name} is {late:?} after {step} steps; after twice as many of half the size it is {now:?}, and {earlier:?} one \
                         step before: it is late by a step"
                    ));
                }
                let effect = |changed: Vec<f64>, constant: &[f64]| -> Vec<f64> {
                    changed.iter().zip(constant).map(|(one, other)| one - other).collect()
                };
                let effects = [effect(of(&changed)?, &whole), effect(of(&changed_halves)?, &half)];
                is_effect_late(&effects[0], &effects[1], variable.is_float()).map(|by| {
                    format!(
                        "an input that is set before a step changes {name} by {by:?}, but only after another step, of any size"
                    )
                })
            })
        })
    })
}

/// Returns the numbers of a variable in each read; `None` if one failed or is not finite.
fn numbers(run: &Run, series: &[Vec<Read>], variable: usize) -> Option<Vec<Vec<f64>>> {
    let numbers = |reads: &Vec<Read>| {
        let numbers = value_of(run, reads, variable)?.numbers();
        numbers.iter().all(|number| number.is_finite()).then_some(numbers)
    };
    series.iter().map(numbers).collect()
}

/// Returns the step with the largest difference if an output is late by a step. `whole` and `half` have its values after steps and after
/// steps of half the size.
fn is_late(whole: &[f64], half: &[f64], is_float: bool) -> Option<usize> {
    let steps = 1..=whole.len() - 1;
    let off = |step: usize| whole[step] - half[2 * step];
    let shifted = |step: usize| whole[step] - half[2 * step - 1];
    let sum = |of: &dyn Fn(usize) -> f64| steps.clone().map(|step| of(step).powi(2)).sum::<f64>();
    let scale = half.iter().fold(0.0_f64, |most, number| most.max(number.abs()));
    let differing = steps.clone().filter(|step| off(*step).abs() > 1e-9 * scale).count();
    let late = match is_float {
        true => differing >= steps.end() / 2 && sum(&shifted) < 0.01 * sum(&off),
        false => differing >= 2 && sum(&shifted) == 0.0,
    };
    steps.clone().filter(|_| late).max_by(|one, other| off(*one).abs().total_cmp(&off(*other).abs()))
}

/// Returns the effect of a change of the inputs in the middle if it is a jump that is late by a step of any size: at the end of the step
/// after the change there is none, but at the same time after two half steps. The effect of an input on a state, which a solver of
/// first order may show late, depends on the size.
fn is_effect_late(whole: &[f64], half: &[f64], is_float: bool) -> Option<f64> {
    // The inputs change after this step.
    let at = (whole.len() - 1) / 2;
    let (first, then) = (whole[at + 1], whole[at + 2]);
    let (first_half, then_half) = (half[2 * at + 1], half[2 * at + 2]);
    let tolerance = if is_float { 0.05 * then.abs() } else { 0.0 };
    let is_none = |effect: f64| effect.abs() <= tolerance;
    (is_none(first) && is_none(first_half) && is_none(then - then_half) && then != 0.0).then_some(then)
}

//! Compares Co-Simulation with Model Exchange, if an FMU offers both.

use crate::call_sequence::{Run, Values};
use crate::checker::Checker;
use crate::description::Description;
use crate::finding::Criterion;
use crate::trajectory::{range, step_size};
use crate::values::near;
use crate::writer::{Read, Trajectory, Writer, value_of};
use fmi_abi::{Causality, Variability};

/// Maximum number of communication steps.
const MAX_STEPS: usize = 40;

/// Number of Runge-Kutta steps in a communication step. Another integration has twice as many, to estimate the error.
const INTEGRATION_STEPS: usize = 4;

/// Part of a difference that is always allowed, relative to the range of the values of an output.
const TOLERANCE: f64 = 5e-3;

/// Index of the simulation in Co-Simulation. One input may differ from its start value.
const STEPPED: usize = 0;
/// Index of the simulation in Co-Simulation with the start values of all inputs.
const AT_START: usize = 1;
/// Index of the integration of Model Exchange with `INTEGRATION_STEPS` Runge-Kutta steps in a communication step, and the inputs of
/// `STEPPED`.
const FINE: usize = 2;
/// Index of the integration with twice as many steps.
const FINER: usize = 3;
/// Index of the integration with one step of Euler's method in a communication step.
const EULER: usize = 4;

/// Calls of a simulation.
struct Simulation {
    /// Reads after each communication step.
    reads: Vec<Vec<Read>>,
    /// Numbers of the integrations; empty in Co-Simulation.
    integrations: Vec<u32>,
}

/// Compares Co-Simulation with an integration of Model Exchange for constant inputs: first with the start values of all inputs, then with
/// another value of one input, for at most four inputs.
pub fn compare(checker: &Checker) -> anyhow::Result<()> {
    let [Some(stepped), Some(integrated)] = [true, false]
        .map(|stepped| checker.trajectories.iter().find(|trajectory| trajectory.is_stepped() == stepped))
    else {
        return Ok(());
    };
    // The program that reproduces a finding loads only one library.
    if checker.setting.libraries[0] != checker.setting.libraries[1] || checker.description.event_mode() {
        return Ok(());
    }
    let description = &checker.description;
    let is_input = |index: &usize| {
        let variable = &description.variables[*index];
        variable.causality == Causality::Input
            && description.is_continuous(*index)
            && variable.size == Some(1)
            && !variable.start.is_empty()
    };
    let inputs = (0..description.variables.len()).filter(is_input).take(4);
    for input in std::iter::once(None).chain(inputs.map(Some)) {
        with_input(checker, [stepped, integrated], input)?;
    }
    Ok(())
}

/// Compares the simulations in which this input, if there is one, has a value other than its start value.
fn with_input(
    checker: &Checker,
    [stepped, integrated]: [&Trajectory; 2],
    input: Option<usize>,
) -> anyhow::Result<()> {
    let description = &checker.description;
    let mut outputs = checker.outputs_and_states();
    outputs.truncate(200);
    let size = step_size(description);
    let count = (range(description) / size + 1e-9).floor().clamp(1.0, MAX_STEPS as f64) as usize;
    let times: Vec<f64> = (0..=count).map(|index| description.start_time + index as f64 * size).collect();
    let mut all = Writer::new(description, stepped, &outputs);
    let mut simulations = Vec::new();
    // Number of integration steps, or `None` for Co-Simulation.
    let integration_steps = [None, None, Some(INTEGRATION_STEPS), Some(2 * INTEGRATION_STEPS), Some(1)];
    for (instance, steps) in integration_steps.into_iter().enumerate() {
        all.trajectory = if steps.is_none() { stepped } else { integrated };
        let changed = input.filter(|_| instance != AT_START).map(|input| {
            let variable = &description.variables[input];
            let value = near(variable, variable.starts().first().copied().unwrap_or_default(), 0.5);
            (input, Values::new(description.kind(input), [value]))
        });
        all.begin_with(instance, changed.as_slice());
        let simulation = match steps {
            None => in_steps(&mut all, instance, &times, size),
            Some(steps) => integrate(&mut all, instance, &times, steps),
        };
        all.free(instance);
        simulations.push(simulation);
    }
    checker.check(
        "results.interfaces",
        all.sequence,
        equal_results(description.clone(), simulations, outputs, times, input),
    )
}

/// Writes the steps of Co-Simulation from each time to the next.
fn in_steps(writer: &mut Writer, instance: usize, times: &[f64], size: f64) -> Simulation {
    let read = |time: &f64| {
        writer.step(instance, *time, size);
        writer.read(instance)
    };
    Simulation { reads: times[..times.len() - 1].iter().map(read).collect(), integrations: Vec::new() }
}

/// Writes the integrations of Model Exchange from each time to the next. A single step is a step of Euler's method.
fn integrate(writer: &mut Writer, instance: usize, times: &[f64], steps: usize) -> Simulation {
    let interval = |pair: &[f64]| {
        let id = writer.integrate_in(instance, pair[0], pair[1], steps, steps == 1);
        (id, writer.read(instance))
    };
    let (integrations, reads) = times.windows(2).map(interval).unzip();
    Simulation { reads, integrations }
}

/// Run of the simulations.
struct Compared<'a> {
    run: &'a Run,
    description: &'a Description,
    /// Simulations in the order of the indices above.
    simulations: &'a [Simulation],
    /// Number of communication steps that succeeded in all simulations.
    count: usize,
}

impl Compared<'_> {
    /// Returns the values of a variable after a step in all simulations.
    fn values(&self, step: usize, variable: usize) -> Option<[Values; 5]> {
        let value = |simulation: &Simulation| value_of(self.run, simulation.reads.get(step)?, variable);
        let all: Vec<Values> = self.simulations.iter().map_while(value).collect();
        all.try_into().ok()
    }

    /// Returns the number of events other than time events in a step of Model Exchange, and whether the step has any event.
    fn events(&self, step: usize) -> Option<(f64, bool)> {
        let id = self.simulations[FINER].integrations.get(step)?;
        let numbers = self.run.written(*id)?.numbers();
        Some((*numbers.get(2)?, numbers[0].is_finite()))
    }

    /// Returns whether a step, the one before and the one after have no event. Results near events may differ, because Co-Simulation may
    /// handle an event somewhat earlier or later than Model Exchange.
    fn is_quiet(&self, step: usize) -> bool {
        let from = step.saturating_sub(1);
        (from..=step + 1).all(|step| self.events(step).is_some_and(|(_, event)| !event))
    }

    /// Returns the first step after which an element of a discrete variable differs, and its values in Co-Simulation and Model Exchange.
    fn discrete(&self, variable: usize) -> Option<(usize, String, String)> {
        let quiet = (0..self.count).filter(|step| self.is_quiet(*step)).find_map(|step| {
            let [stepped, _, fine, finer, euler] = self.values(step, variable)?;
            let integrations_agree = fine == finer && euler == finer;
            let index = stepped.differ_beyond(&finer, 1e-6, |_| 0.0).filter(|_| integrations_agree)?;
            Some((step, stepped.show(index), finer.show(index)))
        });
        quiet.or_else(|| self.discrete_near_events(variable))
    }

    /// Returns the first step after which a discrete variable has a value that Model Exchange has neither after this step, nor
    /// after the two steps before and the next one. Also returns the values in Co-Simulation and Model Exchange. Co-Simulation
    /// may handle an event up to a step earlier or later than Model Exchange, so such a difference must occur after at least
    /// three steps.
    fn discrete_near_events(&self, variable: usize) -> Option<(usize, String, String)> {
        let has_one_event = |step: usize| {
            let numbers = self.run.written(*self.simulations[FINER].integrations.get(step)?)?.numbers();
            Some(numbers[0] == *numbers.get(1)? || numbers[0].is_infinite())
        };
        let differing = (2..self.count.saturating_sub(1)).filter_map(|step| {
            let near = step - 2..=step + 1;
            let has_single_events = near.clone().all(|step| has_one_event(step) == Some(true));
            let near: Vec<[Values; 5]> =
                near.map(|step| self.values(step, variable)).collect::<Option<_>>()?;
            let integrations_agree = has_single_events
                && near.iter().all(|[_, _, fine, finer, euler]| fine == finer && euler == finer);
            let stepped = &near[2][STEPPED];
            let index =
                stepped.differ_beyond(&near[2][FINER], 1e-6, |_| 0.0).filter(|_| integrations_agree)?;
            let occurs =
                near.iter().any(|values| stepped.differ_beyond(&values[FINER], 1e-6, |_| 0.0).is_none());
            (!occurs).then(|| (step, stepped.show(index), near[2][FINER].show(index)))
        });
        let found: Vec<_> = differing.collect();
        if found.len() < 3 { None } else { found.into_iter().next() }
    }

    /// Returns the step after which an element of a continuous variable differs most, and its values in Co-Simulation and Model
    /// Exchange, if the error of a solver does not explain the difference. Compares only the steps before the first event that is
    /// not a time event.
    fn continuous(&self, variable: usize) -> Option<(usize, String, String)> {
        let first_state_event =
            (0..self.count).find(|step| self.events(*step).is_none_or(|(states, _)| states > 0.0));
        let steps = (0..first_state_event.unwrap_or(self.count)).filter(|step| {
            self.is_quiet(*step) || self.events(*step).is_some_and(|(_, event)| !event) && *step == 0
        });
        let all: Vec<(usize, [Values; 5])> =
            steps.filter_map(|step| Some((step, self.values(step, variable)?))).collect();
        let size = all.first()?.1[0].numbers().len();
        (0..size).find_map(|element| {
            let series: Vec<(usize, [f64; 5])> = all
                .iter()
                .map(|(step, values)| {
                    let number = |of: &Values| of.numbers().get(element).copied().unwrap_or(f64::NAN);
                    (*step, values.each_ref().map(number))
                })
                .collect();
            let (step, [stepped, .., finer, _]) = unexplained_difference(&series, self.description)?;
            Some((step, format!("{stepped:?}"), format!("{finer:?}")))
        })
    }
}

/// Returns the step with the largest difference between Co-Simulation and Model Exchange, unless the error of a solver explains it. The
/// error of a first-order solver is proportional to the error of Euler's method, so a proportional part of the difference is subtracted.
/// The error of any other solver is smaller.
fn unexplained_difference(
    series: &[(usize, [f64; 5])],
    description: &Description,
) -> Option<(usize, [f64; 5])> {
    let all = |of: fn(&[f64; 5]) -> f64| series.iter().map(move |(_, values)| of(values));
    let most = |numbers: &mut dyn Iterator<Item = f64>| {
        numbers.fold(0.0, |most: f64, number| most.max(number.abs()))
    };
    if series.iter().flat_map(|(_, values)| values).any(|number| !number.is_finite()) {
        return None;
    }
    let (low, high) = all(|values| values[FINER])
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), number| (low.min(number), high.max(number)));
    let magnitude = most(&mut all(|values| values[FINER]));
    let scale = (high - low).max(1e-3 * magnitude);
    let integration_error = most(&mut all(|values| values[FINER] - values[FINE]));
    let euler_error = most(&mut all(|values| values[EULER] - values[FINER]));
    // The factor of the error of Euler's method that fits the differences best.
    let (numerator, denominator) = all(|values| values[EULER] - values[FINER])
        .zip(all(|values| values[STEPPED] - values[FINER]))
        .fold((0.0, 0.0), |(above, below), (euler, off)| (above + euler * off, below + euler * euler));
    let factor = if denominator > 0.0 { (numerator / denominator).clamp(-1.0, 2.0) } else { 0.0 };
    let remaining = |values: &[f64; 5]| {
        (values[STEPPED] - values[FINER] - factor * (values[EULER] - values[FINER])).abs()
    };
    let largest = series.iter().max_by(|one, other| remaining(&one.1).total_cmp(&remaining(&other.1)))?;
    let allowed = 0.5 * euler_error
        + TOLERANCE * scale
        + 4.0 * integration_error
        + 2.0 * description.tolerance() * magnitude;
    (remaining(&largest.1) > allowed.max(1e-9)).then_some(*largest)
}

/// Returns the criterion that Co-Simulation and Model Exchange have the same results.
fn equal_results(
    description: std::sync::Arc<Description>,
    simulations: Vec<Simulation>,
    outputs: Vec<usize>,
    times: Vec<f64>,
    input: Option<usize>,
) -> impl Criterion {
    move |run: &Run| {
        let succeeded = |step: &usize| {
            let integrated =
                simulations[FINE..].iter().all(|of| run.status(of.integrations[*step]) == Some(0));
            let read = simulations.iter().all(|of| of.reads[*step].iter().all(|read| run.succeeds(read.id)));
            integrated && read
        };
        let count = (0..times.len() - 1).take_while(succeeded).count();
        let compared = Compared { run, description: &description, simulations: &simulations, count };
        // Co-Simulation may ignore an input that Model Exchange needs, for example the derivative of another input, which it may estimate.
        let reacts = |variable: &usize| {
            (0..count).any(|step| {
                compared
                    .values(step, *variable)
                    .is_some_and(|[changed, at_start, ..]| changed.differ(&at_start).is_some())
            })
        };
        if input.is_some() && !outputs.iter().any(reacts) {
            return None;
        }
        outputs.iter().find_map(|variable| {
            let of = &description.variables[*variable];
            let is_continuous = of.is_float() && of.variability == Variability::Continuous;
            let found =
                if is_continuous { compared.continuous(*variable) } else { compared.discrete(*variable) };
            let (step, stepped, integrated) = found?;
            let (name, time) = (&of.name, times[step + 1]);
            Some(format!(
                "{name} is {stepped} in Co-Simulation at {time:?}, integrated in Model Exchange {integrated}"
            ))
        })
    }
}

//! Compares Co-Simulation with Model Exchange, which an FMU offers for the same model.

use crate::call_sequence::{Integration, Run, Step, Values};
use crate::checker::Checker;
use crate::description::Description;
use crate::finding::Criterion;
use crate::trajectory::{range, step_size};
use crate::values::near;
use crate::writer::Part::{Enter, Free, Leave, Make};
use crate::writer::{Read, Trajectory, Writer, value_of};

/// Number of communication points that are compared.
const POINTS: usize = 40;

/// Number of Runge-Kutta steps between two communication points; a second integration with twice as many shows their error.
const STEPS: usize = 4;

/// Difference that is not a finding, relative to the change of an output.
const TOLERANCE: f64 = 5e-3;

/// Values after each step of a simulation, and the results of the integrations.
struct Simulation {
    reads: Vec<Vec<Read>>,
    integrations: Vec<u32>,
}

/// Compares a simulation of Co-Simulation with an integration of Model Exchange, with constant inputs: once with their start values, and
/// with another value of each of at most four inputs.
pub fn compare(checker: &Checker) -> anyhow::Result<()> {
    let [Some(stepped), Some(integrated)] = [true, false]
        .map(|stepped| checker.trajectories.iter().find(|trajectory| trajectory.is_stepped() == stepped))
    else {
        return Ok(());
    };
    // The program that shows a finding loads one library.
    if checker.setting.libraries[0] != checker.setting.libraries[1] || checker.description.event_mode() {
        return Ok(());
    }
    let description = &checker.description;
    let is_input = |index: &usize| {
        let variable = &description.variables[*index];
        variable.causality == "input"
            && variable.is_float()
            && variable.variability == "continuous"
            && variable.size == Some(1)
            && !variable.start.is_empty()
    };
    let inputs = (0..description.variables.len()).filter(is_input).take(checker.at_most(4));
    for input in std::iter::once(None).chain(inputs.map(Some)) {
        with_input(checker, [stepped, integrated], input)?;
    }
    Ok(())
}

/// Compares the simulations, in which this input has another value than its start value.
fn with_input(
    checker: &Checker,
    [stepped, integrated]: [&Trajectory; 2],
    input: Option<usize>,
) -> anyhow::Result<()> {
    let description = &checker.description;
    let mut outputs = checker.outputs_and_states();
    outputs.truncate(200);
    let size = step_size(description);
    let count = (range(description) / size + 1e-9).floor().clamp(1.0, POINTS as f64) as usize;
    let times: Vec<f64> = (0..=count).map(|index| description.start_time + index as f64 * size).collect();
    let mut all = Writer::new(description, stepped, &outputs);
    let mut simulations = Vec::new();
    // Co-Simulation with the input and, to see whether the input matters there, without it; then the integrations.
    let kinds = [
        (true, 0, false),
        (true, 0, true),
        (false, STEPS, false),
        (false, 2 * STEPS, false),
        (false, 1, false),
    ];
    for (instance, (is_stepped, steps, at_start)) in kinds.into_iter().enumerate() {
        let mut writer = Writer::new(description, if is_stepped { stepped } else { integrated }, &outputs);
        writer.next = all.next;
        writer.write(instance, &[Make]);
        if let Some(input) = input.filter(|_| !at_start) {
            let variable = &description.variables[input];
            let value = near(variable, variable.starts().first().copied().unwrap_or_default(), 0.5);
            writer.set_numbers(instance, input, &[value]);
        }
        writer.write(instance, &[Enter, Leave]);
        let simulation = if is_stepped {
            in_steps(&mut writer, instance, &times, size)
        } else {
            integrate(&mut writer, instance, &times, steps)
        };
        writer.write(instance, &[Free]);
        simulations.push(simulation);
        all.next = writer.next;
        all.sequence.extend(writer.sequence);
    }
    checker.check(
        "results.interfaces",
        all.sequence,
        differs(description.clone(), simulations, outputs, times, input),
    )
}

fn in_steps(writer: &mut Writer, instance: usize, times: &[f64], size: f64) -> Simulation {
    let read = |time: &f64| {
        writer.step(instance, *time, size);
        writer.read(instance)
    };
    Simulation { reads: times[..times.len() - 1].iter().map(read).collect(), integrations: Vec::new() }
}

/// Integrates with this number of steps between communication points; one step is by Euler's method.
fn integrate(writer: &mut Writer, instance: usize, times: &[f64], steps: usize) -> Simulation {
    let states = writer.description.states_count().unwrap_or(0);
    let indicators = writer.description.event_indicators.unwrap_or(0);
    let mut simulation = Simulation { reads: Vec::new(), integrations: Vec::new() };
    for pair in times.windows(2) {
        let how = Integration { begin: pair[0], end: pair[1], steps, euler: steps == 1, states, indicators };
        simulation.integrations.push(writer.add(Step::Integrate(instance, how)));
        simulation.reads.push(writer.read(instance));
    }
    simulation
}

/// A run of the simulations.
struct Compared<'a> {
    run: &'a Run,
    description: &'a Description,
    /// Co-Simulation with and without the input, Model Exchange with `STEPS` and twice as many steps, and with Euler's method.
    simulations: &'a [Simulation],
    /// Number of points that all simulations have reached.
    count: usize,
}

impl Compared<'_> {
    /// Returns the values of a variable at a point in all simulations.
    fn values(&self, point: usize, variable: usize) -> Option<[Values; 5]> {
        let value = |simulation: &Simulation| value_of(self.run, simulation.reads.get(point)?, variable);
        let all: Vec<Values> = self.simulations.iter().map_while(value).collect();
        all.try_into().ok()
    }

    /// Returns the number of state events, and whether there is an event, between a point and the one before.
    fn events(&self, point: usize) -> Option<(f64, bool)> {
        let id = self.simulations[3].integrations.get(point)?;
        let numbers = self.run.written(*id)?.numbers();
        Some((*numbers.get(2)?, numbers[0].is_finite()))
    }

    /// Returns whether there is no event near a point: Co-Simulation may handle an event somewhat earlier or later.
    fn is_quiet(&self, point: usize) -> bool {
        let from = point.saturating_sub(1);
        (from..=point + 1).all(|point| self.events(point).is_some_and(|(_, event)| !event))
    }

    /// Returns the point and the values of an element of a discrete variable where they differ.
    fn discrete(&self, variable: usize) -> Option<(usize, String, String)> {
        let quiet = (0..self.count).filter(|point| self.is_quiet(*point)).find_map(|point| {
            let [stepped, _, fine, finer, euler] = self.values(point, variable)?;
            let certain = fine == finer && euler == finer;
            let index = stepped.differ_beyond(&finer, 1e-6, |_| 0.0).filter(|_| certain)?;
            Some((point, stepped.show(index), finer.show(index)))
        });
        quiet.or_else(|| self.amid_events(variable))
    }

    /// Returns the point and the values of an element of a discrete variable that differs from its values at this and the adjacent
    /// points in Model Exchange, if that holds at three points at least. Co-Simulation may handle an event earlier or later than Model
    /// Exchange, but by no more than a step.
    fn amid_events(&self, variable: usize) -> Option<(usize, String, String)> {
        let single = |point: usize| {
            let numbers = self.run.written(*self.simulations[3].integrations.get(point)?)?.numbers();
            Some(numbers[0] == *numbers.get(1)? || numbers[0].is_infinite())
        };
        let elsewhere = (2..self.count.saturating_sub(1)).filter_map(|point| {
            let near = point - 2..=point + 1;
            let is_single = near.clone().all(|point| single(point) == Some(true));
            let near: Vec<[Values; 5]> =
                near.map(|point| self.values(point, variable)).collect::<Option<_>>()?;
            let certain =
                is_single && near.iter().all(|[_, _, fine, finer, euler]| fine == finer && euler == finer);
            let stepped = &near[2][0];
            let index = stepped.differ_beyond(&near[2][3], 1e-6, |_| 0.0).filter(|_| certain)?;
            let is_known =
                near.iter().any(|values| stepped.differ_beyond(&values[3], 1e-6, |_| 0.0).is_none());
            (!is_known).then(|| (point, stepped.show(index), near[2][3].show(index)))
        });
        let found: Vec<_> = elsewhere.collect();
        if found.len() < 3 { None } else { found.into_iter().next() }
    }

    /// Returns the point and the values of an element of a continuous variable where they differ by more than a solver's error.
    fn continuous(&self, variable: usize) -> Option<(usize, String, String)> {
        let until = (0..self.count).find(|point| self.events(*point).is_none_or(|(states, _)| states > 0.0));
        let points = (0..until.unwrap_or(self.count)).filter(|point| {
            self.is_quiet(*point) || self.events(*point).is_some_and(|(_, event)| !event) && *point == 0
        });
        let all: Vec<(usize, [Values; 5])> =
            points.filter_map(|point| Some((point, self.values(point, variable)?))).collect();
        let size = all.first()?.1[0].numbers().len();
        (0..size).find_map(|element| {
            let series: Vec<(usize, [f64; 5])> = all
                .iter()
                .map(|(point, values)| {
                    let number = |of: &Values| of.numbers().get(element).copied().unwrap_or(f64::NAN);
                    (*point, values.each_ref().map(number))
                })
                .collect();
            let (point, [stepped, .., finer, _]) = unlike(&series, self.description)?;
            Some((point, format!("{stepped:?}"), format!("{finer:?}")))
        })
    }
}

/// Returns the point with the largest difference between Co-Simulation and Model Exchange, if no error of a solver explains it. A solver
/// of first order has an error that is proportional to that of Euler's method; any other is smaller.
fn unlike(series: &[(usize, [f64; 5])], description: &Description) -> Option<(usize, [f64; 5])> {
    let all = |of: fn(&[f64; 5]) -> f64| series.iter().map(move |(_, values)| of(values));
    let most = |numbers: &mut dyn Iterator<Item = f64>| {
        numbers.fold(0.0, |most: f64, number| most.max(number.abs()))
    };
    if series.iter().flat_map(|(_, values)| values).any(|number| !number.is_finite()) {
        return None;
    }
    let (low, high) = all(|values| values[3])
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), number| (low.min(number), high.max(number)));
    let magnitude = most(&mut all(|values| values[3]));
    let scale = (high - low).max(1e-3 * magnitude);
    let own_error = most(&mut all(|values| values[3] - values[2]));
    let euler = most(&mut all(|values| values[4] - values[3]));
    let (above, below) = all(|values| values[4] - values[3])
        .zip(all(|values| values[0] - values[3]))
        .fold((0.0, 0.0), |(above, below), (euler, off)| (above + euler * off, below + euler * euler));
    let part = if below > 0.0 { (above / below).clamp(-1.0, 2.0) } else { 0.0 };
    let remaining = |values: &[f64; 5]| (values[0] - values[3] - part * (values[4] - values[3])).abs();
    let largest = series.iter().max_by(|one, other| remaining(&one.1).total_cmp(&remaining(&other.1)))?;
    let allowed =
        0.5 * euler + TOLERANCE * scale + 4.0 * own_error + 2.0 * description.tolerance() * magnitude;
    (remaining(&largest.1) > allowed.max(1e-9)).then_some(*largest)
}

/// Returns the criterion that Co-Simulation and Model Exchange have the same results.
fn differs(
    description: std::sync::Arc<Description>,
    simulations: Vec<Simulation>,
    outputs: Vec<usize>,
    times: Vec<f64>,
    input: Option<usize>,
) -> impl Criterion {
    move |run: &Run| {
        let done = |point: &usize| {
            let integrated = simulations[2..].iter().all(|of| run.status(of.integrations[*point]) == Some(0));
            let read = simulations.iter().all(|of| of.reads[*point].iter().all(|read| run.succeeds(read.id)));
            integrated && read
        };
        let count = (0..times.len() - 1).take_while(done).count();
        let compared = Compared { run, description: &description, simulations: &simulations, count };
        // Co-Simulation may ignore an input that Model Exchange needs, for example a derivative that it estimates itself.
        let reacts = |variable: &usize| {
            (0..count).any(|point| {
                compared.values(point, *variable).is_some_and(|[one, other, ..]| one.differ(&other).is_some())
            })
        };
        if input.is_some() && !outputs.iter().any(reacts) {
            return None;
        }
        outputs.iter().find_map(|variable| {
            let of = &description.variables[*variable];
            let is_continuous = of.is_float() && of.variability == "continuous";
            let found =
                if is_continuous { compared.continuous(*variable) } else { compared.discrete(*variable) };
            let (point, stepped, integrated) = found?;
            let (name, time) = (&of.name, times[point + 1]);
            Some(format!(
                "{name} is {stepped} in Co-Simulation at {time:?}, integrated in Model Exchange {integrated}"
            ))
        })
    }
}

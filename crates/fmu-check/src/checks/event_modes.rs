//! Checks that what Model Exchange returns after an event, and in Event Mode, belongs to the new discrete states and the present inputs.

use super::derivatives::{derivative, references};
use super::excited::{Excited, excited};
use crate::call_sequence::{Arg, Kind, Run, Values};
use crate::checker::Checker;
use crate::description::Description;
use crate::values::inputs_by;
use crate::writer::Part::Begin;
use crate::writer::{Point, Read, Trajectory, Writer, value_of};
use std::collections::BTreeSet;

/// Smallest difference that counts, relative to the largest magnitude of a number in the simulation. Smaller ones are normal, because FMUs
/// solve algebraic loops by iteration.
const TOLERANCE: f64 = 1e-3;

/// Numbers that are a function of time, states, inputs and discrete states.
struct Unknowns {
    /// Continuous outputs and state derivatives.
    variables: Vec<usize>,
    states: usize,
    indicators: usize,
    /// References of the unknowns and the knowns of partial derivatives, if they are offered.
    partial: Option<[Vec<u32>; 2]>,
}

/// Calls that read the unknowns.
struct Snapshot {
    reads: Vec<Read>,
    /// Each vector with its number of elements.
    vectors: Vec<(u32, usize)>,
}

impl Unknowns {
    fn new(checker: &Checker, trajectory: &Trajectory) -> Self {
        let description = &checker.description;
        let is_continuous = |index: &usize| {
            let variable = &description.variables[*index];
            variable.is_float() && variable.variability == "continuous" && !variable.clocked
        };
        let listed = description.outputs.iter().chain(&description.derivatives);
        let all: BTreeSet<usize> = listed.map(|unknown| unknown.variable).filter(is_continuous).collect();
        let variables: Vec<usize> = all.into_iter().take(200).collect();
        let scalar = |index: &usize| description.variables[*index].size == Some(1);
        let offers = ["providesDirectionalDerivative", "providesDirectionalDerivatives"];
        let partial = checker.can(trajectory.interface, &offers).then(|| {
            let unknowns: Vec<usize> = variables.iter().copied().filter(scalar).collect();
            let inputs = inputs_by(description, 0.5).into_iter().map(|(index, _)| index);
            let knowns: Vec<usize> = inputs.chain(description.states()).filter(scalar).take(40).collect();
            [references(description, &unknowns), references(description, &knowns)]
        });
        Self {
            variables,
            states: description.states_count().unwrap_or(0),
            indicators: description.event_indicators.unwrap_or(0),
            partial: partial.filter(|lists| lists.iter().all(|list| !list.is_empty())),
        }
    }

    fn read(&self, writer: &mut Writer) -> Snapshot {
        let names = [(writer.derivatives_name(), self.states), ("GetEventIndicators", self.indicators)];
        let vectors = names.into_iter().filter(|(_, count)| *count > 0);
        let mut vectors: Vec<(u32, usize)> =
            vectors.map(|(name, count)| (writer.vector(0, name, count), count)).collect();
        let reads = writer.read_these(0, &self.variables);
        if let Some([unknowns, knowns]) = &self.partial {
            // A different weight for each known, so that none compensates another one.
            let seed: Vec<f64> = (0..knowns.len()).map(|index| 1.0 + 0.37 * index as f64).collect();
            let count = unknowns.len();
            vectors.push((
                derivative(writer, "GetDirectionalDerivative", unknowns, knowns, &seed, count),
                count,
            ));
        }
        Snapshot { reads, vectors }
    }

    /// Returns the name of each number of a snapshot.
    fn names(&self, description: &Description) -> Vec<String> {
        let numbered = |what: &str, count: usize| -> Vec<String> {
            (1..=count).map(|number| format!("{what} {number}")).collect()
        };
        let variable = |index: &usize| {
            let of = &description.variables[*index];
            vec![of.name.clone(); of.size.unwrap_or(1)]
        };
        let references = self.partial.as_ref().map_or(&[][..], |[unknowns, _]| unknowns);
        let with_reference = |reference: &u32| {
            let of = description.variables.iter().find(|variable| variable.reference == *reference);
            format!("the partial derivative of {}", of.map_or("", |of| &of.name))
        };
        let mut names = numbered("state derivative", self.states);
        names.extend(numbered("event indicator", self.indicators));
        names.extend(references.iter().map(with_reference));
        names.extend(self.variables.iter().flat_map(variable));
        names
    }

    /// Returns the numbers of a snapshot, `None` for those that could not be read.
    fn numbers(&self, description: &Description, run: &Run, snapshot: &Snapshot) -> Vec<Option<f64>> {
        let sized = |values: Option<Vec<f64>>, count: usize| match values {
            Some(values) if values.len() == count => values.into_iter().map(Some).collect(),
            _ => vec![None; count],
        };
        let vector = |(id, count): &(u32, usize)| {
            let written = run.written(*id).filter(|_| run.succeeds(*id));
            sized(written.map(Values::numbers), *count)
        };
        let variable = |index: &usize| {
            let values = value_of(run, &snapshot.reads, *index).map(|values| values.numbers());
            sized(values, description.variables[*index].size.unwrap_or(1))
        };
        snapshot
            .vectors
            .iter()
            .flat_map(vector)
            .chain(self.variables.iter().flat_map(variable))
            .map(|number: Option<f64>| number.filter(|number| number.is_finite()))
            .collect()
    }
}

/// Snapshots at a point, the later of which have the same time, states and inputs.
struct Here {
    time: f64,
    /// In Event Mode, after the last update.
    in_event: Snapshot,
    /// After Event Mode.
    after: Snapshot,
    /// After the time and the states were set to the values that they had.
    again: Snapshot,
    /// After other states were set, and set back.
    back: Snapshot,
    /// With other inputs, before and after the time and the states were set again.
    inputs: [Snapshot; 2],
    /// With the first inputs, before and after the time and the states were set again.
    fresh: [Snapshot; 2],
    /// With other states, before and after CompletedIntegratorStep.
    completed: [Snapshot; 2],
}

/// Returns the states after the event at each of the points.
fn states_after(checker: &Checker, trajectory: &Trajectory, at: &[usize]) -> anyhow::Result<Vec<Vec<f64>>> {
    let count = checker.description.states_count().unwrap_or(0);
    let mut writer = checker.writer(trajectory);
    writer.begin(0);
    let mut ids = Vec::new();
    for (index, point) in trajectory.points.iter().enumerate() {
        writer.point(0, &Point { event: point.event || at.contains(&index), ..point.clone() });
        if at.contains(&index) && count > 0 {
            ids.push(writer.vector(0, "GetContinuousStates", count));
        }
    }
    let run = checker.execute(&writer.sequence)?;
    Ok(ids.into_iter().map(|id| run.written(id).map(Values::numbers).unwrap_or_default()).collect())
}

/// Checks that unknowns depend on time, states, inputs and discrete states only: after an event and after inputs were set they have the
/// values that they have after all of these were set again, and in Event Mode after the last update, too.
pub fn stale(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let Excited { trajectory, chosen: mut at } = excited(checker, trajectory)?;
    at.sort_unstable();
    let states = states_after(checker, &trajectory, &at)?;
    let mut unknowns = Unknowns::new(checker, &trajectory);
    // An FMU that computes partial derivatives by differences may change what is read afterwards, so they are read separately.
    if let Some(lists) = unknowns.partial.take() {
        let partial = Some(lists);
        let only = Unknowns { variables: Vec::new(), states: 0, indicators: 0, partial };
        depend_on_arguments(checker, &trajectory, &at, &states, only)?;
    }
    depend_on_arguments(checker, &trajectory, &at, &states, unknowns)
}

/// Compares the unknowns at these points of a simulation, at which the states after an event are known.
fn depend_on_arguments(
    checker: &Checker,
    trajectory: &Trajectory,
    at: &[usize],
    states: &[Vec<f64>],
    unknowns: Unknowns,
) -> anyhow::Result<()> {
    let description = &checker.description;
    let mut writer = checker.writer(trajectory);
    writer.begin(0);
    let mut all = Vec::new();
    for (index, point) in trajectory.points.iter().enumerate() {
        let Some(position) = at.iter().position(|chosen| *chosen == index) else {
            writer.point(0, point);
            continue;
        };
        let states = states.get(position).map_or(&[][..], Vec::as_slice);
        all.push(here(&mut writer, &unknowns, point, states));
    }
    let names = unknowns.names(description);
    let (description, of_event) = (description.clone(), std::sync::Arc::new((unknowns, all)));
    let of_stale = (std::sync::Arc::clone(&of_event), description.clone(), names.clone());
    let run = checker.evaluate("dynamics.stale", writer.sequence.clone(), move |run| {
        let (shared, description, names) = &of_stale;
        let (unknowns, all) = &**shared;
        compare(run, description, (unknowns, names), all, |here| {
            let [changed, changed_again] = &here.inputs;
            let [unchanged, fresh] = &here.fresh;
            let [before, completed] = &here.completed;
            vec![
                (&here.after, &here.again, "after an event"),
                (&here.after, fresh, "after an event"),
                (&here.back, &here.again, "after other states were set and set back"),
                (changed, changed_again, "after inputs were set"),
                (unchanged, fresh, "after inputs were set"),
                (before, completed, "before CompletedIntegratorStep"),
            ]
        })
    })?;
    checker.record("dynamics.event-mode", &run, &writer.sequence, move |run| {
        let (unknowns, all) = &*of_event;
        compare(run, &description, (unknowns, &names), all, |here| {
            vec![(&here.in_event, &here.fresh[1], "in Event Mode after the last update")]
        })
    });
    Ok(())
}

/// Writes an event at a point, and the calls that read the unknowns there.
fn here(writer: &mut Writer, unknowns: &Unknowns, point: &Point, states: &[f64]) -> Here {
    let set = |writer: &mut Writer, by: f64| {
        writer.call(0, "SetTime", vec![Arg::real(point.time)]);
        if !states.is_empty() {
            let states: Vec<f64> = states.iter().map(|state| state + by * state.abs().max(1e-3)).collect();
            writer.set_states(0, &states);
        }
    };
    let is_set = |index: usize| point.inputs.iter().any(|(input, _)| *input == index);
    let mut others = inputs_by(writer.description, 0.3);
    others.retain(|(index, _)| is_set(*index));
    writer.point(0, &Point { event: false, ..point.clone() });
    writer.call(0, "EnterEventMode", vec![]);
    writer.update(0);
    let in_event = unknowns.read(writer);
    writer.call(0, "EnterContinuousTimeMode", vec![]);
    let after = unknowns.read(writer);
    set(writer, 0.0);
    let again = unknowns.read(writer);
    set(writer, 1e-3);
    unknowns.read(writer);
    set(writer, 0.0);
    let back = unknowns.read(writer);
    let mut with_inputs = |values: &[(usize, Values)]| {
        writer.set(0, values);
        let before = unknowns.read(writer);
        set(writer, 0.0);
        [before, unknowns.read(writer)]
    };
    let (inputs, fresh) = (with_inputs(&others), with_inputs(&point.inputs));
    set(writer, 1e-3);
    let before = unknowns.read(writer);
    let flag = Arg::Out(if writer.fmi3() { Kind::U8 } else { Kind::I32 }, 1);
    writer.call(0, "CompletedIntegratorStep", vec![Arg::Integer(0), flag.clone(), flag]);
    let completed = [before, unknowns.read(writer)];
    Here { time: point.time, in_event, after, again, back, inputs, fresh, completed }
}

/// Returns a description of the first number of a snapshot that differs from the number of the other one, which was read with the same
/// time, states and inputs.
fn compare(
    run: &Run,
    description: &Description,
    (unknowns, names): (&Unknowns, &[String]),
    all: &[Here],
    pairs: impl Fn(&Here) -> Vec<(&Snapshot, &Snapshot, &'static str)>,
) -> Option<String> {
    let numbers = |snapshot: &Snapshot| unknowns.numbers(description, run, snapshot);
    let mut scale = vec![0.0_f64; names.len()];
    let everything = all.iter().flat_map(|here| {
        [&here.in_event, &here.after, &here.again, &here.back]
            .into_iter()
            .chain(here.inputs.iter().chain(&here.fresh).chain(&here.completed))
    });
    for snapshot in everything {
        for (scale, number) in scale.iter_mut().zip(numbers(snapshot)) {
            *scale = number.map_or(*scale, |number| scale.max(number.abs()));
        }
    }
    all.iter().find_map(|here| {
        // How far the results of calls with equal arguments differ shows the error of an iterative solver.
        let repeated = [&here.again, &here.back, &here.fresh[1]].map(numbers);
        pairs(here).into_iter().find_map(|(one, other, when)| {
            let (one, other) = (numbers(one), numbers(other));
            (0..names.len()).find_map(|index| {
                let (is, must) = (one[index]?, other[index]?);
                let [again, back, fresh] = repeated.each_ref().map(|numbers| numbers[index]);
                let noise = (again? - fresh?).abs().min((back? - fresh?).abs());
                let allowed = TOLERANCE * scale[index] + 100.0 * noise;
                ((is - must).abs() > allowed).then(|| {
                    format!(
                        "{} at {:?} is {is:?} {when}, and {must:?} with the same time, states and inputs later",
                        names[index], here.time
                    )
                })
            })
        })
    })
}

/// Inputs, as in `inputs_by`, that are set in Event Mode and after it. The inputs differ so little from those before, which are 0.5, that
/// they cause no further event in both directions.
const VARIANTS: [(Option<f64>, Option<f64>); 5] =
    [(None, None), (Some(0.501), None), (None, Some(0.501)), (Some(0.499), None), (None, Some(0.499))];

fn set_by(writer: &mut Writer, by: Option<f64>) {
    if let Some(by) = by {
        writer.set(0, &inputs_by(writer.description, by));
    }
}

/// Checks that inputs that are set in Event Mode have an effect afterwards, as in Continuous-Time Mode.
pub fn inputs(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let unknowns = Unknowns { partial: None, indicators: 0, ..Unknowns::new(checker, trajectory) };
    let Excited { trajectory, chosen } = &excited(checker, trajectory)?;
    for index in chosen.iter().copied().take(2) {
        let point = &trajectory.points[index];
        let mut writer = checker.writer(trajectory);
        let snapshots = VARIANTS.map(|(in_event, after)| {
            writer.write(0, &[Begin]);
            trajectory.points[..index].iter().for_each(|point| drop(writer.point(0, point)));
            writer.point(0, &Point { event: false, ..point.clone() });
            writer.call(0, "EnterEventMode", vec![]);
            set_by(&mut writer, in_event);
            writer.update(0);
            writer.call(0, "EnterContinuousTimeMode", vec![]);
            set_by(&mut writer, after);
            let snapshot = unknowns.read(&mut writer);
            writer.free(0);
            snapshot
        });
        has_effect(checker, &unknowns, writer, snapshots)?;
    }
    Ok(())
}

/// If an unknown changes when inputs are set after Event Mode, checks that it also changes when they are set in Event Mode. The snapshots
/// are those of `VARIANTS`.
fn has_effect(
    checker: &Checker,
    unknowns: &Unknowns,
    writer: Writer,
    snapshots: [Snapshot; VARIANTS.len()],
) -> anyhow::Result<()> {
    let description = checker.description.clone();
    let names = unknowns.names(&description);
    let unknowns = Unknowns { variables: unknowns.variables.clone(), partial: None, ..*unknowns };
    checker.check("dynamics.event-inputs", writer.sequence, move |run| {
        let all = snapshots.each_ref().map(|snapshot| unknowns.numbers(&description, run, snapshot));
        names.iter().enumerate().find_map(|(index, name)| {
            let [without, in_event, after, in_event_too, after_too] = all.each_ref().map(|of| of[index]);
            let without = without?;
            let (after, after_too) = (after?, after_too?);
            // Opposite changes have opposite effects, unlike the errors of an iterative solver.
            let (effect, opposite) = (after - without, after_too - without);
            let has_effect = effect.abs() > 1e-6 * after.abs().max(without.abs())
                && (effect + opposite).abs() < 0.2 * effect.abs();
            (in_event? == without && in_event_too? == without && has_effect).then(|| {
                format!(
                    "{name} is {without:?}, also after inputs were set in Event Mode; set in the mode after it, they make it {after:?}"
                )
            })
        })
    })
}

/// Checks that inputs that are set in Event Mode of Co-Simulation have an effect on the next step, as in Step Mode.
pub fn stepped_inputs(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let Some(Point { size, .. }) = trajectory.points.first() else { return Ok(()) };
    let unknowns = Unknowns { partial: None, indicators: 0, states: 0, ..Unknowns::new(checker, trajectory) };
    let mut writer = checker.writer(trajectory);
    let snapshots = VARIANTS.map(|(in_event, after)| {
        writer.make_with(0, |how| how.event_mode = true);
        set_by(&mut writer, Some(0.5));
        writer.enter(0);
        writer.call(0, "ExitInitializationMode", vec![]);
        for number in 0..4 {
            if number > 0 {
                writer.step(0, description.start_time + f64::from(number - 1) * size, *size);
                writer.call(0, "EnterEventMode", vec![]);
            }
            set_by(&mut writer, in_event.filter(|_| number == 2));
            writer.update(0);
            writer.call(0, "EnterStepMode", vec![]);
            set_by(&mut writer, after.filter(|_| number == 2));
        }
        let snapshot = unknowns.read(&mut writer);
        writer.free(0);
        snapshot
    });
    has_effect(checker, &unknowns, writer, snapshots)
}

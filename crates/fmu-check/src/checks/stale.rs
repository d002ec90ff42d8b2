//! Checks that Model Exchange returns values of the current discrete states and inputs, in Event Mode and after it.

use super::integration::{Integrated, integrate_with_events};
use super::snapshots::{Snapshot, Unknowns};
use crate::call_sequence::{Arg, Run, Values};
use crate::checker::Checker;
use crate::description::Description;
use crate::values::inputs_by;
use crate::writer::{Point, Trajectory, Writer};
use std::sync::Arc;

/// Difference that is always allowed, relative to the largest magnitude of the number in the simulation. Small differences are
/// normal, because FMUs solve algebraic loops by iteration.
const TOLERANCE: f64 = 1e-3;

/// Two snapshots whose numbers must be equal, and when the first one was read.
type Pair = (Snapshot, Snapshot, &'static str);

/// Snapshots at a point, all at the same time.
struct PointSnapshots {
    time: f64,
    /// Pairs of the rule dynamics.stale.
    after_event: Vec<Pair>,
    /// Pair of the rule dynamics.event-mode.
    in_event: [Pair; 1],
    /// Snapshots of the rule dynamics.read-order. The states are set to A, B, A and B before them. In the middle two, variables are read
    /// before derivatives, and in the others after them.
    orders: [Snapshot; 4],
    /// Snapshots with equal time, states and inputs, whose differences are the error of an iterative solver.
    repeated: [Snapshot; 3],
}

/// Returns the states after an event at each of the points `at`; they are empty if they were not read.
fn states_after(checker: &Checker, trajectory: &Trajectory, at: &[usize]) -> anyhow::Result<Vec<Vec<f64>>> {
    let count = checker.description.states_count();
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

/// Checks that unknowns are a function of time, states, inputs and discrete states. Their values after an event, after inputs were set, and
/// in Event Mode after the last update must equal their values after the same time, states and inputs were set again, and must not depend
/// on which of them is read first.
pub fn stale(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let Integrated { trajectory, chosen: mut at } = integrate_with_events(checker, trajectory)?;
    at.sort_unstable();
    let states = states_after(checker, &trajectory, &at)?;
    let mut unknowns = Unknowns::new(checker, &trajectory);
    // An FMU that computes partial derivatives by differences may change other values, so partial derivatives are read separately.
    if let directional @ Some(_) = unknowns.directional.take() {
        let only_derivatives = Unknowns { variables: Vec::new(), states: 0, indicators: 0, directional };
        depend_on_arguments(checker, &trajectory, &at, &states, only_derivatives)?;
    }
    depend_on_arguments(checker, &trajectory, &at, &states, unknowns)
}

/// Compares the snapshots at the points `at`. `states` are the states after an event at these points.
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
        all.push(write_point(&mut writer, &unknowns, point, states));
    }
    let names = unknowns.names(description);
    let compared = Arc::new(Compared { description: Arc::clone(description), unknowns, names, points: all });
    let [in_event, in_other_order] = [Arc::clone(&compared), Arc::clone(&compared)];
    let run = checker.evaluate("dynamics.stale", writer.sequence.clone(), move |run| {
        compared.first_difference(run, |point| &point.after_event)
    })?;
    checker.record("dynamics.event-mode", &run, &writer.sequence, move |run| {
        in_event.first_difference(run, |point| &point.in_event)
    });
    checker.record("dynamics.read-order", &run, &writer.sequence, move |run| in_other_order.old_value(run));
    Ok(())
}

/// Writes an event at a point, and the snapshots there. `states` are the states after the event.
fn write_point(writer: &mut Writer, unknowns: &Unknowns, point: &Point, states: &[f64]) -> PointSnapshots {
    // Sets the time, and the states increased by `by` times their magnitude.
    let set_states = |writer: &mut Writer, by: f64| {
        writer.call(0, "SetTime", vec![Arg::real(point.time)]);
        if !states.is_empty() {
            let states: Vec<f64> = states.iter().map(|state| state + by * state.abs().max(1e-3)).collect();
            writer.set_states(0, &states);
        }
    };
    let is_set = |index: usize| point.inputs.iter().any(|(input, _)| *input == index);
    let mut other_values = inputs_by(writer.description, 0.3);
    other_values.retain(|(index, _)| is_set(*index));
    writer.point(0, &Point { event: false, ..point.clone() });
    writer.call(0, "EnterEventMode", vec![]);
    writer.update(0);
    let in_event = unknowns.read(writer);
    writer.call(0, "EnterContinuousTimeMode", vec![]);
    let after = unknowns.read(writer);
    set_states(writer, 0.0);
    let set_again = unknowns.read(writer);
    set_states(writer, 1e-3);
    unknowns.read(writer);
    set_states(writer, 0.0);
    let set_back = unknowns.read(writer);
    let mut with_inputs = |values: &[(usize, Values)]| {
        writer.set(0, values);
        let before = unknowns.read(writer);
        set_states(writer, 0.0);
        [before, unknowns.read(writer)]
    };
    let [other_inputs, other_inputs_again] = with_inputs(&other_values);
    let [first_inputs, first_inputs_again] = with_inputs(&point.inputs);
    set_states(writer, 1e-3);
    let before_completed = unknowns.read(writer);
    writer.complete_step(0);
    let after_completed = unknowns.read(writer);
    let mut read_in_order = |by: f64, is_variables_first: bool| {
        set_states(writer, by);
        match is_variables_first {
            true => unknowns.read_variables_first(writer),
            false => unknowns.read(writer),
        }
    };
    let orders = [(0.0, false), (1e-3, true), (0.0, true), (1e-3, false)]
        .map(|(by, is_variables_first)| read_in_order(by, is_variables_first));
    PointSnapshots {
        time: point.time,
        repeated: [set_again.clone(), set_back.clone(), first_inputs_again.clone()],
        in_event: [(in_event, first_inputs_again.clone(), "in Event Mode after the last update")],
        orders,
        after_event: vec![
            (after.clone(), set_again.clone(), "after an event"),
            (after, first_inputs_again.clone(), "after an event"),
            (set_back, set_again, "after other states were set and set back"),
            (other_inputs, other_inputs_again, "after inputs were set"),
            (first_inputs, first_inputs_again, "after inputs were set"),
            (before_completed, after_completed, "before CompletedIntegratorStep"),
        ],
    }
}

/// Snapshots at several points, and the names of their numbers.
struct Compared {
    description: Arc<Description>,
    unknowns: Unknowns,
    names: Vec<String>,
    points: Vec<PointSnapshots>,
}

impl Compared {
    fn numbers(&self, run: &Run, snapshot: &Snapshot) -> Vec<Option<f64>> {
        self.unknowns.numbers(&self.description, run, snapshot)
    }

    /// Returns the largest magnitude of each number in all snapshots.
    fn magnitudes(&self, run: &Run) -> Vec<f64> {
        let mut magnitudes = vec![0.0_f64; self.names.len()];
        let pairs = self.points.iter().flat_map(|point| point.after_event.iter().chain(&point.in_event));
        let snapshots = pairs.flat_map(|(one, other, _)| [one, other]);
        for snapshot in snapshots {
            for (magnitude, number) in magnitudes.iter_mut().zip(self.numbers(run, snapshot)) {
                *magnitude = number.map_or(*magnitude, |number| magnitude.max(number.abs()));
            }
        }
        magnitudes
    }

    /// Returns the error of an iterative solver in each number at a point.
    fn noise(&self, run: &Run, point: &PointSnapshots) -> Vec<Option<f64>> {
        let [again, back, fresh] = point.repeated.each_ref().map(|snapshot| self.numbers(run, snapshot));
        let noise = |index: usize| {
            let fresh = fresh[index]?;
            Some((again[index]? - fresh).abs().min((back[index]? - fresh).abs()))
        };
        (0..self.names.len()).map(noise).collect()
    }

    /// Describes the first number that keeps its value when the states are set, if derivatives were or were not read before it, although
    /// it depends on the states.
    fn old_value(&self, run: &Run) -> Option<String> {
        self.points.iter().find_map(|point| {
            let noise = self.noise(run, point);
            let [before, variables_first, back, derivatives_first] =
                point.orders.each_ref().map(|snapshot| self.numbers(run, snapshot));
            (0..self.names.len()).find_map(|index| {
                let (first, last) = (variables_first[index]?, derivatives_first[index]?);
                let is_old = first == before[index]? || last == back[index]?;
                let differs = (first - last).abs() > 100.0 * noise[index]? + 1e-9 * first.abs().max(last.abs());
                (is_old && differs).then(|| {
                    format!(
                        "{} at {:?} is {first:?} if it is read before the derivatives, and {last:?} after them, with the same time, states \
                         and inputs",
                        self.names[index], point.time
                    )
                })
            })
        })
    }

    /// Describes the first number that differs between the snapshots of a pair.
    fn first_difference(&self, run: &Run, pairs: impl Fn(&PointSnapshots) -> &[Pair]) -> Option<String> {
        let magnitudes = self.magnitudes(run);
        self.points.iter().find_map(|point| {
            let noise = self.noise(run, point);
            pairs(point).iter().find_map(|(one, other, when)| {
                let (one, other) = (self.numbers(run, one), self.numbers(run, other));
                (0..self.names.len()).find_map(|index| {
                    let (is, must) = (one[index]?, other[index]?);
                    let allowed = TOLERANCE * magnitudes[index] + 100.0 * noise[index]?;
                    ((is - must).abs() > allowed).then(|| {
                        format!(
                            "{} at {:?} is {is:?} {when}, and {must:?} with the same time, states and inputs later",
                            self.names[index], point.time
                        )
                    })
                })
            })
        })
    }
}

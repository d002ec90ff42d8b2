//! Parts of a simulation, from which the checks compose call sequences.

use super::{Point, Read, Writer};
use crate::call_sequence::Arg;

/// Part of a simulation.
#[derive(Clone, Copy, Debug)]
pub enum Part {
    /// Instantiates.
    Make,
    /// Enters Initialization Mode.
    Enter,
    /// Leaves Initialization Mode for the mode in which time advances.
    Leave,
    /// Instantiates and initializes.
    Begin,
    /// Simulates the first points of the trajectory, at most this many.
    Points(usize),
    /// Simulates from this point to the end, with `ReadAll` after each point.
    Run(usize),
    /// Reads the variables.
    Read,
    /// Reads the variables and, in Model Exchange, the vectors: states, derivatives and event indicators.
    ReadAll,
    /// Calls a function without arguments.
    Call(&'static str),
    /// Updates the discrete states until no further update is needed.
    Update,
    /// Saves the state with this index.
    Save(usize),
    /// Restores the saved state with this index.
    Restore(usize),
    /// Frees the saved state with this index.
    Drop(usize),
    Free,
}

/// Calls that were written.
#[derive(Clone, Default)]
pub struct Calls {
    /// Numbers of the calls that do not read variables.
    pub ids: Vec<u32>,
    /// Calls that read variables.
    pub reads: Vec<Read>,
}

impl Writer<'_> {
    /// Writes parts of a simulation.
    pub fn write(&mut self, instance: usize, parts: &[Part]) -> Calls {
        let mut calls = Calls::default();
        let points = &self.trajectory.points;
        for part in parts {
            match *part {
                Part::Make => calls.ids.push(self.make(instance)),
                Part::Enter => calls.ids.push(self.enter(instance)),
                Part::Leave => calls.ids.extend(self.leave(instance)),
                Part::Begin => calls.ids.extend(self.begin(instance)),
                Part::Points(count) => {
                    calls.ids.extend(points.iter().take(count).flat_map(|point| self.point(instance, point)));
                }
                Part::Run(from) => {
                    for point in &points[from..] {
                        calls.ids.extend(self.point(instance, point));
                        calls.reads.extend(self.read_all(instance));
                    }
                }
                Part::Read => calls.reads.extend(self.read(instance)),
                Part::ReadAll => calls.reads.extend(self.read_all(instance)),
                Part::Call(function) => calls.ids.push(self.call(instance, function, vec![])),
                Part::Update => calls.ids.push(self.update(instance)),
                Part::Save(slot) => {
                    calls.ids.push(self.call(instance, "GetFMUState", vec![Arg::StateOut(slot)]))
                }
                Part::Restore(slot) => {
                    calls.ids.push(self.call(instance, "SetFMUState", vec![Arg::State(slot)]))
                }
                Part::Drop(slot) => {
                    calls.ids.push(self.call(instance, "FreeFMUState", vec![Arg::StateOut(slot)]))
                }
                Part::Free => calls.ids.push(self.free(instance)),
            }
        }
        calls
    }

    /// Writes parts of a simulation; returns the reads of each part that reads. There must be `N` such parts.
    pub fn groups<const N: usize>(&mut self, instance: usize, parts: &[Part]) -> [Vec<Read>; N] {
        let groups = parts.iter().filter_map(|part| {
            let reads = self.write(instance, &[*part]).reads;
            matches!(part, Part::Read | Part::ReadAll | Part::Run(_)).then_some(reads)
        });
        let groups: Vec<Vec<Read>> = groups.collect();
        groups.try_into().unwrap_or_else(|_| panic!("the number of parts that read is not {N}"))
    }

    /// Writes a point: in Co-Simulation sets inputs and advances a step; in Model Exchange sets time, states and inputs, and
    /// completes the integrator step. If the point has an event, the event follows.
    pub fn point(&mut self, instance: usize, point: &Point) -> Vec<u32> {
        let mut ids = Vec::new();
        if self.trajectory.is_stepped() {
            ids.extend(self.set(instance, &point.inputs));
            ids.push(self.step(instance, point.time, point.size));
        } else {
            ids.push(self.call(instance, "SetTime", vec![Arg::real(point.time)]));
            if !point.states.is_empty() {
                ids.push(self.set_states(instance, &point.states));
            }
            ids.extend(self.set(instance, &point.inputs));
            ids.push(self.complete_step(instance));
        }
        if point.event {
            ids.extend(self.event(instance));
        }
        ids
    }
}

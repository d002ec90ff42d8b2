//! Reads the numbers that are a function of time, states, inputs and discrete states: outputs, state derivatives, event indicators and
//! partial derivatives.

use super::derivatives::{references, request_derivatives};
use crate::call_sequence::{Run, Values};
use crate::checker::Checker;
use crate::description::Description;
use crate::values::inputs_by;
use crate::writer::{Read, Trajectory, Writer, value_of};
use std::collections::BTreeSet;

/// Unknowns that a snapshot contains.
pub struct Unknowns {
    /// Continuous outputs and state derivatives.
    pub variables: Vec<usize>,
    /// Number of state derivatives.
    pub states: usize,
    /// Number of event indicators.
    pub indicators: usize,
    /// Value references of the unknowns and the knowns of a directional derivative; `None` if the FMU provides no directional derivatives.
    pub directional: Option<[Vec<u32>; 2]>,
}

/// Calls that read the unknowns at one point.
#[derive(Clone)]
pub struct Snapshot {
    reads: Vec<Read>,
    /// Number of the call for each vector, and the number of elements.
    vectors: Vec<(u32, usize)>,
}

impl Unknowns {
    /// Returns the unknowns of an FMU, with at most 200 variables.
    pub fn new(checker: &Checker, trajectory: &Trajectory) -> Self {
        let description = &checker.description;
        let listed = description.outputs.iter().chain(&description.derivatives);
        let all: BTreeSet<usize> = listed.map(|unknown| unknown.variable).collect();
        let is_continuous = |index: &usize| description.is_continuous(*index);
        let variables: Vec<usize> = all.into_iter().filter(is_continuous).take(200).collect();
        let scalar = |index: &usize| description.variables[*index].size == Some(1);
        let offers = ["providesDirectionalDerivative", "providesDirectionalDerivatives"];
        let directional = checker.can(trajectory.interface, &offers).then(|| {
            let unknowns: Vec<usize> = variables.iter().copied().filter(scalar).collect();
            let inputs = inputs_by(description, 0.5).into_iter().map(|(index, _)| index);
            let knowns: Vec<usize> = inputs.chain(description.states()).filter(scalar).take(40).collect();
            [references(description, &unknowns), references(description, &knowns)]
        });
        Self {
            variables,
            states: description.states_count(),
            indicators: description.indicators_count(),
            directional: directional.filter(|lists| lists.iter().all(|list| !list.is_empty())),
        }
    }

    /// Writes the calls of a snapshot.
    pub fn read(&self, writer: &mut Writer) -> Snapshot {
        let vectors = self.read_vectors(writer);
        Snapshot { reads: writer.read_these(0, &self.variables), vectors }
    }

    /// Writes the calls of a snapshot, those that read variables before all others.
    pub fn read_variables_first(&self, writer: &mut Writer) -> Snapshot {
        let reads = writer.read_these(0, &self.variables);
        Snapshot { reads, vectors: self.read_vectors(writer) }
    }

    fn read_vectors(&self, writer: &mut Writer) -> Vec<(u32, usize)> {
        let names = [(writer.derivatives_name(), self.states), ("GetEventIndicators", self.indicators)];
        let vectors = names.into_iter().filter(|(_, count)| *count > 0);
        let mut vectors: Vec<(u32, usize)> =
            vectors.map(|(name, count)| (writer.vector(0, name, count), count)).collect();
        if let Some([unknowns, knowns]) = &self.directional {
            // The weights of the knowns differ, so that the effects of two knowns do not cancel.
            let seed: Vec<f64> = (0..knowns.len()).map(|index| 1.0 + 0.37 * index as f64).collect();
            let count = unknowns.len();
            vectors.push((
                request_derivatives(writer, "GetDirectionalDerivative", unknowns, knowns, &seed, count),
                count,
            ));
        }
        vectors
    }

    /// Returns the name of each number of a snapshot, in the order of `numbers`.
    pub fn names(&self, description: &Description) -> Vec<String> {
        let numbered = |what: &str, count: usize| -> Vec<String> {
            (1..=count).map(|number| format!("{what} {number}")).collect()
        };
        let references = self.directional.as_ref().map_or(&[][..], |[unknowns, _]| unknowns);
        let with_reference = |reference: &u32| {
            let of = description.variables.iter().find(|variable| variable.reference == *reference);
            format!("the partial derivative of {}", of.map_or("", |of| &of.name))
        };
        let mut names = numbered("state derivative", self.states);
        names.extend(numbered("event indicator", self.indicators));
        names.extend(references.iter().map(with_reference));
        names.extend(description.element_names(&self.variables));
        names
    }

    /// Returns the numbers of a snapshot; `None` for numbers that were not read or are not finite.
    pub fn numbers(&self, description: &Description, run: &Run, snapshot: &Snapshot) -> Vec<Option<f64>> {
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

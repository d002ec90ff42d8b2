//! Values of the inputs, or of their time derivatives, in Co-Simulation.

use super::inputs::{Inputs, Numbers};
use super::resampling::Resampling;

/// Inputs of a run.
pub(super) struct InputRows<'a> {
    values: Vec<Signal<'a>>,
    /// Buffer for the values of all inputs at one communication point.
    row: Vec<f64>,
}

/// An input of a run.
#[derive(Clone, Copy)]
enum Signal<'a> {
    Constant(f64),
    Values(&'a [f64]),
    Sampled(&'a Resampling, &'a [f64], bool),
}

impl<'a> InputRows<'a> {
    pub fn new(inputs: &Inputs) -> Self {
        Self { values: Vec::new(), row: vec![0.0; inputs.values.len()] }
    }

    /// Selects the values of a run.
    pub fn begin(&mut self, inputs: &'a Inputs<'a>, run: usize, times: usize) {
        self.values.clear();
        self.values.extend(inputs.values.iter().map(|numbers| match numbers {
            Numbers::Constant(value) => Signal::Constant(*value),
            Numbers::Shared(values) => Signal::Values(values),
            Numbers::EachRun(values) => Signal::Values(&values[run * times..][..times]),
            Numbers::Sampled { resampling, values, is_held, is_each, .. } => {
                let first = if *is_each { run * resampling.length() } else { 0 };
                Signal::Sampled(resampling, &values[first..][..resampling.length()], *is_held)
            }
        }));
    }

    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Returns the values of all inputs at the time with this index.
    #[inline(always)]
    pub fn at(&mut self, time: usize) -> &[f64] {
        for (value, signal) in self.row.iter_mut().zip(&self.values) {
            *value = match signal {
                Signal::Constant(value) => *value,
                Signal::Values(values) => values[time],
                Signal::Sampled(resampling, values, is_held) => resampling.value(values, time, *is_held),
            };
        }
        &self.row
    }
}

//! Values of the inputs, or of their time derivatives, in Co-Simulation.

use super::inputs::Inputs;
use super::series::Series;

/// Inputs of a run.
pub(super) struct InputRows<'a> {
    /// The inputs, and their values in the run.
    values: Vec<(&'a Series<'a, f64>, &'a [f64])>,
    /// Buffer for the values of all inputs at one communication point.
    row: Vec<f64>,
}

impl<'a> InputRows<'a> {
    pub fn new(inputs: &Inputs) -> Self {
        Self { values: Vec::new(), row: vec![0.0; inputs.values.len()] }
    }

    /// Selects the values of a run.
    pub fn begin(&mut self, inputs: &'a Inputs<'a>, run: usize) {
        self.values.clear();
        self.values.extend(inputs.values.iter().map(|series| (series, series.of_run(run))));
    }

    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Returns the values of all inputs at the time with this index.
    #[inline(always)]
    pub fn at(&mut self, time: usize) -> &[f64] {
        for (value, (series, values)) in self.row.iter_mut().zip(&self.values) {
            *value = series.value(values, time);
        }
        &self.row
    }
}

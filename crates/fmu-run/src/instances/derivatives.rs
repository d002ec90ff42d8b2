//! Directional derivatives, and derivatives of inputs and outputs with respect to time.

use super::entry::rows;
use super::{Instances, Mask};
use crate::error::{Error, request};
use crate::selection::Selection;

impl Instances {
    /// Computes the directional derivatives of unknowns into a row for each instance. There is one seed for all instances, or a seed
    /// for each.
    ///
    /// # Errors
    /// Returns [`Error::Request`] unless all variables are Real variables of a single FMU that provides directional derivatives,
    /// and each known is an input, a parameter or a continuous state.
    ///
    /// # Panics
    /// Panics if the number of values is wrong.
    pub fn directional_derivative(
        &mut self,
        unknowns: &Selection,
        (knowns, seed): (&Selection, &[f64]),
        values: &mut [f64],
    ) -> Result<(), Error> {
        let (unknown, known) = (self.real(unknowns)?, self.real(knowns)?);
        let why = "has no directional derivatives (providesDirectionalDerivative is not true)";
        self.system.check_offer(self.interface, |offer| offer.directional_derivatives, why)?;
        if let Some(name) =
            self.description().and_then(|of| knowns.names().iter().find(|name| !of.is_known(name)))
        {
            return request(format!(
                "{name} cannot be a known; expected an input, a parameter or a continuous state"
            ));
        }
        let seed = rows(seed, knowns.len(), self.len());
        self.fill(unknowns.len(), values, |index, _, instance, row| {
            instance.sole().directional_derivative(unknown, known, seed(index), row)
        });
        Ok(())
    }

    /// Sets the first time derivatives of inputs, in Co-Simulation. Only FMI 2.0 supports them.
    ///
    /// # Errors
    /// Returns [`Error::Request`] unless all variables are Real inputs of an FMU that accepts input
    /// derivatives.
    ///
    /// # Panics
    /// Panics if the number of values is wrong.
    pub fn set_input_derivatives(
        &mut self,
        inputs: &Selection,
        values: &[f64],
        mask: Mask,
    ) -> Result<(), Error> {
        let (references, orders) = (self.real(inputs)?, vec![1; inputs.len()]);
        inputs.names().iter().try_for_each(|name| self.system.takes_input_derivative(name).map(drop))?;
        let row = rows(values, inputs.len(), self.len());
        self.alive(mask, |index, _, instance| {
            instance.sole().set_input_derivatives(references, &orders, row(index))
        });
        Ok(())
    }

    /// Reads the first time derivatives of outputs into a row for each instance, in Co-Simulation.
    ///
    /// # Errors
    /// Returns [`Error::Request`] unless all variables are Real variables of a single FMU.
    ///
    /// # Panics
    /// Panics if the length of `values` is wrong.
    pub fn get_output_derivatives(&mut self, outputs: &Selection, values: &mut [f64]) -> Result<(), Error> {
        let references = self.real(outputs)?;
        self.fill(outputs.len(), values, |_, _, instance, row| {
            instance.sole().get_output_derivatives(references, row)
        });
        Ok(())
    }

    /// Returns the value references of the variables. Fails unless all of them are Real and belong to a single FMU.
    fn real<'s>(&self, variables: &'s Selection) -> Result<&'s [u32], Error> {
        let why = "only Real variables have derivatives, of one FMU and not of a system";
        let references = self.system.sole().and_then(|_| variables.references());
        references.ok_or_else(|| Error::Request(why.to_owned()))
    }
}

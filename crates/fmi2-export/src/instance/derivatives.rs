//! Derivatives with respect to variables and to time (sections 2.1.9 and 4.2.1).

use super::{Instance, finite, name, variable};
use crate::call_table::{Interface, Mode};
use crate::logger::Sink;
use crate::model::Model;
use crate::refusal::{Outcome, refuse};
use crate::variable::{BaseType, Causality, Variability, Variable};

impl<M: Model, S: Sink> Instance<M, S> {
    pub fn directional_derivative(
        &self,
        unknown: &[u32],
        known: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Outcome {
        let offered = match self.interface {
            Interface::CoSimulation => {
                M::INFO.co_simulation.is_some_and(|offer| offer.directional_derivative)
            }
            Interface::ModelExchange => {
                M::INFO.model_exchange.is_some_and(|offer| offer.directional_derivative)
            }
        };
        if !offered {
            return refuse(
                "this FMU has no directional derivatives (providesDirectionalDerivative is false)",
            );
        }
        for vr in unknown {
            let variable = variable::<M>(*vr, BaseType::Real)?;
            if variable.causality != Causality::Output && !variable.is_state_derivative() {
                return refuse(format!(
                    "{} is no unknown: neither output nor state derivative",
                    variable.name
                ));
            }
        }
        for (vr, seed) in known.iter().zip(seed) {
            let variable = variable::<M>(*vr, BaseType::Real)?;
            let parameter =
                variable.causality == Causality::Parameter && self.state.mode == Mode::Initialization;
            if variable.causality != Causality::Input && !variable.state && !parameter {
                return refuse(format!("{} is no known: neither input nor state", variable.name));
            }
            if !seed.is_finite() {
                return refuse(format!(
                    "the seed of {} must be a finite number, it is {seed}",
                    variable.name
                ));
            }
        }
        for (unknown, result) in unknown.iter().zip(result) {
            let mut sum = 0.0;
            for (known, seed) in known.iter().zip(seed) {
                let Some(partial) = self.state.model.partial_derivative(*unknown, *known) else {
                    return refuse(format!(
                        "the derivative of {} with respect to {} is not provided",
                        name::<M>(*unknown),
                        name::<M>(*known)
                    ));
                };
                sum += partial * seed;
            }
            *result = finite::<M>(*unknown, sum)?;
        }
        Ok(())
    }

    pub fn set_input_derivatives(&mut self, vr: &[u32], orders: &[i32], values: &[f64]) -> Outcome {
        if !M::INFO.co_simulation.is_some_and(|offer| offer.interpolates_inputs) {
            return refuse("this FMU does not use input derivatives (canInterpolateInputs is false)");
        }
        for ((vr, order), value) in vr.iter().zip(orders).zip(values) {
            let variable = variable::<M>(*vr, BaseType::Real)?;
            if variable.causality != Causality::Input || variable.variability != Variability::Continuous {
                return refuse(format!("{} is no continuous input", variable.name));
            }
            check_order(variable, *order)?;
            if !value.is_finite() {
                return refuse(format!(
                    "the derivative of {} must be a finite number, it is {value}",
                    variable.name
                ));
            }
        }
        for ((vr, order), value) in vr.iter().zip(orders).zip(values) {
            self.state.model.set_input_derivative(*vr, order.unsigned_abs(), *value);
        }
        Ok(())
    }

    pub fn get_output_derivatives(&self, vr: &[u32], orders: &[i32], values: &mut [f64]) -> Outcome {
        if M::INFO.co_simulation.is_none_or(|offer| offer.max_output_derivative_order == 0) {
            return refuse("this FMU has no output derivatives (maxOutputDerivativeOrder is 0)");
        }
        for (vr, order) in vr.iter().zip(orders) {
            check_order(variable::<M>(*vr, BaseType::Real)?, *order)?;
        }
        for ((vr, order), value) in vr.iter().zip(orders).zip(values) {
            *value = finite::<M>(*vr, self.state.model.output_derivative(*vr, order.unsigned_abs()))?;
        }
        Ok(())
    }
}

fn check_order(variable: &Variable, order: i32) -> Outcome {
    if order >= 1 {
        return Ok(());
    }
    refuse(format!("the order of the derivative of {} must be at least 1, it is {order}", variable.name))
}

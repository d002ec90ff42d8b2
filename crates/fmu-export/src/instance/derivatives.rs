//! Derivatives with respect to variables and to time (sections 2.1.9 and 4.2.1).

use super::{Instance, Outcome, finite, refuse, variable};
use crate::export::Exported;
use crate::mode::Mode;
use crate::types::BaseType;
use crate::variable::{Causality, Variability, Variable};
use std::mem::MaybeUninit;

impl<M: Exported> Instance<M> {
    pub fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        result: &mut [MaybeUninit<f64>],
    ) -> Outcome {
        if !M::PARTIALS {
            return refuse(
                "this FMU has no directional derivatives (providesDirectionalDerivative is false)",
            );
        }
        for vr in unknowns {
            let variable = variable::<M>(*vr, BaseType::Real)?;
            if variable.causality() != Causality::Output && !variable.is_state_derivative() {
                return refuse(format!(
                    "{} is no unknown: neither output nor state derivative",
                    variable.name()
                ));
            }
        }
        for (vr, seed) in knowns.iter().zip(seed) {
            let variable = variable::<M>(*vr, BaseType::Real)?;
            let parameter =
                variable.causality() == Causality::Parameter && self.mode() == Mode::Initialization;
            if variable.causality() != Causality::Input && !variable.is_state() && !parameter {
                return refuse(format!("{} is no known: neither input nor state", variable.name()));
            }
            if !seed.is_finite() {
                return refuse(format!(
                    "the seed of {} must be a finite number, it is {seed}",
                    variable.name()
                ));
            }
        }
        let model = self.calculated();
        for (unknown, result) in unknowns.iter().map(|vr| *vr as usize).zip(result) {
            let mut sum = 0.0;
            for (known, seed) in knowns.iter().map(|vr| *vr as usize).zip(seed) {
                let Some(partial) = model.exported_partial(M::NAMES[unknown], M::NAMES[known]) else {
                    return refuse(format!(
                        "the derivative of {} with respect to {} is not provided",
                        M::TABLE[unknown].name(),
                        M::TABLE[known].name()
                    ));
                };
                sum += partial * seed;
            }
            result.write(finite(&M::TABLE[unknown], sum)?);
        }
        Ok(())
    }

    pub fn set_input_derivatives(&mut self, vr: &[u32], orders: &[i32], values: &[f64]) -> Outcome {
        if !M::INPUT_DERIVATIVES {
            return refuse("this FMU does not use input derivatives (canInterpolateInputs is false)");
        }
        for ((vr, order), value) in vr.iter().zip(orders).zip(values) {
            let variable = variable::<M>(*vr, BaseType::Real)?;
            if variable.causality() != Causality::Input || variable.variability() != Variability::Continuous {
                return refuse(format!("{} is no continuous input", variable.name()));
            }
            check_order(variable, *order)?;
            if !value.is_finite() {
                return refuse(format!(
                    "the derivative of {} must be a finite number, it is {value}",
                    variable.name()
                ));
            }
        }
        for ((vr, order), value) in vr.iter().zip(orders).zip(values) {
            let name = M::NAMES[*vr as usize];
            self.state.model.exported_input_derivative(name, order.unsigned_abs(), *value);
        }
        self.state.stale = true;
        Ok(())
    }

    pub fn get_output_derivatives(
        &mut self,
        vr: &[u32],
        orders: &[i32],
        values: &mut [MaybeUninit<f64>],
    ) -> Outcome {
        if M::OUTPUT_DERIVATIVES == 0 {
            return refuse("this FMU has no output derivatives (maxOutputDerivativeOrder is 0)");
        }
        for (vr, order) in vr.iter().zip(orders) {
            check_order(variable::<M>(*vr, BaseType::Real)?, *order)?;
        }
        let model = self.calculated();
        for ((vr, order), value) in vr.iter().zip(orders).zip(values) {
            let variable = &M::TABLE[*vr as usize];
            value.write(finite(variable, derivative(model, *vr as usize, order.unsigned_abs()))?);
        }
        Ok(())
    }
}

/// What stands still has no derivatives; the time has one.
fn derivative<M: Exported>(model: &M, place: usize, order: u32) -> f64 {
    match M::TABLE[place].causality() {
        Causality::Parameter | Causality::CalculatedParameter => 0.0,
        Causality::Independent => f64::from(u8::from(order == 1)),
        _ => model.exported_output_derivative(M::NAMES[place], order),
    }
}

fn check_order<M>(variable: &Variable<M>, order: i32) -> Outcome {
    if order >= 1 {
        return Ok(());
    }
    refuse(format!("the order of the derivative of {} must be at least 1, it is {order}", variable.name()))
}

//! Derivatives with respect to variables (section 2.1.9 of FMI 2.0, 2.2.12 of FMI 3.0) and to time (section 4.2.1 of FMI
//! 2.0, 4.1.2 of FMI 3.0).

use super::{Instance, Outcome, Reference, finite, independent, refuse};
use crate::causality::{Causality, Initial, Variability};
use crate::export::Exported;
use crate::variable::Variable;
use fmi_abi::BaseType;
use fmi_abi::{Mode, Standard};
use std::mem::MaybeUninit;

/// Which way partial derivatives are summed up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direction {
    /// What changes of the knowns make of the unknowns.
    Forward,
    /// The transposed: what the knowns contribute to changes of the unknowns.
    Adjoint,
}

impl<M: Exported> Instance<M> {
    /// The partial derivatives of unknowns with respect to knowns, times the seed: by rows for a directional
    /// derivative, by columns for an adjoint one.
    pub fn derivatives<R: Reference>(
        &mut self,
        unknowns: &[R],
        knowns: &[R],
        seed: &[f64],
        result: &mut [MaybeUninit<f64>],
        direction: Direction,
    ) -> Outcome {
        if !M::PARTIALS {
            return refuse(match (self.standard(), direction) {
                (Standard::Fmi2, _) => {
                    "this FMU has no directional derivatives (providesDirectionalDerivative is false)"
                }
                (_, Direction::Forward) => {
                    "this FMU has no directional derivatives (providesDirectionalDerivatives is false)"
                }
                (_, Direction::Adjoint) => {
                    "this FMU has no adjoint derivatives (providesAdjointDerivatives is false)"
                }
            });
        }
        let initial = self.mode() == Mode::Initialization;
        for vr in unknowns {
            check_unknown(self.variable(vr.place(), BaseType::Real)?, initial)?;
        }
        for vr in knowns {
            check_known(self.variable(vr.place(), BaseType::Real)?, initial)?;
        }
        let (seeded, wanted) = match direction {
            Direction::Forward => (knowns, unknowns),
            Direction::Adjoint => (unknowns, knowns),
        };
        for (vr, seed) in seeded.iter().zip(seed) {
            if !seed.is_finite() {
                let name = self.name(vr.place(), BaseType::Real)?;
                return refuse(format!("the seed of {name} must be a finite number, it is {seed}"));
            }
        }
        self.calculated();
        let model = &self.state.model;
        let (time, _) = independent::<M>();
        for (wanted, result) in wanted.iter().zip(result) {
            let mut sum = 0.0;
            for (seeded, seed) in seeded.iter().zip(seed) {
                let (unknown, known) = match direction {
                    Direction::Forward => (wanted.place(), seeded.place()),
                    Direction::Adjoint => (seeded.place(), wanted.place()),
                };
                let by = (known != time).then(|| M::element(known));
                let Some(partial) = model.exported_partial(M::element(unknown), by, initial) else {
                    return refuse(format!(
                        "the derivative of {} with respect to {} is not provided",
                        self.name(unknown, BaseType::Real)?,
                        self.name(known, BaseType::Real)?
                    ));
                };
                sum += partial * seed;
            }
            result.write(finite(self.variable(wanted.place(), BaseType::Real)?, sum)?);
        }
        Ok(())
    }

    pub fn set_input_derivatives(&mut self, vr: &[u32], orders: &[i32], values: &[f64]) -> Outcome {
        if !M::INPUT_DERIVATIVES {
            return refuse("this FMU does not use input derivatives (canInterpolateInputs is false)");
        }
        for ((vr, order), value) in vr.iter().zip(orders).zip(values) {
            let variable = self.variable(vr.place(), BaseType::Real)?;
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
            self.state.model.exported_input_derivative(M::element(*vr), order.unsigned_abs(), *value);
        }
        self.state.stale = true;
        Ok(())
    }

    pub fn get_output_derivatives<R: Reference>(
        &mut self,
        vr: &[R],
        orders: &[i32],
        values: &mut [MaybeUninit<f64>],
    ) -> Outcome {
        if M::OUTPUT_DERIVATIVES == 0 {
            return refuse("this FMU has no output derivatives (maxOutputDerivativeOrder is 0)");
        }
        for (vr, order) in vr.iter().zip(orders) {
            let variable = self.variable(vr.place(), BaseType::Real)?;
            check_order(variable, *order)?;
            // Section 4.3.1 of FMI 2.0, 4.4.1 of FMI 3.0.
            if order.unsigned_abs() > M::OUTPUT_DERIVATIVES {
                return refuse(format!(
                    "the order of the derivative of {} must be at most {} (maxOutputDerivativeOrder), it is {order}",
                    variable.name(),
                    M::OUTPUT_DERIVATIVES
                ));
            }
            if super::indicator::<M>(vr.place()).is_some() {
                return refuse("event indicators have no output derivatives");
            }
        }
        let model = self.calculated();
        for ((vr, order), value) in vr.iter().zip(orders).zip(values) {
            let place = vr.place() as usize;
            value.write(match M::TABLE.get(place) {
                Some(variable) => finite(variable, derivative(model, place, order.unsigned_abs()))?,
                None => derivative_of_time(*order),
            });
        }
        Ok(())
    }
}

/// What the instance calculates: outputs and derivatives of states, while initializing all InitialUnknowns (section
/// 2.1.9 of FMI 2.0).
fn check_unknown<M>(variable: &Variable<M>, initial: bool) -> Outcome {
    let calculated = matches!(variable.initial(), Some(Initial::Calculated | Initial::Approx));
    let is_initial = variable.causality() == Causality::CalculatedParameter || variable.is_state();
    if variable.causality() == Causality::Output
        || variable.differentiates().is_some()
        || initial && calculated && is_initial
    {
        return Ok(());
    }
    refuse(format!("{} is no unknown: neither output nor state derivative", variable.name()))
}

/// What the importer sets: inputs, states and parameters, while initializing all that is exact (section 2.2.8 of FMI 2.0).
/// Parameters may be set at any time, whether the description calls them tunable or not. FMI 2.0 has them among the knowns
/// in initialization mode alone; CasADi asks later.
fn check_known<M>(variable: &Variable<M>, initial: bool) -> Outcome {
    let name = variable.name();
    match variable.causality() {
        Causality::Input | Causality::Parameter | Causality::Independent => Ok(()),
        _ if variable.variability() == Variability::Constant => {
            refuse(format!("{name} is no known: it is constant"))
        }
        _ if initial && variable.initial() == Some(Initial::Exact) => Ok(()),
        _ if initial && variable.is_state() => {
            refuse(format!("{name} is no known in initialization mode, where it is calculated"))
        }
        _ if variable.is_state() => Ok(()),
        _ => refuse(format!("{name} is no known: neither input, parameter nor state")),
    }
}

/// What stands still has no derivatives; the time has one.
fn derivative<M: Exported>(model: &M, place: usize, order: u32) -> f64 {
    match M::TABLE[place].causality() {
        Causality::Parameter | Causality::CalculatedParameter => 0.0,
        Causality::Independent => derivative_of_time(order.cast_signed()),
        _ => model.exported_output_derivative(M::element(place as u32), order),
    }
}

fn derivative_of_time(order: i32) -> f64 {
    f64::from(u8::from(order == 1))
}

fn check_order<M>(variable: &Variable<M>, order: i32) -> Outcome {
    if order >= 1 {
        return Ok(());
    }
    refuse(format!("the order of the derivative of {} must be at least 1, it is {order}", variable.name()))
}

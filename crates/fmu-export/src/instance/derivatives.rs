//! Derivatives with respect to variables (section 2.1.9 of FMI 2.0, 2.2.12 of FMI 3.0) and to time (section 4.2.1 of FMI
//! 2.0, 4.1.2 of FMI 3.0).

use super::values::is_finite;
use super::{Instance, Outcome, Reference, finite, independent, reject};
use crate::export::Exported;
use crate::variable::Variable;
use fmi_abi::BaseType;
use fmi_abi::{Causality, Initial, Variability};
use fmi_abi::{Mode, Standard};
use std::mem::MaybeUninit;

impl<M: Exported> Instance<M> {
    /// Multiplies the partial derivatives by the seed and adds the products to `sums`, which must be zero before. A
    /// directional derivative is a sum over the knowns, an adjoint derivative a sum over the unknowns.
    #[inline]
    pub fn derivatives<R: Reference, const ADJOINT: bool>(
        &mut self,
        unknowns: &[R],
        knowns: &[R],
        seed: &[f64],
        sums: &mut [f64],
    ) -> Outcome {
        if !M::PARTIALS {
            return self.reject_derivatives(ADJOINT);
        }
        self.calculated();
        let initial = self.mode() == Mode::Initialization;
        // The total is finite only if all sums are, and a sum is finite only if all its seeds are, so one check is
        // enough.
        let mut total = 0.0;
        for (column, known) in knowns.iter().enumerate() {
            self.check_known(*known, initial)?;
            let is_time = known.index() == independent::<M>().0;
            let by = (!is_time).then(|| M::element(known.index()));
            let partial = self.state.model.exported_partials(by, initial);
            let mut add = |unknown: R, seed: f64, sum: &mut f64| {
                self.check_unknown(unknown, initial)?;
                let Some(partial) = partial(M::element(unknown.index())) else {
                    return self.reject_partial(unknown, *known);
                };
                *sum += partial * seed;
                total += *sum;
                Ok(())
            };
            if ADJOINT {
                let mut pairs = unknowns.iter().zip(seed);
                pairs.try_for_each(|(unknown, seed)| add(*unknown, *seed, &mut sums[column]))?;
            } else {
                let mut pairs = unknowns.iter().zip(&mut *sums);
                pairs.try_for_each(|(unknown, sum)| add(*unknown, seed[column], sum))?;
            }
        }
        if is_finite(total) && !unknowns.is_empty() && !knowns.is_empty() {
            return Ok(());
        }
        unknowns.iter().try_for_each(|unknown| self.check_unknown(*unknown, initial))?;
        let (seeded, wanted) = if ADJOINT { (unknowns, knowns) } else { (knowns, unknowns) };
        self.reject_numbers(seeded, seed, wanted, sums)
    }

    /// Returns an error for the first seed or sum that is not finite, if there is one.
    #[cold]
    #[inline(never)]
    fn reject_numbers<R: Reference>(
        &self,
        seeded: &[R],
        seed: &[f64],
        wanted: &[R],
        sums: &[f64],
    ) -> Outcome {
        if let Some((vr, seed)) = seeded.iter().zip(seed).find(|(_, seed)| !seed.is_finite()) {
            let name = self.name(*vr, BaseType::Real)?;
            return reject(format!("the seed of {name} must be a finite number, it is {seed}"));
        }
        for (vr, sum) in wanted.iter().zip(sums) {
            finite(self.variable(vr.index(), BaseType::Real)?, *sum)?;
        }
        Ok(())
    }

    #[cold]
    #[inline(never)]
    fn reject_derivatives(&self, adjoint: bool) -> Outcome {
        let plural = if self.standard() == Standard::Fmi2 { "" } else { "s" };
        let (kind, capability) =
            if adjoint { ("adjoint", "Adjoint") } else { ("directional", "Directional") };
        reject(format!(
            "this FMU has no {kind} derivatives (provides{capability}Derivative{plural} is false)"
        ))
    }

    #[cold]
    #[inline(never)]
    fn reject_partial<R: Reference>(&self, unknown: R, known: R) -> Outcome {
        reject(format!(
            "the derivative of {} with respect to {} is not provided",
            self.name(unknown, BaseType::Real)?,
            self.name(known, BaseType::Real)?
        ))
    }

    /// Checks that a variable is an unknown. Unknowns are the outputs and the derivatives of states, and in
    /// Initialization Mode also the other InitialUnknowns (section 2.1.9 of FMI 2.0).
    #[inline]
    fn check_unknown<R: Reference>(&self, unknown: R, initial: bool) -> Outcome {
        let is_unknown = |of: &Variable<M>| {
            of.base() == BaseType::Real
                && (of.causality() == Causality::Output || of.differentiates().is_some())
        };
        if M::TABLE.get(unknown.index() as usize).is_some_and(is_unknown) {
            return Ok(());
        }
        self.check_initial_unknown(unknown.index(), initial)
    }

    #[cold]
    #[inline(never)]
    fn check_initial_unknown(&self, index: u32, initial: bool) -> Outcome {
        let variable = self.variable(index, BaseType::Real)?;
        let calculated = matches!(variable.initial(), Some(Initial::Calculated | Initial::Approx));
        let is_initial = variable.causality() == Causality::CalculatedParameter || variable.is_state();
        if initial && calculated && is_initial {
            return Ok(());
        }
        reject(format!("{} is not an unknown: neither output nor state derivative", variable.name()))
    }

    /// Checks that a variable is a known. Knowns are inputs, parameters, states and the time; in Initialization Mode,
    /// variables with `initial` "exact" take the place of the states (section 2.2.8 of FMI 2.0). Parameters are knowns
    /// at any time, whether they are tunable or not. FMI 2.0 allows this only in Initialization Mode, but CasADi also
    /// needs it later.
    #[inline]
    fn check_known<R: Reference>(&self, known: R, initial: bool) -> Outcome {
        let is_known = |of: &Variable<M>| {
            let is_set = match of.causality() {
                Causality::Input | Causality::Parameter | Causality::Independent => true,
                _ if of.variability() == Variability::Constant => false,
                _ if initial => of.initial() == Some(Initial::Exact),
                _ => of.is_state(),
            };
            is_set && of.base() == BaseType::Real
        };
        match M::TABLE.get(known.index() as usize).is_some_and(is_known) {
            true => Ok(()),
            false => self.reject_known(known.index()),
        }
    }

    /// Rejects a variable that is not a known, unless it is the time of FMI 3.0, which may be after the table.
    #[cold]
    #[inline(never)]
    fn reject_known(&self, index: u32) -> Outcome {
        let variable = self.variable(index, BaseType::Real)?;
        if variable.causality() == Causality::Independent {
            return Ok(());
        }
        let why = if variable.variability() == Variability::Constant {
            "not a known: it is constant"
        } else if variable.is_state() {
            "not a known in initialization mode, where it is calculated"
        } else {
            "not a known: neither input, parameter nor state"
        };
        reject(format!("{} is {why}", variable.name()))
    }

    pub fn set_input_derivatives(&mut self, vr: &[u32], orders: &[i32], values: &[f64]) -> Outcome {
        if !M::INPUT_DERIVATIVES {
            return reject("this FMU does not use input derivatives (canInterpolateInputs is false)");
        }
        for ((vr, order), value) in vr.iter().zip(orders).zip(values) {
            let variable = self.variable(vr.index(), BaseType::Real)?;
            if variable.causality() != Causality::Input || variable.variability() != Variability::Continuous {
                return reject(format!("{} is not a continuous input", variable.name()));
            }
            check_order(variable, *order)?;
            if !value.is_finite() {
                return reject(format!(
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
            return reject("this FMU has no output derivatives (maxOutputDerivativeOrder is 0)");
        }
        for (vr, order) in vr.iter().zip(orders) {
            let variable = self.variable(vr.index(), BaseType::Real)?;
            check_order(variable, *order)?;
            // Maximum order: section 4.3.1 of FMI 2.0, 4.4 of FMI 3.0.
            if order.unsigned_abs() > M::OUTPUT_DERIVATIVES {
                return reject(format!(
                    "the order of the derivative of {} must be at most {} (maxOutputDerivativeOrder), it is {order}",
                    variable.name(),
                    M::OUTPUT_DERIVATIVES
                ));
            }
            if super::indicator::<M>(vr.index()).is_some() {
                return reject("event indicators have no output derivatives");
            }
        }
        let model = self.calculated();
        for ((vr, order), value) in vr.iter().zip(orders).zip(values) {
            let index = vr.index() as usize;
            value.write(match M::TABLE.get(index) {
                Some(variable) => finite(variable, derivative::<M>(model, index, order.unsigned_abs()))?,
                None => derivative_of_time(*order),
            });
        }
        Ok(())
    }
}

/// Returns a time derivative of a variable. It is 0 for a parameter; for the time, it is 1 if the order is 1,
/// otherwise 0.
fn derivative<M: Exported>(model: &M, index: usize, order: u32) -> f64 {
    match M::TABLE[index].causality() {
        Causality::Parameter | Causality::CalculatedParameter => 0.0,
        Causality::Independent => derivative_of_time(order.cast_signed()),
        _ => model.exported_output_derivative(M::element(index as u32), order),
    }
}

fn derivative_of_time(order: i32) -> f64 {
    f64::from(u8::from(order == 1))
}

fn check_order<M>(variable: &Variable<M>, order: i32) -> Outcome {
    if order >= 1 {
        return Ok(());
    }
    reject(format!("the order of the derivative of {} must be at least 1, it is {order}", variable.name()))
}

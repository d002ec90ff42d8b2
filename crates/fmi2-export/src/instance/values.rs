//! Values (section 2.1.7).

use super::{Instance, finite, variable};
use crate::call_table::Interface;
use crate::logger::Sink;
use crate::model::Model;
use crate::refusal::{Outcome, refuse, refuse_with};
use crate::types::fmi2String;
use crate::variable::{BaseType, Causality, Kind, Variable};

impl<M: Model, S: Sink> Instance<M, S> {
    #[inline]
    pub fn get_real(&self, vr: &[u32], values: &mut [f64]) -> Outcome {
        for vr in vr {
            variable::<M>(*vr, BaseType::Real)?;
        }
        for (vr, value) in vr.iter().zip(values) {
            *value = finite::<M>(*vr, self.state.model.real(*vr))?;
        }
        Ok(())
    }

    pub fn get_integer(&self, vr: &[u32], values: &mut [i32]) -> Outcome {
        for vr in vr {
            variable::<M>(*vr, BaseType::Integer)?;
        }
        for (vr, value) in vr.iter().zip(values) {
            *value = self.state.model.integer(*vr);
        }
        Ok(())
    }

    pub fn get_boolean(&self, vr: &[u32], values: &mut [i32]) -> Outcome {
        for vr in vr {
            variable::<M>(*vr, BaseType::Boolean)?;
        }
        for (vr, value) in vr.iter().zip(values) {
            *value = i32::from(self.state.model.boolean(*vr));
        }
        Ok(())
    }

    /// There are no String variables: every value reference is of another type or unknown.
    pub fn get_string(&self, vr: &[u32], _values: &mut [fmi2String]) -> Outcome {
        vr.iter().try_for_each(|vr| variable::<M>(*vr, BaseType::String).map(|_| ()))
    }

    /// See [`get_string`](Self::get_string).
    pub fn set_string(&mut self, vr: &[u32], _values: &[fmi2String]) -> Outcome {
        self.get_string(vr, &mut [])
    }

    #[inline]
    pub fn set_real(&mut self, vr: &[u32], values: &[f64]) -> Outcome {
        let mut parameters = false;
        for (vr, value) in vr.iter().zip(values) {
            let variable = variable::<M>(*vr, BaseType::Real)?;
            self.check_settable(variable)?;
            if !value.is_finite() {
                return refuse_with(move || {
                    format!("{} must be a finite number, it is {value}", variable.name)
                });
            }
            if variable.causality == Causality::Parameter {
                parameters = true;
                check_real_range(variable, *value)?;
            }
        }
        self.assign(parameters, |model| {
            for (vr, value) in vr.iter().zip(values) {
                model.set_real(*vr, *value);
            }
        })
    }

    pub fn set_integer(&mut self, vr: &[u32], values: &[i32]) -> Outcome {
        for (vr, value) in vr.iter().zip(values) {
            let variable = variable::<M>(*vr, BaseType::Integer)?;
            self.check_settable(variable)?;
            if let Kind::Integer { min, max, .. } = variable.kind
                && !(min..=max).contains(value)
            {
                return refuse(format!("{} must be between {min} and {max}, it is {value}", variable.name));
            }
        }
        self.assign(true, |model| {
            for (vr, value) in vr.iter().zip(values) {
                model.set_integer(*vr, *value);
            }
        })
    }

    pub fn set_boolean(&mut self, vr: &[u32], values: &[i32]) -> Outcome {
        for (vr, value) in vr.iter().zip(values) {
            let variable = variable::<M>(*vr, BaseType::Boolean)?;
            self.check_settable(variable)?;
            if !(0..=1).contains(value) {
                return refuse(format!("{} must be 0 (false) or 1 (true), it is {value}", variable.name));
            }
        }
        self.assign(true, |model| {
            for (vr, value) in vr.iter().zip(values) {
                model.set_boolean(*vr, *value == 1);
            }
        })
    }

    #[inline]
    fn check_settable(&self, variable: &Variable) -> Outcome {
        let modes = match self.interface {
            Interface::CoSimulation => variable.settable.co_simulation,
            Interface::ModelExchange => variable.settable.model_exchange,
        };
        if modes.contains(self.state.mode) {
            return Ok(());
        }
        let Self { state, interface, .. } = self;
        refuse_with(move || {
            format!(
                "{} cannot be set in state '{}' of {interface}; it can be set in: {modes}",
                variable.name, state.mode
            )
        })
    }

    /// Inputs and states are just set; a change of parameters is tried on a copy first, because the
    /// model may refuse the combination.
    #[inline]
    fn assign(&mut self, parameters: bool, set: impl Fn(&mut M)) -> Outcome {
        if !parameters {
            set(&mut self.state.model);
            return Ok(());
        }
        self.assign_parameters(set)
    }

    #[cold]
    #[inline(never)]
    fn assign_parameters(&mut self, set: impl Fn(&mut M)) -> Outcome {
        let mut draft = self.state.model.clone();
        set(&mut draft);
        draft.parameters_changed()?;
        self.state.model = draft;
        Ok(())
    }
}

#[cold]
fn check_real_range(variable: &Variable, value: f64) -> Outcome {
    if let Kind::Real { of, .. } = variable.kind {
        if let Some(min) = of.min
            && value < min
        {
            return refuse(format!("{} must not be below {min}, it is {value}", variable.name));
        }
        if let Some(max) = of.max
            && value > max
        {
            return refuse(format!("{} must not be above {max}, it is {value}", variable.name));
        }
    }
    Ok(())
}

//! Model Exchange (section 3.2).

use super::{Instance, finite, name};
use crate::call_table::Mode;
use crate::logger::Sink;
use crate::model::Model;
use crate::refusal::{Outcome, refuse};
use crate::variable::Kind;

impl<M: Model, S: Sink> Instance<M, S> {
    pub fn enter_event_mode(&mut self) {
        self.state.mode = Mode::Event;
    }

    pub fn enter_continuous_time_mode(&mut self) {
        self.state.mode = Mode::ContinuousTime;
    }

    pub fn set_time(&mut self, time: f64) -> Outcome {
        if !time.is_finite() {
            return refuse(format!("the time must be a finite number, it is {time}"));
        }
        self.state.time = time;
        self.state.model.set_time(time);
        Ok(())
    }

    pub fn set_continuous_states(&mut self, x: &[f64]) -> Outcome {
        check_count::<M>(x.len())?;
        for (vr, value) in M::INFO.states().zip(x) {
            if !value.is_finite() {
                return refuse(format!("{} must be a finite number, it is {value}", name::<M>(vr)));
            }
        }
        for (vr, value) in M::INFO.states().zip(x) {
            self.state.model.set_real(vr, *value);
        }
        Ok(())
    }

    pub fn get_continuous_states(&self, x: &mut [f64]) -> Outcome {
        self.fill(M::INFO.states(), x)
    }

    pub fn get_derivatives(&self, derivatives: &mut [f64]) -> Outcome {
        self.fill(M::INFO.derivatives(), derivatives)
    }

    fn fill(&self, vrs: impl Iterator<Item = u32>, values: &mut [f64]) -> Outcome {
        check_count::<M>(values.len())?;
        for (vr, value) in vrs.zip(values) {
            *value = finite::<M>(vr, self.state.model.real(vr))?;
        }
        Ok(())
    }

    pub fn get_nominals(&self, nominals: &mut [f64]) -> Outcome {
        check_count::<M>(nominals.len())?;
        for (vr, value) in M::INFO.states().zip(nominals) {
            if let Kind::Real { of, .. } = M::INFO.variables[vr as usize].kind {
                *value = of.nominal.unwrap_or(1.0);
            }
        }
        Ok(())
    }

    /// There are no event indicators, so the only array that fits is empty.
    pub fn get_event_indicators(&self, count: usize) -> Outcome {
        if count == 0 { Ok(()) } else { refuse(format!("there are no event indicators, not {count}")) }
    }
}

fn check_count<M: Model>(count: usize) -> Outcome {
    let states = M::INFO.states().count();
    if count == states {
        return Ok(());
    }
    refuse(format!("the model has {states} continuous states, the array has {count} elements"))
}

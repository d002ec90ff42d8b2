//! Model Exchange (section 3.2 of both FMI versions).

use super::{Instance, Outcome, finite, reject};
use crate::capabilities::{Event, StepCompleted};
use crate::export::Exported;
use crate::table::StateOfTable;
use fmi_abi::{Interface, Mode};
use std::mem::MaybeUninit;

impl<M: Exported> Instance<M> {
    pub fn enter_event_mode(&mut self) -> Outcome {
        if self.interface() == Interface::CoSimulation && !self.importer.event_mode {
            return reject("the instance was created without Event Mode (eventModeUsed was false)");
        }
        self.enter(Mode::Event);
        Ok(())
    }

    /// Number of event indicators.
    pub const INDICATORS: usize = match M::MODEL_EXCHANGE {
        Some(offer) => offer.indicators,
        None => 0,
    };

    /// Performs one iteration of an event.
    pub fn event(&mut self) -> Outcome<Event> {
        let time = self.state.time;
        let event = self.try_change(|model| {
            model.calculate(time);
            model.exported_event(time)
        })?;
        self.state.ended |= event.terminate;
        Ok(event)
    }

    pub fn enter_continuous_time_mode(&mut self) {
        self.state.model.exported_continuous_time_entered();
        (self.state.stale, self.state.started) = (true, true);
        self.enter(Mode::ContinuousTime);
    }

    pub fn step_completed(&mut self) -> StepCompleted {
        if M::MODEL_EXCHANGE.is_none_or(|offer| !offer.step_completed) {
            return StepCompleted::default();
        }
        self.calculated();
        self.state.stale = true;
        self.state.model.exported_step_completed(self.state.time)
    }

    pub fn set_time(&mut self, time: f64) -> Outcome {
        if !time.is_finite() {
            return reject(format!("the time must be a finite number, it is {time}"));
        }
        self.state.time = time;
        self.state.stale = true;
        Ok(())
    }

    pub fn set_continuous_states(&mut self, x: &[f64]) -> Outcome {
        check_count::<M>(x.len())?;
        for (StateOfTable { state, .. }, value) in M::STATES.iter().zip(x) {
            if !value.is_finite() {
                let name = M::TABLE[*state as usize].name();
                return reject(format!("{name} must be a finite number, it is {value}"));
            }
        }
        for (StateOfTable { state, .. }, value) in M::STATES.iter().zip(x) {
            M::TABLE[*state as usize].set_real(&mut self.state.model, *value);
        }
        self.state.stale = true;
        Ok(())
    }

    pub fn get_continuous_states(&mut self, x: &mut [MaybeUninit<f64>]) -> Outcome {
        self.fill(x, |state| state.state)
    }

    pub fn get_derivatives(&mut self, derivatives: &mut [MaybeUninit<f64>]) -> Outcome {
        self.fill(derivatives, |state| state.derivative)
    }

    fn fill(&mut self, values: &mut [MaybeUninit<f64>], which: impl Fn(&StateOfTable) -> u32) -> Outcome {
        check_count::<M>(values.len())?;
        if M::ARRAYS {
            return self.get_reals_of_arrays(|number| which(&M::STATES[number]), values);
        }
        let model = self.calculated();
        for (state, value) in M::STATES.iter().zip(values) {
            let variable = &M::TABLE[which(state) as usize];
            value.write(finite(variable, variable.real(model).unwrap_or_default())?);
        }
        Ok(())
    }

    pub fn get_nominals(&mut self, nominals: &mut [MaybeUninit<f64>]) -> Outcome {
        check_count::<M>(nominals.len())?;
        let of_types =
            M::STATES.iter().map(|state| M::TABLE[state.state as usize].variable_type().nominal_or_one());
        let mut now: Vec<f64> = of_types.collect();
        self.calculated().exported_nominals(&mut now);
        if let Some(index) = now.iter().position(|nominal| !(nominal.is_finite() && *nominal > 0.0)) {
            let name = M::TABLE[M::STATES[index].state as usize].name();
            return reject(format!(
                "the nominal value of {name} must be finite and > 0, the model returns {}",
                now[index]
            ));
        }
        nominals.iter_mut().zip(now).for_each(|(nominal, now)| {
            nominal.write(now);
        });
        Ok(())
    }

    pub fn get_event_indicators(&mut self, indicators: &mut [MaybeUninit<f64>]) -> Outcome {
        let count = Self::INDICATORS;
        if indicators.len() != count {
            let number = if count == 0 { "no".to_owned() } else { count.to_string() };
            return reject(format!("there are {number} event indicators, not {}", indicators.len()));
        }
        indicators.iter_mut().zip(self.indicators()?).for_each(|(indicator, now)| {
            indicator.write(now);
        });
        Ok(())
    }

    pub fn indicators(&mut self) -> Outcome<Vec<f64>> {
        let mut now = vec![0.0; Self::INDICATORS];
        if Self::INDICATORS > 0 {
            self.calculated().exported_indicators(&mut now);
        }
        if let Some(index) = now.iter().position(|indicator| !indicator.is_finite()) {
            return reject(format!("event indicator {index} is not a finite number"));
        }
        Ok(now)
    }
}

fn check_count<M: Exported>(count: usize) -> Outcome {
    let states = M::STATES.len();
    if count == states {
        return Ok(());
    }
    reject(format!("the model has {states} continuous states, the array has {count} elements"))
}

//! The functions of Model Exchange.

use super::entry::rows;
use super::{Instances, Mask};
use crate::error::{Error, request};
use crate::selection::Selection;
use fmi_abi::client::Continuous;

impl Instances {
    /// Sets the time, s, in Model Exchange: one time for all instances, or a time for each.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if a time is not finite.
    ///
    /// # Panics
    /// Panics if the number of times is wrong.
    pub fn set_time(&mut self, times: &[f64], mask: Mask) -> Result<(), Error> {
        if let Some(time) = times.iter().find(|time| !time.is_finite()) {
            return request(format!("time is {time}; it must be finite"));
        }
        let row = rows(times, 1, self.len());
        self.alive(mask, |index, progress, instance| {
            progress.time = row(index)[0];
            instance.sole().set_time(progress.time)
        });
        Ok(())
    }

    /// Sets the continuous states, in Model Exchange, from one row for all instances or a row for each.
    ///
    /// # Panics
    /// Panics if the number of values is wrong.
    pub fn set_continuous_states(&mut self, values: &[f64], mask: Mask) {
        let row = rows(values, self.continuous(Continuous::States), self.len());
        self.alive(mask, |index, _, instance| instance.sole().set_continuous_states(row(index)));
    }

    /// Reads states, derivatives, nominal values or event indicators into a row for each instance, in Model
    /// Exchange.
    ///
    /// # Panics
    /// Panics if the length of `values` is wrong.
    pub fn get_continuous(&mut self, what: Continuous, values: &mut [f64]) {
        self.fill(self.continuous(what), values, |_, _, instance, row| {
            instance.sole().get_continuous(what, row)
        });
    }

    /// Returns the number of values of this quantity in an instance.
    pub fn continuous(&self, what: Continuous) -> usize {
        self.description().map_or(0, |description| match what {
            Continuous::EventIndicators => description.event_indicators,
            _ => description.states,
        })
    }

    /// Handles an event in Model Exchange: enters Event Mode, sets variables, iterates until the event is complete, and returns to
    /// Continuous-Time Mode. The values are one row for all instances or a row for each. [`events`](Self::events) returns the
    /// results.
    ///
    /// # Errors
    /// Same errors as [`set`](Self::set).
    ///
    /// # Panics
    /// Panics if the number of values is wrong.
    pub fn handle_events(&mut self, (set, values): (&Selection, &[f64]), mask: Mask) -> Result<(), Error> {
        set.check(values)?;
        let row = rows(values, set.len(), self.len());
        self.alive(mask, |index, progress, instance| {
            instance.sole().enter_event_mode()?;
            instance.set(set, row(index))?;
            progress.event = instance.sole().event()?;
            instance.sole().enter_continuous_time_mode()
        });
        Ok(())
    }

    /// Notifies the FMU of a completed integrator step, in Model Exchange. Writes two values for each instance to `wanted`, 1 or 0:
    /// whether the FMU requests an event, and whether it requests the end of the simulation. They are NaN for a failed instance.
    ///
    /// # Panics
    /// Panics if `wanted` does not have two values for each instance.
    pub fn completed_integrator_step(&mut self, wanted: &mut [f64]) {
        self.fill(2, wanted, |_, _, instance, row| {
            row.copy_from_slice(
                &instance.sole().completed_integrator_step()?.map(|wanted| f64::from(u8::from(wanted))),
            );
            Ok(())
        });
    }
}

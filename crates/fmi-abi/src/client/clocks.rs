//! Clocks of FMI 3.0 (section 2.2.8): ticks, intervals and shifts.

use super::instance::{Instance, call};
use super::rejection::Rejection;
use crate::c_types::c_int;
use crate::calls::Functions;
use crate::fmi3::types::*;

/// Interval from a clock's last tick, or from the current event, to its next tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interval {
    /// In s.
    Decimal(f64),
    /// A counter, in units of 1/resolution s.
    Fraction {
        /// Number of units.
        counter: u64,
        /// Number of units per second.
        resolution: u64,
    },
}

/// Meaning of an interval that was read (`fmi3IntervalQualifier`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Qualifier {
    /// There is no interval yet.
    NotYetKnown,
    /// The interval has not changed since it was last read.
    Unchanged,
    /// The interval is new.
    Changed,
}

impl Instance {
    /// Activates clocks. The instance must be in Event Mode.
    ///
    /// # Errors
    /// The FMU rejects the call, or is of FMI 2.0.
    pub fn activate_clocks(&mut self, vr: &[u32]) -> Result<(), Rejection> {
        let active = vec![fmi3True; vr.len()];
        call!(fmi3 self, fmi3SetClock(vr.as_ptr(), vr.len(), active.as_ptr()))
    }

    /// Returns whether a clock is active. The instance must be in Event Mode.
    ///
    /// # Errors
    /// The FMU rejects the call, or is of FMI 2.0.
    pub fn is_clock_active(&mut self, vr: u32) -> Result<bool, Rejection> {
        let mut active = fmi3False;
        call!(fmi3 self, fmi3GetClock(&vr, 1, &mut active))?;
        Ok(active != fmi3False)
    }

    /// Reads the interval of a clock, as a fraction if `is_fraction` is true.
    ///
    /// # Errors
    /// The FMU rejects the call, is of FMI 2.0, or returns an unknown qualifier.
    pub fn interval(&mut self, vr: u32, is_fraction: bool) -> Result<(Interval, Qualifier), Rejection> {
        let (mut decimal, mut counter, mut resolution, mut qualifier) = (0.0, 0, 0, 0);
        let interval = if is_fraction {
            call!(fmi3 self, fmi3GetIntervalFraction(&vr, 1, &mut counter, &mut resolution, &mut qualifier))?;
            Interval::Fraction { counter, resolution }
        } else {
            call!(fmi3 self, fmi3GetIntervalDecimal(&vr, 1, &mut decimal, &mut qualifier))?;
            Interval::Decimal(decimal)
        };
        let qualifier = match qualifier {
            0 => Qualifier::NotYetKnown,
            1 => Qualifier::Unchanged,
            2 => Qualifier::Changed,
            other => {
                let text = format!("the qualifier of an interval is {other}; it must be 0, 1 or 2");
                return Err(self.own_rejection("fmi3GetInterval", text));
            }
        };
        Ok((interval, qualifier))
    }

    /// Reads the delay of a clock's first tick after the start time, as a fraction if `is_fraction` is true.
    ///
    /// # Errors
    /// The FMU rejects the call, or is of FMI 2.0.
    pub fn shift(&mut self, vr: u32, is_fraction: bool) -> Result<Interval, Rejection> {
        let (mut decimal, mut counter, mut resolution) = (0.0, 0, 0);
        if is_fraction {
            call!(fmi3 self, fmi3GetShiftFraction(&vr, 1, &mut counter, &mut resolution))?;
            return Ok(Interval::Fraction { counter, resolution });
        }
        call!(fmi3 self, fmi3GetShiftDecimal(&vr, 1, &mut decimal))?;
        Ok(Interval::Decimal(decimal))
    }
}

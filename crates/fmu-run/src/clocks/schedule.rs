//! The next tick of a clock.

use super::fraction::Fraction;
use super::{Clock, Source};
use crate::system_instance::SystemInstance;
use fmi_abi::IntervalVariability;
use fmi_abi::client::{Interval, Qualifier, Rejection};

/// The ticks of a clock are at origin + index * interval. An aperiodic clock ticks once at origin + interval, and then has another
/// interval (section 2.2.8.2 of FMI 3.0).
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Schedule {
    /// Origin and interval; `None` if the clock does not tick at times that follow from an interval, or the interval is not known yet.
    pub ticks: Option<[Fraction; 2]>,
    /// Index of the next tick.
    pub index: u64,
}

impl Schedule {
    /// Schedules the first tick, in Initialization Mode.
    pub fn begin(clock: &Clock, instance: &mut SystemInstance, start: Fraction) -> Result<Self, Rejection> {
        let mut schedule = Self::default();
        match clock.source {
            Source::Declared { shift, interval } => {
                schedule.ticks = Some([clock.sum(start, shift)?, interval])
            }
            Source::Asked { variability, is_fraction } if is_periodic(variability) => {
                let shift = instance.sole().shift(clock.reference, is_fraction)?;
                let shift = clock.checked("shift", shift, true)?;
                schedule.ask(clock, instance, clock.sum(start, shift)?, true)?;
                schedule.index = 0;
            }
            Source::Asked { .. } => schedule.ask(clock, instance, start, true)?,
            Source::Given(_) | Source::Fmu => {}
        }
        Ok(schedule)
    }

    /// Schedules the next tick at the end of an event, whose time is `now`. `has_ticked` tells whether the clock has ticked in the event.
    pub fn advance(
        &mut self,
        clock: &Clock,
        instance: &mut SystemInstance,
        now: Fraction,
        has_ticked: bool,
    ) -> Result<(), Rejection> {
        self.index += u64::from(has_ticked);
        let Source::Asked { variability, .. } = clock.source else { return Ok(()) };
        if has_ticked && !is_periodic(variability) {
            self.ticks = None;
        }
        match variability {
            IntervalVariability::Fixed => Ok(()),
            IntervalVariability::Changing if !has_ticked => Ok(()),
            _ => self.ask(clock, instance, now, has_ticked),
        }
    }

    /// Asks for the interval, which begins at `now`. `is_due` tells whether a clock other than a countdown clock must have a new one.
    fn ask(
        &mut self,
        clock: &Clock,
        instance: &mut SystemInstance,
        now: Fraction,
        is_due: bool,
    ) -> Result<(), Rejection> {
        let Source::Asked { variability, is_fraction } = clock.source else { return Ok(()) };
        let (interval, qualifier) = instance.sole().interval(clock.reference, is_fraction)?;
        let is_new = match (variability, qualifier) {
            (IntervalVariability::Countdown, _) => qualifier == Qualifier::Changed,
            (_, Qualifier::NotYetKnown) => {
                return Err(clock.error(
                    "has no interval (fmi3IntervalNotYetKnown), which only a countdown clock may lack",
                ));
            }
            (IntervalVariability::Changing, _) => is_due,
            _ => qualifier == Qualifier::Changed || self.ticks.is_none(),
        };
        if is_new {
            let interval = clock.checked("interval", interval, !is_periodic(variability))?;
            (self.ticks, self.index) = (Some([now, interval]), 1);
        }
        Ok(())
    }

    /// Returns the exact time of the next tick.
    pub fn next(&self, clock: &Clock) -> Result<Option<Fraction>, Rejection> {
        let Some([origin, interval]) = self.ticks else { return Ok(None) };
        let after = interval.times(self.index).and_then(|after| origin.plus(after));
        after.map(Some).ok_or_else(|| clock.error("ticks at times that are not representable as fractions"))
    }
}

/// Returns whether a clock with an interval that the FMU returns has the same one after each tick.
fn is_periodic(of: IntervalVariability) -> bool {
    matches!(of, IntervalVariability::Fixed | IntervalVariability::Tunable)
}

impl Clock<'_> {
    /// Converts an interval or a shift that the FMU has returned. Fails if it is negative or not finite, or 0 unless that is allowed.
    fn checked(&self, what: &str, interval: Interval, may_be_zero: bool) -> Result<Fraction, Rejection> {
        let (fraction, shown) = match interval {
            Interval::Decimal(decimal) => {
                (Fraction::of_decimal(decimal), fmi_abi::shown_number(decimal).to_string())
            }
            Interval::Fraction { counter, resolution } => {
                (Fraction::of(counter.into(), resolution.into()), format!("{counter}/{resolution}"))
            }
        };
        let allowed = |of: &Fraction| of.is_positive() || may_be_zero && !of.is_negative();
        fraction.filter(allowed).ok_or_else(|| {
            let zero = if may_be_zero { "0 or " } else { "" };
            self.error(&format!("has the {what} {shown} s; it must be {zero}from 1e-18 s to 1e18 s"))
        })
    }

    fn sum(&self, one: Fraction, other: Fraction) -> Result<Fraction, Rejection> {
        one.plus(other).ok_or_else(|| self.error("ticks at times that are not representable as fractions"))
    }

    /// Returns an error about the clock.
    pub(super) fn error(&self, what: &str) -> Rejection {
        Rejection::without_fmu("clocks", &format!("{} {what}", self.name))
    }
}

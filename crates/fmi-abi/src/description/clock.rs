//! Clocks (sections 2.2.8 and 2.4.5 of FMI 3.0).

use super::faults::Faults;
use crate::IntervalVariability;
use roxmltree::Node;

/// Attributes of a clock.
#[derive(Clone, Debug, PartialEq)]
pub struct Clock {
    /// Source of the clock's ticks; `None` if it is missing or unknown.
    pub interval_variability: Option<IntervalVariability>,
    /// Interval and shift of a periodic clock, if the description contains the interval.
    pub timing: Option<Timing>,
    /// Whether the interval can be read as a fraction (`supportsFraction`).
    pub supports_fraction: bool,
}

/// Interval of a periodic clock, and the delay of its first tick after the start time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Timing {
    /// `intervalDecimal` and `shiftDecimal`, s.
    Decimal {
        /// Interval, s.
        interval: f64,
        /// Delay of the first tick, s.
        shift: f64,
    },
    /// `intervalCounter` and `shiftCounter`, in units of 1/`resolution` s.
    Fraction {
        /// Interval.
        interval: u64,
        /// Delay of the first tick.
        shift: u64,
        /// Number of units per second.
        resolution: u64,
    },
}

impl Clock {
    /// Reads a clock. Fractions count rather than decimal numbers, because they are exact.
    pub(super) fn read(node: Node, faults: &Faults) -> Self {
        let supports_fraction = faults.read(node, "supportsFraction") == Some(true);
        let [counter, resolution] = ["intervalCounter", "resolution"].map(|name| faults.read(node, name));
        let timing = match (counter, resolution) {
            (Some(interval), Some(resolution)) if supports_fraction => {
                let shift = faults.read(node, "shiftCounter").unwrap_or(0);
                Some(Timing::Fraction { interval, shift, resolution })
            }
            _ => faults.read(node, "intervalDecimal").map(|interval| {
                let shift = faults.read(node, "shiftDecimal").unwrap_or(0.0);
                Timing::Decimal { interval, shift }
            }),
        };
        Self { interval_variability: faults.read(node, "intervalVariability"), timing, supports_fraction }
    }
}

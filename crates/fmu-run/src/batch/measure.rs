//! What is calculated of a course on the way.

use std::str::FromStr;

/// A number that stands for a course: for all its times, whether they are kept or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// The smallest value.
    Min,
    /// The largest value.
    Max,
    /// The largest magnitude.
    Peak,
    /// When that is reached first, s.
    TimeOfPeak,
    /// The mean of the samples.
    Mean,
    /// The root of the mean square of the samples.
    Rms,
    /// The last value.
    End,
}

impl Measure {
    /// All of them, with their names.
    pub const ALL: [(&str, Self); 7] = [
        ("min", Self::Min),
        ("max", Self::Max),
        ("peak", Self::Peak),
        ("time_of_peak", Self::TimeOfPeak),
        ("mean", Self::Mean),
        ("rms", Self::Rms),
        ("end", Self::End),
    ];
}

impl FromStr for Measure {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|(known, _)| *known == name);
        found.map(|(_, measure)| *measure).ok_or_else(|| {
            let names = Self::ALL.map(|(known, _)| known).join(", ");
            format!("there is no measure {name:?}; there are {names}")
        })
    }
}

/// What is remembered of a course.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    min: f64,
    max: f64,
    peak: f64,
    time_of_peak: f64,
    sum: f64,
    squares: f64,
    end: f64,
    count: f64,
}

impl Measured {
    pub const NOTHING: Self = Self {
        min: f64::INFINITY,
        max: f64::NEG_INFINITY,
        peak: -1.0,
        time_of_peak: f64::NAN,
        sum: 0.0,
        squares: 0.0,
        end: f64::NAN,
        count: 0.0,
    };

    #[inline]
    pub fn add(&mut self, time: f64, value: f64) {
        let magnitude = value.abs();
        if magnitude > self.peak {
            (self.peak, self.time_of_peak) = (magnitude, time);
        }
        self.min = self.min.min(value);
        self.max = self.max.max(value);
        self.sum += value;
        self.squares += value * value;
        self.end = value;
        self.count += 1.0;
    }

    pub fn measure(&self, measure: Measure) -> f64 {
        match measure {
            Measure::Min => self.min,
            Measure::Max => self.max,
            Measure::Peak => self.peak,
            Measure::TimeOfPeak => self.time_of_peak,
            Measure::Mean => self.sum / self.count,
            Measure::Rms => (self.squares / self.count).sqrt(),
            Measure::End => self.end,
        }
    }
}

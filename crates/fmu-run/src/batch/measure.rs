//! Statistics of trajectories, calculated during a run.

use std::str::FromStr;

/// A statistic of a trajectory over all times, including times that are not kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// The smallest value.
    Min,
    /// The largest value.
    Max,
    /// The largest magnitude.
    Peak,
    /// Time at which the peak is reached first, s.
    TimeOfPeak,
    /// The mean of the samples.
    Mean,
    /// The root of the mean square of the samples.
    Rms,
    /// The last value.
    End,
}

impl Measure {
    /// All statistics, with their names.
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

/// Running data of all outputs for the requested statistics.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    extremes: bool,
    peaks: bool,
    sums: bool,
    count: f64,
    min: Vec<f64>,
    max: Vec<f64>,
    peak: Vec<f64>,
    time_of_peak: Vec<f64>,
    sum: Vec<f64>,
    squares: Vec<f64>,
    end: Vec<f64>,
}

impl Measured {
    pub fn new(measures: &[Measure], outputs: usize) -> Self {
        let needs = |of: &[Measure]| measures.iter().any(|measure| of.contains(measure));
        let zeros = vec![0.0; outputs];
        Self {
            extremes: needs(&[Measure::Min, Measure::Max]),
            peaks: needs(&[Measure::Peak, Measure::TimeOfPeak]),
            sums: needs(&[Measure::Mean, Measure::Rms]),
            count: 0.0,
            min: zeros.clone(),
            max: zeros.clone(),
            peak: zeros.clone(),
            time_of_peak: zeros.clone(),
            sum: zeros.clone(),
            squares: zeros.clone(),
            end: zeros,
        }
    }

    /// Clears the data of the previous run.
    pub fn begin(&mut self) {
        self.count = 0.0;
        self.min.fill(f64::INFINITY);
        self.max.fill(f64::NEG_INFINITY);
        self.peak.fill(-1.0);
        self.sum.fill(0.0);
        self.squares.fill(0.0);
    }

    /// Adds the outputs at a time.
    #[inline]
    pub fn add(&mut self, time: f64, row: &[f64]) {
        self.count += 1.0;
        if self.extremes {
            for ((min, max), value) in self.min.iter_mut().zip(&mut self.max).zip(row) {
                *min = if *value < *min { *value } else { *min };
                *max = if *value > *max { *value } else { *max };
            }
        }
        if self.peaks {
            for ((peak, when), value) in self.peak.iter_mut().zip(&mut self.time_of_peak).zip(row) {
                if value.abs() > *peak {
                    (*peak, *when) = (value.abs(), time);
                }
            }
        }
        if self.sums {
            for ((sum, squares), value) in self.sum.iter_mut().zip(&mut self.squares).zip(row) {
                *sum += value;
                *squares += value * value;
            }
        }
        self.end.copy_from_slice(row);
    }

    pub fn measure(&self, measure: Measure, output: usize) -> f64 {
        match measure {
            Measure::Min => self.min[output],
            Measure::Max => self.max[output],
            Measure::Peak => self.peak[output],
            Measure::TimeOfPeak => self.time_of_peak[output],
            Measure::Mean => self.sum[output] / self.count,
            Measure::Rms => (self.squares[output] / self.count).sqrt(),
            Measure::End => self.end[output],
        }
    }
}

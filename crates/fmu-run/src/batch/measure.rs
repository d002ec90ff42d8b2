//! Statistics of trajectories, calculated during a run.

use crate::error::named;
use std::str::FromStr;

/// A statistic of a trajectory over all times, including times whose values are not kept. If a value is NaN, all statistics except
/// [`End`](Self::End) are NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// The smallest value.
    Min,
    /// The largest value.
    Max,
    /// The largest magnitude.
    Peak,
    /// The time at which the peak is first reached, s.
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
        named(&Self::ALL, "measure", name)
    }
}

/// Intermediate results for the requested statistics of all outputs.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    /// Which groups of statistics are requested.
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
        let Self { extremes: _, peaks: _, sums: _, count, min, max, peak, time_of_peak, sum, squares, end } =
            self;
        *count = 0.0;
        min.fill(f64::INFINITY);
        max.fill(f64::NEG_INFINITY);
        peak.fill(f64::NEG_INFINITY);
        time_of_peak.fill(f64::NAN);
        sum.fill(0.0);
        squares.fill(0.0);
        end.fill(f64::NAN);
    }

    /// Adds the values of all outputs at a time, s.
    #[inline]
    pub fn add(&mut self, time: f64, row: &[f64]) {
        self.count += 1.0;
        if self.extremes {
            for ((min, max), value) in self.min.iter_mut().zip(&mut self.max).zip(row) {
                // NaN stays, because comparisons with it are false.
                *min = if *value < *min || value.is_nan() { *value } else { *min };
                *max = if *value > *max || value.is_nan() { *value } else { *max };
            }
        }
        if self.peaks {
            for ((peak, when), value) in self.peak.iter_mut().zip(&mut self.time_of_peak).zip(row) {
                if value.abs() > *peak {
                    (*peak, *when) = (value.abs(), time);
                } else if value.is_nan() {
                    (*peak, *when) = (f64::NAN, f64::NAN);
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

    /// Returns a statistic of an output. Before the first call of [`add`](Self::add), it is NaN.
    pub fn measure(&self, measure: Measure, output: usize) -> f64 {
        match measure {
            _ if self.count == 0.0 => f64::NAN,
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

#[cfg(test)]
mod tests {
    use super::{Measure, Measured};

    /// Calculates a statistic directly from its definition.
    fn expected(measure: Measure, times: &[f64], values: &[f64]) -> f64 {
        let (count, end) = (values.len() as f64, values[values.len() - 1]);
        if measure == Measure::End {
            return end;
        }
        if values.iter().any(|value| value.is_nan()) {
            return f64::NAN;
        }
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (min, max) = (sorted[0], sorted[values.len() - 1]);
        let peak = if -min > max { -min } else { max.abs() };
        match measure {
            Measure::Min => min,
            Measure::Max => max,
            Measure::Peak => peak,
            Measure::TimeOfPeak => times[values.iter().position(|value| value.abs() == peak).unwrap()],
            Measure::Mean => values.iter().sum::<f64>() / count,
            Measure::Rms => (values.iter().map(|value| value * value).sum::<f64>() / count).sqrt(),
            Measure::End => end,
        }
    }

    /// Compares the statistics of successive runs that have NaN at different times.
    #[test]
    fn not_a_number_stays_and_no_run_affects_the_next() {
        let measures = Measure::ALL.map(|(_, measure)| measure);
        let (times, nan) = ([0.0, 0.5, 1.0, 1.5], f64::NAN);
        let runs = [
            [1.0, -3.0, 2.0, 0.5],
            [nan, nan, nan, nan],
            [nan, 4.0, 5.0, -6.0],
            [1.0, nan, 7.0, 8.0],
            [-1.0, 2.0, 3.0, nan],
            [-0.25, -0.5, -0.125, -0.5],
            [f64::INFINITY, 1.0, 0.0, f64::NEG_INFINITY],
        ];
        let mut measured = Measured::new(&measures, 2);
        for run in runs {
            measured.begin();
            // The second output is the time, which is never NaN.
            times.iter().zip(run).for_each(|(time, value)| measured.add(*time, &[value, *time]));
            for measure in measures {
                let found = [0, 1].map(|output| measured.measure(measure, output));
                let wanted = [expected(measure, &times, &run), expected(measure, &times, &times)];
                assert_eq!(
                    found.map(|value| value.to_string()),
                    wanted.map(|value| value.to_string()),
                    "{measure:?} of {run:?}"
                );
            }
        }
        measured.begin();
        assert!(
            measures.iter().all(|measure| measured.measure(*measure, 0).is_nan()),
            "without values, all statistics must be NaN"
        );
    }
}

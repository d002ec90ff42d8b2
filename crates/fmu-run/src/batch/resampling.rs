//! Interpolates inputs that have their own times, which need not be communication points.

use crate::error::{Error, request};
use fmi_abi::shown_number;

/// Maps the communication points to the times of an input.
pub(super) struct Resampling {
    /// Times of the input, s. A time that differs from a communication point only by a rounding error is replaced by it, so that a
    /// jump there happens at this point and not shortly before or after it.
    pub times: Vec<f64>,
    /// For each communication point, the index of the last time of the input that is not after it (0 if there is none), and the
    /// fraction of the way to the next time, from 0 to 1.
    at: Vec<(usize, f64)>,
}

impl Resampling {
    /// Finds the communication points `points` among the `times` of the input `name`. Two equal times make a jump: from this time on,
    /// the second value is valid. Fails if there are no times, or if they are not finite or decrease.
    pub fn of(name: &str, times: &[f64], points: &[f64]) -> Result<Self, Error> {
        if times.is_empty() {
            return request(format!("{name} has no times"));
        }
        if let Some(index) = times.iter().position(|time| !time.is_finite()) {
            return request(format!("time {index} of {name} is {}; times must be finite", times[index]));
        }
        if let Some(index) = times.windows(2).position(|pair| pair[1] < pair[0]) {
            let [before, after] = [times[index], times[index + 1]].map(shown_number);
            return request(format!("the times of {name} decrease: {after} follows {before}"));
        }
        if let Some(three) = times.windows(3).find(|three| three[0] == three[2]) {
            let time = shown_number(three[0]);
            return request(format!("{name} has the time {time} three times; a jump has it twice"));
        }
        let times: Vec<_> = times.iter().map(|time| rounded_to(points, *time)).collect();
        let at = points.iter().map(|point| {
            let after = times.partition_point(|time| time <= point);
            match (after.checked_sub(1), times.get(after)) {
                (None, _) => (0, 0.0),
                (Some(before), None) => (before, 0.0),
                (Some(before), Some(next)) => {
                    (before, ((point - times[before]) / (next - times[before])).max(0.0))
                }
            }
        });
        let at = at.collect();
        Ok(Self { times, at })
    }

    /// Returns the value at a communication point: interpolated linearly, or the earlier value if values are held.
    #[inline]
    pub fn value(&self, values: &[f64], point: usize, is_held: bool) -> f64 {
        let (index, way) = self.at[point];
        let value = values[index];
        if is_held || way == 0.0 { value } else { value + way * (values[index + 1] - value) }
    }

    /// Returns the index of the value that holds at a communication point.
    pub fn index(&self, point: usize) -> usize {
        self.at[point].0
    }
}

/// Returns the communication point from which a time differs by less than 1e-9 of the step there; otherwise the time itself.
fn rounded_to(points: &[f64], time: f64) -> f64 {
    let next = points.partition_point(|point| *point < time);
    let is_near = |index: &usize| {
        let begin = index.saturating_sub(1);
        let step = points.get(begin + 1).map_or(0.0, |end| end - points[begin]);
        (points[*index] - time).abs() <= 1e-9 * step
    };
    let near = [Some(next), next.checked_sub(1)].into_iter().flatten().filter(|index| *index < points.len());
    near.filter(is_near).map(|index| points[index]).next().unwrap_or(time)
}

#[cfg(test)]
mod tests {
    use super::Resampling;

    #[test]
    fn values_between_times() {
        let points = [-1.0, 0.0, 0.25, 0.5, 1.0, 3.0];
        let (times, values) = ([0.0, 0.5, 0.5, 1.0], [1.0, 2.0, 5.0, 6.0]);
        let resampling = Resampling::of("u", &times, &points).unwrap();
        let all = |is_held| {
            points.iter().enumerate().map(|(k, _)| resampling.value(&values, k, is_held)).collect::<Vec<_>>()
        };
        assert_eq!(all(false), [1.0, 1.0, 1.5, 5.0, 6.0, 6.0]);
        assert_eq!(all(true), [1.0, 1.0, 1.0, 5.0, 6.0, 6.0]);
        assert_eq!([0, 1, 2, 3, 4, 5].map(|point| resampling.index(point)), [0, 0, 0, 2, 3, 3]);
    }

    #[test]
    fn rounding_of_times_does_not_delay_a_step() {
        // The last point is the largest number below 0.3.
        let points: Vec<_> = (0..4).map(|k| 0.1 * f64::from(k) - 1e-17).collect();
        let points = [points[0], 0.1, 0.2, f64::from_bits(0.3_f64.to_bits() - 1)];
        let resampling = Resampling::of("u", &[0.0, 0.3], &points).unwrap();
        assert_eq!(
            (resampling.value(&[1.0, 2.0], 3, true), resampling.value(&[1.0, 2.0], 3, false)),
            (2.0, 2.0)
        );
        assert!((resampling.value(&[0.0, 3.0], 1, false) - 1.0).abs() < 1e-15);
        assert_eq!(resampling.times, [points[0], points[3]]);
    }

    #[test]
    fn wrong_times() {
        for (times, why) in [
            (&[][..], "no times"),
            (&[0.0, f64::NAN], "must be finite"),
            (&[0.0, 1.0, 0.5], "decrease"),
            (&[0.0, 0.5, 0.5, 0.5], "u has the time 0.5 three times"),
        ] {
            assert!(
                Resampling::of("u", times, &[0.0, 1.0]).is_err_and(|error| error.to_string().contains(why))
            );
        }
    }
}

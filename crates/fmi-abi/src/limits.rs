//! Rules for numbers in a model description. The build and the checker call the same functions.

use std::fmt::Display;

/// If a range contains no value, returns the reason.
pub fn empty_range<T: PartialOrd + Display>(min: T, max: T) -> Option<String> {
    (min > max).then(|| format!("min {min} is above max {max}"))
}

/// If a default experiment ends before its start, returns the reason. It may end at its start, because the standards do not require a
/// duration.
pub fn ends_too_early(start: f64, stop: f64) -> Option<String> {
    (stop < start).then(|| format!("the default experiment ends at {stop}, before its start at {start}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_limits_are_possible() {
        assert_eq!((empty_range(1.0, 1.0), empty_range(-2, 3)), (None, None));
        assert_eq!(empty_range(1.5, -2.0).as_deref(), Some("min 1.5 is above max -2"));
        assert_eq!((ends_too_early(1.0, 1.0), ends_too_early(-1.0, 0.0)), (None, None));
        let why = ends_too_early(2.0, 1.0);
        assert_eq!(why.as_deref(), Some("the default experiment ends at 1, before its start at 2"));
    }
}

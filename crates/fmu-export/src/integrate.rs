//! Help for the integration within a step of Co-Simulation: splitting a step, a Runge-Kutta method, and the search
//! for events.

use crate::capabilities::Step;
use crate::model::Error;
use std::convert::Infallible;

/// Maximum number of parts of a step.
const MOST_PARTS: f64 = 1e7;

impl Step {
    /// Returns the time at the end of the step, s.
    pub fn end(&self) -> f64 {
        self.time + self.size
    }

    /// Splits the step into parts of equal size, each at most `longest` s.
    ///
    /// # Errors
    /// Fails if there would be more than 10,000,000 parts, or if `longest` is not above 0.
    pub fn parts(self, longest: f64) -> Result<impl Iterator<Item = Self>, Error> {
        let count = (self.size / longest).ceil().max(1.0);
        if !(longest > 0.0 && count <= MOST_PARTS) {
            return Err(Error::new(format!(
                "a step of {} s has more than {MOST_PARTS} parts of {longest} s; make shorter steps",
                self.size
            )));
        }
        let size = self.size / count;
        Ok((0..count as u32).map(move |part| Self { time: self.time + f64::from(part) * size, size, ..self }))
    }
}

/// Integrates a state over a step with the classical Runge-Kutta method of order 4, and returns the state at its end.
///
/// `rates` returns the time derivatives for a time, s, and a state.
///
/// ```
/// # use fmu_export::{Step, rk4};
/// // An oscillator: x' = v, v' = -x.
/// let [x, v] = rk4([1.0, 0.0], Step::new(0.0, 0.1), |_, [x, v]| [v, -x]);
/// assert!((x - 0.1_f64.cos()).abs() < 1e-6 && (v + 0.1_f64.sin()).abs() < 1e-6);
/// ```
pub fn rk4<const N: usize>(
    state: [f64; N],
    step: Step,
    mut rates: impl FnMut(f64, [f64; N]) -> [f64; N],
) -> [f64; N] {
    let Ok(end) = runge_kutta(&state, step, |time, state| Ok::<_, Infallible>(rates(time, state)));
    end
}

/// The method of [`rk4`] for any number of states, and for rates that may fail.
pub(crate) fn runge_kutta<S: Clone + AsRef<[f64]> + AsMut<[f64]>, E>(
    state: &S,
    step: Step,
    mut rates: impl FnMut(f64, S) -> Result<S, E>,
) -> Result<S, E> {
    let size = step.size;
    let after = |size: f64, rates: &S| {
        let mut after = state.clone();
        after.as_mut().iter_mut().zip(rates.as_ref()).for_each(|(state, rate)| *state += size * rate);
        after
    };
    let first = rates(step.time, state.clone())?;
    let second = rates(step.time + 0.5 * size, after(0.5 * size, &first))?;
    let third = rates(step.time + 0.5 * size, after(0.5 * size, &second))?;
    let fourth = rates(step.end(), after(size, &third))?;
    let mut mean = first;
    let others = second.as_ref().iter().zip(third.as_ref()).zip(fourth.as_ref());
    for (first, ((second, third), fourth)) in mean.as_mut().iter_mut().zip(others) {
        *first = (*first + 2.0 * (second + third) + fourth) / 6.0;
    }
    Ok(after(size, &mean))
}

/// Direction in which an event indicator changes its sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Crossing {
    /// From above zero to zero or below.
    Falling,
    /// From below zero to zero or above.
    Rising,
    /// Either direction.
    Any,
}

/// Returns the part of a step up to an event: the time at which an indicator changes its sign in the direction
/// `crossing`. Returns `None` if the indicator has not changed its sign in this direction at the end of the step.
///
/// `indicator` integrates the model over a part of the step, which begins where the step begins and may have size 0,
/// and returns the value of the indicator at its end. The returned part ends at most `tolerance` s (or the rounding
/// error of the time, if that is larger) after the change of sign, and never before it. If the indicator begins at
/// zero, no event is found. Two changes of sign within a step cancel each other, so they are not found; [`Step::parts`]
/// splits a step into shorter ones.
///
/// ```
/// # use fmu_export::{Crossing, Step, find_event};
/// // A stone falls from 5 m at t = 2 s.
/// let height = |part: Step| 5.0 - 0.5 * 9.81 * part.size * part.size;
/// let fall = find_event(Step::new(2.0, 3.0), Crossing::Falling, 1e-9, height).unwrap();
/// let exact = 2.0 + (10.0_f64 / 9.81).sqrt();
/// assert!(fall.end() >= exact && fall.end() < exact + 2e-9);
/// ```
pub fn find_event(
    step: Step,
    crossing: Crossing,
    tolerance: f64,
    mut indicator: impl FnMut(Step) -> f64,
) -> Option<Step> {
    let begin = indicator(Step { size: 0.0, ..step });
    let falls = crossing.falls(begin)?;
    let end = indicator(step);
    is_after(falls, end).then(|| locate(step, [begin, end], falls, tolerance, indicator))
}

/// Returns the part of a step up to the first event among several indicators, and the number of the indicator,
/// counted from 0; see [`find_event`].
///
/// Each indicator has its own direction and is searched separately. If a model passed the minimum of all indicators
/// to [`find_event`] instead, an indicator that begins at zero, for example because its event has just happened,
/// would hide the others. Several events may happen at the same time, so compare all indicators with zero after the
/// event.
///
/// ```
/// # use fmu_export::{Crossing, Step, find_first_event};
/// // A ball begins on the floor, and hits the ceiling at 3 m before it falls back.
/// let height = |part: Step| part.size * (9.0 - 0.5 * 9.81 * part.size);
/// let (hit, number) = find_first_event(Step::new(0.0, 1.0), [Crossing::Falling; 2], 1e-9, |part| {
///     [height(part), 3.0 - height(part)]
/// })
/// .unwrap();
/// assert_eq!(number, 1);
/// assert!((height(hit) - 3.0).abs() < 1e-7);
/// ```
pub fn find_first_event<const N: usize>(
    step: Step,
    crossings: [Crossing; N],
    tolerance: f64,
    mut indicators: impl FnMut(Step) -> [f64; N],
) -> Option<(Step, usize)> {
    let begin = indicators(Step { size: 0.0, ..step });
    let mut end = indicators(step);
    let mut first = None;
    let mut before = step;
    for (number, crossing) in crossings.into_iter().enumerate() {
        let Some(falls) = crossing.falls(begin[number]) else { continue };
        // Only the first event counts, so the next search ends at the earliest event found so far.
        if is_after(falls, end[number]) {
            let ends = [begin[number], end[number]];
            before = locate(before, ends, falls, tolerance, |part| indicators(part)[number]);
            end = indicators(before);
            first = Some((before, number));
        }
    }
    first
}

impl Crossing {
    /// Returns whether an indicator that begins with this value is searched for a fall (true) or a rise (false);
    /// `None` if it is not searched.
    fn falls(self, begin: f64) -> Option<bool> {
        match self {
            Self::Falling | Self::Any if begin > 0.0 => Some(true),
            Self::Rising | Self::Any if begin < 0.0 => Some(false),
            _ => None,
        }
    }
}

fn is_after(falls: bool, value: f64) -> bool {
    if falls { value <= 0.0 } else { value >= 0.0 }
}

/// Returns the part of a step up to a change of sign. `begin` and `end` are the values of the indicator at both ends
/// of the step.
pub(crate) fn locate(
    step: Step,
    [begin, end]: [f64; 2],
    falls: bool,
    tolerance: f64,
    mut indicator: impl FnMut(Step) -> f64,
) -> Step {
    let part = |size: f64| Step { size, ..step };
    // The ITP method (Oliveira and Takahashi, 2020): a regula falsi that needs at most one evaluation more than
    // bisection.
    let tolerance = tolerance.max(4.0 * f64::EPSILON * step.size);
    let (mut before, mut after) = ((0.0, begin), (step.size, end));
    let mut widest = step.size;
    while after.0 - before.0 > tolerance {
        let width = after.0 - before.0;
        let middle = before.0 + 0.5 * width;
        let falsi = (after.1 * before.0 - before.1 * after.0) / (after.1 - before.1);
        let shift = 0.2 * width * (width / step.size);
        let towards =
            if (middle - falsi).abs() > shift { falsi + shift.copysign(middle - falsi) } else { middle };
        let radius = widest - 0.5 * width;
        let size = if (towards - middle).abs() <= radius {
            towards
        } else {
            middle - radius.copysign(middle - falsi)
        };
        let value = indicator(part(size));
        if is_after(falls, value) {
            after = (size, value)
        } else {
            before = (size, value)
        }
        widest *= 0.5;
    }
    part(after.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_fill_the_step() {
        for (size, longest, count) in [(1.0, 0.3, 4), (0.2, 0.3, 1), (0.3, 0.1, 3), (2.0, 2.0, 1)] {
            let parts: Vec<Step> = Step::new(5.0, size).parts(longest).unwrap().collect();
            assert_eq!(parts.len(), count);
            assert_eq!(parts[0].time, 5.0);
            assert!(parts.windows(2).all(|two| (two[0].end() - two[1].time).abs() < 1e-14));
            assert!((parts[count - 1].end() - (5.0 + size)).abs() < 1e-14);
        }
        for longest in [1e-8, 0.0, -1.0, f64::NAN] {
            let error = Step::new(0.0, 1.0).parts(longest).err().unwrap().to_string();
            assert!(error.ends_with("make shorter steps"), "{error}");
        }
    }

    /// Solves x' = cos(t) x, whose solution is e^(sin t). Half the step size must give 1/16 of the error.
    #[test]
    fn rk4_has_order_4() {
        let error = |size: f64| {
            let parts = Step::new(0.0, 2.0).parts(size).unwrap();
            let [x] = parts.fold([1.0], |x, part| rk4(x, part, |time: f64, [x]| [time.cos() * x]));
            (x - 2.0_f64.sin().exp()).abs()
        };
        let order = (error(0.1) / error(0.05)).log2();
        assert!((order - 4.0).abs() < 0.1, "{order}");
    }

    #[test]
    fn events_are_found_in_their_direction() {
        // cos(t) falls through zero at pi / 2 and rises through zero at 3 pi / 2.
        let find = |time, size, crossing| {
            find_event(Step::new(time, size), crossing, 1e-10, |part| part.end().cos()).map(|part| part.end())
        };
        let instants = [(1.0, 0.5 * std::f64::consts::PI), (4.0, 1.5 * std::f64::consts::PI)];
        for ((begin, exact), direction) in instants.into_iter().zip([Crossing::Falling, Crossing::Rising]) {
            for crossing in [Crossing::Falling, Crossing::Rising, Crossing::Any] {
                match find(begin, 1.0, crossing) {
                    Some(found) => assert!(found >= exact && found < exact + 2e-10, "{found} for {exact}"),
                    None => assert!(crossing != Crossing::Any && crossing != direction),
                }
            }
        }
        assert_eq!(find(2.0, 1.0, Crossing::Any), None);
    }

    /// Searches smooth, discontinuous, infinite and flat indicators. Bisection would need 32 evaluations for this
    /// tolerance.
    #[test]
    fn the_search_never_needs_much_more_than_bisection() {
        type Case = (fn(f64) -> f64, usize);
        let indicators: [Case; 6] = [
            (|x| 0.3 - x, 10),
            (|x| 0.3 - x * x * x, 11),
            (|x| if x < 0.3 { 1.0 } else { -1e-9 }, 33),
            (|x| if x < 0.3 { f64::INFINITY } else { -1.0 }, 32),
            (|x| (0.3 - x).powi(9), 33),
            (|x| 1e-300 - x, 6),
        ];
        for (number, (indicator, limit)) in indicators.into_iter().enumerate() {
            let mut count = 0;
            let found = find_event(Step::new(0.0, 1.0), Crossing::Any, 1e-9, |part| {
                count += 1;
                indicator(part.size)
            });
            let end = found.unwrap().size;
            assert!(indicator(end) <= 0.0 && indicator(end - 1e-9) > 0.0, "indicator {number}: {end}");
            assert!(count <= limit, "indicator {number}: {count} evaluations");
        }
    }

    /// Each indicator cos(a t) falls through zero at pi / (2 a). Indicator 1 begins at zero, so it would hide the
    /// others if they were combined into their minimum.
    #[test]
    fn the_first_of_several_events_is_found() {
        let factors = [1.0, 0.0, 2.0, 1.5];
        let find = |crossing, size| {
            find_first_event(Step::new(0.0, size), [crossing; 4], 1e-10, |part| {
                std::array::from_fn(|n| if n == 1 { part.size } else { (factors[n] * part.size).cos() })
            })
        };
        let (event, number) = find(Crossing::Any, 1.9).unwrap();
        let exact = 0.25 * std::f64::consts::PI;
        assert!(number == 2 && event.size >= exact && event.size < exact + 2e-10, "{event:?}, {number}");
        assert_eq!(find(Crossing::Rising, 1.9), None);
        assert_eq!(find(Crossing::Falling, 0.5), None);
        // Indicator 2 changes its sign twice in this step, but only once up to the event of indicator 0, where its
        // search ends.
        assert_eq!(find(Crossing::Falling, 2.4).unwrap().1, 2);
    }

    #[test]
    fn no_event_begins_at_zero_or_without_a_number() {
        let find = |indicator: fn(f64) -> f64| {
            find_event(Step::new(0.0, 1.0), Crossing::Any, 0.0, |part| indicator(part.size))
        };
        assert_eq!(find(|x| x), None);
        assert_eq!(find(|x| if x > 0.0 { f64::NAN } else { 1.0 }), None);
        assert_eq!(find(|x| x / 0.0), None);
        // With tolerance 0, the result is as exact as rounding permits.
        let exact = find(|x| 0.7 - x).unwrap().size;
        assert!((exact - 0.7).abs() < 1e-15, "{exact}");
    }
}

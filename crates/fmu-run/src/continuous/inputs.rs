//! Inputs as functions of time: piecewise polynomials. A break is a time at which one polynomial follows another.

/// An input as a function of time.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Curve<'a> {
    /// One value for all times.
    Constant(f64),
    /// Values at times that do not decrease. Two equal times make a jump. If `is_held`, each value holds until the next time.
    Samples { times: &'a [f64], values: &'a [f64], slopes: Slopes<'a>, is_held: bool },
    /// The time derivative of the input with this index.
    RateOf(usize),
}

/// Time derivatives of an input at the times of its values.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) enum Slopes<'a> {
    /// No derivatives: the values are connected by lines.
    #[default]
    Lines,
    Constant(f64),
    Each(&'a [f64]),
}

impl Slopes<'_> {
    /// Returns the derivative at the time with this index.
    fn at(self, index: usize) -> Option<f64> {
        match self {
            Self::Lines => None,
            Self::Constant(slope) => Some(slope),
            Self::Each(slopes) => Some(slopes[index]),
        }
    }
}

/// An input, with the polynomial between the last break and the next.
#[derive(Debug)]
struct Signal<'a> {
    curve: Curve<'a>,
    /// Index of the first given time after the last break.
    next: usize,
    piece: Piece,
    /// Time of the next break, s.
    until: f64,
}

/// Cubic polynomial in the time since its origin.
#[derive(Clone, Copy, Debug, Default)]
struct Piece {
    origin: f64,
    coefficients: [f64; 4],
}

impl Piece {
    fn constant(value: f64) -> Self {
        Self { origin: 0.0, coefficients: [value, 0.0, 0.0, 0.0] }
    }

    /// Returns the polynomial with these values at two times: a line, or the cubic that also has these slopes.
    fn between([t0, t1]: [f64; 2], [v0, v1]: [f64; 2], slopes: Option<[f64; 2]>) -> Self {
        let h = t1 - t0;
        let mean = (v1 - v0) / h;
        let coefficients = match slopes {
            None => [v0, mean, 0.0, 0.0],
            Some([s0, s1]) => [v0, s0, (3.0 * mean - 2.0 * s0 - s1) / h, (s0 + s1 - 2.0 * mean) / (h * h)],
        };
        Self { origin: t0, coefficients }
    }

    fn value(&self, time: f64) -> f64 {
        let ([c0, c1, c2, c3], s) = (self.coefficients, time - self.origin);
        c0 + s * (c1 + s * (c2 + s * c3))
    }

    fn rate(&self, time: f64) -> f64 {
        let ([_, c1, c2, c3], s) = (self.coefficients, time - self.origin);
        c1 + s * (2.0 * c2 + s * 3.0 * c3)
    }

    fn is_constant(&self) -> bool {
        self.coefficients[1..] == [0.0; 3]
    }
}

impl<'a> Signal<'a> {
    fn new(curve: Curve<'a>) -> Self {
        Self { curve, next: 0, piece: Piece::default(), until: f64::INFINITY }
    }

    /// Selects the polynomial for the times from this time to the next break. Returns whether the value jumps here, because two
    /// different values are given for one time.
    fn enter(&mut self, time: f64) -> bool {
        let (times, values, slopes, is_held) = match self.curve {
            Curve::Constant(value) => {
                self.piece = Piece::constant(value);
                return false;
            }
            Curve::RateOf(_) => return false,
            Curve::Samples { times, values, slopes, is_held } => (times, values, slopes, is_held),
        };
        let first = self.next;
        self.next += times[first..].iter().take_while(|other| **other <= time).count();
        let Some(left) = self.next.checked_sub(1) else {
            (self.piece, self.until) = (Piece::constant(values[0]), times[0]);
            return false;
        };
        let jumps = (first.max(1)..self.next)
            .any(|row| times[row] == times[row - 1] && differ(values[row - 1], values[row]));
        let value = values[left];
        if self.next == times.len() || is_held {
            self.piece = Piece::constant(value);
        } else {
            let [t, v] = [times, values].map(|of| [of[left], of[self.next]]);
            self.piece = Piece::between(t, v, slopes.at(left).zip(slopes.at(self.next)).map(|(a, b)| [a, b]));
        }
        // While the value stays constant, there is no break.
        let mut after = self.next;
        if is_held {
            after += values[after..].iter().take_while(|other| **other == value).count();
        } else if self.piece.is_constant() {
            let is_flat =
                |index: usize| values[index] == value && slopes.at(index).is_none_or(|slope| slope == 0.0);
            while after + 1 < times.len() && is_flat(after) && is_flat(after + 1) {
                after += 1;
            }
        }
        self.until = times.get(after).copied().unwrap_or(f64::INFINITY);
        jumps
    }
}

/// All inputs of a run: first the continuous ones, then those that change only at events.
#[derive(Debug, Default)]
pub(crate) struct Signals<'a> {
    all: Vec<Signal<'a>>,
    /// Number of continuous inputs.
    moving: usize,
    /// Whether a continuous input changes before the next break.
    is_moving: bool,
}

/// What has happened at the breaks of inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Break {
    /// No break.
    None,
    /// Another polynomial begins, but no value jumps.
    Kink,
    /// A value jumps, which is an event.
    Jump,
}

/// Largest relative change of the rate of an input at a break that is not treated as a jump, because rounding causes such changes
/// where two polynomials meet.
const SAME: f64 = 1e-9;

/// Returns whether two values differ; NaN equals NaN.
fn differ(one: f64, other: f64) -> bool {
    one != other && !(one.is_nan() && other.is_nan())
}

impl<'a> Signals<'a> {
    /// Creates the inputs from curves. The first `moving` of them are continuous.
    pub fn new(curves: impl Iterator<Item = Curve<'a>>, moving: usize) -> Self {
        Self { all: curves.map(Signal::new).collect(), moving, is_moving: false }
    }

    /// Returns the time of the next break, s.
    pub(super) fn until(&self) -> f64 {
        self.all.iter().map(|signal| signal.until).fold(f64::INFINITY, f64::min)
    }

    /// Selects the polynomials for the start time, s.
    pub(super) fn begin(&mut self, time: f64) {
        self.all.iter_mut().for_each(|signal| _ = signal.enter(time));
        self.find_moving();
    }

    /// Passes the breaks up to this time, s. At the end of the run, a continuous input that does not jump keeps its last polynomial,
    /// because otherwise its rate would become 0 there.
    pub(super) fn pass(&mut self, time: f64, is_end: bool) -> Break {
        if self.until() > time {
            return Break::None;
        }
        let mut found = Break::None;
        let before: Vec<_> = (0..self.all.len()).map(|index| self.value(index, time)).collect();
        let mut jumps = false;
        for (index, signal) in self.all.iter_mut().enumerate() {
            if signal.until <= time {
                let last = signal.piece;
                let is_jump = signal.enter(time);
                if is_end && index < self.moving && !is_jump {
                    (signal.piece, signal.until) = (last, f64::INFINITY);
                } else {
                    found = Break::Kink;
                }
                jumps |= is_jump;
            }
        }
        jumps |= before.into_iter().enumerate().any(|(index, before)| {
            let now = self.value(index, time);
            match self.all[index].curve {
                // Where two polynomials meet, the rounding error of the value may be large compared with the value.
                Curve::Constant(_) | Curve::Samples { is_held: false, .. } => false,
                Curve::Samples { is_held: true, .. } => differ(before, now),
                Curve::RateOf(_) => (now - before).abs() > SAME * now.abs().max(before.abs()),
            }
        });
        self.find_moving();
        if jumps { Break::Jump } else { found }
    }

    /// Updates `is_moving`.
    fn find_moving(&mut self) {
        self.is_moving = (0..self.moving).any(|index| match self.all[index].curve {
            Curve::RateOf(of) => self.all[of].piece.coefficients[2..] != [0.0; 2],
            _ => !self.all[index].piece.is_constant(),
        });
    }

    /// Returns whether a continuous input changes before the next break.
    pub(super) fn is_moving(&self) -> bool {
        self.is_moving
    }

    fn value(&self, index: usize, time: f64) -> f64 {
        match self.all[index].curve {
            Curve::RateOf(of) => self.all[of].piece.rate(time),
            _ => self.all[index].piece.value(time),
        }
    }

    /// Writes the values of the continuous inputs at this time to `row`.
    pub(super) fn moving(&self, time: f64, row: &mut Vec<f64>) {
        row.clear();
        row.extend((0..self.moving).map(|index| self.value(index, time)));
    }

    /// Writes the values of all other inputs at this time to `row`.
    pub(super) fn held(&self, time: f64, row: &mut Vec<f64>) {
        row.clear();
        row.extend((self.moving..self.all.len()).map(|index| self.value(index, time)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines<'a>(times: &'a [f64], values: &'a [f64]) -> Curve<'a> {
        Curve::Samples { times, values, slopes: Slopes::Lines, is_held: false }
    }

    #[test]
    fn values_rates_and_breaks() {
        let (times, values) = ([0.0, 1.0, 1.0, 3.0, 4.0, 5.0], [0.0, 2.0, 5.0, 1.0, 1.0, 1.0]);
        let held = Curve::Samples { times: &times, values: &values, slopes: Slopes::Lines, is_held: true };
        let mut inputs = Signals::new([lines(&times, &values), Curve::RateOf(0), held].into_iter(), 2);
        inputs.begin(-1.0);
        let (mut moving, mut held) = (Vec::new(), Vec::new());
        let mut seen = Vec::new();
        let mut time = -1.0;
        while time < 6.0 {
            let stop = inputs.until().min(6.0);
            inputs.moving(0.5 * (time + stop), &mut moving);
            inputs.held(0.5 * (time + stop), &mut held);
            seen.push((stop, moving[0], moving[1], held[0]));
            time = stop;
            inputs.pass(time, false);
        }
        assert_eq!(
            seen,
            [
                (0.0, 0.0, 0.0, 0.0),
                (1.0, 1.0, 2.0, 0.0),
                (3.0, 3.0, -2.0, 5.0),
                (5.0, 1.0, 0.0, 1.0),
                (6.0, 1.0, 0.0, 1.0)
            ]
        );
    }

    #[test]
    fn a_cubic_is_followed_exactly() {
        let cubic = |t: f64| [t * t * t - t, 3.0 * t * t - 1.0];
        let times = [0.0, 0.7, 2.0];
        let [values, slopes] = [0, 1].map(|of| times.map(|time| cubic(time)[of]));
        let curve =
            Curve::Samples { times: &times, values: &values, slopes: Slopes::Each(&slopes), is_held: false };
        let mut inputs = Signals::new([curve, Curve::RateOf(0)].into_iter(), 2);
        inputs.begin(0.0);
        assert_eq!((inputs.until(), inputs.is_moving()), (0.7, true));
        assert_eq!(inputs.pass(0.7, false), Break::Kink, "neither the value nor its rate jumps");
        let mut row = Vec::new();
        inputs.moving(1.3, &mut row);
        row.iter().zip(cubic(1.3)).for_each(|(found, expected)| assert!((found - expected).abs() < 1e-14));
        assert_eq!((inputs.pass(2.0, true), inputs.until()), (Break::None, f64::INFINITY));
    }

    #[test]
    fn a_jump_is_an_event_and_a_kink_is_not() {
        let (times, values) = ([0.0, 1.0, 2.0], [0.0, 1.0, 0.0]);
        let mut inputs = Signals::new([lines(&times, &values)].into_iter(), 1);
        inputs.begin(0.0);
        assert_eq!(inputs.pass(1.0, false), Break::Kink);
        let mut inputs = Signals::new([lines(&times, &values), Curve::RateOf(0)].into_iter(), 2);
        inputs.begin(0.0);
        assert_eq!(inputs.pass(1.0, false), Break::Jump);
        // Two values for one time are a jump of any size, also at the end. The rounding error of a line is not one.
        let after = |values: [f64; 4], is_end| {
            let mut inputs = Signals::new([lines(&[0.0, 1.0, 1.0, 2.0], &values)].into_iter(), 1);
            inputs.begin(0.0);
            let mut row = Vec::new();
            (inputs.pass(1.0, is_end), inputs.moving(1.0, &mut row), row[0])
        };
        for is_end in [false, true] {
            let (found, (), value) = after([1.7e9, 1.7e9, 1.7e9 + 1.0, 1.7e9 + 1.0], is_end);
            assert_eq!((found, value), (Break::Jump, 1.7e9 + 1.0));
        }
        assert_eq!(after([0.0, 1.0, 1.0, 5.0], false).0, Break::Kink);
        let mut inputs = Signals::new([lines(&[0.0, 0.3, 2.0], &[1e9, 0.1, 1.0])].into_iter(), 1);
        inputs.begin(0.0);
        assert_eq!(inputs.pass(0.3, false), Break::Kink);
    }
}

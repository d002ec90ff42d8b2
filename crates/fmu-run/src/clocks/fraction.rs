//! Times of ticks as exact fractions. Sums of floating-point numbers would drift, and then clocks that should tick together would not.

/// A time or an interval, s, as a reduced fraction. Arithmetic returns `None` if a result needs more than 127 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Fraction {
    numerator: i128,
    denominator: i128,
}

impl Fraction {
    /// Returns the quotient of two integers; `None` if the denominator is not above 0.
    pub fn of(numerator: i128, denominator: i128) -> Option<Self> {
        let divisor = gcd(numerator.unsigned_abs(), u128::try_from(denominator).ok().filter(|of| *of > 0)?);
        let divisor = i128::try_from(divisor).ok()?;
        Some(Self { numerator: numerator / divisor, denominator: denominator / divisor })
    }

    /// Returns the shortest decimal number that is nearest to a floating-point number, because this is the number that somebody has
    /// written: 1/10 for 0.1. Returns `None` if the number is not finite, or too large or small.
    pub fn of_decimal(number: f64) -> Option<Self> {
        let text = format!("{number:e}");
        let (digits, exponent) = text.split_once('e')?;
        let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
        let numerator: i128 = format!("{whole}{part}").parse().ok()?;
        let exponent = exponent.parse::<i32>().ok()? - i32::try_from(part.len()).ok()?;
        let power = 10_i128.checked_pow(exponent.unsigned_abs())?;
        if exponent < 0 { Self::of(numerator, power) } else { Self::of(numerator.checked_mul(power)?, 1) }
    }

    pub fn plus(self, other: Self) -> Option<Self> {
        let divisor = gcd(self.denominator.unsigned_abs(), other.denominator.unsigned_abs());
        let divisor = i128::try_from(divisor).ok()?;
        let [own, others] = [self.denominator / divisor, other.denominator / divisor];
        let numerator = self.numerator.checked_mul(others)?.checked_add(other.numerator.checked_mul(own)?)?;
        Self::of(numerator, self.denominator.checked_mul(others)?)
    }

    pub fn times(self, count: u64) -> Option<Self> {
        Self::of(self.numerator.checked_mul(count.into())?, self.denominator)
    }

    pub fn is_positive(self) -> bool {
        self.numerator > 0
    }

    pub fn is_negative(self) -> bool {
        self.numerator < 0
    }

    /// Returns the nearest floating-point number. Equal fractions have equal numbers, and the number of a decimal number is the one that
    /// it was made of.
    pub fn to_f64(self) -> f64 {
        let (all, divisor) = (self.numerator.unsigned_abs(), self.denominator.unsigned_abs());
        let (mut bits, mut rest, mut exponent) = (all / divisor, all % divisor, 0);
        // Appends binary digits. The last one notes whether there are more, so that the conversion below is rounded only once.
        while rest > 0 && bits < 1 << 64 {
            rest *= 2;
            bits = 2 * bits + rest / divisor;
            rest %= divisor;
            exponent -= 1;
        }
        bits |= u128::from(rest > 0);
        let magnitude = bits as f64 * 2_f64.powi(exponent);
        if self.is_negative() { -magnitude } else { magnitude }
    }
}

/// Returns the greatest common divisor; the other number if one is 0.
fn gcd(one: u128, other: u128) -> u128 {
    let (mut one, mut other) = (one, other);
    while other > 0 {
        (one, other) = (other, one % other);
    }
    one
}

#[cfg(test)]
mod tests {
    use super::Fraction;

    fn decimal(number: f64) -> Fraction {
        Fraction::of_decimal(number).unwrap()
    }

    #[test]
    fn ticks_of_a_decimal_interval_do_not_drift() {
        let tenth = decimal(0.1);
        assert_eq!(tenth, Fraction::of(1, 10).unwrap());
        // 3 * 0.1 is not 0.3 in floating-point numbers, and a sum of 1e6 intervals is off by 1e-6.
        for (count, expected) in [(3, 0.3), (7, 0.7), (1_000_000, 100_000.0), (123_456_789, 12_345_678.9)] {
            assert_eq!(tenth.times(count).unwrap().to_f64(), expected);
        }
        let third = Fraction::of(1, 3).unwrap();
        assert_eq!(third.plus(third).unwrap().plus(third), Fraction::of(1, 1));
        assert_eq!(third.to_f64(), 1.0 / 3.0);
        assert_eq!(decimal(-0.25).plus(third.times(2).unwrap()), Fraction::of(5, 12));
    }

    #[test]
    fn each_number_is_found_again() {
        let mut random = fmi_abi::calls::Random::mixed(1);
        for _ in 0..1000 {
            let number = random.between(-1.0, 1.0) * 10_f64.powf(random.between(-12.0, 12.0));
            assert_eq!(decimal(number).to_f64(), number);
        }
        assert_eq!([0.0, 1e18, 5e-20].map(|number| decimal(number).to_f64()), [0.0, 1e18, 5e-20]);
    }

    #[test]
    fn what_is_no_fraction_is_none() {
        for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, 1e-300] {
            assert_eq!(Fraction::of_decimal(number), None);
        }
        assert_eq!((Fraction::of(1, 0), Fraction::of(1, -2)), (None, None));
        let large = Fraction::of(i128::MAX, 1).unwrap();
        assert_eq!((large.times(2), large.plus(large), large.times(1)), (None, None, Some(large)));
        let [a, b] = [i128::MAX, i128::MAX - 1].map(|of| Fraction::of(1, of).unwrap());
        assert_eq!(a.plus(b), None);
        assert!(a.to_f64() > 0.0);
    }
}

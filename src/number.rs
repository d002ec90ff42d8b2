//! The numbers that step matrices are calculated with: `f64`, or twice its precision.
//!
//! On its way to the full step the matrix of a stiff testbed loses up to 15 of the 16 digits of an `f64`.
//! [`DoubleDouble`] has 32, so that the 16 that count are right. It uses nothing but additions,
//! multiplications and divisions of `f64`: every platform gets the same bits.

use nalgebra::{ClosedAddAssign, ClosedDivAssign, ClosedMulAssign, ClosedSubAssign, Scalar};
use num_traits::{One, Zero};
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// `f64` or [`DoubleDouble`].
pub trait Number:
    Scalar
    + Copy
    + Zero
    + One
    + From<f64>
    + Neg<Output = Self>
    + ClosedAddAssign
    + ClosedSubAssign
    + ClosedMulAssign
    + ClosedDivAssign
{
    /// The last term that matters of the series of exp(1/4): `0.25^n / n!` is below the precision from
    /// the next one on.
    const TAYLOR_ORDER: i32;

    /// The nearest `f64`.
    fn rounded(self) -> f64;
}

impl Number for f64 {
    const TAYLOR_ORDER: i32 = 13;

    fn rounded(self) -> f64 {
        self
    }
}

impl Number for DoubleDouble {
    const TAYLOR_ORDER: i32 = 21;

    fn rounded(self) -> f64 {
        self.high
    }
}

/// The sum `high + low` of two numbers, `high` being that sum rounded to `f64`. The algorithms are
/// Dekker's (*A floating-point technique for extending the available precision*, 1971) and Knuth's (*The
/// Art of Computer Programming*, vol. 2, section 4.2.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubleDouble {
    high: f64,
    low: f64,
}

/// The sum and its rounding error, if `|a| >= |b|`.
#[inline]
fn quick_two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    (sum, b - (sum - a))
}

/// The sum and its rounding error.
#[inline]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_rounded = sum - a;
    (sum, (a - (sum - b_rounded)) + (b - b_rounded))
}

/// Two halves of 26 bits, whose products are exact. Out of range above 1e300.
#[inline]
fn split(a: f64) -> (f64, f64) {
    const FACTOR: f64 = 134_217_729.0; // 2^27 + 1
    let shifted = FACTOR * a;
    let high = shifted - (shifted - a);
    (high, a - high)
}

/// The product and its rounding error.
#[inline]
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    let ((a_high, a_low), (b_high, b_low)) = (split(a), split(b));
    (product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low)
}

impl From<f64> for DoubleDouble {
    fn from(value: f64) -> Self {
        Self { high: value, low: 0.0 }
    }
}

// Sums and products are functions of their own: inlined into every matrix product they would make up a
// tenth of the library.

impl Add for DoubleDouble {
    type Output = Self;

    #[inline(never)]
    fn add(self, other: Self) -> Self {
        let (sum, error) = two_sum(self.high, other.high);
        let (low_sum, low_error) = two_sum(self.low, other.low);
        let (sum, error) = quick_two_sum(sum, error + low_sum);
        let (high, low) = quick_two_sum(sum, error + low_error);
        Self { high, low }
    }
}

impl Neg for DoubleDouble {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
}

impl Sub for DoubleDouble {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for DoubleDouble {
    type Output = Self;

    #[inline(never)]
    fn mul(self, other: Self) -> Self {
        let (product, error) = two_product(self.high, other.high);
        let (high, low) = quick_two_sum(product, error + (self.high * other.low + self.low * other.high));
        Self { high, low }
    }
}

impl Div for DoubleDouble {
    type Output = Self;

    /// Long division, one `f64` at a time.
    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * first.into();
        let second = rest.high / other.high;
        let rest = rest - other * second.into();
        let (high, low) = quick_two_sum(first, second);
        Self { high, low } + (rest.high / other.high).into()
    }
}

macro_rules! assign {
    ($($trait:ident $method:ident $operator:tt;)+) => {
        $(impl $trait for DoubleDouble {
            #[inline]
            fn $method(&mut self, other: Self) {
                *self = *self $operator other;
            }
        })+
    };
}

assign! {
    AddAssign add_assign +;
    SubAssign sub_assign -;
    MulAssign mul_assign *;
    DivAssign div_assign /;
}

impl Zero for DoubleDouble {
    fn zero() -> Self {
        0.0.into()
    }

    fn is_zero(&self) -> bool {
        self.high == 0.0
    }
}

impl One for DoubleDouble {
    fn one() -> Self {
        1.0.into()
    }
}

#[cfg(test)]
mod tests {
    use super::{DoubleDouble, Number};

    fn number(value: f64) -> DoubleDouble {
        value.into()
    }

    /// Differences that `f64` rounds away.
    #[test]
    fn no_digit_of_thirty_is_lost() {
        let tiny = 2.0_f64.powi(-100);
        assert_eq!((number(1.0) + number(tiny) - number(1.0)).rounded(), tiny);
        let third = number(1.0) / number(3.0);
        assert!((third * number(3.0) - number(1.0)).rounded().abs() < 1e-32);
        // 10^15 + 1 and 10^15 - 1 are exact, their product 10^30 - 1 has 100 bits.
        let product = number(1e15 + 1.0) * number(1e15 - 1.0);
        assert_eq!((product - number(1e15) * number(1e15)).rounded(), -1.0);
        assert_eq!((product / number(1e15 - 1.0)).rounded(), 1e15 + 1.0);
    }
}

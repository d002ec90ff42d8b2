//! The number types for the calculation of step matrices: `f64`, and a type of twice its precision.
//!
//! During the doublings, the matrix of a stiff testbed loses up to 15 of the 16 digits of an `f64`. A
//! [`TwoFloat`] has 32 digits, so that the result has 16 correct digits. Its products use the fused
//! multiply-add of the crate libm, so that the results are bit-identical on every platform.

use crate::pair::Pair;
use nalgebra::{ClosedAddAssign, ClosedMulAssign, ClosedSubAssign, Scalar};
use num_traits::{One, Zero};
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A number, or a [`Pair`] of numbers on which the same operations act.
pub trait Arithmetic:
    Scalar
    + Copy
    + Zero
    + One
    + From<f64>
    + Neg<Output = Self>
    + ClosedAddAssign
    + ClosedSubAssign
    + ClosedMulAssign
    + Div<f64, Output = Self>
{
    /// Order of the last term that is added in the series of exp(1/4). Later terms `0.25^n / n!` are below the
    /// precision.
    const TAYLOR_ORDER: i32;
}

/// `f64` or [`TwoFloat`].
pub trait Number: Arithmetic {
    /// Returns the quotient, to full precision.
    fn over(self, divisor: Self) -> Self;

    /// Returns the nearest `f64`.
    fn rounded(self) -> f64;
}

impl Arithmetic for f64 {
    const TAYLOR_ORDER: i32 = 13;
}

impl Arithmetic for Pair {
    const TAYLOR_ORDER: i32 = f64::TAYLOR_ORDER;
}

impl Arithmetic for TwoFloat {
    const TAYLOR_ORDER: i32 = 21;
}

impl Number for f64 {
    fn over(self, divisor: Self) -> Self {
        self / divisor
    }

    fn rounded(self) -> f64 {
        self
    }
}

/// The unevaluated sum of two `f64`: the nearest `f64`, and the remainder.
///
/// The algorithms are from Joldes, Muller and Popescu, *Tight and rigorous error bounds for basic building
/// blocks of double-word arithmetic*, ACM Transactions on Mathematical Software 44 (2017).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoFloat {
    high: f64,
    low: f64,
}

impl TwoFloat {
    /// Returns the exact sum if `|a| >= |b|` (algorithm 1).
    fn fast_sum(a: f64, b: f64) -> Self {
        let high = a + b;
        Self { high, low: b - (high - a) }
    }

    /// Returns the exact sum (algorithm 2).
    fn sum(a: f64, b: f64) -> Self {
        let high = a + b;
        let rounded_a = high - b;
        Self { high, low: (a - rounded_a) + (b - (high - rounded_a)) }
    }

    /// Returns the exact product (algorithm 3).
    fn product(a: f64, b: f64) -> Self {
        let high = a * b;
        Self { high, low: libm::fma(a, b, -high) }
    }

    /// Returns the product with an `f64` (algorithm 9).
    fn times(self, factor: f64) -> Self {
        let high = Self::product(self.high, factor);
        Self::fast_sum(high.high, libm::fma(self.low, factor, high.low))
    }

    /// Returns the inverse, to about 31 digits (the first part of algorithm 18).
    fn inverse(self) -> Self {
        let estimate = self.high.recip();
        let error = Self::fast_sum(1.0 - self.high * estimate, -(self.low * estimate));
        let correction = error.times(estimate);
        let sum = Self::sum(correction.high, estimate);
        Self::fast_sum(sum.high, correction.low + sum.low)
    }
}

impl From<f64> for TwoFloat {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl Neg for TwoFloat {
    type Output = Self;

    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
}

impl Add for TwoFloat {
    type Output = Self;

    /// Algorithm 6.
    fn add(self, other: Self) -> Self {
        let high = Self::sum(self.high, other.high);
        let low = Self::sum(self.low, other.low);
        let middle = Self::fast_sum(high.high, high.low + low.high);
        Self::fast_sum(middle.high, low.low + middle.low)
    }
}

impl Sub for TwoFloat {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for TwoFloat {
    type Output = Self;

    /// Algorithm 12.
    fn mul(self, other: Self) -> Self {
        let high = Self::product(self.high, other.high);
        let cross = libm::fma(self.high, other.low, self.low * other.low);
        let cross = libm::fma(self.low, other.high, cross);
        Self::fast_sum(high.high, high.low + cross)
    }
}

impl Div<f64> for TwoFloat {
    type Output = Self;

    /// Algorithm 15.
    fn div(self, divisor: f64) -> Self {
        let quotient = self.high / divisor;
        let back = Self::product(quotient, divisor);
        let rest = ((self.high - back.high) - back.low) + self.low;
        Self::fast_sum(quotient, rest / divisor)
    }
}

macro_rules! assign {
    ($($trait:ident $function:ident $operator:tt),+) => {
        $(impl $trait for TwoFloat {
            fn $function(&mut self, other: Self) {
                *self = *self $operator other;
            }
        })+
    };
}
assign!(AddAssign add_assign +, SubAssign sub_assign -, MulAssign mul_assign *);

impl Zero for TwoFloat {
    fn zero() -> Self {
        0.0.into()
    }

    fn is_zero(&self) -> bool {
        self.high == 0.0
    }
}

impl One for TwoFloat {
    fn one() -> Self {
        1.0.into()
    }
}

impl Number for TwoFloat {
    /// Corrects the quotient once, because the product with the inverse loses a few bits.
    fn over(self, divisor: Self) -> Self {
        let inverse = divisor.inverse();
        let quotient = self * inverse;
        quotient + (self - quotient * divisor) * inverse
    }

    fn rounded(self) -> f64 {
        self.high
    }
}

#[cfg(test)]
mod tests {
    use super::{Number, TwoFloat};

    fn number(value: f64) -> TwoFloat {
        value.into()
    }

    /// Checks differences that `f64` rounds to 0, and a quotient.
    #[test]
    fn no_digit_of_thirty_is_lost() {
        let tiny = 2.0_f64.powi(-100);
        assert_eq!((number(1.0) + number(tiny) - number(1.0)).rounded(), tiny);
        for third in [number(1.0).over(number(3.0)), number(1.0) / 3.0] {
            assert!((third * number(3.0) - number(1.0)).rounded().abs() < 1e-31);
        }
        // 10^15 + 1 and 10^15 - 1 are exact in `f64`, but their product 10^30 - 1 has 100 bits.
        let product = number(1e15 + 1.0) * number(1e15 - 1.0);
        assert_eq!((product - number(1e15) * number(1e15)).rounded(), -1.0);
        assert_eq!(product.over(number(1e15 - 1.0)).rounded(), 1e15 + 1.0);
    }
}

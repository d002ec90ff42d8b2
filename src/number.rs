//! The numbers that step matrices are calculated with: `f64`, or twice its precision.
//!
//! On its way to the full step the matrix of a stiff testbed loses up to 15 of the 16 digits of an `f64`.
//! A [`TwoFloat`] has 32, so that the 16 that count are right. Its products are made with the fused
//! multiply-add of the crate libm, not that of the platform: every platform gets the same bits.

use crate::pair::Pair;
use nalgebra::{ClosedAddAssign, ClosedMulAssign, ClosedSubAssign, Scalar};
use num_traits::{One, Zero};
use std::ops::{Div, Neg};
use twofloat::TwoFloat;

/// A number, or a [`Pair`] of numbers that take the same steps.
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
    /// The last term that matters of the series of exp(1/4): `0.25^n / n!` is below the precision from
    /// the next one on.
    const TAYLOR_ORDER: i32;
}

/// `f64` or [`TwoFloat`].
pub trait Number: Arithmetic {
    /// The quotient, to full precision.
    fn over(self, divisor: Self) -> Self;

    /// The nearest `f64`.
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

impl Number for TwoFloat {
    /// In two steps, because the quotient of two `TwoFloat`s has 16 digits only (in version 0.8.4).
    fn over(self, divisor: Self) -> Self {
        let quotient = self / divisor;
        quotient + (self - quotient * divisor) / divisor
    }

    fn rounded(self) -> f64 {
        self.hi()
    }
}

#[cfg(test)]
mod tests {
    use super::{Number, TwoFloat};

    fn number(value: f64) -> TwoFloat {
        value.into()
    }

    /// Differences that `f64` rounds away.
    #[test]
    fn no_digit_of_thirty_is_lost() {
        let tiny = 2.0_f64.powi(-100);
        assert_eq!((number(1.0) + number(tiny) - number(1.0)).rounded(), tiny);
        for third in [number(1.0).over(number(3.0)), number(1.0) / 3.0] {
            assert!((third * number(3.0) - number(1.0)).rounded().abs() < 1e-31);
        }
        // 10^15 + 1 and 10^15 - 1 are exact, their product 10^30 - 1 has 100 bits.
        let product = number(1e15 + 1.0) * number(1e15 - 1.0);
        assert_eq!((product - number(1e15) * number(1e15)).rounded(), -1.0);
        assert_eq!(product.over(number(1e15 - 1.0)).rounded(), 1e15 + 1.0);
    }
}

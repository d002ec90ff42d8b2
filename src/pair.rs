//! Two numbers that take every step of a calculation together.

use std::ops::{Add, Div, Index, IndexMut, Mul, Neg, Sub};
use wide::f64x2;

/// A quantity of side 1 next to the same quantity of side 2 (or pitch next to roll), in one register.
///
/// An array of two would be the same numbers, but the compiler then takes the sides apart.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pair(f64x2);

impl Pair {
    /// The pair of these two.
    #[inline]
    pub const fn new(first: f64, second: f64) -> Self {
        Self(f64x2::new([first, second]))
    }

    /// Twice the same.
    #[inline]
    pub const fn both(value: f64) -> Self {
        Self::new(value, value)
    }

    /// The two as an array.
    #[inline]
    pub const fn array(self) -> [f64; 2] {
        self.0.to_array()
    }
}

/// A quantity of both sides.
pub type Sides = Pair;

/// A quantity of the pitch and of the roll subsystem.
pub type PitchRoll = Pair;

/// Sum and difference of the two sides, twice the quantities of pitch and roll. The factor 1/2 is left
/// to the matrices that they meet.
#[inline]
pub fn sum_difference(sides: Sides) -> PitchRoll {
    let [side1, side2] = f64x2::transpose([sides.0; 2]);
    // A difference is the sum with the negated number, bit for bit.
    Pair(side1 + (side2 ^ f64x2::new([0.0, -0.0])))
}

/// The two sides from the quantities of pitch and roll, their mean and half difference.
#[inline]
pub fn sides(z: PitchRoll) -> Sides {
    sum_difference(z)
}

impl Index<usize> for Pair {
    type Output = f64;

    #[inline]
    fn index(&self, index: usize) -> &f64 {
        &self.0.as_array()[index]
    }
}

impl IndexMut<usize> for Pair {
    #[inline]
    fn index_mut(&mut self, index: usize) -> &mut f64 {
        &mut self.0.as_mut_array()[index]
    }
}

/// Operators on both numbers, each with that of the other pair.
macro_rules! operators {
    ($($operator:ident $function:ident)*) => {
        $(impl $operator for Pair {
            type Output = Self;

            #[inline]
            fn $function(self, other: Self) -> Self {
                Self(self.0.$function(other.0))
            }
        })*
    };
}

operators! { Add add Sub sub Mul mul Div div }

impl Mul<f64> for Pair {
    type Output = Self;

    #[inline]
    fn mul(self, factor: f64) -> Self {
        self * Self::both(factor)
    }
}

impl Neg for Pair {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

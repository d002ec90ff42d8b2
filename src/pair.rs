//! Two numbers that take every step of a calculation together.

use std::ops::{Add, Div, Index, IndexMut, Mul, Neg, Sub};

/// A quantity of side 1 beside the same of side 2 (or of pitch beside roll). Aligned as the registers
/// that hold both.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(16))]
pub struct Pair([f64; 2]);

impl Pair {
    /// The pair of these two.
    #[inline]
    pub const fn new(first: f64, second: f64) -> Self {
        Self([first, second])
    }

    /// Twice the same.
    #[inline]
    pub const fn both(value: f64) -> Self {
        Self([value; 2])
    }

    /// The two as an array.
    #[inline]
    pub const fn array(self) -> [f64; 2] {
        self.0
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
    let [side1, side2] = sides.array();
    PitchRoll::new(side1 + side2, side1 - side2)
}

/// The two sides from the quantities of pitch and roll, their mean and half difference.
#[inline]
pub fn sides(z: PitchRoll) -> Sides {
    let [pitch, roll] = z.array();
    Sides::new(pitch + roll, pitch - roll)
}

impl Index<usize> for Pair {
    type Output = f64;

    #[inline]
    fn index(&self, index: usize) -> &f64 {
        &self.0[index]
    }
}

impl IndexMut<usize> for Pair {
    #[inline]
    fn index_mut(&mut self, index: usize) -> &mut f64 {
        &mut self.0[index]
    }
}

/// Operators on both numbers, each with that of the other pair.
macro_rules! operators {
    ($($operator:ident $function:ident $symbol:tt)*) => {
        $(impl $operator for Pair {
            type Output = Self;

            #[inline]
            fn $function(self, other: Self) -> Self {
                Self([self.0[0] $symbol other.0[0], self.0[1] $symbol other.0[1]])
            }
        })*
    };
}

operators! { Add add + Sub sub - Mul mul * Div div / }

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
        Self([-self.0[0], -self.0[1]])
    }
}

//! Two numbers on which the same operations act.

use num_traits::{One, Zero};
#[cfg(target_arch = "x86_64")]
use safe_arch::{
    bitxor_m128d, cast_to_m128d_from_m128i, cast_to_m128i_from_m128d, m128d, set_splat_m128d,
    shuffle_ai_f32_all_m128i,
};
use std::ops::{Add, AddAssign, Div, DivAssign, Index, IndexMut, Mul, MulAssign, Neg, Sub, SubAssign};

/// A quantity of side 1 and the same quantity of side 2 (or pitch and roll). It is aligned like a
/// vector register.
///
/// On x86-64, the operators between two pairs use vector instructions explicitly, because the compiler would handle the
/// two numbers separately. The results are bit-identical with and without these instructions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(16))]
pub struct Pair([f64; 2]);

impl Pair {
    /// Creates a pair of two numbers.
    #[inline]
    pub const fn new(first: f64, second: f64) -> Self {
        Self([first, second])
    }

    /// Creates a pair of two equal numbers.
    #[inline]
    pub const fn both(value: f64) -> Self {
        Self([value; 2])
    }

    /// Creates a pair of two equal numbers, on x86-64 with one vector instruction. If the pair is stored, both halves are
    /// stored at once, so that reading it soon after does not stall the processor.
    #[inline]
    pub fn splat(value: f64) -> Self {
        #[cfg(target_arch = "x86_64")]
        return Self(set_splat_m128d(value).into());
        #[cfg(not(target_arch = "x86_64"))]
        Self::both(value)
    }

    /// Returns the two numbers as an array.
    #[inline]
    pub const fn array(self) -> [f64; 2] {
        self.0
    }
}

/// A quantity of both sides.
pub type PerSide = Pair;

/// A quantity of the pitch and of the roll subsystem.
pub type PitchRoll = Pair;

/// Returns the sum and the difference of the two sides, which are twice the quantities of pitch and roll. The
/// missing factor 1/2 is in the step matrices, or the caller multiplies by it.
#[inline]
pub fn to_modes(sides: PerSide) -> PitchRoll {
    #[cfg(target_arch = "x86_64")]
    {
        // [a, b] -> [a, -b] + [b, a]. This shuffle writes to another register, so it needs no separate copy.
        let sides = m128d::from(sides.0);
        let swapped = shuffle_ai_f32_all_m128i::<0b01_00_11_10>(cast_to_m128i_from_m128d(sides));
        Pair((bitxor_m128d(sides, [0.0, -0.0].into()) + cast_to_m128d_from_m128i(swapped)).into())
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        let [side1, side2] = sides.array();
        PitchRoll::new(side1 + side2, side1 - side2)
    }
}

/// Returns the two sides from the quantities of pitch and roll, which are the mean and the half difference of the
/// sides.
#[inline]
pub fn from_modes(z: PitchRoll) -> PerSide {
    to_modes(z)
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

/// Implements operators between two pairs, number by number.
macro_rules! operators {
    ($($operator:ident $function:ident $symbol:tt, $assigning:ident $assign:ident;)*) => {
        $(
            impl $operator for Pair {
                type Output = Self;

                #[inline]
                fn $function(self, other: Self) -> Self {
                    #[cfg(target_arch = "x86_64")]
                    return Self((m128d::from(self.0) $symbol m128d::from(other.0)).into());
                    #[cfg(not(target_arch = "x86_64"))]
                    Self([self.0[0] $symbol other.0[0], self.0[1] $symbol other.0[1]])
                }
            }

            impl $assigning for Pair {
                #[inline]
                fn $assign(&mut self, other: Self) {
                    *self = *self $symbol other;
                }
            }
        )*
    };
}

operators! {
    Add add +, AddAssign add_assign;
    Sub sub -, SubAssign sub_assign;
    Mul mul *, MulAssign mul_assign;
    Div div /, DivAssign div_assign;
}

/// Implements operators between a pair and one number.
macro_rules! with_number {
    ($($operator:ident $function:ident)*) => {
        $(impl $operator<f64> for Pair {
            type Output = Self;

            #[inline]
            fn $function(self, number: f64) -> Self {
                self.$function(Self::both(number))
            }
        })*
    };
}

with_number! { Mul mul Div div }

impl Neg for Pair {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self([-self.0[0], -self.0[1]])
    }
}

impl From<f64> for Pair {
    #[inline]
    fn from(number: f64) -> Self {
        Self::both(number)
    }
}

impl Zero for Pair {
    #[inline]
    fn zero() -> Self {
        Self::both(0.0)
    }

    #[inline]
    fn is_zero(&self) -> bool {
        *self == Self::zero()
    }
}

impl One for Pair {
    #[inline]
    fn one() -> Self {
        Self::both(1.0)
    }
}

//! The scaling of the velocity with which [`propagator`](crate::propagator) computes its matrices.

use crate::number::Number;
use nalgebra::Matrix3;

/// The velocity unit in which the Taylor series of a subsystem converges best, and how fast it converges.
///
/// Angles and velocities differ in magnitude. With the velocity in this unit, the entries of the state matrix
/// that couple them have about the same magnitude. Therefore the norm of the matrix and the rounding error of the
/// doublings are smaller than in rad/s. The unit is a power of 2, so the scaling is exact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balance {
    /// Velocity unit, rad/s.
    pub(crate) scale: f64,
    /// Base-2 logarithm of the factor by which a step of 1 s must be divided so that the norm of `A h` is 1/4. The
    /// logarithm is stored because, for stiff systems, the product of the factor and a long step would overflow.
    halvings: f64,
}

impl Balance {
    /// Computes the balance for the state matrix `a`.
    pub fn new<T: Number>(a: &Matrix3<T>) -> Self {
        let rounded = a.map(T::rounded);
        let into_velocity = rounded[(2, 0)].abs().max(rounded[(2, 1)].abs());
        let from_velocity = rounded[(0, 2)].abs().max(rounded[(1, 2)].abs());
        let power = (-0.5 * (into_velocity / from_velocity).log2()).round().clamp(-300.0, 300.0) as i32;
        let scale = 0.5_f64.powi(power);
        let norm = rescaled(a, scale).map(T::rounded).abs().row_sum().max();
        Self { scale, halvings: (norm / 0.25).log2() }
    }

    /// Returns the number of times that a step is halved before the series is evaluated. After the evaluation, the same
    /// number of doublings extends the result to the full step. `log2_of_h` is the base-2 logarithm of the step size in s.
    pub(crate) fn doublings(&self, log2_of_h: f64) -> i32 {
        (self.halvings + log2_of_h).ceil().clamp(0.0, 2100.0) as i32
    }
}

/// Returns the matrix for a velocity in units of `scale`.
pub(crate) fn rescaled<T: Number>(a: &Matrix3<T>, scale: f64) -> Matrix3<T> {
    let mut b = *a;
    b[(2, 0)] = b[(2, 0)] / scale;
    b[(2, 1)] = b[(2, 1)] / scale;
    b[(0, 2)] *= scale.into();
    b[(1, 2)] *= scale.into();
    b
}

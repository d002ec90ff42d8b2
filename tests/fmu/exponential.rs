//! The matrix exponential, with which tests compare steps. It shares no code with the propagator of the testbed.

use nalgebra::SMatrix;

/// Returns the exponential of a matrix: the series of a fraction of it, squared repeatedly.
pub fn exponential(matrix: SMatrix<f64, 10, 10>) -> SMatrix<f64, 10, 10> {
    let largest = matrix.iter().fold(1.0, |largest: f64, x| largest.max(x.abs()));
    let halvings = largest.log2().ceil() as i32 + 4;
    let part = matrix * 0.5_f64.powi(halvings);
    let (mut sum, mut term) = (SMatrix::identity(), SMatrix::identity());
    for k in 1..16 {
        term = term * part / f64::from(k);
        sum += term;
    }
    (0..halvings).fold(sum, |power, _| power * power)
}

//! The model in matrix form, eqs. (8) to (15), with corrections of the printed eq. (11).
//!
//! These matrices use the paper's notation and are the reference for the tests. The FMU evaluates
//! [`decoupled`](crate::decoupled), which contains the same equations split into pitch and roll.

use crate::parameters::Parameters;
use nalgebra::{Complex, Matrix2, Matrix4, Matrix4x2, SMatrix, Vector4};

/// Returns the mass matrix M of eq. (8), `M q'' + Delta q' + K q = f` with
/// `q = [theta3, theta4, theta5, theta6]`, kg.m2.
///
/// All entries are zero except the block M_II of theta5 and theta6. Its diagonal is
/// `J2 + H3/4 + J3 N^2/4M^2`; its off-diagonal is `H3/4 - J3 N^2/4M^2`.
pub fn mass_matrix(p: &Parameters) -> Matrix4<f64> {
    let (same, other) = sect_terms(p.H3, p.J3, p);
    lower_block(Matrix2::new(p.J2 + same, other, other, p.J2 + same))
}

/// Returns the damping matrix Delta of eq. (8), N.m.s/rad, from c1 and c2 of the couplings and c3 of the
/// load. In the block of theta5 and theta6, c3 adds `c3/4 + c3 N^2/4M^2` to the diagonal and
/// `c3/4 - c3 N^2/4M^2` to the off-diagonal.
pub fn damping_matrix(p: &Parameters) -> Matrix4<f64> {
    let (same, other) = sect_terms(p.c3, p.c3, p);
    couplings(p.c1, p.c2) + lower_block(Matrix2::new(same, other, other, same))
}

/// Returns the stiffness matrix K of eq. (8), N.m/rad, from k1 and k2 of the couplings.
pub fn stiffness_matrix(p: &Parameters) -> Matrix4<f64> {
    couplings(p.k1, p.k2)
}

/// Returns the generalized force of eq. (8), N.m, `f = [c1 omega1 + k1 theta1, c1 omega2 + k1 theta2, 0, 0]`,
/// for the motors' angles theta in rad and rates omega in rad/s.
pub fn force(p: &Parameters, theta: [f64; 2], omega: [f64; 2]) -> Vector4<f64> {
    Vector4::new(p.c1 * omega[0] + p.k1 * theta[0], p.c1 * omega[1] + p.k1 * theta[1], 0.0, 0.0)
}

/// Returns the contributions of pitch and roll to the diagonal and the off-diagonal of the block of theta5
/// and theta6:
/// `of_pitch/4 + of_roll N^2/4M^2` and `of_pitch/4 - of_roll N^2/4M^2`.
fn sect_terms(of_pitch: f64, of_roll: f64, p: &Parameters) -> (f64, f64) {
    let roll = of_roll * p.roll_ratio() * p.roll_ratio();
    (0.25 * of_pitch + roll, 0.25 * of_pitch - roll)
}

/// Returns the stiffness or damping matrix of the couplings, which has the same pattern for both: two chains of
/// motor, coupling, massless shaft, coupling and SECT.
fn couplings(motor_side: f64, sect_side: f64) -> Matrix4<f64> {
    let (sum, d) = (motor_side + sect_side, sect_side);
    Matrix4::new(
        sum, 0.0, -d, 0.0, //
        0.0, sum, 0.0, -d, //
        -d, 0.0, d, 0.0, //
        0.0, -d, 0.0, d,
    )
}

fn lower_block(block: Matrix2<f64>) -> Matrix4<f64> {
    let mut matrix = Matrix4::zeros();
    matrix.fixed_view_mut::<2, 2>(2, 2).copy_from(&block);
    matrix
}

/// The state-space form, eq. (11): `x' = A x + B u`, `y = C x + D u` with
/// `x = [theta3, theta4, theta5, theta6, omega5, omega6]`, `u = [theta1, theta2, omega1, omega2]`,
/// `y = [theta3, theta4, theta1, theta2, tau1, tau2]`.
#[allow(non_snake_case, reason = "the paper's symbols")]
#[derive(Clone, Debug, PartialEq)]
pub struct StateSpace {
    /// State matrix, 6 x 6.
    pub A: SMatrix<f64, 6, 6>,
    /// Input matrix, 6 x 4.
    pub B: SMatrix<f64, 6, 4>,
    /// Output matrix, 6 x 6.
    pub C: SMatrix<f64, 6, 6>,
    /// Feedthrough, 6 x 4.
    pub D: SMatrix<f64, 6, 4>,
}

/// Computes A, B, C and D of eq. (11), corrected.
///
/// The first block row of eq. (8) is `C_I q_I' + K_I q_I + C_I,II v_II + K_I,II q_II = f_I`. Solved for
/// `q_I'`, it gives A11, A12 and A13 with **negative** signs. The paper prints positive signs, with which A
/// would have two eigenvalues near +183.5 1/s. Inserting `q_I'` into eq. (10) makes the first terms of D31 and D32
/// **positive**; the paper prints them negative.
///
/// # Panics
/// Panics if inertias differ so much that `M_II` cannot be inverted in double precision. May panic or return NaN if the
/// parameters do not pass [`Parameters::check`].
#[allow(non_snake_case, reason = "the paper's symbols")]
pub fn state_space(p: &Parameters) -> StateSpace {
    let block = |matrix: &Matrix4<f64>, row, column| matrix.fixed_view::<2, 2>(row, column).into_owned();
    let (mass, damping, stiffness) = (mass_matrix(p), damping_matrix(p), stiffness_matrix(p));
    let M_II = block(&mass, 2, 2);
    let (C_I, C_I_II, C_II) = (block(&damping, 0, 0), block(&damping, 0, 2), block(&damping, 2, 2));
    let (K_I, K_I_II, K_II) = (block(&stiffness, 0, 0), block(&stiffness, 0, 2), block(&stiffness, 2, 2));
    let K_1in = Matrix2::identity() * p.k1;
    let C_1in = Matrix2::identity() * p.c1;

    // Scaled, because the determinant of very small or large entries would underflow or overflow.
    let invert = |matrix: Matrix2<f64>| {
        let scale = matrix.amax();
        (matrix / scale).try_inverse().expect("checked parameters must give invertible blocks") / scale
    };
    let C_I_inv = invert(C_I);
    let M_II_inv = invert(M_II);

    let A11 = -C_I_inv * K_I;
    let A12 = -C_I_inv * K_I_II;
    let A13 = -C_I_inv * C_I_II;
    let A31 = -M_II_inv * (-C_I_II.transpose() * C_I_inv * K_I + K_I_II.transpose());
    let A32 = -M_II_inv * (-C_I_II.transpose() * C_I_inv * K_I_II + K_II);
    let A33 = -M_II_inv * (-C_I_II.transpose() * C_I_inv * C_I_II + C_II);
    let B11 = C_I_inv * K_1in;
    let B12 = C_I_inv * C_1in;
    let B31 = -M_II_inv * C_I_II.transpose() * C_I_inv * K_1in;
    let B32 = -M_II_inv * C_I_II.transpose() * C_I_inv * C_1in;
    let C31 = K_1in - C_1in * C_I_inv * K_I;
    let C32 = -C_1in * C_I_inv * K_I_II;
    let C33 = -C_1in * C_I_inv * C_I_II;
    let D31 = C_1in * C_I_inv * K_1in - K_1in;
    let D32 = C_1in * C_I_inv * C_1in - C_1in;

    let (zero, one) = (Matrix2::zeros(), Matrix2::identity());
    StateSpace {
        A: assemble([[A11, A12, A13], [zero, zero, one], [A31, A32, A33]]),
        B: assemble([[B11, B12], [zero, zero], [B31, B32]]),
        C: assemble([[one, zero, zero], [zero, zero, zero], [C31, C32, C33]]),
        D: assemble([[zero, zero], [one, zero], [D31, D32]]),
    }
}

/// Assembles a matrix from its 2 x 2 blocks.
fn assemble<const BLOCKS: usize, const COLUMNS: usize>(
    blocks: [[Matrix2<f64>; BLOCKS]; 3],
) -> SMatrix<f64, 6, COLUMNS> {
    SMatrix::from_fn(|row, column| blocks[row / 2][column / 2][(row % 2, column % 2)])
}

/// Returns the transfer matrix `G(s) = C (s 1 - A)^-1 B + D` from u to y, eq. (13); `None` at an eigenvalue
/// of A.
pub fn transfer_matrix(p: &Parameters, s: Complex<f64>) -> Option<SMatrix<Complex<f64>, 6, 4>> {
    let system = state_space(p);
    let complex = |x: f64| Complex::new(x, 0.0);
    let resolvent = (SMatrix::<Complex<f64>, 6, 6>::identity() * s - system.A.map(complex)).try_inverse()?;
    Some(system.C.map(complex) * resolvent * system.B.map(complex) + system.D.map(complex))
}

/// Returns the transfer matrix `H(s) = (s^2 M + s Delta + K)^-1 F_u (c1 s + k1)` from the motor angles to q,
/// eq. (15); `None` at a pole.
pub fn angle_transfer_matrix(p: &Parameters, s: Complex<f64>) -> Option<Matrix4x2<Complex<f64>>> {
    let complex = |x: f64| Complex::new(x, 0.0);
    let pencil = mass_matrix(p).map(complex) * (s * s)
        + damping_matrix(p).map(complex) * s
        + stiffness_matrix(p).map(complex);
    Some(pencil.try_inverse()?.fixed_columns::<2>(0) * (s * p.c1 + p.k1))
}

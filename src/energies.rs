//! Energies and power of the testbed, eqs. (1) and (3) to (7), from which the paper derives the model.
//!
//! The stepping does not use this module. Tests derive the matrices of eq. (8) from these functions.

use crate::parameters::Parameters;

/// Angles at one instant, rad. Also used for their rates, rad/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Angles {
    /// Motor 1.
    pub theta1: f64,
    /// Motor 2.
    pub theta2: f64,
    /// Massless shaft between couplings 1 and 2.
    pub theta3: f64,
    /// Massless shaft between couplings 3 and 4.
    pub theta4: f64,
    /// SECT input shaft 1.
    pub theta5: f64,
    /// SECT input shaft 2.
    pub theta6: f64,
}

/// Returns pitch theta7 and roll theta8 of the output shaft from theta5 and theta6, eq. (1):
/// `theta7 = (theta5 + theta6) / 2`, `theta8 = N/2M (theta5 - theta6)`.
///
/// The paper's list of symbols calls theta7 "rolling"; eq. (1), the frame of eq. (4a) and Sec. 4
/// agree that it is pitch.
pub fn sect(p: &Parameters, theta5: f64, theta6: f64) -> (f64, f64) {
    (0.5 * (theta5 + theta6), p.roll_ratio() * (theta5 - theta6))
}

/// Returns the kinetic energy `T = J2/2 (theta5'^2 + theta6'^2) + H3/2 theta7'^2 + J3/2 theta8'^2`, eq. (5),
/// in J.
///
/// The kinetic energy of the motors, `J1/2 (theta1'^2 + theta2'^2)`, is left out because their motion is an
/// input. Eqs. (3) and (4) contain the load's inertia as a matrix in a frame with X along the pitch axis and
/// Y along the roll axis.
pub fn kinetic_energy(p: &Parameters, rates: &Angles) -> f64 {
    let (pitch_rate, roll_rate) = sect(p, rates.theta5, rates.theta6);
    0.5 * p.J2 * (square(rates.theta5) + square(rates.theta6))
        + 0.5 * p.H3 * square(pitch_rate)
        + 0.5 * p.J3 * square(roll_rate)
}

/// Returns the potential energy of the couplings,
/// `V = k1/2 ((theta1 - theta3)^2 + (theta2 - theta4)^2) + k2/2 ((theta3 - theta5)^2 + (theta4 - theta6)^2)`,
/// eq. (6), in J.
///
/// The paper prints k1 in the last term; it is k2, as in K of eq. (8) and by symmetry.
pub fn potential_energy(p: &Parameters, q: &Angles) -> f64 {
    0.5 * p.k1 * (square(q.theta1 - q.theta3) + square(q.theta2 - q.theta4))
        + 0.5 * p.k2 * (square(q.theta3 - q.theta5) + square(q.theta4 - q.theta6))
}

/// Returns Rayleigh's dissipation function, eq. (7), in W.
///
/// It is V of eq. (6) with angles replaced by rates and k by c, plus `c3/2 (theta7'^2 + theta8'^2)`. The dissipated
/// power is twice this value.
pub fn dissipation(p: &Parameters, rates: &Angles) -> f64 {
    let (pitch_rate, roll_rate) = sect(p, rates.theta5, rates.theta6);
    0.5 * p.c1 * (square(rates.theta1 - rates.theta3) + square(rates.theta2 - rates.theta4))
        + 0.5 * p.c2 * (square(rates.theta3 - rates.theta5) + square(rates.theta4 - rates.theta6))
        + 0.5 * p.c3 * (square(pitch_rate) + square(roll_rate))
}

fn square(x: f64) -> f64 {
    x * x
}

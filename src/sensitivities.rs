//! How what is calculated reacts to the parameters, at a given state and motion of the motors.
//!
//! With `q_I' = (c1 w + c2 v - k1 (q_I - u) - k2 (q_I - q_II)) / (c1 + c2)` the sensor torque is
//! `tau = k1 (q_I - u) + c1 (q_I' - w)`, eq. (9), and the motion of the SECT shafts splits into pitch and
//! roll, `J v' = -tau - c v` (see [`decoupled`](crate::decoupled)).

use crate::decoupled::{PitchRoll, sides, sum_difference};
use crate::motor::Motion;
use crate::testbed::{State, Testbed};

/// A Real parameter of the testbed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the paper's symbols, see Parameters")]
pub enum Parameter {
    J2,
    J3,
    H3,
    K1,
    K2,
    C1,
    C2,
    C3,
}

/// Derivative of the rate of the massless shaft of side 0 or 1 with respect to a parameter.
pub fn shaft_rate(
    testbed: &Testbed,
    x: &State,
    motors: &[Motion; 2],
    side: usize,
    parameter: Parameter,
) -> f64 {
    let p = &testbed.parameters;
    let [q_i, q_ii, v] = [x[side], x[2 + side], x[4 + side]];
    let motor = motors[side];
    let q_i_rate = testbed.system().side.shaft_rate(q_i, q_ii, v, motor);
    let numerator = match parameter {
        Parameter::K1 => motor.angle - q_i,
        Parameter::K2 => q_ii - q_i,
        Parameter::C1 => motor.rate - q_i_rate,
        Parameter::C2 => v - q_i_rate,
        _ => 0.0,
    };
    numerator / (p.c1 + p.c2)
}

/// Derivative of the sensor torque of side 0 or 1 with respect to a parameter.
pub fn torque(testbed: &Testbed, x: &State, motors: &[Motion; 2], side: usize, parameter: Parameter) -> f64 {
    let motor = motors[side];
    let own = match parameter {
        Parameter::K1 => x[side] - motor.angle,
        Parameter::C1 => {
            testbed.system().side.shaft_rate(x[side], x[2 + side], x[4 + side], motor) - motor.rate
        }
        _ => 0.0,
    };
    own + testbed.parameters.c1 * shaft_rate(testbed, x, motors, side, parameter)
}

/// Derivatives of the accelerations of theta5 and theta6 with respect to a parameter, given these
/// accelerations.
pub fn accelerations(
    testbed: &Testbed,
    x: &State,
    motors: &[Motion; 2],
    accelerations: [f64; 2],
    parameter: Parameter,
) -> [f64; 2] {
    let system = testbed.system();
    let inertia = PitchRoll::new(system.pitch.inertia, system.roll.inertia);
    let [torque1, torque2] = [0, 1].map(|side| torque(testbed, x, motors, side, parameter));
    let torque = sum_difference(torque1, torque2) * 0.5;
    let rate = sum_difference(x[4], x[5]) * 0.5;
    let acceleration = sum_difference(accelerations[0], accelerations[1]) * 0.5;
    // The shares of J2, H3, J3 and c3 in the inertia and damping of pitch and of roll.
    let roll_share = 2.0 * system.roll_ratio * system.roll_ratio;
    let (inertia_share, damping_share) = match parameter {
        Parameter::J2 => (PitchRoll::new(1.0, 1.0), PitchRoll::zeros()),
        Parameter::H3 => (PitchRoll::new(0.5, 0.0), PitchRoll::zeros()),
        Parameter::J3 => (PitchRoll::new(0.0, roll_share), PitchRoll::zeros()),
        Parameter::C3 => (PitchRoll::zeros(), PitchRoll::new(0.5, roll_share)),
        _ => (PitchRoll::zeros(), PitchRoll::zeros()),
    };
    let force = -torque - damping_share.component_mul(&rate) - inertia_share.component_mul(&acceleration);
    sides(force.component_div(&inertia))
}

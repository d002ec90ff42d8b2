//! The equations at one instant: sensor torques, pitch and roll, rates of the shafts and their accelerations. Also the
//! derivatives of torques, shaft rates and accelerations with respect to the Real parameters.
//!
//! With `q_I' = (c1 w + c2 v - k1 (q_I - u) - k2 (q_I - q_II)) / (c1 + c2)`, eq. (8) row 1, the sensor torque is
//! `tau = k1 (q_I - u) + c1 (q_I' - w)`, eq. (9), and the motion of the SECT shafts splits into pitch and roll,
//! `J v' = -tau - c v` (see [`decoupled`](crate::decoupled)).

use crate::decoupled::Decoupled;
use crate::motor::{Motion, Motions};
use crate::pair::{PerSide, PitchRoll, from_modes, to_modes};
use crate::parameters::Parameters;
use crate::testbed::{State, StateBySide, split_by_side};

/// State x and motion of the motors at one instant.
///
/// All methods are linear in these numbers. If one number is 1 and the others are 0, the methods therefore return
/// partial derivatives with respect to it; called on [`rates`](Self::rates), they return time derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Instant {
    /// State x of eq. (11).
    pub x: State,
    /// Motion of the motors: angles and rates are u of eq. (11).
    pub motors: Motions,
}

/// Returns the sensor torques, eq. (9), N.m.
#[inline]
pub fn torques([q_i, q_ii, v]: StateBySide, motors: &Motions, system: &Decoupled) -> PerSide {
    system.both_sides.torque(q_i, q_ii, v, *motors)
}

/// Returns pitch and roll of the output shaft and their rates, eq. (1), rad and rad/s.
#[inline]
pub fn output_shaft([_, q_ii, v]: StateBySide, system: &Decoupled) -> [PitchRoll; 2] {
    [q_ii, v].map(|sides| to_modes(sides) * system.output_shaft)
}

impl Instant {
    /// Returns the sensor torques, eq. (9), N.m.
    pub fn torques(&self, system: &Decoupled) -> PerSide {
        torques(split_by_side(&self.x), &self.motors, system)
    }

    /// Returns the rates of the massless shafts, eq. (11a), rad/s.
    pub fn shaft_rates(&self, system: &Decoupled) -> PerSide {
        let [q_i, q_ii, v] = split_by_side(&self.x);
        system.both_sides.shaft_rate(q_i, q_ii, v, self.motors)
    }

    /// Returns the accelerations of the SECT input shafts, eq. (11a), rad/s2.
    pub fn accelerations(&self, system: &Decoupled) -> PerSide {
        // J v' = -tau - c v, separately for pitch and for roll.
        let torque = to_modes(self.torques(system)) * 0.5;
        let [.., v] = split_by_side(&self.x);
        let rate = to_modes(v) * 0.5;
        from_modes((-torque - system.load_damping() * rate) / system.inertia())
    }

    /// Returns the pitch angle theta7, eq. (1), rad.
    #[inline]
    pub fn pitch(&self, _: &Decoupled) -> f64 {
        0.5 * (self.x[2] + self.x[3])
    }

    /// Returns the roll angle theta8, eq. (1), rad.
    #[inline]
    pub fn roll(&self, system: &Decoupled) -> f64 {
        system.roll_ratio * (self.x[2] - self.x[3])
    }

    /// Returns the pitch rate, rad/s.
    #[inline]
    pub fn pitch_rate(&self, _: &Decoupled) -> f64 {
        0.5 * (self.x[4] + self.x[5])
    }

    /// Returns the roll rate, rad/s.
    #[inline]
    pub fn roll_rate(&self, system: &Decoupled) -> f64 {
        system.roll_ratio * (self.x[4] - self.x[5])
    }

    /// Returns the time derivatives of state and motion, eq. (11a).
    pub fn rates(&self, system: &Decoupled) -> Self {
        let [.., v] = split_by_side(&self.x);
        let [shafts, v, accelerations] =
            [self.shaft_rates(system), v, self.accelerations(system)].map(PerSide::array);
        let x = [shafts[0], shafts[1], v[0], v[1], accelerations[0], accelerations[1]];
        let Motions { rate, acceleration, .. } = self.motors;
        Self { x, motors: Motion { angle: rate, rate: acceleration, ..Motion::default() } }
    }

    /// Returns the derivative of [`shaft_rates`](Self::shaft_rates) with respect to the parameters in the
    /// direction `change`.
    pub fn change_of_shaft_rates(&self, system: &Decoupled, change: &Parameters) -> PerSide {
        let [q_i, q_ii, v] = split_by_side(&self.x);
        let Motions { angle, rate, .. } = self.motors;
        let q_i_rate = self.shaft_rates(system);
        let force = (angle - q_i) * change.k1
            + (q_ii - q_i) * change.k2
            + (rate - q_i_rate) * change.c1
            + (v - q_i_rate) * change.c2;
        force * (1.0 / (system.parameters.c1 + system.parameters.c2))
    }

    /// Returns the derivative of [`torques`](Self::torques) with respect to the parameters in the direction
    /// `change`.
    pub fn change_of_torques(&self, system: &Decoupled, change: &Parameters) -> PerSide {
        let [q_i, ..] = split_by_side(&self.x);
        let Motions { angle, rate, .. } = self.motors;
        (q_i - angle) * change.k1
            + (self.shaft_rates(system) - rate) * change.c1
            + self.change_of_shaft_rates(system, change) * system.parameters.c1
    }

    /// Returns the derivative of [`accelerations`](Self::accelerations) with respect to the parameters in the
    /// direction `change`.
    pub fn change_of_accelerations(&self, system: &Decoupled, change: &Parameters) -> PerSide {
        let torque = to_modes(self.change_of_torques(system, change)) * 0.5;
        let [.., v] = split_by_side(&self.x);
        let rate = to_modes(v) * 0.5;
        let acceleration = to_modes(self.accelerations(system)) * 0.5;
        // Changes of the inertia and of the load damping, for pitch and for roll.
        let roll_share = 2.0 * system.roll_ratio * system.roll_ratio;
        let inertia = PitchRoll::new(change.J2 + 0.5 * change.H3, change.J2 + roll_share * change.J3);
        let damping = PitchRoll::new(0.5 * change.c3, roll_share * change.c3);
        from_modes((-torque - damping * rate - inertia * acceleration) / system.inertia())
    }
}

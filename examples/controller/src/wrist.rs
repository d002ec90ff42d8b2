//! Kinematics of a rigid wrist, eq. (1): pitch and roll for given motor angles, and the inverse.

/// Pitch and roll, rad, or their rates, rad/s.
pub type PitchRoll = [f64; 2];
/// Angles of motors 1 and 2, rad, or their rates, rad/s.
pub type Motors = [f64; 2];

/// Kinematics of a wrist with certain numbers of cam lobes and rollers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kinematics {
    /// M / N: angle of motor 1 per roll angle; motor 2 turns in the opposite direction.
    motor_per_roll: f64,
}

impl Kinematics {
    /// Creates the kinematics of a wrist with `lobes` (M) and `rollers` (N), both at least 1.
    pub fn new(lobes: i32, rollers: i32) -> Self {
        Self { motor_per_roll: f64::from(lobes) / f64::from(rollers) }
    }

    /// Returns pitch and roll by eq. (1) with theta5 = theta1 and theta6 = theta2.
    pub fn wrist(&self, [one, two]: Motors) -> PitchRoll {
        [0.5 * one + 0.5 * two, (0.5 * one - 0.5 * two) / self.motor_per_roll]
    }

    /// Returns the motor angles by the inverse of eq. (1).
    pub fn motors(&self, [pitch, roll]: PitchRoll) -> Motors {
        [pitch + roll * self.motor_per_roll, pitch - roll * self.motor_per_roll]
    }
}

#[cfg(test)]
mod tests {
    use super::Kinematics;

    #[test]
    fn thirty_degrees_of_pitch_and_seventy_of_roll() {
        let wrist = Kinematics::new(4, 7);
        let motors = wrist.motors([30.0, 70.0]);
        assert_eq!(motors, [70.0, -10.0]);
        assert_eq!(wrist.wrist(motors), [30.0, 70.0]);
    }
}

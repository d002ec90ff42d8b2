//! Motion of a motor from sample to sample: as fast as its limits permit, without overshoot.
//!
//! The acceleration is constant during a sample period, so the rate changes linearly and the angle is a parabola. At
//! each sample, the motor chooses the highest rate from which it can still stop at its goal by full braking *in whole
//! samples*. Therefore it reaches the goal exactly and stays there. With a formula for braking in continuous time, it
//! would overshoot by a fraction of a sample and then oscillate around the goal.

/// Limits of a motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Highest rate, rad/s.
    pub rate: f64,
    /// Highest acceleration and deceleration, rad/s2.
    pub acceleration: f64,
}

/// Angle and rate at a sample, and the acceleration until the next sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorSetpoint {
    /// Angle, rad.
    pub angle: f64,
    /// Rate, rad/s.
    pub rate: f64,
    /// Acceleration, rad/s2.
    pub acceleration: f64,
}

impl MotorSetpoint {
    /// Returns the motion `time` s after the sample.
    #[inline]
    pub fn after(&self, time: f64) -> Self {
        Self {
            angle: self.angle + (self.rate + 0.5 * self.acceleration * time) * time,
            rate: self.rate + self.acceleration * time,
            acceleration: self.acceleration,
        }
    }

    /// Chooses the acceleration for the next `period` s on the way to `goal` (rad; may be infinite).
    ///
    /// Within its limits, the motor reaches the goal in the least number of samples. If the goal is behind the motor or
    /// nearer than its stopping distance, the motor first stops and then turns back. Returns whether the motor is at rest
    /// at its goal, or will be within two samples.
    pub fn plan_acceleration(&mut self, goal: f64, limits: &Limits, period: f64) -> bool {
        let Limits { rate: max_rate, acceleration: max } = *limits;
        // Units: the rate a T that the motor gains in one period T at full acceleration a, and the angle a T^2 that it
        // travels in one period at that rate.
        let (rate_unit, angle_unit) = (max * period, max * period * period);
        let distance = (goal - self.angle - 0.5 * self.rate * period) / angle_unit;
        let wanted = rate_unit * max_stoppable_rate(distance.abs(), max_rate / rate_unit).copysign(distance);
        let rate = wanted.clamp(-max_rate, max_rate);
        let acceleration = (rate - self.rate) / period;
        self.acceleration = acceleration.clamp(-max, max);
        // The next rate is then less than one unit, so that braking from it takes one period. The motor arrives after these
        // two periods unless a limit of the rate or the acceleration was applied.
        distance.abs() < 1.0 && rate == wanted && acceleration == self.acceleration
    }
}

/// Returns the rate v at the next sample, at most `limit`, from which the motor can just stop within the distance q. All
/// values are in the units that [`MotorSetpoint::plan_acceleration`] defines.
///
/// Until the next sample, a motor that reaches v covers v/2 (the part that depends on its current rate is already
/// subtracted from q). Braking takes m = floor(v) whole samples, and one more for the remainder v - m, over the distance
/// D(v) = (m + 1/2) v - m (m + 1)/2. Hence q = v/2 + D(v) = (m + 1) v - m (m + 1)/2, which is m (m + 1)/2 at v = m.
fn max_stoppable_rate(q: f64, limit: f64) -> f64 {
    // For a q beyond this bound, which may be infinite, v would exceed the limit.
    if q > 0.5 * (limit + 1.0) * (limit + 2.0) {
        return limit;
    }
    let m = (((1.0 + 8.0 * q).sqrt() - 1.0) * 0.5).floor();
    q / (m + 1.0) + 0.5 * m
}

#[cfg(test)]
mod tests {
    use super::{Limits, MotorSetpoint};

    const PERIOD: f64 = 1e-3;

    /// Moves a motor to `goal`. Returns the number of samples, the farthest angle in the direction of the goal, and the
    /// motor at the end.
    fn move_to(mut motor: MotorSetpoint, goal: f64, limits: &Limits) -> (usize, f64, MotorSetpoint) {
        let direction = (goal - motor.angle).signum();
        let mut farthest = motor.angle;
        for samples in 0..100_000 {
            if motor.angle == goal && motor.rate == 0.0 {
                return (samples, farthest, motor);
            }
            motor.plan_acceleration(goal, limits, PERIOD);
            assert!(motor.acceleration.abs() <= limits.acceleration);
            motor = motor.after(PERIOD);
            assert!(motor.rate.abs() <= limits.rate * (1.0 + 1e-12), "{}", motor.rate);
            if (motor.angle - farthest) * direction > 0.0 {
                farthest = motor.angle;
            }
            let settled = (motor.angle - goal).abs() < 1e-12 && motor.rate.abs() < 1e-9;
            if settled {
                return (samples + 1, farthest, motor);
            }
        }
        panic!("the motor has not arrived at {goal}: {motor:?}");
    }

    #[test]
    fn it_arrives_in_the_shortest_time_and_never_beyond_the_goal() {
        for (rate, acceleration) in [(3.0, 30.0), (2.345, 17.89), (0.5, 1e3), (100.0, 30.0), (0.02, 30.0)] {
            let limits = Limits { rate, acceleration };
            for goal in [1.1220, -0.5, 1e-3, 3.3e-5, 1e-5, -1e-7, 0.022_2] {
                let (samples, farthest, _) = move_to(MotorSetpoint::default(), goal, &limits);
                assert!((farthest - goal) * f64::signum(goal) <= 1e-12, "{goal}: {farthest}");
                // The shortest time in continuous time, with full acceleration and braking. Sampling adds at most three
                // samples.
                let distance = goal.abs();
                let peak = (distance * acceleration).sqrt().min(rate);
                let shortest = distance / peak + peak / acceleration;
                let expected = (shortest / PERIOD).floor();
                assert!(
                    (expected..=expected + 3.0).contains(&(samples as f64)),
                    "{goal} {limits:?}: {samples} {expected}"
                );
            }
        }
    }

    /// Checks the return value of `plan_acceleration`. With the last two limits, the maximum rate is less than one unit, so
    /// the motor needs several periods for the last unit.
    #[test]
    fn arrival_within_two_samples_is_announced() {
        let mut announced = 0;
        for (rate, acceleration) in [(3.0, 30.0), (2.345, 17.89), (0.5, 1e3), (0.02, 30.0), (0.004, 30.0)] {
            let limits = Limits { rate, acceleration };
            for goal in [1.1220, -0.5, 1e-3, 3.3e-5, 1e-5, -1e-7, 0.022_2, 6e-6, 1.7e-5] {
                let mut motor = MotorSetpoint::default();
                for _ in 0..400_000 {
                    let is_near = motor.plan_acceleration(goal, &limits, PERIOD);
                    if is_near {
                        let mut two_later = motor.after(PERIOD);
                        two_later.plan_acceleration(goal, &limits, PERIOD);
                        two_later = two_later.after(PERIOD);
                        assert!((two_later.angle - goal).abs() < 1e-12, "{goal} {limits:?} {two_later:?}");
                        assert!(two_later.rate.abs() < 1e-9, "{goal} {limits:?} {two_later:?}");
                        announced += 1;
                        break;
                    }
                    motor = motor.after(PERIOD);
                }
            }
        }
        assert_eq!(announced, 45);
    }

    #[test]
    fn it_stays_where_it_has_arrived() {
        let limits = Limits { rate: 3.0, acceleration: 30.0 };
        let (_, _, mut motor) = move_to(MotorSetpoint::default(), 0.7, &limits);
        for _ in 0..1000 {
            motor.plan_acceleration(0.7, &limits, PERIOD);
            motor = motor.after(PERIOD);
            assert!((motor.angle - 0.7).abs() < 1e-12 && motor.rate.abs() < 1e-9, "{motor:?}");
        }
    }

    #[test]
    fn a_goal_that_comes_too_near_is_passed_once() {
        let limits = Limits { rate: 3.0, acceleration: 30.0 };
        let fast = MotorSetpoint { angle: 0.0, rate: 3.0, acceleration: 0.0 };
        let (_, farthest, motor) = move_to(fast, 0.05, &limits);
        // The motor cannot stop before 3^2 / 60 = 0.15.
        assert!((farthest - 0.15).abs() < 1e-9, "{farthest}");
        assert!((motor.angle - 0.05).abs() < 1e-12);
    }

    #[test]
    fn extreme_goals_give_finite_motion() {
        let limits = Limits { rate: 3.0, acceleration: 30.0 };
        for goal in [f64::INFINITY, f64::NEG_INFINITY, f64::MAX, -f64::MAX, 5e-324] {
            let mut motor = MotorSetpoint::default();
            for _ in 0..1000 {
                motor.plan_acceleration(goal, &limits, PERIOD);
                motor = motor.after(PERIOD);
            }
            assert!(motor.angle.is_finite() && motor.rate.abs() <= 3.0, "{motor:?}");
        }
    }
}

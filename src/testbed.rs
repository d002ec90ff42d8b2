//! The testbed: parameters, motors and state, advanced exactly from point to point.

use crate::decoupled::{Decoupled, sides, sum_difference};
use crate::motor::{Motion, Motor, RateSource, SampleTimes};
use crate::parameters::{InvalidParameter, Parameters};
use crate::propagator::StepCache;

/// The state x of eq. (11): `[theta3, theta4, theta5, theta6, omega5, omega6]`, rad and rad/s.
pub type State = [f64; 6];

/// The testbed between two communication points.
#[derive(Debug)]
pub struct Testbed {
    /// Parameters; call [`parameters_changed`](Self::parameters_changed) after a change.
    pub parameters: Parameters,
    /// Where motor rates come from.
    pub rate_source: RateSource,
    /// State x.
    pub state: State,
    /// Motors 1 and 2.
    pub motors: [Motor; 2],
    /// When the motors' angles were sampled.
    pub times: SampleTimes,
    system: Decoupled,
    cache: StepCache,
}

impl Clone for Testbed {
    fn clone(&self) -> Self {
        Self { cache: self.cache.clone(), ..*self }
    }

    /// With the same parameters what follows from them stays good; the rest is little.
    fn clone_from(&mut self, source: &Self) {
        if self.parameters != source.parameters {
            *self = source.clone();
        }
        self.rate_source = source.rate_source;
        self.state = source.state;
        self.motors = source.motors;
        self.times = source.times;
    }
}

impl Testbed {
    /// A testbed at rest at angle 0.
    ///
    /// # Errors
    /// When the parameters make no testbed.
    pub fn new(parameters: Parameters) -> Result<Self, InvalidParameter> {
        Ok(Self {
            parameters,
            rate_source: RateSource::Samples,
            state: [0.0; 6],
            motors: [Motor::default(); 2],
            times: SampleTimes::default(),
            system: Decoupled::new(&parameters)?,
            cache: StepCache::new(),
        })
    }

    /// The equations that follow from the parameters.
    pub fn system(&self) -> &Decoupled {
        &self.system
    }

    /// Brings what follows from the parameters up to date.
    ///
    /// # Errors
    /// When the parameters make no testbed; they stay as they are.
    pub fn parameters_changed(&mut self) -> Result<(), InvalidParameter> {
        self.system = Decoupled::new(&self.parameters)?;
        self.cache = StepCache::new();
        Ok(())
    }

    /// Forgets the samples of the motor angles: the next one is the first.
    pub fn forget_samples(&mut self) {
        self.times = SampleTimes::default();
        for motor in &mut self.motors {
            *motor = Motor {
                theta: motor.theta,
                omega: motor.omega,
                set_rate: motor.set_rate,
                ..Motor::default()
            };
        }
    }

    /// The motion of motor 0 or 1 at the current communication point.
    #[inline]
    pub fn motion(&self, motor: usize) -> Motion {
        self.motors[motor].now(&self.times, self.rate_source)
    }

    /// Advances the state by step size `h > 0` in s, exactly for motors on straight lines.
    ///
    /// An angle that differs from the end of the last line does so by a jump, which passes through the
    /// dampers as an impulse: x jumps by B2 d, B2 being the rate columns of B in eq. (11).
    ///
    /// Returns false, with nothing changed, if the state would leave the range of numbers.
    #[inline]
    #[must_use]
    pub fn step(&mut self, h: f64) -> bool {
        let [motor1, motor2] = &self.motors;
        let motion1 = motor1.sampled(&self.times, self.rate_source);
        let motion2 = motor2.sampled(&self.times, self.rate_source);
        let jump = sum_difference(motor1.jump(&self.times), motor2.jump(&self.times));
        let u = sum_difference(motion1.angle, motion2.angle);
        let w = sum_difference(motion1.rate, motion2.rate);

        let [theta3, theta4, theta5, theta6, omega5, omega6] = self.state;
        let [jump_i, jump_v] = self.system.half_jump.map(|half| half.component_mul(&jump));
        let deviation = [
            (sum_difference(theta3, theta4) - u) + jump_i * 2.0,
            sum_difference(theta5, theta6) - u,
            sum_difference(omega5, omega6) + jump_v * 2.0,
        ];
        let matrices = self.cache.get(&self.system, h);
        let [d_i, d_ii, d_v] = matrices.increment(&deviation, w);
        let [d3, d4] = sides(d_i + jump_i);
        let [d5, d6] = sides(d_ii);
        let [v5, v6] = match matrices.left_velocity(deviation[2]) {
            None => {
                let [dv5, dv6] = sides(d_v + jump_v);
                [omega5 + dv5, omega6 + dv6]
            }
            Some(left) => sides(left + d_v),
        };
        let next = [theta3 + d3, theta4 + d4, theta5 + d5, theta6 + d6, v5, v6];

        // A sum is finite only if all its terms are.
        let path_ends = (motion1.angle + motion1.rate * h) + (motion2.angle + motion2.rate * h);
        let end_rates = (motion1.rate + motion1.acceleration * h) + (motion2.rate + motion2.acceleration * h);
        let sum = (next[0] + next[1]) + (next[2] + next[3]) + (next[4] + next[5]) + (path_ends + end_rates);
        if !sum.is_finite() {
            return false;
        }
        self.state = next;
        self.motors[0].step(&motion1, h);
        self.motors[1].step(&motion2, h);
        self.times.shift(h);
        true
    }
}

//! The control law, and the schedule of its samples.
//!
//! At each sample, the goal of the motors is the inverse of eq. (1), applied to the reference plus a
//! correction:
//!
//! ```text
//! twist      = rigid - measured          rigid: eq. (1) for the current motor angles
//! correction = b twist + (1 - b) I - D               b = Kp / (1 + Kp)
//! I'         = Ki (1 - b) (twist - I)
//! D          = Kd rate, filtered with the time constant 2 Kd
//! goal       = inverse of eq. (1) of (reference + correction)
//! ```
//!
//! This is PI control, because rigid = reference + correction if the motors are at their goal. Then, with Kd = 0,
//! twist - correction is the error e = reference - measured, correction = Kp e + I, and I' = Ki e. But unlike usual
//! PI control, this form corrects only the twist of the couplings while the motors move, not their remaining distance
//! to the goal. The integral pauses while a motor moves or is limited by its torque (anti-windup), so no error
//! accumulates during a move.
//!
//! D damps the vibration of the couplings. Its filter is needed for a wrist that is so stiff that it follows the motors
//! immediately. Without the filter, the rate of the motors would be fed back with the gain Kd / sample_time, which is
//! far above 1 and would cause a limit cycle. With the filter, the gain at high frequencies is 1/2.
//!
//! Torque limiting: the goal of a motor is limited to the angle at which the couplings of a blocked wrist would reach
//! the torque limit. If the torque exceeds the limit, this angle is behind the motor, so the motor turns back. Because a
//! motor always moves so slowly that it can stop at its goal, its own motion does not cause a torque above the limit.

use crate::motor::{Limits, MotorSetpoint};
use crate::parameters::Parameters;
use crate::wrist::{Kinematics, Motors, PitchRoll};
use fmu_export::Error;
use std::array::from_fn;

/// Inputs of the controller, or their time derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inputs {
    /// Reference pitch and roll, rad.
    pub reference: PitchRoll,
    /// Measured pitch and roll, rad.
    pub angle: PitchRoll,
    /// Measured rates of pitch and roll, rad/s.
    pub rate: PitchRoll,
    /// Measured torques with the sign of the paper (eq. 9), negative while the motor drives, N.m.
    pub torque: Motors,
}

impl Inputs {
    /// Returns the inputs after `time` s if each changes with its constant `slope`.
    fn after(&self, slope: &Self, time: f64) -> Self {
        let after = |values: [f64; 2], slopes: [f64; 2]| from_fn(|i| values[i] + slopes[i] * time);
        Self {
            reference: after(self.reference, slope.reference),
            angle: after(self.angle, slope.angle),
            rate: after(self.rate, slope.rate),
            torque: after(self.torque, slope.torque),
        }
    }
}

/// Schedule of the samples: one at `epoch`, and then one per `period`. Times are products, not sums, so that rounding
/// errors do not accumulate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Schedule {
    /// Time of the sample with number 0, s.
    pub epoch: f64,
    /// Time between samples, s.
    pub period: f64,
    /// Number of the next sample, an integer.
    pub next: f64,
}

impl Schedule {
    fn time_of(&self, sample: f64) -> f64 {
        self.epoch + sample * self.period
    }
}

/// The controller: its parameters and inputs, and its state after the last sample.
#[derive(Clone, Debug)]
pub struct Controller {
    /// Parameters. Call [`parameters_changed`](Self::parameters_changed) after a change.
    pub parameters: Parameters,
    /// Inputs at the current communication point.
    pub inputs: Inputs,
    /// Slopes of the inputs, per s; 0 if the importer has not set them since the last step.
    pub slopes: Inputs,
    /// Motors 1 and 2 at the last sample.
    pub motors: [MotorSetpoint; 2],
    /// I of pitch and roll, rad.
    pub integral: PitchRoll,
    /// D of pitch and roll, rad.
    pub damping: PitchRoll,
    /// The last correction of pitch and roll, rad.
    pub correction: PitchRoll,
    /// Whether, at the last sample, both motors were at their goals or within two samples of them, and no goal was limited
    /// by the torque.
    pub on_goal: bool,
    /// Schedule of the samples.
    pub schedule: Schedule,
    /// Time of the last sample, s.
    pub sampled_at: f64,
    /// Time for which [`motion`](Self::motion) returns the motion, s; in Co-Simulation the communication point.
    pub now: f64,
}

/// Maximum number of samples in a step or an event: one hour of samples at 1 kHz, which take less than a second to
/// calculate.
const MOST_SAMPLES: f64 = 3.6e6;
/// Largest number of a sample; an `f64` cannot represent all larger integers.
const LAST_SAMPLE: f64 = (1_u64 << 53) as f64;

impl Controller {
    /// Creates a controller with its motors at rest at angle 0.
    ///
    /// # Errors
    /// Fails if the parameters are invalid.
    pub fn new(parameters: Parameters) -> Result<Self, Error> {
        parameters.check()?;
        Ok(Self {
            parameters,
            inputs: Inputs::default(),
            slopes: Inputs::default(),
            motors: [MotorSetpoint::default(); 2],
            integral: [0.0; 2],
            damping: [0.0; 2],
            correction: [0.0; 2],
            on_goal: false,
            schedule: Schedule { epoch: 0.0, period: parameters.sample_time, next: 0.0 },
            sampled_at: 0.0,
            now: 0.0,
        })
    }

    /// Checks the parameters and updates the schedule. A new sample time applies from the next sample on.
    ///
    /// # Errors
    /// Fails if the parameters are invalid; the schedule then stays unchanged.
    pub fn parameters_changed(&mut self) -> Result<(), Error> {
        self.parameters.check()?;
        if self.schedule.period != self.parameters.sample_time {
            let Schedule { next, .. } = self.schedule;
            self.schedule = Schedule {
                epoch: self.schedule.time_of(next),
                period: self.parameters.sample_time,
                next: 0.0,
            };
        }
        Ok(())
    }

    /// Schedules the first sample at `start_time`, s.
    pub fn start(&mut self, start_time: f64) {
        self.schedule = Schedule { epoch: start_time, period: self.parameters.sample_time, next: 0.0 };
        (self.sampled_at, self.now) = (start_time, start_time);
    }

    /// Returns the current motion of the motors. It depends only on earlier samples, because an input takes effect at the
    /// next sample after it has been set.
    #[inline]
    pub fn motion(&self) -> [MotorSetpoint; 2] {
        self.motors.map(|motor| motor.after((self.now - self.sampled_at).max(0.0)))
    }

    /// Advances from `time` to `time + h` (s) and takes the samples that are due before the end.
    ///
    /// A sample at the end, within rounding error, belongs to the next step, because only then are its inputs set.
    ///
    /// Returns false and changes nothing if the step contains too many samples.
    #[must_use]
    pub fn step(&mut self, time: f64, h: f64) -> bool {
        let end = time + h;
        let due = self.due_before(end - self.rounding(end, h));
        if !self.can_take(due) {
            return false;
        }
        let (inputs, slopes) = (self.inputs, self.slopes);
        while self.schedule.next < due {
            self.take_sample(|now| inputs.after(&slopes, (now - time).max(0.0)));
        }
        self.now = end;
        self.slopes = Inputs::default();
        true
    }

    /// Returns the time of the next sample, s, if it is before or at the end of a step from `time` to
    /// `time + h` (s).
    pub fn sample_within(&self, time: f64, h: f64) -> Option<f64> {
        let (next, end) = (self.next_sample(), time + h);
        (next <= end + self.rounding(end, h)).then_some(next.min(end))
    }

    /// Returns the time of the next sample, s.
    pub fn next_sample(&self) -> f64 {
        self.schedule.time_of(self.schedule.next)
    }

    /// Takes the samples that are due at `time` (s), with the current inputs.
    ///
    /// Returns false and changes nothing if there are too many samples.
    #[must_use]
    pub fn take_samples(&mut self, time: f64) -> bool {
        let due = self.due_before(time + self.rounding(time, self.schedule.period));
        if !self.can_take(due) {
            return false;
        }
        let inputs = self.inputs;
        while self.schedule.next < due {
            self.take_sample(|_| inputs);
        }
        true
    }

    /// Returns the tolerance, in s, for rounding errors in the times of an importer.
    fn rounding(&self, time: f64, h: f64) -> f64 {
        (0.01 * h.min(self.schedule.period)).min(1e-9) + 8.0 * f64::EPSILON * time.abs()
    }

    /// Returns the number of the first sample that is not due before `time`.
    fn due_before(&self, time: f64) -> f64 {
        ((time - self.schedule.epoch) / self.schedule.period).ceil()
    }

    fn can_take(&self, due: f64) -> bool {
        due - self.schedule.next <= MOST_SAMPLES && due.abs() <= LAST_SAMPLE
    }

    /// Takes the next sample, with the inputs at its time.
    fn take_sample(&mut self, inputs: impl Fn(f64) -> Inputs) {
        let now = self.next_sample();
        self.motors = self.motors.map(|motor| motor.after(now - self.sampled_at));
        self.control(&inputs(now));
        self.schedule.next += 1.0;
        self.sampled_at = now;
    }

    /// Evaluates the control law.
    fn control(&mut self, inputs: &Inputs) {
        let p = &self.parameters;
        let kinematics = Kinematics::new(p.M, p.N);
        let rigid = kinematics.wrist(self.motors.map(|motor| motor.angle));
        let share = p.Kp / (1.0 + p.Kp);
        let gain = p.Ki * (1.0 - share) * p.sample_time;
        let smoothing = p.sample_time / (2.0 * p.Kd + p.sample_time);
        let bounded = |correction: f64| correction.clamp(-p.max_correction, p.max_correction);
        for (axis, rigid) in rigid.into_iter().enumerate() {
            let twist = rigid - inputs.angle[axis];
            let integral = &mut self.integral[axis];
            if self.on_goal {
                *integral = bounded(*integral + gain * (twist - *integral));
            }
            let damping = &mut self.damping[axis];
            *damping += smoothing * (bounded(p.Kd * inputs.rate[axis]) - *damping);
            let correction = share * twist + (1.0 - share) * *integral - *damping;
            self.correction[axis] = bounded(correction);
        }
        let goals = kinematics.motors(from_fn(|axis| inputs.reference[axis] + self.correction[axis]));

        let limits = Limits { rate: p.max_rate, acceleration: p.max_acceleration };
        self.on_goal = true;
        for (motor, (goal, torque)) in self.motors.iter_mut().zip(goals.into_iter().zip(inputs.torque)) {
            // Limits how much farther the couplings can be twisted, in both directions.
            let farthest = motor.angle + (p.max_torque + torque) / p.stiffness;
            let nearest = motor.angle - (p.max_torque - torque) / p.stiffness;
            let allowed = goal.min(farthest).max(nearest);
            self.on_goal &= motor.plan_acceleration(allowed, &limits, p.sample_time) && allowed == goal;
        }
    }
}

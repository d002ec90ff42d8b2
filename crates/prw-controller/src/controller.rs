//! The control law, and when it is carried out.
//!
//! At each sample the motors head for the inverse of eq. (1), taken of the reference plus a correction:
//!
//! ```text
//! windup     = rigid - measured          rigid: eq. (1) of the motors' angles as they are
//! correction = b windup + (1 - b) I - D               b = Kp / (1 + Kp)
//! I'         = Ki (1 - b) (windup - I)
//! D          = Kd rate, filtered with the time constant 2 Kd
//! goal       = inverse of eq. (1) of (reference + correction)
//! ```
//!
//! This is PI control: where the motors are at their goal, rigid = reference + correction, so (with Kd = 0)
//! windup - correction is the error e = reference - measured, correction = Kp e + I, and I' = Ki e. Written
//! like this, only what the couplings take counts as error, not the way that is still to go. I waits while a
//! motor is under way or backs off (anti-windup), so that the drag of a move leaves nothing to be undone.
//!
//! D damps the vibration of the couplings, where the wrist follows its motors late. A stiff wrist follows at
//! once, and without the filter the motors' own rate would come back at them with the gain Kd / sample_time,
//! far above 1, and set up a limit cycle; with it the gain at high frequencies is 1/2.
//!
//! A motor backs off from torque: it may head no farther than where, with a wrist that is stuck, the
//! couplings would reach the torque limit; beyond the limit that goal lies behind it. As the motor never
//! goes faster than it can stop at its goal, it cannot run into the limit either.

use crate::motor::{Limits, Motor};
use crate::parameters::{InvalidParameter, Parameters};
use crate::wrist::{Kinematics, Motors, PitchRoll};
use std::array::from_fn;

/// What the controller reads, or how fast that changes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inputs {
    /// Where pitch and roll are to go, rad.
    pub reference: PitchRoll,
    /// Measured pitch and roll, rad.
    pub angle: PitchRoll,
    /// Measured rates of pitch and roll, rad/s.
    pub rate: PitchRoll,
    /// Measured torques in the paper's sign (eq. 9), negative while the motor drives, N.m.
    pub torque: Motors,
}

impl Inputs {
    /// After `time` s at a constant `slope`.
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

/// When samples are due: at `epoch` and every `period` from there. No sum, so nothing adds up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Schedule {
    /// Time of the sample with number 0, s.
    pub epoch: f64,
    /// Time between samples, s.
    pub period: f64,
    /// Number of the next sample, a whole number.
    pub next: f64,
}

impl Schedule {
    fn time_of(&self, sample: f64) -> f64 {
        self.epoch + sample * self.period
    }
}

/// The controller between two communication points.
#[derive(Clone, Debug)]
pub struct Controller {
    /// Parameters; call [`parameters_changed`](Self::parameters_changed) after a change.
    pub parameters: Parameters,
    /// The inputs at the current communication point.
    pub inputs: Inputs,
    /// How fast they change, if the importer has said so since the last step; per s.
    pub slopes: Inputs,
    /// Motors 1 and 2 at the last sample.
    pub motors: [Motor; 2],
    /// I of pitch and roll, rad.
    pub integral: PitchRoll,
    /// D of pitch and roll, rad.
    pub damping: PitchRoll,
    /// The last correction of pitch and roll, rad.
    pub correction: PitchRoll,
    /// Whether both motors were on their goals at the last sample.
    pub on_goal: bool,
    /// When samples are due.
    pub schedule: Schedule,
    /// When the last sample was taken, s.
    pub sampled_at: f64,
    /// The time of the motors' [`motion`](Self::motion), s: in Co-Simulation the communication point.
    pub now: f64,
}

/// Steps with more samples are refused: an hour at 1 kHz, which takes less than a second.
const MOST_SAMPLES: f64 = 3.6e6;
/// Beyond it a double cannot count.
const LAST_SAMPLE: f64 = (1_u64 << 53) as f64;

impl Controller {
    /// A controller with its motors at rest at angle 0.
    ///
    /// # Errors
    /// When the parameters make no controller.
    pub fn new(parameters: Parameters) -> Result<Self, InvalidParameter> {
        parameters.check()?;
        Ok(Self {
            parameters,
            inputs: Inputs::default(),
            slopes: Inputs::default(),
            motors: [Motor::default(); 2],
            integral: [0.0; 2],
            damping: [0.0; 2],
            correction: [0.0; 2],
            on_goal: false,
            schedule: Schedule { epoch: 0.0, period: parameters.sample_time, next: 0.0 },
            sampled_at: 0.0,
            now: 0.0,
        })
    }

    /// Checks the parameters. A new sample time holds from the next sample on.
    ///
    /// # Errors
    /// When they make no controller; they stay as they are.
    pub fn parameters_changed(&mut self) -> Result<(), InvalidParameter> {
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

    /// The first sample is taken at `start_time`, s.
    pub fn start(&mut self, start_time: f64) {
        self.schedule = Schedule { epoch: start_time, period: self.parameters.sample_time, next: 0.0 };
        (self.sampled_at, self.now) = (start_time, start_time);
    }

    /// The motion of the motors now. It follows from earlier samples alone: an input acts at the sample
    /// that comes after it has been set.
    #[inline]
    pub fn motion(&self) -> [Motor; 2] {
        self.motors.map(|motor| motor.after((self.now - self.sampled_at).max(0.0)))
    }

    /// Goes from `time` to `time + h` (s) and takes the samples that are due before its end.
    ///
    /// A sample within rounding of the end belongs to the next step, which knows its inputs.
    ///
    /// Returns false, with nothing changed, if the step holds so many samples that a master would wait long for it.
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

    /// When the next sample is due, s, if that is before the end of a step from `time` to `time + h` (s) or at its end.
    pub fn sample_within(&self, time: f64, h: f64) -> Option<f64> {
        let (next, end) = (self.next_sample(), time + h);
        (next <= end + self.rounding(end, h)).then_some(next.min(end))
    }

    /// When the next sample is due, s.
    pub fn next_sample(&self) -> f64 {
        self.schedule.time_of(self.schedule.next)
    }

    /// Takes the samples that are due at `time` (s), with the inputs as they are.
    ///
    /// Returns false, with nothing changed, if a master would wait long for it.
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

    /// How far the times of masters may be off.
    fn rounding(&self, time: f64, h: f64) -> f64 {
        (0.01 * h.min(self.schedule.period)).min(1e-9) + 8.0 * f64::EPSILON * time.abs()
    }

    /// The number of the first sample that is not due before `time`.
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

    /// The control law.
    fn control(&mut self, inputs: &Inputs) {
        let p = &self.parameters;
        let kinematics = Kinematics::new(p.M, p.N);
        let rigid = kinematics.wrist(self.motors.map(|motor| motor.angle));
        let share = p.Kp / (1.0 + p.Kp);
        let gain = p.Ki * (1.0 - share) * p.sample_time;
        let smoothing = p.sample_time / (2.0 * p.Kd + p.sample_time);
        let bounded = |correction: f64| correction.clamp(-p.max_correction, p.max_correction);
        for (axis, rigid) in rigid.into_iter().enumerate() {
            let windup = rigid - inputs.angle[axis];
            let integral = &mut self.integral[axis];
            if self.on_goal {
                *integral = bounded(*integral + gain * (windup - *integral));
            }
            let damping = &mut self.damping[axis];
            *damping += smoothing * (bounded(p.Kd * inputs.rate[axis]) - *damping);
            let correction = share * windup + (1.0 - share) * *integral - *damping;
            self.correction[axis] = bounded(correction);
        }
        let goals = kinematics.motors(from_fn(|axis| inputs.reference[axis] + self.correction[axis]));

        let limits = Limits { rate: p.max_rate, acceleration: p.max_acceleration };
        self.on_goal = true;
        for (motor, (goal, torque)) in self.motors.iter_mut().zip(goals.into_iter().zip(inputs.torque)) {
            // How much farther the motor may wind up its couplings, forward and back.
            let farthest = motor.angle + (p.max_torque + torque) / p.stiffness;
            let nearest = motor.angle - (p.max_torque - torque) / p.stiffness;
            let allowed = goal.min(farthest).max(nearest);
            self.on_goal &= motor.turn_towards(allowed, &limits, p.sample_time) && allowed == goal;
        }
    }
}

//! Motion of the motors between communication points, estimated from samples of their angles.

use crate::pair::PerSide;

/// Number of the samples before the current one, and the times between the last three samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleTimes {
    /// Number of earlier samples: 0, 1, or 2 for two or more.
    pub count: i32,
    /// Time from the previous sample to the current one, s.
    pub last_step: f64,
    /// Time between the two samples before the current one, s.
    pub step_before: f64,
    /// The step size that leaves these fields unchanged; 0 if there is none.
    steady_step: f64,
    /// 1 / last_step, 1 / step_before and 1 / mean of both, each as a pair for both motors. They are stored, like
    /// `half_last_step`, so that a step with constant size does not divide.
    inverses: [PerSide; 3],
    half_last_step: PerSide,
}

impl SampleTimes {
    /// Makes the current sample the previous one after a step of size `h`, whose `inverse` is 1 / h. Divides only
    /// once, for the mean of both steps, because the inverses of the steps are known.
    pub fn shift(&mut self, h: f64, inverse: f64) {
        if h == self.steady_step {
            return;
        }
        self.count = (self.count + 1).min(2);
        (self.step_before, self.last_step) = (self.last_step, h);
        (self.inverses[1], self.inverses[0]) = (self.inverses[0], PerSide::splat(inverse));
        self.update_both();
    }

    /// Returns whether the number of samples is in range and the time between them is positive.
    pub fn are_possible(&self) -> bool {
        (0..=2).contains(&self.count)
            && (self.count < 1 || self.last_step > 0.0)
            && (self.count < 2 || self.step_before > 0.0)
    }

    /// Computes the private fields from `count`, `last_step` and `step_before`.
    pub fn update(&mut self) {
        let inverse = |step: f64| PerSide::splat(1.0 / step);
        (self.inverses[0], self.inverses[1]) = (inverse(self.last_step), inverse(self.step_before));
        self.update_both();
    }

    /// Computes the private fields except the inverses of the two steps.
    #[inline]
    fn update_both(&mut self) {
        let Self { count, last_step, step_before, .. } = *self;
        let is_steady = count == 2 && last_step == step_before;
        self.steady_step = if is_steady { last_step } else { 0.0 };
        self.inverses[2] = PerSide::splat(1.0 / (0.5 * (last_step + step_before)));
        self.half_last_step = PerSide::splat(0.5 * last_step);
    }
}

/// Angle, rate and angular acceleration of a motor at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion<T = f64> {
    /// Angle, rad.
    pub angle: T,
    /// Rate, rad/s.
    pub rate: T,
    /// Acceleration, rad/s2.
    pub acceleration: T,
}

/// Motions of both motors.
pub type Motions = Motion<PerSide>;

impl Motions {
    /// Creates the motions of both motors.
    #[inline]
    pub const fn new(motor1: Motion, motor2: Motion) -> Self {
        Self {
            angle: PerSide::new(motor1.angle, motor2.angle),
            rate: PerSide::new(motor1.rate, motor2.rate),
            acceleration: PerSide::new(motor1.acceleration, motor2.acceleration),
        }
    }

    /// Returns the motion of motor 0 or 1.
    #[inline]
    pub fn of(&self, motor: usize) -> Motion {
        Motion { angle: self.angle[motor], rate: self.rate[motor], acceleration: self.acceleration[motor] }
    }

    /// Returns the motion after time `h`. The angle changes linearly, but the rate changes with the estimated
    /// acceleration, so that the torques up to the next sample are second-order accurate too.
    #[inline]
    pub fn after(&self, h: f64) -> Self {
        Self {
            angle: self.angle + self.rate * h,
            rate: self.rate + self.acceleration * h,
            acceleration: self.acceleration,
        }
    }
}

/// The angle of one motor as the importer sets it.
///
/// The flag is stored before the angle for speed: an importer sets one angle at a time, and a processor stalls if it
/// reads 16 bytes right after 8 of them were written. The compiler would generate such a read of two numbers if they
/// were neighbours, or if the first of them were aligned to 16 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Sample {
    /// Whether theta has been set since the last step. If not, [`Motors::segment_end`] replaces the sample.
    pub is_new: bool,
    /// Angle, rad; see [`Motors::theta_changed`].
    pub theta: f64,
}

/// The motors of the FMU: their inputs and the values stored from earlier steps.
///
/// After a caller has written an input field directly, it must call [`theta_changed`](Self::theta_changed),
/// [`omega_changed`](Self::omega_changed) or [`use_omega_changed`](Self::use_omega_changed).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motors {
    /// Angles that the importer sets.
    pub samples: [Sample; 2],
    /// Rates that the importer sets, rad/s; see [`omega_changed`](Self::omega_changed).
    pub omega: [f64; 2],
    /// Whether the rates come from omega if no derivative is set. If false, they are estimated from the last samples
    /// of the angles. See [`use_omega_changed`](Self::use_omega_changed).
    pub use_omega: bool,
    /// Derivatives of theta that the importer has set since the last step, rad/s.
    pub given_rate: [Option<f64>; 2],
    /// theta of the previous two samples, rad; the newer sample first.
    pub earlier: [PerSide; 2],
    /// Motion at the end of the last step, during which the angles changed linearly. If the importer then sets the rate
    /// of a motor, that rate replaces the one at the end of the step.
    pub segment_end: Motions,
    /// Times of the samples.
    pub times: SampleTimes,
    /// Whether a rate is given for the next step or comes from omega; see
    /// [`rates_changed`](Self::rates_changed).
    has_rates: bool,
}

impl Motors {
    /// Returns the motor angles that the importer set, rad.
    #[inline(always)]
    pub fn theta(&self) -> PerSide {
        PerSide::new(self.samples[0].theta, self.samples[1].theta)
    }

    /// Returns the rates that the importer set, rad/s.
    #[inline]
    pub fn omega(&self) -> PerSide {
        PerSide::new(self.omega[0], self.omega[1])
    }

    /// Sets the angle of motor 0 or 1.
    #[inline]
    pub fn set_theta(&mut self, motor: usize, theta: f64) {
        self.samples[motor].theta = theta;
        self.theta_changed(motor);
    }

    /// Sets the input omega of motor 0 or 1.
    #[inline]
    pub fn set_omega(&mut self, motor: usize, omega: f64) {
        self.omega[motor] = omega;
        self.omega_changed(motor);
    }

    /// Records a new sample. Call this after theta of motor 0 or 1 has been set.
    #[inline]
    pub fn theta_changed(&mut self, motor: usize) {
        self.samples[motor].is_new = true;
    }

    /// Makes a new omega effective immediately, if the rate of motor 0 or 1 comes from omega. Call this after
    /// omega has been set.
    #[inline]
    pub fn omega_changed(&mut self, motor: usize) {
        if self.takes_omega(motor) {
            self.segment_end.rate[motor] = self.omega[motor];
        }
    }

    /// Returns whether the rate of motor 0 or 1 comes from omega.
    #[inline]
    pub fn takes_omega(&self, motor: usize) -> bool {
        self.use_omega && self.given_rate[motor].is_none()
    }

    /// Makes a new value of `use_omega` effective. Call this after `use_omega` has been set.
    pub fn use_omega_changed(&mut self) {
        self.omega_changed(0);
        self.omega_changed(1);
        self.rates_changed();
    }

    /// Updates `has_rates`. Call this after the sources of the rates have changed.
    pub fn rates_changed(&mut self) {
        self.has_rates = self.use_omega || self.given_rate.iter().any(Option::is_some);
    }

    /// Sets the derivative of theta of motor 0 or 1 at the current communication point. The derivative takes
    /// precedence over omega, in any order of the calls.
    #[inline]
    pub fn set_rate(&mut self, motor: usize, rate: f64) {
        self.given_rate[motor] = Some(rate);
        self.segment_end.rate[motor] = rate;
        self.has_rates = true;
    }

    /// Forgets the earlier samples and the last step, so that the current angles are the first sample.
    pub fn forget_samples(&mut self) {
        let Self { omega, use_omega, given_rate, has_rates, .. } = *self;
        let samples = self.samples.map(|sample| Sample { is_new: false, ..sample });
        *self = Self { samples, omega, use_omega, given_rate, has_rates, ..Self::default() };
    }

    /// Returns whether each of the last two steps had the size `h`.
    #[inline]
    pub fn has_constant_step(&self, h: f64) -> bool {
        h == self.times.steady_step
    }

    /// Returns the motions at the current communication point after three samples or more; see
    /// [`extrapolate`](Self::extrapolate).
    #[inline(always)]
    pub fn extrapolate_fast(&self) -> Motions {
        self.with_rates(self.parabolas())
    }

    /// Returns the motions at the current communication point on the parabolas through the last three samples.
    #[inline(always)]
    fn parabolas(&self) -> Motions {
        let [inverse_last, inverse_before, inverse_mean] = self.times.inverses;
        let last = (self.theta() - self.earlier[0]) * inverse_last;
        let before = (self.earlier[0] - self.earlier[1]) * inverse_before;
        let acceleration = (last - before) * inverse_mean;
        Motion { angle: self.theta(), rate: last + acceleration * self.times.half_last_step, acceleration }
    }

    /// Returns the motions at the current communication point. The rates come from the importer's derivative, from omega,
    /// or from the parabolas through the last three samples. If there are only two samples, the rates are their difference
    /// quotients; with one sample, the motors are at rest.
    pub fn extrapolate(&self) -> Motions {
        let at_rate = |rate| Motion { angle: self.theta(), rate, acceleration: PerSide::default() };
        self.with_rates(match self.times.count {
            2 => self.parabolas(),
            1 => at_rate((self.theta() - self.earlier[0]) * self.times.inverses[0]),
            _ => at_rate(PerSide::default()),
        })
    }

    /// Replaces an estimated rate if the importer has set a derivative or if the rate comes from omega. The
    /// acceleration of this motor is then 0.
    #[inline(always)]
    fn with_rates(&self, motions: Motions) -> Motions {
        if !self.has_rates {
            return motions;
        }
        let [rate, acceleration] = [motions.rate, motions.acceleration].map(PerSide::array);
        let [motor1, motor2] = [0, 1].map(|motor| {
            let given = self.given_rate[motor].or(self.use_omega.then_some(self.omega[motor]));
            given.map_or((rate[motor], acceleration[motor]), |rate| (rate, 0.0))
        });
        Motions {
            rate: PerSide::new(motor1.0, motor2.0),
            acceleration: PerSide::new(motor1.1, motor2.1),
            ..motions
        }
    }

    /// Returns whether motor 0 or 1 is at [`segment_end`](Self::segment_end), because its angle has not been set
    /// since the last step.
    #[inline]
    pub fn is_at_segment_end(&self, motor: usize) -> bool {
        !self.samples[motor].is_new && self.times.count > 0
    }

    /// Returns the current motion of each motor: [`segment_end`](Self::segment_end) if the motor
    /// [is there](Self::is_at_segment_end), else extrapolated from its sample.
    pub fn now(&self) -> Motions {
        if self.is_at_segment_end(0) && self.is_at_segment_end(1) {
            return self.segment_end;
        }
        let motions = self.extrapolate();
        let now = |motor| {
            if self.is_at_segment_end(motor) { self.segment_end.of(motor) } else { motions.of(motor) }
        };
        Motions::new(now(0), now(1))
    }

    /// Returns motors whose motion is the derivative of the current motion in the direction `theta` of the angles.
    /// A motion is linear in angles, earlier samples and rates. Earlier samples and rates are 0 in the result,
    /// because they do not change.
    pub fn sensitivity(&self, theta: [f64; 2]) -> Self {
        Self {
            samples: theta.map(|theta| Sample { is_new: true, theta }),
            omega: [0.0; 2],
            given_rate: self.given_rate.map(|rate| rate.and(Some(0.0))),
            earlier: Default::default(),
            ..*self
        }
    }

    /// Returns the jumps from [`segment_end`](Self::segment_end) to the current samples, rad; 0 for the first samples.
    #[inline]
    pub fn input_jumps(&self) -> PerSide {
        if self.times.count == 0 { PerSide::default() } else { self.theta() - self.segment_end.angle }
    }

    /// Stores the samples `theta` at the start of a step, and the motions at its `end`. The caller updates `times`.
    #[inline(always)]
    pub fn finish_step(&mut self, theta: PerSide, end: &Motions) {
        self.earlier[1] = self.earlier[0];
        self.earlier[0] = theta;
        self.segment_end = *end;
        self.samples[0].is_new = false;
        self.samples[1].is_new = false;
        if self.has_rates {
            self.given_rate = [None; 2];
            self.has_rates = self.use_omega;
        }
    }
}

//! How the motors move between communication points, known only by samples of their angles.

use crate::pair::Sides;

/// When the last two samples before the current one were taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleTimes {
    /// Number of earlier samples: 0, 1, or 2 for two and more.
    pub count: i32,
    /// Step from the previous sample to the current one, s.
    pub last_step: f64,
    /// Step before that, s.
    pub step_before: f64,
    /// The step size that leaves all of this as it is, if there is one, else 0.
    steady_step: f64,
    /// 1 / last_step, 1 / step_before and 1 / mean of both, and half of last_step, each for both motors:
    /// a step needs no division.
    inverses: [Sides; 3],
    half_last_step: Sides,
}

impl SampleTimes {
    /// The current sample becomes the previous one after a step of size `h`.
    #[inline]
    pub fn shift(&mut self, h: f64) {
        if h != self.steady_step {
            self.shift_by(h);
        }
    }

    #[cold]
    fn shift_by(&mut self, h: f64) {
        self.count = (self.count + 1).min(2);
        self.step_before = self.last_step;
        self.last_step = h;
        self.update();
    }

    /// Whether the number of samples is one that counts, and there was time between them.
    pub fn are_possible(&self) -> bool {
        (0..=2).contains(&self.count)
            && (self.count < 1 || self.last_step > 0.0)
            && (self.count < 2 || self.step_before > 0.0)
    }

    /// Brings what follows from the steps up to date.
    pub fn update(&mut self) {
        let Self { count, last_step, step_before, .. } = *self;
        let is_steady = count == 2 && last_step == step_before;
        self.steady_step = if is_steady { last_step } else { 0.0 };
        self.inverses =
            [last_step, step_before, 0.5 * (last_step + step_before)].map(|step| Sides::both(1.0 / step));
        self.half_last_step = Sides::both(0.5 * last_step);
    }
}

/// A motor's angle, rate and angular acceleration at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion<T = f64> {
    /// Angle, rad.
    pub angle: T,
    /// Rate, rad/s.
    pub rate: T,
    /// Acceleration, rad/s2.
    pub acceleration: T,
}

/// The motions of both motors.
pub type Motions = Motion<Sides>;

impl Motions {
    /// The motions of both.
    #[inline]
    pub const fn new(motor1: Motion, motor2: Motion) -> Self {
        Self {
            angle: Sides::new(motor1.angle, motor2.angle),
            rate: Sides::new(motor1.rate, motor2.rate),
            acceleration: Sides::new(motor1.acceleration, motor2.acceleration),
        }
    }

    /// The motion of motor 0 or 1.
    #[inline]
    pub fn of(&self, motor: usize) -> Motion {
        Motion { angle: self.angle[motor], rate: self.rate[motor], acceleration: self.acceleration[motor] }
    }

    /// After time `h`: the angle on a straight line, the rate as the parabola predicts it, so that
    /// torques read before the next sample are second-order accurate too.
    #[inline]
    pub fn after(&self, h: f64) -> Self {
        Self {
            angle: self.angle + self.rate * h,
            rate: self.rate + self.acceleration * h,
            acceleration: self.acceleration,
        }
    }
}

/// The inputs of one motor.
///
/// By motor and not in pairs: an importer sets one number at a time, and a pair that is read at once right
/// after its halves were written makes the processor wait.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inputs {
    /// Angle, rad; see [`Motors::theta_changed`].
    pub theta: f64,
    /// Rate, rad/s; see [`Motors::omega_changed`].
    pub omega: f64,
}

/// The motors as the FMU sees them: their inputs and what is remembered of earlier steps.
///
/// Inputs may be set as fields; then [`theta_changed`](Self::theta_changed) or its like must follow.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motors {
    /// What the importer sets.
    pub inputs: [Inputs; 2],
    /// Whether the rates come from omega where no derivative is set, else from a backward difference of
    /// the sampled angles; see [`use_omega_changed`](Self::use_omega_changed).
    pub use_omega: bool,
    /// Whether theta has been set since the last step; if not, the path's end stands in for it.
    pub is_sampled: [bool; 2],
    /// Derivatives of theta that the importer has set since the last step, rad/s.
    pub given_rate: [Option<f64>; 2],
    /// theta of the previous samples and of those before, rad.
    pub earlier: [Sides; 2],
    /// Where the last step's straight lines ended.
    pub path_end: Motions,
    /// When the angles were sampled.
    pub times: SampleTimes,
    /// Whether a rate is given for the next step, or comes from omega; see [`rates_changed`](Self::rates_changed).
    has_rates: bool,
}

impl Motors {
    /// The angles that are set, rad.
    #[inline(always)]
    pub fn theta(&self) -> Sides {
        Sides::new(self.inputs[0].theta, self.inputs[1].theta)
    }

    /// Both rates, rad/s.
    #[inline]
    pub fn omega(&self) -> Sides {
        Sides::new(self.inputs[0].omega, self.inputs[1].omega)
    }

    /// Takes a new angle of motor 0 or 1.
    #[inline]
    pub fn set_theta(&mut self, motor: usize, theta: f64) {
        self.inputs[motor].theta = theta;
        self.theta_changed(motor);
    }

    /// Takes a new rate of motor 0 or 1 from the input omega.
    #[inline]
    pub fn set_omega(&mut self, motor: usize, omega: f64) {
        self.inputs[motor].omega = omega;
        self.omega_changed(motor);
    }

    /// After theta of motor 0 or 1 has been set: there is a new sample.
    #[inline]
    pub fn theta_changed(&mut self, motor: usize) {
        self.is_sampled[motor] = true;
    }

    /// After omega of motor 0 or 1 has been set. If rates come from there, it holds at once, but for a
    /// derivative that is set.
    #[inline]
    pub fn omega_changed(&mut self, motor: usize) {
        if self.takes_omega(motor) {
            self.path_end.rate[motor] = self.inputs[motor].omega;
        }
    }

    /// Whether the rate of motor 0 or 1 comes from omega.
    #[inline]
    pub fn takes_omega(&self, motor: usize) -> bool {
        self.use_omega && self.given_rate[motor].is_none()
    }

    /// After `use_omega` has been set.
    pub fn use_omega_changed(&mut self) {
        self.omega_changed(0);
        self.omega_changed(1);
        self.rates_changed();
    }

    /// After the sources of the rates have changed.
    pub fn rates_changed(&mut self) {
        self.has_rates = self.use_omega || self.given_rate.iter().any(Option::is_some);
    }

    /// Takes the derivative of theta of motor 0 or 1 at the current communication point. It precedes
    /// omega, in whatever order they are set.
    #[inline]
    pub fn set_rate(&mut self, motor: usize, rate: f64) {
        self.given_rate[motor] = Some(rate);
        self.path_end.rate[motor] = rate;
        self.has_rates = true;
    }

    /// Forgets the samples: the next one is the first.
    pub fn forget_samples(&mut self) {
        let Self { inputs, use_omega, given_rate, has_rates, .. } = *self;
        *self = Self { inputs, use_omega, given_rate, has_rates, ..Self::default() };
    }

    /// Whether the step size `h` is that of the last two steps.
    #[inline]
    pub fn are_steady(&self, h: f64) -> bool {
        h == self.times.steady_step
    }

    /// The motions at the current communication point after three samples or more; see [`sampled`](Self::sampled).
    #[inline(always)]
    pub fn steady(&self) -> Motions {
        let motions = self.parabolas();
        if self.has_rates { self.with_rates(motions) } else { motions }
    }

    /// The motions at the current communication point that the last three samples let expect.
    #[inline(always)]
    fn parabolas(&self) -> Motions {
        let [inverse_last, inverse_before, inverse_mean] = self.times.inverses;
        let last = (self.theta() - self.earlier[0]) * inverse_last;
        let before = (self.earlier[0] - self.earlier[1]) * inverse_before;
        let acceleration = (last - before) * inverse_mean;
        Motion { angle: self.theta(), rate: last + acceleration * self.times.half_last_step, acceleration }
    }

    /// The motions at the current communication point, from the current samples and the rates' sources:
    /// what the importer has set, or omega, or the parabolas through the last three samples (straight
    /// lines through two; with one sample the motors rest).
    pub fn sampled(&self) -> Motions {
        let steady = |rate| Motion { angle: self.theta(), rate, acceleration: Sides::default() };
        self.with_rates(match self.times.count {
            0 => steady(Sides::default()),
            1 => steady((self.theta() - self.earlier[0]) * self.times.inverses[0]),
            _ => self.parabolas(),
        })
    }

    /// The motions with the rates that are given or come from omega.
    #[inline]
    fn with_rates(&self, motions: Motions) -> Motions {
        let [rate, acceleration] = [motions.rate, motions.acceleration].map(Sides::array);
        let [motor1, motor2] = [0, 1].map(|motor| {
            let given = self.given_rate[motor].or(self.use_omega.then_some(self.inputs[motor].omega));
            given.map_or((rate[motor], acceleration[motor]), |rate| (rate, 0.0))
        });
        Motions {
            rate: Sides::new(motor1.0, motor2.0),
            acceleration: Sides::new(motor1.1, motor2.1),
            ..motions
        }
    }

    /// Whether motor 0 or 1 is where the last step left off: the importer has set no sample since.
    #[inline]
    pub fn is_at_path_end(&self, motor: usize) -> bool {
        !self.is_sampled[motor] && self.times.count > 0
    }

    /// The motions of both motors now: the sample's, or that at the end of the path.
    pub fn now(&self) -> Motions {
        if self.is_at_path_end(0) && self.is_at_path_end(1) {
            return self.path_end;
        }
        let motions = self.sampled();
        let now =
            |motor| if self.is_at_path_end(motor) { self.path_end.of(motor) } else { motions.of(motor) };
        Motions::new(now(0), now(1))
    }

    /// The reaction of these motors to a change of their inputs: their motions are linear in the inputs, in
    /// earlier samples and in given rates, so here the latter are 0.
    pub fn reaction(&self, inputs: [Inputs; 2]) -> Self {
        Self {
            inputs,
            is_sampled: [true; 2],
            given_rate: self.given_rate.map(|rate| rate.and(Some(0.0))),
            earlier: Default::default(),
            ..*self
        }
    }

    /// The jumps from the ends of the last paths to the current samples, rad. The first samples jump
    /// from nowhere.
    #[inline]
    pub fn jumps(&self) -> Sides {
        if self.times.count == 0 { Sides::default() } else { self.theta() - self.path_end.angle }
    }

    /// After a step that led from the angles `theta` to `end`: the samples become earlier ones. The times are another
    /// matter.
    #[inline(always)]
    pub fn go_on(&mut self, theta: Sides, end: &Motions) {
        self.earlier = [theta, self.earlier[0]];
        self.path_end = *end;
        self.is_sampled = [false; 2];
        if self.has_rates {
            self.given_rate = [None; 2];
            self.has_rates = self.use_omega;
        }
    }
}

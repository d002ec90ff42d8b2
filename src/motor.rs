//! How a motor moves between communication points, known only by samples of its angle.

/// Where a motor's rate comes from in Co-Simulation when the importer sets no derivative.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RateSource {
    /// The input omega.
    Omega,
    /// A backward difference of the sampled angles.
    Samples,
}

/// When the last two samples before the current one were taken, the same for both motors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleTimes {
    /// Number of earlier samples: 0, 1, or 2 for two and more.
    pub count: i32,
    /// Step from the previous sample to the current one, s.
    pub last_step: f64,
    /// Step before that, s.
    pub step_before: f64,
    /// 1 / last_step, 1 / step_before and 1 / (last_step + step_before): a step needs no division.
    inverses: [f64; 3],
}

impl SampleTimes {
    /// The current sample becomes the previous one after a step of size `h`.
    #[inline]
    pub fn shift(&mut self, h: f64) {
        let steady = self.count == 2 && h == self.last_step && h == self.step_before;
        if !steady {
            self.count = (self.count + 1).min(2);
            self.step_before = self.last_step;
            self.last_step = h;
            self.update_inverses();
        }
    }

    /// Whether there was time between the samples.
    pub fn are_possible(&self) -> bool {
        (self.count < 1 || self.last_step > 0.0) && (self.count < 2 || self.step_before > 0.0)
    }

    /// Brings what follows from the steps up to date.
    pub fn update_inverses(&mut self) {
        self.inverses = [self.last_step, self.step_before, self.last_step + self.step_before].map(f64::recip);
    }
}

/// A motor's angle, rate and angular acceleration at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Angle, rad.
    pub angle: f64,
    /// Rate, rad/s.
    pub rate: f64,
    /// Acceleration, rad/s2.
    pub acceleration: f64,
}

/// One motor as the FMU sees it: its inputs and what is remembered of earlier steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motor {
    /// Input theta, rad.
    pub theta: f64,
    /// Input omega, rad/s.
    pub omega: f64,
    /// Derivative of theta that the importer has set since the last step, rad/s.
    pub set_rate: Option<f64>,
    /// Whether theta has been set since the last step; if not, the path's end stands in for it.
    pub is_sampled: bool,
    /// theta of the previous sample and of the one before, rad.
    pub earlier: [f64; 2],
    /// Where the last step's straight line ended.
    pub path_end: Motion,
}

impl Motor {
    /// Takes a new angle.
    #[inline]
    pub fn set_theta(&mut self, theta: f64) {
        self.theta = theta;
        self.is_sampled = true;
    }

    /// Takes a new rate from the input omega. If rates come from there, it holds at once.
    #[inline]
    pub fn set_omega(&mut self, omega: f64, source: RateSource) {
        self.omega = omega;
        self.source_changed(source);
    }

    /// If rates come from omega now, its value holds at once, but for a derivative that is set.
    #[inline]
    pub fn source_changed(&mut self, source: RateSource) {
        if source == RateSource::Omega && self.set_rate.is_none() {
            self.path_end.rate = self.omega;
        }
    }

    /// Takes the derivative of theta at the current communication point. It precedes omega, in whatever
    /// order they are set.
    #[inline]
    pub fn set_rate(&mut self, rate: f64) {
        self.set_rate = Some(rate);
        self.path_end.rate = rate;
    }

    /// The motion at the current communication point, from the current sample and the rate's source:
    /// what the importer has set, or omega, or the parabola through the last three samples (a straight
    /// line through two; a motor with one sample rests).
    #[inline]
    pub fn sampled(&self, times: &SampleTimes, source: RateSource) -> Motion {
        let steady = |rate| Motion { angle: self.theta, rate, acceleration: 0.0 };
        match (self.set_rate, source) {
            (Some(rate), _) => steady(rate),
            (None, RateSource::Omega) => steady(self.omega),
            (None, RateSource::Samples) => match times.count {
                0 => steady(0.0),
                1 => steady((self.theta - self.earlier[0]) * times.inverses[0]),
                _ => self.parabola(times),
            },
        }
    }

    #[inline]
    fn parabola(&self, times: &SampleTimes) -> Motion {
        let last = (self.theta - self.earlier[0]) * times.inverses[0];
        let before = (self.earlier[0] - self.earlier[1]) * times.inverses[1];
        let bend = (last - before) * times.inverses[2];
        Motion { angle: self.theta, rate: last + bend * times.last_step, acceleration: 2.0 * bend }
    }

    /// The motion now: the sample's if the importer has set one since the last step, else where that
    /// step left off.
    #[inline]
    pub fn now(&self, times: &SampleTimes, source: RateSource) -> Motion {
        if self.is_sampled || times.count == 0 { self.sampled(times, source) } else { self.path_end }
    }

    /// The jump from the end of the last path to the current sample, rad. The first sample jumps from
    /// nowhere.
    #[inline]
    pub fn jump(&self, times: &SampleTimes) -> f64 {
        if times.count == 0 { 0.0 } else { self.theta - self.path_end.angle }
    }

    /// After a step of size `h` on the straight line of `motion`: the sample becomes an earlier one.
    ///
    /// The end of the path has the rate that the parabola predicts there, so that torques read before
    /// the next sample are second-order accurate too.
    #[inline]
    pub fn step(&mut self, motion: &Motion, h: f64) {
        self.earlier = [self.theta, self.earlier[0]];
        self.path_end = Motion {
            angle: motion.angle + motion.rate * h,
            rate: motion.rate + motion.acceleration * h,
            acceleration: motion.acceleration,
        };
        self.set_rate = None;
        self.is_sampled = false;
    }
}

//! A ball with events at which an indicator changes its sign and a state jumps. The model ends the simulation itself.

use fmu_export::*;

const HEIGHT: Type = Type::real("Height", &Unit::new("m").m(1));
const VELOCITY: Type = Type::real("Velocity", &Unit::new("m/s").m(1).s(-1));
const ACCELERATION: Type = Type::real("Acceleration", &Unit::new("m/s2").m(1).s(-2)).min(1e-3).max(1e3);
const RATE: Type = Type::real("Rate", &Unit::new("m/s2").m(1).s(-2));
const RATIO: Type = Type::real("Ratio", &units::ONE).min(0.0).max(1.0);
const COUNT: Type = Type::integer("Count").min_integer(0);

variables! {
    /// A ball that falls and bounces off the floor, slower each time, and ends the simulation after some bounces.
    pub struct Ball {
        /// Greatest height until the next bounce.
        apex: f64 = 1.0,
    }, memory in apex;

    /// Height above the floor
    height: f64 = output(&HEIGHT).state().start(1.0);
    /// Upward velocity
    velocity: f64 = output(&VELOCITY).state().reinit();
    /// Rate of the height
    der_height as "der(height)" = local(&VELOCITY).derivative_of(height) by |ball| ball.velocity;
    /// Rate of the velocity
    der_velocity as "der(velocity)" = local(&RATE).derivative_of(velocity) by |ball| -ball.gravity;
    /// Gravitational acceleration
    gravity: f64 = parameter(&ACCELERATION).start(9.81);
    /// Ratio of the speeds after and before a bounce
    restitution: f64 = parameter(&RATIO).start(0.7);
    /// Number of bounces
    bounces: i32 = output(&COUNT).exact();
    /// Number of bounces that ends the simulation
    most_bounces: i32 = parameter(&COUNT).start(5);
}

impl Model for Ball {
    const INFO: Info = Info {
        description: "Bouncing ball",
        default_experiment: DefaultExperiment {
            stop_time: 3.0,
            step_size: 0.01,
            ..DefaultExperiment::DEFAULT
        },
        ..info!("Ball", "ball")
    };
}

impl Ball {
    /// Reverses the velocity. Returns whether the simulation ends.
    fn bounce(&mut self) -> bool {
        self.velocity *= -self.restitution;
        self.apex = (0.5 * self.velocity * self.velocity / self.gravity).min(1e6);
        self.bounces = self.bounces.saturating_add(1);
        self.bounces >= self.most_bounces
    }

    /// Returns the time until the ball hits the floor, s.
    fn flight(&self) -> f64 {
        let speed = (self.velocity * self.velocity + 2.0 * self.gravity * self.height.max(0.0)).sqrt();
        (self.velocity + speed) / self.gravity
    }

    fn fly(&mut self, time: f64) {
        self.height = (self.height + time * (self.velocity - 0.5 * self.gravity * time)).max(0.0);
        self.velocity -= self.gravity * time;
    }
}

impl CoSimulation for Ball {
    /// A step ends at the last bounce.
    const ENDS_EARLY: bool = true;

    /// Each flight is a parabola, so the times of the bounces within a step are calculated exactly.
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        const MOST: usize = 10_000;
        let mut left = step.size;
        for _ in 0..MOST {
            let flight = self.flight();
            if flight > left {
                self.fly(left);
                return Ok(Stepped::Done);
            }
            self.fly(flight);
            self.height = 0.0;
            left -= flight;
            if self.bounce() {
                return Ok(Stepped::Terminate(step.time + step.size - left));
            }
            // The ball lies on the floor.
            if self.apex < 1e-12 {
                self.velocity = 0.0;
                return Ok(Stepped::Done);
            }
        }
        Err(Error::new(format!(
            "the ball bounces more than {MOST} times in a step of {} s; make shorter steps",
            step.size
        )))
    }
}

impl ModelExchange for Ball {
    const INDICATORS: usize = 1;
    const STEP_COMPLETED: bool = true;

    /// The sign changes when the ball hits the floor.
    fn indicators(&self, indicators: &mut [f64]) {
        indicators[0] = self.height;
    }

    fn event(&mut self, _: f64) -> Result<Event, Error> {
        if self.height > 0.0 || self.velocity >= 0.0 {
            return Ok(Event::default());
        }
        let terminate = self.bounce();
        Ok(Event { states_changed: true, nominals_changed: true, terminate, ..Event::default() })
    }

    /// Requests the event if the importer has missed the change of the sign, or ends the simulation if the ball is too low.
    fn step_completed(&mut self, _: f64) -> StepCompleted {
        StepCompleted { event: self.height < 0.0 && self.velocity < 0.0, terminate: self.height < -100.0 }
    }

    /// Flights get lower, so the absolute tolerance of the integrator should decrease with them.
    fn nominals(&self, nominals: &mut [f64]) {
        nominals[0] = self.apex.max(1e-6);
    }
}

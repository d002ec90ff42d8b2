//! A bouncing ball, for importers that integrate: an event where an indicator changes its sign, and an end.

use fmu_export::*;

/// Falls, bounces off the floor a little slower each time, and ends the simulation when it has bounced enough.
#[derive(Clone)]
pub struct Ball {
    height: f64,
    velocity: f64,
    gravity: f64,
    restitution: f64,
    bounces: i32,
    most_bounces: i32,
    /// How high it flies at the most until the next bounce.
    apex: f64,
}

const HEIGHT: Type = Type::real("Height", &Unit::new("m").m(1));
const VELOCITY: Type = Type::real("Velocity", &Unit::new("m/s").m(1).s(-1));
const ACCELERATION: Type = Type::real("Acceleration", &Unit::new("m/s2").m(1).s(-2)).min(1e-3).max(1e3);
const RATE: Type = Type::real("Rate", &Unit::new("m/s2").m(1).s(-2));
const RATIO: Type = Type::real("Ratio", &units::ONE).min(0.0).max(1.0);
const COUNT: Type = Type::integer("Count").min_integer(0);

variables! { for Ball, memory in apex;
    /// Above the floor
    height = output(&HEIGHT).state() in height;
    /// Upwards
    velocity = output(&VELOCITY).state() in velocity;
    /// Rate of the height
    der_height as "der(height)" = local(&VELOCITY).derivative_of(height) by |ball| ball.velocity;
    /// Rate of the velocity
    der_velocity as "der(velocity)" = local(&RATE).derivative_of(velocity) by |ball| -ball.gravity;
    /// Pull of the earth
    gravity = parameter(&ACCELERATION) in gravity;
    /// What is left of the velocity after a bounce
    restitution = parameter(&RATIO) in restitution;
    /// How often it has bounced
    bounces = output(&COUNT).exact() in bounces;
    /// After how many bounces the simulation ends
    most_bounces = parameter(&COUNT) in most_bounces;
}

impl Model for Ball {
    const INFO: Info = Info { description: "Bouncing ball", guid: "{ball}", ..info!("Ball", "ball") };

    fn new(_: &Setup) -> Result<Self, Error> {
        let (height, velocity, gravity) = (1.0, 0.0, 9.81);
        Ok(Self { height, velocity, gravity, restitution: 0.7, bounces: 0, most_bounces: 5, apex: height })
    }
}

impl ModelExchange for Ball {
    const INDICATORS: usize = 1;
    const STEP_COMPLETED: bool = true;

    /// The ball is above the floor or below it.
    fn indicators(&self, indicators: &mut [f64]) {
        indicators[0] = self.height;
    }

    fn event(&mut self, _: f64) -> Result<Event, Error> {
        if self.height > 0.0 || self.velocity >= 0.0 {
            return Ok(Event::default());
        }
        self.velocity *= -self.restitution;
        self.apex = (0.5 * self.velocity * self.velocity / self.gravity).min(1e6);
        self.bounces = self.bounces.saturating_add(1);
        Ok(Event {
            states_changed: true,
            nominals_changed: true,
            terminate: self.bounces >= self.most_bounces,
            ..Event::default()
        })
    }

    /// An importer that has overlooked the sign is told here; where it is too late, that this must end.
    fn step_completed(&mut self, _: f64) -> StepCompleted {
        StepCompleted { event: self.height < 0.0 && self.velocity < 0.0, terminate: self.height < -100.0 }
    }

    /// Flights get lower and lower, and so should what the integrator takes for small.
    fn nominals(&self, nominals: &mut [f64]) {
        nominals[0] = self.apex.max(1e-6);
    }
}

offer!(Ball: ModelExchange);

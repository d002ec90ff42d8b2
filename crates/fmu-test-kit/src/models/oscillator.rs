//! A mass on springs: states, parameters with ranges, exact steps, derivatives of every kind.

use fmu_export::*;

const FORCE: Type = Type::real("Force", &Unit::new("N").kg(1).m(1).s(-2));
const POSITION: Type = Type::real("Position", &Unit::new("m").m(1)).nominal(0.1);
const VELOCITY: Type = Type::real("Velocity", &Unit::new("m/s").m(1).s(-1)).nominal(0.5);
const ACCELERATION: Type = Type::real("Acceleration", &Unit::new("m/s2").m(1).s(-2));
const ENERGY: Type = Type::real("Energy", &Unit::new("J").kg(1).m(2).s(-2));
const MASS: Type = Type::real("Mass", &Unit::new("kg").kg(1)).min(1e-3).max(1e6);
const STIFFNESS: Type = Type::real("Stiffness", &Unit::new("N/m").kg(1).s(-2)).min(1e-3).max(1e6);
const DAMPING: Type = Type::real("Damping", &Unit::new("N.s/m").kg(1).s(-1)).min(0.0);
const SPRINGS: Type = Type::integer("Springs").min_integer(1).max_integer(9);

variables! {
    /// m v' = F - k x - c v, solved exactly if the force changes linearly during a step.
    pub struct Oscillator {
        /// Slope of the force in the next step, if the importer has set one.
        slope: Option<f64>,
    }, memory in slope;

    /// Force on the mass
    force: f64 = input(&FORCE);
    /// Position of the mass
    position: f64 = output(&POSITION).state();
    /// Velocity of the mass
    velocity: f64 = local(&VELOCITY).state();
    /// Rate of the position
    der_position as "der(position)" = local(&VELOCITY).derivative_of(position).depends_on(&[velocity])
        by |o| o.velocity;
    /// Rate of the velocity
    der_velocity as "der(velocity)" = local(&ACCELERATION).derivative_of(velocity) by |o| o.acceleration();
    /// Force of the springs
    spring_force = output(&FORCE).depends_on(&[position, stiffness, springs]) by |o| -o.all_springs() * o.position;
    /// Energy in springs and mass
    energy = output(&ENERGY) by |o| 0.5 * (o.all_springs() * o.position.powi(2) + o.mass * o.velocity.powi(2));
    /// Mass
    mass: f64 = parameter(&MASS).start(2.0);
    /// Stiffness of one spring
    stiffness: f64 = parameter(&STIFFNESS).start(50.0);
    /// Number of springs in parallel
    springs: i32 = parameter(&SPRINGS).start(1);
    /// Damping
    damping: f64 = parameter(&DAMPING).start(0.5);
    /// Whether there is a damper
    damped: bool = parameter(&BOOLEAN).start(true);
}

impl Oscillator {
    fn all_springs(&self) -> f64 {
        self.stiffness * f64::from(self.springs)
    }

    fn damper(&self) -> f64 {
        if self.damped { self.damping } else { 0.0 }
    }

    fn acceleration(&self) -> f64 {
        (self.force - self.all_springs() * self.position - self.damper() * self.velocity) / self.mass
    }

    /// Returns the decay rate, which is minus the real part of the eigenvalues, and the square of the angular frequency.
    fn decay_and_frequency_squared(&self) -> (f64, f64) {
        let decay = 0.5 * self.damper() / self.mass;
        (decay, self.all_springs() / self.mass - decay * decay)
    }
}

impl Model for Oscillator {
    const INFO: Info = Info { description: "Mass on springs", ..info!("Oscillator", "oscillator") };

    fn update(&mut self) -> Result<(), Error> {
        let (_, frequency_squared) = self.decay_and_frequency_squared();
        if frequency_squared > 0.0 {
            return Ok(());
        }
        Err(Error::new(
            "the damping is so strong that nothing oscillates: damping^2 must be below 4 mass stiffness springs",
        ))
    }
}

impl CoSimulation for Oscillator {
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        let (k, c, slope, h) = (self.all_springs(), self.damper(), self.slope.unwrap_or(0.0), step.size);
        // The motion is the sum of a particular solution, a + b t, and a decaying oscillation that starts at x with velocity v.
        let b = slope / k;
        let a = (self.force - c * b) / k;
        let (x, v) = (self.position - a, self.velocity - b);
        let (decay, frequency_squared) = self.decay_and_frequency_squared();
        let frequency = frequency_squared.sqrt();
        let (sine, cosine) = (frequency * h).sin_cos();
        let amplitude = (v + decay * x) / frequency;
        let fading = (-decay * h).exp();
        let position = a + b * h + fading * (x * cosine + amplitude * sine);
        let velocity = b + fading * (v * cosine - (decay * amplitude + frequency * x) * sine);
        if !(position.is_finite() && velocity.is_finite()) {
            return Err(Error::new("position or velocity would not be finite"));
        }
        (self.position, self.velocity, self.slope) = (position, velocity, None);
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Oscillator {}

impl Partials for Oscillator {
    fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
        let (m, k, c) = (self.mass, self.all_springs(), self.damper());
        Some(match (unknown, known) {
            (Name::position, Name::position) | (Name::der_position, Name::velocity) => 1.0,
            (Name::der_velocity, Name::force) => 1.0 / m,
            (Name::der_velocity, Name::position) => -k / m,
            (Name::der_velocity, Name::velocity) => -c / m,
            (Name::der_velocity, Name::mass) => -self.acceleration() / m,
            (Name::der_velocity, Name::stiffness) => -f64::from(self.springs) * self.position / m,
            (Name::der_velocity, Name::damping) => -f64::from(u8::from(self.damped)) * self.velocity / m,
            (Name::spring_force, Name::position) => -k,
            (Name::spring_force, Name::stiffness) => -f64::from(self.springs) * self.position,
            (Name::energy, Name::position) => k * self.position,
            (Name::energy, Name::velocity) => m * self.velocity,
            // Not provided, so that tests can check the error message.
            (Name::energy, Name::mass | Name::stiffness | Name::damping) => return None,
            _ => 0.0,
        })
    }
}

impl InputDerivatives for Oscillator {
    fn set_input_derivative(&mut self, of: Name, order: u32, value: f64) {
        if (of, order) == (Name::force, 1) {
            self.slope = Some(value);
        }
    }
}

impl OutputDerivatives for Oscillator {
    fn output_derivative(&self, of: Name, _: u32) -> f64 {
        let (k, c, slope) = (self.all_springs(), self.damper(), self.slope.unwrap_or(0.0));
        let (x, v, a) = (self.position, self.velocity, self.acceleration());
        match of {
            Name::force => slope,
            Name::position => v,
            Name::velocity | Name::der_position => a,
            Name::der_velocity => (slope - k * v - c * a) / self.mass,
            Name::spring_force => -k * v,
            Name::energy => k * x * v + self.mass * v * a,
            _ => 0.0,
        }
    }
}

offer!(Oscillator: CoSimulation + ModelExchange + Partials + InputDerivatives + OutputDerivatives);

//! A spring balance: a state that starts at rest, wherever the load is then.

use fmu_export::*;

/// d x' = F - k x.
#[derive(Clone)]
pub struct Balance {
    load: f64,
    stiffness: f64,
    stretch: f64,
    moving: bool,
}

variables! { for Balance, memory in moving;
    /// What hangs on the spring
    load = input(&NUMBER) in load then |balance| { balance.hang() };
    /// How far the spring is stretched
    stretch = output(&NUMBER).state().calculated().depends_on(&[load, stiffness]) in stretch
        then |balance| { balance.moving = true };
    /// How fast
    der_stretch as "der(stretch)" = local(&NUMBER).derivative_of(stretch)
        by |balance| balance.load - balance.stiffness * balance.stretch;
    /// Stiffness of the spring
    stiffness = parameter(&Type::real("Stiffness", &Unit::new("N/m").kg(1).s(-2)).min(0.125)) in stiffness
        then |balance| { balance.hang() };
}

impl Balance {
    fn hang(&mut self) {
        if !self.moving {
            self.stretch = self.load / self.stiffness;
        }
    }
}

impl Model for Balance {
    const INFO: Info = Info { guid: "{balance}", ..info!("Balance", "balance") };

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self { load: 0.0, stiffness: 2.0, stretch: 0.0, moving: false })
    }
}

impl CoSimulation for Balance {
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        self.moving = true;
        let rest = self.load / self.stiffness;
        self.stretch = rest + (self.stretch - rest) * (-self.stiffness * step.size).exp();
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Balance {
    fn continuous_time_entered(&mut self) {
        self.moving = true;
    }
}

impl Partials for Balance {
    fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
        Some(match (unknown, known) {
            (Name::stretch, Name::stretch) | (Name::der_stretch, Name::load) => 1.0,
            (Name::der_stretch, Name::stretch) => -self.stiffness,
            (Name::der_stretch, Name::stiffness) => -self.stretch,
            _ => 0.0,
        })
    }

    /// stretch = load / stiffness, at rest.
    fn initial_partial(&self, unknown: Name, known: Name) -> Option<f64> {
        Some(match (unknown, known) {
            (Name::stretch, Name::load) => 1.0 / self.stiffness,
            (Name::stretch, Name::stiffness) => -self.load / (self.stiffness * self.stiffness),
            _ => 0.0,
        })
    }
}

offer!(Balance: CoSimulation + ModelExchange + Partials);

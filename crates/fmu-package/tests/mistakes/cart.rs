//! A model whose states do not follow their derivatives, or change unexpectedly.
#![allow(missing_docs, unsafe_code)]

mod mistake;

use fmu_export::*;
use mistake::{mistake, read_mistake};

/// A cart on a spring, x' = v, v' = (u - k x - d v) / m. [`mistake`] selects a mistake or another difference.
#[derive(Clone)]
struct Cart {
    u: f64,
    x: f64,
    v: f64,
    k: f64,
    d: f64,
    hits: i32,
}

const POSITION: Type = Type::real("Position", &Unit::new("m").m(1));
const SPEED: Type = Type::real("Speed", &Unit::new("m/s").m(1).s(-1));
const ACCELERATION: Type = Type::real("Acceleration", &Unit::new("m/s2").m(1).s(-2));
const FORCE: Type = Type::real("Force", &units::ONE).nominal(10.0);
const FACTOR: Type = Type::real("Factor", &units::ONE).min(0.0);

variables! { for Cart;
    /// Force
    u = input(&FORCE) in u;
    /// Position
    x = output(&POSITION).state().reinit() in x;
    /// Speed
    v = output(&SPEED).state() in v;
    /// Rate of the position
    der_x as "der(x)" = local(&SPEED).derivative_of(x) by |cart| match mistake() {
        "swapped" => cart.rates([cart.x, cart.v])[1],
        _ => cart.v,
    };
    /// Rate of the speed
    der_v as "der(v)" = local(&ACCELERATION).derivative_of(v) by |cart| {
        let rate = cart.rates([cart.x, cart.v])[1];
        match mistake() {
            "swapped" => cart.v,
            "sign" => -rate,
            "factor" => 1.1 * rate,
            "forgotten" => rate + cart.k * cart.x,
            _ => rate,
        }
    };
    /// Stiffness
    k = parameter(&FACTOR) in k;
    /// Damping
    d = parameter(&FACTOR) in d;
    /// Natural angular frequency
    omega = calculated_parameter(&FACTOR) by |cart| if mistake() == "stiff" { 1.0 } else { cart.k.sqrt() };
    /// Number of hits
    hits = output(&INTEGER).exact() in hits;
}

impl Cart {
    fn rates(&self, [x, v]: [f64; 2]) -> [f64; 2] {
        let (force, mass) = match mistake() {
            // A very small mass with strong damping: the time constant of the speed, m / d, is a nanosecond.
            "stiff" => (self.u - self.k * x - 1e3 * v, 1e-6),
            // Coulomb friction.
            "friction" => (self.u - self.k * x - self.d * v - 3.0 * v.signum(), 1.0),
            _ => (self.u - self.k * x - self.d * v, 1.0),
        };
        [v, force / mass]
    }
}

impl Model for Cart {
    const INFO: Info = Info::new("Cart", "cart");

    fn new(setup: &Setup) -> Result<Self, Error> {
        read_mistake(setup);
        let (x, k) = if mistake() == "at rest" { (0.0, 100.0) } else { (0.2, 40.0) };
        Ok(Self { u: 0.0, x, v: 0.0, k, d: 0.5, hits: 0 })
    }

    fn calculate(&mut self, _: f64) {
        match mistake() {
            "calculate" => self.x += 1e-6,
            "clamped" => self.x = self.x.clamp(-0.1, 0.1),
            "counted" => self.hits += 1,
            _ => {}
        }
    }
}

impl CoSimulation for Cart {
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        if mistake() == "stiff" {
            // The speed decays exponentially to the value at which the forces balance.
            let end = (self.u - self.k * self.x) / 1e3;
            self.v = end + (self.v - end) * (-step.size * 1e3 / 1e-6).exp();
            self.x += step.size * self.v;
            return Ok(Stepped::Done);
        }
        if mistake() == "still" {
            return Ok(Stepped::Done);
        }
        for part in step.parts(1e-2)? {
            let part = if mistake() == "inner steps" { Step::new(part.time, 1e-3) } else { part };
            [self.x, self.v] = rk4([self.x, self.v], part, |_, state| self.rates(state));
        }
        if mistake() == "jumps" {
            // An impact at the end of each step that has the default size.
            self.v *= if step.size > 0.9e-3 { -0.5 } else { 1.0 };
        }
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Cart {
    /// An impact, which changes the speed, or a jump of the position, which is declared with `reinit`.
    fn event(&mut self, time: f64) -> Result<Event, Error> {
        let acts = |event: &str| mistake().split(' ').next() == Some(event) && time > 2e-3;
        self.v *= if acts("hit") { -0.5 } else { 1.0 };
        self.x += if acts("jump") { 0.1 } else { 0.0 };
        Ok(Event { states_changed: mistake().ends_with("and reported"), ..Event::default() })
    }
}

export_fmu!(Cart: CoSimulation + ModelExchange);

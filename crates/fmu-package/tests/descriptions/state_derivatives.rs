//! A model is rejected if its states do not follow their derivatives, have derivatives in another unit, or change unexpectedly: when
//! values are calculated, or in an event that does not report it.

use crate::{BOTH, changed};
use fmu_export::*;
use fmu_package::{Changes, Standard, describe};
use std::cell::Cell;

thread_local! {
    static CASE: Cell<&'static str> = const { Cell::new("") };
}

fn case() -> &'static str {
    CASE.get()
}

/// A cart on a spring, x' = v, v' = (u - k x - d v) / m. [`case`] selects a mistake or another difference.
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
    x = output(&POSITION).state() in x;
    /// Speed
    v = output(&SPEED).state() in v;
    /// Rate of the position
    der_x as "der(x)" = local(&SPEED).derivative_of(x) by |cart| match case() {
        "swapped" => cart.rates([cart.x, cart.v])[1],
        _ => cart.v,
    };
    /// Rate of the speed
    der_v as "der(v)" = local(&ACCELERATION).derivative_of(v) by |cart| {
        let rate = cart.rates([cart.x, cart.v])[1];
        match case() {
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
    /// Number of hits
    hits = output(&INTEGER).exact() in hits;
}

impl Cart {
    fn rates(&self, [x, v]: [f64; 2]) -> [f64; 2] {
        let (force, mass) = match case() {
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

    fn new(_: &Setup) -> Result<Self, Error> {
        let (x, k) = if case() == "at rest" { (0.0, 100.0) } else { (0.2, 40.0) };
        Ok(Self { u: 0.0, x, v: 0.0, k, d: 0.5, hits: 0 })
    }

    fn calculate(&mut self, _: f64) {
        match case() {
            "calculate" => self.x += 1e-6,
            "clamped" => self.x = self.x.clamp(-0.1, 0.1),
            "counted" => self.hits += 1,
            _ => {}
        }
    }
}

impl CoSimulation for Cart {
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        if case() == "stiff" {
            // The speed decays exponentially to the value at which the forces balance.
            let end = (self.u - self.k * self.x) / 1e3;
            self.v = end + (self.v - end) * (-step.size * 1e3 / 1e-6).exp();
            self.x += step.size * self.v;
            return Ok(Stepped::Done);
        }
        if case() == "still" {
            return Ok(Stepped::Done);
        }
        for part in step.parts(1e-2)? {
            let part = if case() == "inner steps" { Step::new(part.time, 1e-3) } else { part };
            [self.x, self.v] = rk4([self.x, self.v], part, |_, state| self.rates(state));
        }
        if case() == "jumps" {
            // An impact at the end of each step that has the default size.
            self.v *= if step.size > 0.9e-3 { -0.5 } else { 1.0 };
        }
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Cart {
    /// An impact.
    fn event(&mut self, time: f64) -> Result<Event, Error> {
        let is_hit = case().starts_with("hit") && time > 2e-3;
        self.v *= if is_hit { -0.5 } else { 1.0 };
        Ok(Event { states_changed: case() == "hit and reported", ..Event::default() })
    }
}

offer!(Cart: CoSimulation + ModelExchange);

fn message(of: &'static str, changes: &str, fmi: Standard) -> String {
    CASE.set(of);
    let error = describe(&changed::<Cart>(changes), fmi, &Changes::default()).err();
    error.map(|error| format!("{error:#}")).unwrap_or_default()
}

#[test]
fn states_follow_their_derivatives() {
    for of in ["", "at rest", "stiff", "friction", "jumps"] {
        for fmi in BOTH {
            assert_eq!(message(of, "", fmi), "", "{of}");
        }
    }
    for (of, text) in [
        ("swapped", "x changes by "),
        ("sign", "v changes by "),
        ("factor", "v changes by "),
        ("forgotten", "v changes by "),
        ("inner steps", "x changes by "),
        ("still", "x changes by 0.000000e0 per second in a step, but its derivative der(x) is "),
    ] {
        let message = message(of, "", Standard::Fmi3);
        assert!(message.starts_with(text) && message.contains("compare `step` with"), "{of}: {message}");
    }
    // Without Co-Simulation, there are no steps to compare with.
    assert_eq!(message("sign", "coSimulation=null", Standard::Fmi2), "");
}

#[test]
fn reading_changes_nothing() {
    const REMEDY: &str = "`calculate` must not change states";
    for (of, name) in [("calculate", "x"), ("clamped", "x"), ("counted", "hits")] {
        let message = message(of, "", Standard::Fmi2);
        let is_named =
            ["", "the importer sets "].iter().any(|begin| message.starts_with(&format!("{begin}{name} ")));
        assert!(is_named && message.contains(REMEDY), "{of}: {message}");
    }
    // Without Model Exchange, the fault is found in Co-Simulation.
    assert!(message("calculate", "modelExchange=null", Standard::Fmi3).starts_with("x is "));
}

#[test]
fn events_declare_that_they_change_states() {
    let declared = "variables/v/reinit=true";
    assert_eq!(message("hit and reported", declared, Standard::Fmi3), "");
    for (of, changes, missing) in
        [("hit", declared, "`states_changed: true`"), ("hit and reported", "", "`.reinit()`")]
    {
        let message = message(of, changes, Standard::Fmi3);
        assert!(
            message.starts_with("an event changes v from ") && message.contains(missing),
            "{of}: {message}"
        );
    }
}

#[test]
fn derivatives_have_the_unit_of_the_state_per_second() {
    CASE.set("");
    let with = |path: &str, value: &str| message("", &format!("variables/{path}={value}"), Standard::Fmi2);
    let unit = "type/unit/exponents";
    assert_eq!(
        with(&format!("der(x)/{unit}"), "[0,1,-2,0,0,0,0,0]"),
        "der(x) is in m/s (m.s-2), but x is in m, so the unit of its derivative has the exponents m.s-1"
    );
    // The radian may be left out.
    assert_eq!(with(&format!("x/{unit}"), "[0,1,0,0,0,0,0,1]"), "");
    let text = with("der(x)/type/unit/factor", "\"0.001\"");
    assert!(
        text.starts_with("der(x) is in m/s, whose factor is 0.001, but x is in m, whose factor is 1;"),
        "{text}"
    );
}

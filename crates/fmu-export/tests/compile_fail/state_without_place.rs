//! A state lives somewhere.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// A state
    x = output(&NUMBER).state() by |toy| toy.x;
    /// Its rate
    dx = local(&NUMBER).derivative_of(x) by |toy| toy.u;
}

fn main() {}

//! Only a Real has a rate.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// A state
    x = output(&NUMBER).state() in x;
    /// Its rate
    n = local(&INTEGER).derivative_of(x) by |toy| toy.n;
}

fn main() {}

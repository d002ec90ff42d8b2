//! Every state has a derivative.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// A state with one
    u = output(&NUMBER).state() in u;
    /// Its rate
    du = local(&NUMBER).derivative_of(u) by |toy| toy.u;
    /// A state without
    x = output(&NUMBER).state() in x;
}

fn main() {}

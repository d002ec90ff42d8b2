//! Other variables are named by their names.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// A rate
    dx = local(&NUMBER).derivative_of(w) by |toy| toy.u;
}

fn main() {}

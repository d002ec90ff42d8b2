//! A Real is an f64.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// An output
    y = output(&NUMBER) by |toy| toy.n;
}

fn main() {}

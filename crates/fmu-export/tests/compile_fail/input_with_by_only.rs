//! An input lives somewhere.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// An input
    u = input(&NUMBER) by |toy| toy.u;
}

fn main() {}

//! A constant is exact (section 2.2.7).
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// An output
    y = output(&NUMBER).constant().approx() in x;
}

fn main() {}

//! A variable has a place or a calculation.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// An output
    y = output(&NUMBER);
}

fn main() {}

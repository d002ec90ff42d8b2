//! A parameter has an exact value (section 2.2.7).
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// A parameter
    gain = parameter(&NUMBER).approx() in x;
}

fn main() {}

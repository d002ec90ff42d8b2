//! A parameter is fixed or tunable (section 2.2.7).
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// A parameter
    gain = parameter(&NUMBER).discrete() in x;
}

fn main() {}

//! An input has no initial (section 2.2.7).
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// An input
    u = input(&NUMBER).exact() in u;
}

fn main() {}

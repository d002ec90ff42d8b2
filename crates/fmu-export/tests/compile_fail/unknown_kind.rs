//! A kind is a function of Variable.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// An input
    u = inlet(&NUMBER) in u;
}

fn main() {}

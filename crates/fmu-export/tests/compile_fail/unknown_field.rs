//! A place is a field of the model.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// An input
    u = input(&NUMBER) in w;
}

fn main() {}

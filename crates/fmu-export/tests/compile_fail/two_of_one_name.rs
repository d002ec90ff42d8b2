//! Names are unique.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// An input
    u = input(&NUMBER) in u;
    /// Another
    u = input(&NUMBER) in x;
}

fn main() {}

//! Users read what a variable is.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    u = input(&NUMBER) in u;
}

fn main() {}

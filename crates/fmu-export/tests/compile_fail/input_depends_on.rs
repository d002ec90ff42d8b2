//! Only what is calculated depends on others.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// An input
    u = input(&NUMBER).depends_on(&[u]) in u;
}

fn main() {}

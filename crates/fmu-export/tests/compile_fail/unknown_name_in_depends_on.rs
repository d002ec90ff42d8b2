//! Other variables are named by their names.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// An output
    y = output(&NUMBER).depends_on(&[w]) by |toy| toy.u;
}

fn main() {}

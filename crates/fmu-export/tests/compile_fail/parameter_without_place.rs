//! What importers set lives somewhere.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// A parameter
    gain = parameter(&NUMBER) by |toy| toy.x;
}

fn main() {}

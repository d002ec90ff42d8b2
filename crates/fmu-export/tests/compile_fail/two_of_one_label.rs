//! Names are unique for importers, too.
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
    w as "u" = input(&NUMBER) in x;
}

fn main() {}

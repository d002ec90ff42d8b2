//! The time is the instance's.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// The time
    time = independent(&TIME) by |toy| toy.x;
}

fn main() {}

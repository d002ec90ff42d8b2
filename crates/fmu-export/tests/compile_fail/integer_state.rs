//! Only a Real is continuous (section 2.2.7).
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// A state
    n = output(&INTEGER).state() in n;
}

fn main() {}

//! No variable is a character.
use fmu_export::*;

#[derive(Clone)]
pub struct Toy {
    u: f64,
    x: f64,
    n: i32,
}

variables! { for Toy;
    /// An output
    y = output(&INTEGER) by |_| '7';
}

fn main() {}

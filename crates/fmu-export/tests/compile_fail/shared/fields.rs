// The model of these tests, with its fields.
use fmu_export::*;

#[derive(Clone)]
pub struct Plant {
    u: f64,
    x: f64,
    n: i32,
    list: [f64; 8],
}


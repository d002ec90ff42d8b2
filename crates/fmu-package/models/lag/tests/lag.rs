//! Simulations of the model.

use fmu_export::*;
use lag::Lag;

#[test]
fn steps_are_exact() {
    let mut lag = Simulation::<Lag>::new().unwrap();
    let x = lag.step_size(0.3).set("u", 2.0).unwrap().run(3.0).unwrap().get("x").unwrap();
    assert!((x - 2.0 * (1.0 - (-3.0_f64).exp())).abs() < 1e-15);
}

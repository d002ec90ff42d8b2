//! Simulations of the model.

use ball::Ball;
use fmu_export::*;

/// The fifth bounce follows the fall from 1 m and four flights. The first flight takes `2 * restitution` times as long as the fall,
/// each other flight `restitution` times as long as the flight before it.
#[test]
fn it_bounces_when_it_should() {
    let fall = (2.0_f64 / 9.81).sqrt();
    let expected = fall + 2.0 * fall * (0.7 + 0.7_f64.powi(2) + 0.7_f64.powi(3) + 0.7_f64.powi(4));
    let exchange = (Interface::ModelExchange, 0.05);
    for (interface, size) in [1e-3, 0.05, 10.0].map(|size| (Interface::CoSimulation, size)).into_iter().chain([exchange]) {
        let mut ball = Simulation::<Ball>::of(interface).unwrap();
        ball.step_size(size).run(10.0).unwrap();
        let time = ball.time();
        assert!((time - expected).abs() < 1e-9, "{time} instead of {expected} with steps of {size} s");
        assert!(ball.has_ended());
        assert_eq!(ball.get("bounces").unwrap(), 5.0);
    }
}

#[test]
fn the_energy_equals_the_energy_of_the_fall() {
    let mut ball = Simulation::<Ball>::new().unwrap();
    ball.step_size(0.4).run(0.4).unwrap();
    let [height, velocity] = ["height", "velocity"].map(|name| ball.get(name).unwrap());
    assert!((9.81 * height + 0.5 * velocity * velocity - 9.81).abs() < 1e-12);
}

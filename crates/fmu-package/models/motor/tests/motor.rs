//! Simulations of the model.

use fmu_export::*;
use motor::Motor;

fn speed(duty: f64, step_size: f64, time: f64) -> f64 {
    speed_in(Interface::CoSimulation, duty, step_size, time)
}

fn speed_in(interface: Interface, duty: f64, step_size: f64, time: f64) -> f64 {
    let mut motor = Simulation::<Motor>::of(interface).unwrap();
    motor.step_size(step_size).set("duty", duty).unwrap().run(time).unwrap().get("speed").unwrap()
}

/// If the supply is always on, the motor is linear. With the roots s1 and s2 of L J s^2 + R J s + k^2 = 0, the speed is
/// (1 + (s2 e^(s1 t) - s1 e^(s2 t)) / (s1 - s2)) U / k.
#[test]
fn always_on_it_follows_the_exact_solution() {
    let (u, r, l, k, j) = (24.0_f64, 0.5_f64, 1e-3_f64, 0.05_f64, 2e-4_f64);
    let root = (r * r / (4.0 * l * l) - k * k / (l * j)).sqrt();
    let (s1, s2) = (-r / (2.0 * l) + root, -r / (2.0 * l) - root);
    let t = 0.05;
    let exact = u / k * (1.0 + (s2 * (s1 * t).exp() - s1 * (s2 * t).exp()) / (s1 - s2));
    let speed = speed(1.0, 1e-3, t);
    assert!((speed - exact).abs() < 1e-3, "{speed} instead of {exact}");
}

/// With pulses, too, `step` follows the derivatives and events that importers of Model Exchange integrate.
#[test]
fn both_interface_types_agree() {
    let [stepped, integrated] = [Interface::CoSimulation, Interface::ModelExchange]
        .map(|interface| speed_in(interface, 0.25, 1e-3, 0.0207));
    assert!((stepped - integrated).abs() < 1e-4 * integrated, "{stepped} and {integrated}");
}

/// Without load, the mean voltage determines the speed, at any step size.
#[test]
fn the_duty_sets_the_speed() {
    for (size, time) in [(1e-3, 1.0), (0.3e-3, 0.99), (0.1, 1.0)] {
        let speed = speed(0.25, size, time);
        assert!((speed - 0.25 * 24.0 / 0.05).abs() < 0.5, "{speed} with {size}");
    }
}

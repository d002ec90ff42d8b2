//! The model as it is, without FMI.

use fmu_export::*;
use motor::{Motor, Name};

fn motor(duty: f64) -> Motor {
    let mut motor = Motor::new(&Setup::new(Interface::CoSimulation)).unwrap();
    Motor::TABLE[Name::duty as usize].set(&mut motor, &Value::Real(duty));
    motor.initialize(&Experiment::default()).unwrap();
    motor
}

fn speed(motor: &Motor) -> f64 {
    match Motor::TABLE[Name::speed as usize].value(motor) {
        Some(Value::Real(value)) => value,
        other => panic!("the speed is {other:?}"),
    }
}

fn run(motor: &mut Motor, steps: u32, size: f64) {
    for k in 0..steps {
        assert_eq!(motor.step(Step::new(f64::from(k) * size, size)).unwrap(), Stepped::Done);
    }
}

/// Always on, it is linear: with s1 and s2 the roots of L J s^2 + R J s + k^2 = 0, the speed is
/// (1 + (s2 e^(s1 t) - s1 e^(s2 t)) / (s1 - s2)) U / k.
#[test]
fn always_on_it_follows_the_exact_solution() {
    let mut motor = motor(1.0);
    run(&mut motor, 50, 1e-3);
    let (u, r, l, k, j) = (24.0_f64, 0.5_f64, 1e-3_f64, 0.05_f64, 2e-4_f64);
    let root = (r * r / (4.0 * l * l) - k * k / (l * j)).sqrt();
    let (s1, s2) = (-r / (2.0 * l) + root, -r / (2.0 * l) - root);
    let t = 0.05;
    let exact = u / k * (1.0 + (s2 * (s1 * t).exp() - s1 * (s2 * t).exp()) / (s1 - s2));
    assert!((speed(&motor) - exact).abs() < 1e-3, "{} instead of {exact}", speed(&motor));
}

/// Without load it turns as fast as the mean voltage has it, whatever the size of the steps.
#[test]
fn the_duty_sets_the_speed() {
    for (steps, size) in [(1000, 1e-3), (3300, 0.3e-3), (10, 0.1)] {
        let mut motor = motor(0.25);
        run(&mut motor, steps, size);
        assert!((speed(&motor) - 0.25 * 24.0 / 0.05).abs() < 0.5, "{} with {size}", speed(&motor));
    }
}

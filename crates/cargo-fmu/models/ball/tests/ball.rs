//! The model as it is, without FMI.

use ball::{Ball, Name};
use fmu_export::*;

fn ball() -> Ball {
    Ball::new(&Setup::new(Interface::CoSimulation)).unwrap()
}

fn value(ball: &Ball, name: Name) -> f64 {
    match Ball::TABLE[name as usize].value(ball) {
        Some(Value::Real(value)) => value,
        Some(Value::Integer(value)) => value as f64,
        other => panic!("{name:?} is {other:?}"),
    }
}

/// Goes on in equal steps until the ball wants to end it; tells when.
fn end(ball: &mut Ball, size: f64) -> f64 {
    for k in 0.. {
        match ball.step(Step::new(f64::from(k) * size, size)).unwrap() {
            Stepped::Done => {}
            Stepped::Terminate(time) => return time,
            other => panic!("{other:?}"),
        }
    }
    unreachable!("the ball bounces five times")
}

/// The fall from 1 m, and four flights, each shorter by the restitution.
#[test]
fn it_bounces_when_it_should() {
    let fall = (2.0_f64 / 9.81).sqrt();
    let expected = fall + 2.0 * fall * (0.7 + 0.7_f64.powi(2) + 0.7_f64.powi(3) + 0.7_f64.powi(4));
    for size in [1e-3, 0.05, 10.0] {
        let mut ball = ball();
        let time = end(&mut ball, size);
        assert!((time - expected).abs() < 1e-9, "{time} instead of {expected} with steps of {size} s");
        assert_eq!(value(&ball, Name::bounces), 5.0);
    }
}

#[test]
fn its_energy_is_that_of_the_fall() {
    let mut ball = ball();
    ball.step(Step::new(0.0, 0.4)).unwrap();
    let (height, velocity) = (value(&ball, Name::height), value(&ball, Name::velocity));
    assert!((9.81 * height + 0.5 * velocity * velocity - 9.81).abs() < 1e-12);
}

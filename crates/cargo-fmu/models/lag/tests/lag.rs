//! The model as it is, without FMI.

use fmu_export::*;
use lag::{Lag, Name};

#[test]
fn steps_are_exact() {
    let mut lag = Lag::new(&Setup::new(Interface::CoSimulation)).unwrap();
    Lag::TABLE[Name::u as usize].set(&mut lag, &Value::Real(2.0));
    for k in 0..10 {
        let step = Step::new(f64::from(k) * 0.3, 0.3);
        assert_eq!(lag.step(step).unwrap(), Stepped::Done);
    }
    let Some(Value::Real(x)) = Lag::TABLE[Name::x as usize].value(&lag) else { panic!("x is a Real") };
    assert!((x - 2.0 * (1.0 - (-3.0_f64).exp())).abs() < 1e-15);
}

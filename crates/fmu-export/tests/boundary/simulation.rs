//! Tests of [`Simulation`], with which authors test their models without an FMU.

use crate::models::{Counter, Rod};
use fmu_export::{Interface, Simulation, Value};

/// Checks a scalar variable, elements of arrays and whole arrays, all by their names in the model description.
#[test]
fn variables_have_the_names_of_the_description() {
    let mut rod = Simulation::<Rod>::new().unwrap();
    rod.set("conductance", 0.5).unwrap().set("limits[2,1]", 12.0).unwrap();
    rod.set_array("power", [1.0, 2.0]).unwrap().set("labels", "half").unwrap();
    assert_eq!(rod.get("conductance").unwrap(), 0.5);
    let limits = [10.0, 25.0, 12.0, 30.0].map(Value::Real);
    assert_eq!(rod.values("limits").unwrap(), limits);
    assert_eq!(rod.get("power[2]").unwrap(), 2.0);
    assert_eq!(rod.value("labels[1]").unwrap(), Value::from("half"));
    // The calculated array of derivatives depends on the values that were set.
    let wall = rod.get("der(T[1])").unwrap();
    assert!(rod.set("wall", 500.0).unwrap().get("der(T[1])").unwrap() > wall);
}

#[test]
fn errors_name_the_mistake() {
    let mut rod = Simulation::<Rod>::new().unwrap();
    let rejected =
        |result: Result<&mut Simulation<Rod>, fmu_export::Error>| result.err().unwrap().to_string();
    assert!(rejected(rod.set("wal", 1.0)).starts_with("Rod has no variable wal; it has wall, T, power,"));
    assert_eq!(rejected(rod.set_array("power", [1.0; 3])), "power has 2 elements, there are 3 values");
    assert_eq!(rejected(rod.set("wall", 1)), "wall is of type Real and cannot be Integer(1)");
    assert_eq!(rejected(rod.set("conductance", 2.0)), "conductance must not be above 1, it is 2");
    assert_eq!(rejected(rod.set("mean", 2.0)).split(" in state").next(), Some("mean cannot be set"));
    assert_eq!(
        rod.get("labels[1]").err().unwrap().to_string().split(" but").next(),
        Some("labels[1] is not a number")
    );
}

/// Checks that events within a step are handled, and that the simulation ends when the model requests it.
#[test]
fn events_are_handled() {
    for interface in [Interface::CoSimulation, Interface::ModelExchange] {
        let mut counter = Simulation::<Counter>::of(interface).unwrap();
        counter.set("weight", 2.0).unwrap().set("limit", 8.0).unwrap().step_size(0.6).run(0.6).unwrap();
        assert_eq!((counter.get("count").unwrap(), counter.get("sum").unwrap()), (3.0, 6.0));
        assert!(!counter.has_ended() && counter.time() == 0.6);
        counter.run(9.0).unwrap();
        assert!(counter.has_ended() && counter.time() == 0.75);
        assert_eq!(counter.get("count").unwrap(), 4.0);
    }
}

mod slope {
    use fmu_export::*;

    variables! {
        /// x' = gain / (1 - x), which has no solution after x = 1, and a switch that holds x at 0.
        pub struct Slope;

        /// Slope
        gain: f64 = parameter(&NUMBER).start(1.0);
        /// Whether the switch holds x
        holds: bool = parameter(&BOOLEAN);
        /// State
        x: f64 = output(&NUMBER).state();
        /// Whether x rises
        rises: bool = output(&BOOLEAN).exact().start(true);
        /// Its rate
        der_x as "der(x)" = local(&NUMBER).derivative_of(x) by |slope| match (slope.holds, slope.rises) {
            (false, _) => slope.gain / (1.0 - slope.x),
            (true, rises) => if rises { slope.gain } else { -slope.gain },
        };
    }

    impl Model for Slope {
        const INFO: Info = info!("Slope", "slope");
    }

    impl ModelExchange for Slope {
        const INDICATORS: usize = 1;

        fn indicators(&self, indicators: &mut [f64]) {
            indicators[0] = if self.holds { self.x - 0.25 } else { 1.0 };
        }

        fn event(&mut self, _: f64) -> Result<Event, Error> {
            self.rises = self.x <= 0.25;
            Ok(Event::default())
        }
    }

    offer!(Slope: ModelExchange);
}

/// Checks the integration of a nonlinear model, whose solution is 1 - sqrt(1 - 2 t), and that the simulation fails where no step has a
/// small error, or where the model switches back and forth.
#[test]
fn model_exchange_is_integrated() {
    let simulation = || Simulation::<slope::Slope>::of(Interface::ModelExchange).unwrap();
    for size in [1e-3, 0.1, 10.0] {
        let x = simulation().step_size(size).run(0.375).unwrap().get("x").unwrap();
        assert!((x - 0.5).abs() < 1e-9, "{x} with steps of {size} s");
    }
    let rejected =
        |result: Result<&mut Simulation<slope::Slope>, fmu_export::Error>| result.err().unwrap().to_string();
    let steep = rejected(simulation().run(1.0));
    assert!(
        steep.starts_with("the derivatives at 0.49999") && steep.ends_with("s are too steep for any step"),
        "{steep}"
    );
    let chatters = rejected(simulation().set("holds", true).unwrap().run(1.0));
    assert!(chatters.contains("more than 10000 events") && chatters.contains("hysteresis"), "{chatters}");
    let missing = Simulation::<slope::Slope>::new().err().unwrap();
    assert_eq!(missing.to_string(), "this FMU has no Co-Simulation");
}

/// Checks that another simulation can continue from a saved state. The state must include the `memory` fields of the
/// model: here `next`, the time of the next count.
#[test]
fn another_simulation_continues_from_a_state() {
    let mut counter = Simulation::<Counter>::new().unwrap();
    let saved = counter.step_size(0.3).set("weight", 2.0).unwrap().run(0.6).unwrap().save().unwrap();
    let mut other = Simulation::<Counter>::new().unwrap();
    other.step_size(0.3).restore(&saved).unwrap();
    assert_eq!(other.time(), 0.6);
    for simulation in [&mut counter, &mut other] {
        assert_eq!(simulation.run(1.2).unwrap().get("sum").unwrap(), 10.0);
    }
    assert!(other.restore(&saved[1..]).is_err());
}

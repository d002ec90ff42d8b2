//! The model as an importer simulates it.

use fmu_export::*;
use tank::Tank;

/// The characteristic is a straight line: the level falls from 1 m as e^(-0.01 t), to 0.5 m after 100 ln 2 s.
#[test]
fn the_pump_starts_at_the_lower_level() {
    for size in [0.5, 1.0, 200.0] {
        let mut tank = Simulation::<Tank>::new().unwrap();
        tank.step_size(size).run(50.0).unwrap();
        assert!((tank.get("level").unwrap() - (-0.5_f64).exp()).abs() < 1e-6);
        tank.run(100.0).unwrap();
        assert_eq!(tank.get("switches").unwrap(), 1.0);
        assert_eq!(tank.value("mode").unwrap(), Value::from("filling"));
        let since = 100.0 * 2.0_f64.ln();
        assert!((tank.get("duration").unwrap() - (100.0 - since)).abs() < 1e-4);
        assert!(tank.messages().contains(&(Status::Ok, format!("the pump is switched at {since:.1} s"))));
    }
}

/// The content of the bucket does not flow out of a closed valve.
#[test]
fn the_bucket_is_emptied_once() {
    let mut tank = Simulation::<Tank>::new().unwrap();
    tank.set("valve", 1).unwrap().run(10.0).unwrap();
    tank.set("bucket", true).unwrap().run(20.0).unwrap();
    assert!((tank.get("level").unwrap() - 1.2).abs() < 1e-12);
}

/// `step` and the equations are separate code, so the results must be equal except for the errors of `step`.
#[test]
fn both_interface_types_agree() {
    let [stepped, integrated] = [Interface::CoSimulation, Interface::ModelExchange].map(|interface| {
        let mut tank = Simulation::<Tank>::of(interface).unwrap();
        tank.run(100.0).unwrap().set("bucket", true).unwrap().run(600.0).unwrap();
        ["level", "switches", "duration"].map(|name| tank.get(name).unwrap())
    });
    for (stepped, integrated) in stepped.into_iter().zip(integrated) {
        assert!((stepped - integrated).abs() < 1e-5, "{stepped} and {integrated}");
    }
}

#[test]
fn points_that_do_not_rise_are_rejected() {
    let mut tank = Simulation::<Tank>::new().unwrap();
    tank.set_array("levels", [0.0, 0.5, 1.0, 5.0]).unwrap();
    let error = tank.set("levels[2]", 1.0).err().unwrap();
    assert_eq!(error.to_string(), "levels must rise");
    assert_eq!(tank.get("levels[2]").unwrap(), 0.5);
}

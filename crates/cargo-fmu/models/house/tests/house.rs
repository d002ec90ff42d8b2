//! The model as it is, without FMI.

use fmu_export::*;
use house::{House, Name};

fn house(weather: &str) -> Result<House, Error> {
    let resources = concat!(env!("CARGO_MANIFEST_DIR"), "/modelDescription/resources");
    let setup =
        Setup { resource_location: Some(resources.to_owned()), ..Setup::new(Interface::CoSimulation) };
    let mut house = House::new(&setup)?;
    House::TABLE[Name::weather as usize].set(&mut house, &Value::String(weather.to_owned()));
    house.update()?;
    house.calculate(0.0);
    Ok(house)
}

fn real(house: &House, name: Name) -> f64 {
    match House::TABLE[name as usize].value(house) {
        Some(Value::Real(value)) => value,
        other => panic!("{name:?} is {other:?}"),
    }
}

#[test]
fn the_weather_is_that_of_the_table() {
    let mut house = house("winter.csv").unwrap();
    for (hour, outside) in [(0.0, -4.0), (4.5, -5.75), (24.0 + 13.0, 1.5)] {
        house.calculate(hour * 3600.0);
        assert!((real(&house, Name::outside) - outside).abs() < 1e-9, "at {hour} h");
    }
}

#[test]
fn what_is_no_table_is_refused() {
    for weather in ["summer.csv", "../../Cargo.toml"] {
        let error = house(weather).err().expect("there is no such table").to_string();
        assert!(error.starts_with(&format!("weather {weather:?}: ")), "{error}");
    }
}

/// Small steps and large ones come to the same day.
#[test]
fn a_day_does_not_depend_on_the_steps() {
    let day = |steps: u32| {
        let mut house = house("winter.csv").unwrap();
        let size = 86400.0 / f64::from(steps);
        for k in 0..steps {
            house.step(Step::new(f64::from(k) * size, size)).unwrap();
        }
        real(&house, Name::room)
    };
    let (coarse, fine) = (day(1), day(2880));
    assert!((coarse - fine).abs() < 1e-3, "{coarse} and {fine}");
}

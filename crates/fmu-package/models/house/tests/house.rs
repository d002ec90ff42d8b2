//! Simulations of the model.

use fmu_export::*;
use house::House;

fn house(weather: &str) -> Result<Simulation<House>, Error> {
    let resources = concat!(env!("CARGO_MANIFEST_DIR"), "/modelDescription/resources");
    let mut house = Simulation::with_resources(resources)?;
    house.set("weather", weather)?.initialize()?;
    Ok(house)
}

#[test]
fn the_weather_follows_the_table() {
    let mut house = house("winter.csv").unwrap();
    for (hour, outside) in [(0.0, -4.0), (4.5, -5.75), (24.0 + 13.0, 1.5)] {
        let found = house.run(hour * 3600.0).unwrap().get("outside").unwrap();
        assert!((found - outside).abs() < 1e-9, "{found} at {hour} h");
    }
    let messages = house.messages();
    let read = |(_, text): &(Status, String)| text == "read 9 temperatures from winter.csv";
    assert!(messages.iter().any(read), "{messages:?}");
}

#[test]
fn invalid_tables_are_rejected() {
    for weather in ["summer.csv", "../../Cargo.toml"] {
        let error = house(weather).err().expect("there is no such table").to_string();
        assert!(error.contains(weather), "{error}");
    }
}

/// Small and large steps give the same temperature within 1 mK.
#[test]
fn a_day_does_not_depend_on_the_steps() {
    let day = |steps: f64| {
        let mut house = house("winter.csv").unwrap();
        house.step_size(86400.0 / steps).run(86400.0).unwrap().get("room").unwrap()
    };
    let (coarse, fine) = (day(1.0), day(2880.0));
    assert!((coarse - fine).abs() < 1e-3, "{coarse} and {fine}");
}

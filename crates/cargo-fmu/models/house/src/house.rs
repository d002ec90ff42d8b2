//! The house: a table in a file that the FMU brings, texts, units with an offset.

use fmu_export::*;
use std::path::PathBuf;

/// A house of one room, which the heating warms and the weather cools.
#[derive(Clone)]
pub struct House {
    heating: f64,
    room: f64,
    capacity: f64,
    loss: f64,
    weather: String,
    /// The hours of a day and how warm it is outside then, degC.
    table: Vec<(f64, f64)>,
    /// The file that it is from.
    read: String,
    outside: f64,
    resources: Option<PathBuf>,
    log: Log,
}

const CELSIUS: Unit = Unit::new("degC").K(1).offset(273.15);
const TEMPERATURE: Type = Type::real("Temperature", &CELSIUS).min(-273.15).nominal(10.0);
const RATE: Type = Type::real("TemperatureRate", &Unit::new("K/s").K(1).s(-1)).nominal(1e-3);
const POWER: Type = Type::real("Power", &Unit::new("W").kg(1).m(2).s(-3)).nominal(1000.0);
const CAPACITY: Type =
    Type::real("HeatCapacity", &Unit::new("J/K").kg(1).m(2).s(-2).K(-1)).min(1e4).max(1e9).nominal(1e6);
const LOSS: Type = Type::real("ThermalConductance", &Unit::new("W/K").kg(1).m(2).s(-3).K(-1))
    .min(1.0)
    .max(1e4)
    .nominal(100.0);

variables! { for House, memory in table, read;
    /// Of the heating
    heating = input(&POWER) in heating;
    /// In the room
    room = output(&TEMPERATURE).state() in room;
    /// Rate of the room's
    der_room as "der(room)" = local(&RATE).derivative_of(room) by |house| house.rate();
    /// Outside, after the table
    outside = output(&TEMPERATURE) by |house| house.outside;
    /// How it feels in the room
    comfort = output(&STRING) by |house| house.comfort().to_owned();
    /// Of air and walls
    capacity = parameter(&CAPACITY) in capacity;
    /// Through the walls, for each kelvin of difference
    loss = parameter(&LOSS) in loss;
    /// The file in the FMU's resources with the temperatures of a day
    weather = parameter(&STRING) in weather;
}

impl House {
    fn rate(&self) -> f64 {
        (self.heating - self.loss * (self.room - self.outside)) / self.capacity
    }

    fn comfort(&self) -> &'static str {
        match self.room {
            room if room < 18.0 => "cold",
            room if room > 24.0 => "hot",
            _ => "comfortable",
        }
    }

    /// Of the table, straight lines between its hours; every day is like the first.
    fn outside_at(&self, time: f64) -> f64 {
        let hour = (time / 3600.0).rem_euclid(24.0);
        let after = self.table.partition_point(|(given, _)| *given <= hour);
        match (after.checked_sub(1).and_then(|before| self.table.get(before)), self.table.get(after)) {
            (Some(begin), Some(end)) => begin.1 + (hour - begin.0) / (end.0 - begin.0) * (end.1 - begin.1),
            (Some(nearest), None) | (None, Some(nearest)) => nearest.1,
            (None, None) => 0.0,
        }
    }

    fn read_table(&self) -> Result<Vec<(f64, f64)>, Error> {
        let name = &self.weather;
        let fault = |fault: String| Error::new(format!("weather {name:?}: {fault}"));
        // Without an importer, as in a test, there are no resources.
        let Some(folder) = &self.resources else { return Ok(Vec::new()) };
        if name.contains(['/', '\\', ':']) || name.starts_with('.') {
            return Err(fault("name a file in the FMU's folder resources".to_owned()));
        }
        let bytes = read_resource(folder.join(name)).map_err(|error| fault(error.to_string()))?;
        let text = String::from_utf8(bytes).map_err(|error| fault(error.to_string()))?;
        let number = |text: &str| text.trim().parse().ok().filter(|number: &f64| number.is_finite());
        let row = |line: &str| {
            let (hour, temperature) = line.split_once(',')?;
            Some((number(hour)?, number(temperature)?))
        };
        let rows = text.lines().skip(1).filter(|line| !line.trim().is_empty());
        let table: Vec<_> = rows
            .map(|line| row(line).ok_or_else(|| fault(format!("{line:?} is no hour and temperature"))))
            .collect::<Result<_, _>>()?;
        if !table.is_sorted_by(|one, next| one.0 < next.0) {
            return Err(fault("its hours must rise".to_owned()));
        }
        Ok(table)
    }
}

impl Model for House {
    const INFO: Info = Info {
        description: "House with a heating and the weather of a day",
        default_experiment: DefaultExperiment {
            stop_time: 86400.0,
            step_size: 60.0,
            ..DefaultExperiment::DEFAULT
        },
        ..info!("House", "house")
    };

    fn new(setup: &Setup) -> Result<Self, Error> {
        let mut house = Self {
            heating: 3000.0,
            room: 20.0,
            capacity: 5e6,
            loss: 150.0,
            weather: "winter.csv".to_owned(),
            table: Vec::new(),
            read: String::new(),
            outside: 0.0,
            resources: setup.resources(),
            log: Log::default(),
        };
        house.update()?;
        house.calculate(0.0);
        Ok(house)
    }

    /// A file that cannot be read is refused, and the house stays as it is.
    fn update(&mut self) -> Result<(), Error> {
        if self.weather != self.read {
            self.table = self.read_table()?;
            self.read.clone_from(&self.weather);
            self.log.event(format!("read {} temperatures from {}", self.table.len(), self.weather));
        }
        Ok(())
    }

    fn calculate(&mut self, time: f64) {
        self.outside = self.outside_at(time);
    }

    fn log(&mut self) -> Option<&mut Log> {
        Some(&mut self.log)
    }
}

impl CoSimulation for House {
    /// In parts of five minutes at most, in which the weather is taken as it is in the middle; the rest is exact.
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        const PART: f64 = 300.0;
        const MOST: f64 = 1e6;
        let parts = (step.size / PART).ceil();
        if parts > MOST {
            return Err(Error::new(format!("a step may have {} s at most", MOST * PART)));
        }
        let size = step.size / parts;
        let mut room = self.room;
        for part in 0..parts as u32 {
            let outside = self.outside_at(step.time + (f64::from(part) + 0.5) * size);
            let end = outside + self.heating / self.loss;
            room = end + (room - end) * (-size * self.loss / self.capacity).exp();
        }
        if !room.is_finite() {
            return Err(Error::new("no house gets as warm as that"));
        }
        self.room = room;
        Ok(Stepped::Done)
    }
}

impl ModelExchange for House {}

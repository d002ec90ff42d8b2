//! A house with a table that is read from a file in the FMU, with strings, and with units that have an offset.

use fmu_export::*;

/// A house of one room, which the heating warms and the weather cools.
#[derive(Clone)]
pub struct House {
    heating: f64,
    room: f64,
    capacity: f64,
    loss: f64,
    weather: String,
    /// Outside temperatures in degC over the hours of a day.
    table: LookupTable,
    /// Name of the file from which the table was read.
    read: String,
    outside: f64,
    setup: Setup,
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
    /// Power of the heating
    heating = input(&POWER) in heating;
    /// Temperature in the room
    room = output(&TEMPERATURE).state() in room;
    /// Rate of the temperature in the room
    der_room as "der(room)" = local(&RATE).derivative_of(room) by |house| house.rate();
    /// Temperature outside, from the table
    outside = output(&TEMPERATURE) by |house| house.outside;
    /// Comfort in the room
    comfort = output(&STRING) by |house| house.comfort().to_owned();
    /// Heat capacity of air and walls
    capacity = parameter(&CAPACITY) in capacity;
    /// Heat flow through the walls per kelvin of difference
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

    /// Returns the temperature outside, which repeats every day.
    fn outside_at(&self, time: f64) -> f64 {
        self.table.at((time / 3600.0).rem_euclid(24.0))
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
            table: LookupTable::default(),
            read: String::new(),
            outside: 0.0,
            setup: setup.clone(),
            log: Log::default(),
        };
        house.update()?;
        house.calculate(0.0);
        Ok(house)
    }

    /// Rejects a file that is not a table; the house then does not change.
    fn update(&mut self) -> Result<(), Error> {
        if self.weather != self.read {
            self.table = LookupTable::read(&self.setup.resource(&self.weather)?)?;
            self.read.clone_from(&self.weather);
            let count = self.table.xs().len();
            self.log.event(format!("read {count} temperatures from {}", self.weather));
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
    /// Solves the equation exactly in intervals of at most five minutes, in which the weather is taken as constant.
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        let mut room = self.room;
        for part in step.parts(300.0)? {
            let outside = self.outside_at(part.time + 0.5 * part.size);
            let end = outside + self.heating / self.loss;
            room = end + (room - end) * (-part.size * self.loss / self.capacity).exp();
        }
        if !room.is_finite() {
            return Err(Error::new("the temperature would not be finite; look at the heating"));
        }
        self.room = room;
        Ok(Stepped::Done)
    }
}

impl ModelExchange for House {}

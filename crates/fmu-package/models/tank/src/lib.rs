//! A tank that a pump keeps filled.

use fmu_export::*;

enumeration! {
    /// Positions of the valve in the outlet.
    pub enum Valve {
        /// Nothing flows out
        Closed = 1,
        /// Half of the flow
        Half = 2,
        /// All of the flow
        Open = 3,
    }
}

const LEVEL: Type = Type::real("Level", &Unit::new("m").m(1)).min(0.0).max(100.0);
const RATE: Type = Type::real("Velocity", &Unit::new("m/s").m(1).s(-1)).nominal(0.01);
const M3_PER_S: Unit = Unit::new("m3/s").m(3).s(-1).display("l/min", 60_000.0, 0.0);
const FLOW: Type = Type::real("VolumeFlow", &M3_PER_S).nominal(0.01);
const AREA: Type = Type::real("Area", &Unit::new("m2").m(2)).min(1e-3).max(1e3);
const VOLUME: Type = Type::real("Volume", &Unit::new("m3").m(3)).min(0.0).max(1e3);
const DURATION: Type = Type::real("Time", &units::S);
const VALVE: Type = Type::enumeration("Valve", <Valve as Enumeration>::ITEMS);

variables! {
    /// A tank with a pump that is on or off.
    pub struct Tank {
        /// The time at which the pump was switched last, s.
        since: f64,
        /// The value of the input `bucket` at the last event.
        was_poured: bool,
        /// The time to which the other values belong, s.
        time: f64,
        log: Log,
    }, memory in since, was_poured;

    /// From other sources
    inflow: f64 = input(&FLOW);
    /// Position of the valve
    valve: Valve = input(&VALVE).start(Valve::Open);
    /// When it becomes true, a bucket is emptied into the tank
    bucket: bool = input(&BOOLEAN);
    /// Above the bottom
    level: f64 = output(&LEVEL).state().reinit().start(1.0);
    /// Rate of the level
    der_level as "der(level)" = local(&RATE).derivative_of(level) by |tank| tank.rate(tank.level);
    /// Whether the pump is on
    pumping: bool = output(&BOOLEAN).exact();
    /// The number of times that the pump was switched
    switches: i32 = output(&INTEGER).exact();
    /// The time at which the pump was switched last
    switched_at = output(&DURATION).discrete() by |tank| tank.since;
    /// Time since the pump was switched
    duration = output(&DURATION) by |tank| tank.time - tank.since;
    /// Name of the mode
    mode = output(&STRING) by |tank| if tank.pumping { "filling" } else { "draining" }.to_owned();
    /// Cross section
    area: f64 = parameter(&AREA).start(1.0);
    /// Flow of the pump
    pump: f64 = parameter(&FLOW).start(0.03);
    /// The pump starts here
    low: f64 = parameter(&LEVEL).start(0.5);
    /// The pump stops here
    high: f64 = parameter(&LEVEL).start(1.5);
    /// Content of the bucket
    poured: f64 = parameter(&VOLUME).start(0.2);
    /// Points of the characteristic, rising
    levels: [f64; 4] = parameter(&LEVEL).start([0.0, 1.0, 2.0, 3.0]);
    /// Flows through the open valve at these levels
    flows: [f64; 4] = parameter(&FLOW).start([0.0, 0.01, 0.02, 0.03]);
}

impl Tank {
    fn rate(&self, level: f64) -> f64 {
        let pump = if self.pumping { self.pump } else { 0.0 };
        let opening = match self.valve {
            Valve::Closed => 0.0,
            Valve::Half => 0.5,
            Valve::Open => 1.0,
        };
        (self.inflow + pump - opening * interpolate(&self.levels, &self.flows, level)) / self.area
    }

    /// The distance to the level at which the pump is switched, m.
    fn distance(&self, level: f64) -> f64 {
        if self.pumping { self.high - level } else { level - self.low }
    }
}

impl Model for Tank {
    const INFO: Info = Info {
        description: "Tank with a pump that is on or off",
        default_experiment: DefaultExperiment {
            stop_time: 600.0,
            step_size: 1.0,
            ..DefaultExperiment::DEFAULT
        },
        ..info!("Tank", "tank")
    };

    fn update(&mut self) -> Result<(), Error> {
        if !self.levels.is_sorted_by(|one, next| one < next) {
            return Err(Error::new("levels must rise"));
        }
        if self.low >= self.high {
            return Err(Error::new("low must be below high"));
        }
        Ok(())
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Error> {
        self.since = experiment.start_time;
        Ok(())
    }

    fn calculate(&mut self, time: f64) {
        self.time = time;
    }

    fn log(&mut self) -> Option<&mut Log> {
        Some(&mut self.log)
    }
}

impl CoSimulation for Tank {
    const EVENTS: Events = Events::Stop;

    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        if self.bucket != self.was_poured {
            return Ok(Stepped::Event(step.time));
        }
        let mut level = self.level;
        for part in step.parts(0.1)? {
            let after = |part: Step| rk4([level], part, |_, [level]| [self.rate(level)])[0].max(0.0);
            let event = find_event(part, Crossing::Falling, 1e-9, |part| self.distance(after(part)));
            level = after(event.unwrap_or(part));
            if !level.is_finite() {
                return Err(Error::new("the level would not be finite; look at the flows"));
            }
            if let Some(event) = event {
                self.level = level;
                return Ok(Stepped::Event(event.end()));
            }
        }
        self.level = level;
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Tank {
    const INDICATORS: usize = 1;

    fn indicators(&self, indicators: &mut [f64]) {
        indicators[0] = self.distance(self.level);
    }

    fn event(&mut self, time: f64) -> Result<Event, Error> {
        let poured = self.bucket && !self.was_poured;
        self.was_poured = self.bucket;
        if poured {
            self.level += self.poured / self.area;
        }
        if self.distance(self.level) <= 0.0 {
            self.pumping = !self.pumping;
            self.switches = self.switches.saturating_add(1);
            self.since = time;
            self.log.event(format!("the pump is switched at {time:.1} s"));
        }
        Ok(Event { states_changed: poured, ..Event::default() })
    }
}

export_fmu!(Tank: CoSimulation + ModelExchange);

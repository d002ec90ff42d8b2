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

/// A tank with a pump that is on or off.
#[derive(Clone)]
pub struct Tank {
    inflow: f64,
    valve: Valve,
    bucket: bool,
    level: f64,
    pumping: bool,
    switches: i32,
    area: f64,
    pump: f64,
    low: f64,
    high: f64,
    poured: f64,
    levels: [f64; 4],
    flows: [f64; 4],
    /// The time at which the pump was switched last, s.
    since: f64,
    /// The value of the input `bucket` at the last event.
    was_poured: bool,
    /// The time to which the other values belong, s.
    time: f64,
    log: Log,
}

const LEVEL: Type = Type::real("Level", &Unit::new("m").m(1)).min(0.0).max(100.0);
const RATE: Type = Type::real("Velocity", &Unit::new("m/s").m(1).s(-1)).nominal(0.01);
const M3_PER_S: Unit = Unit::new("m3/s").m(3).s(-1).display("l/min", 60_000.0, 0.0);
const FLOW: Type = Type::real("VolumeFlow", &M3_PER_S).nominal(0.01);
const AREA: Type = Type::real("Area", &Unit::new("m2").m(2)).min(1e-3).max(1e3);
const VOLUME: Type = Type::real("Volume", &Unit::new("m3").m(3)).min(0.0).max(1e3);
const DURATION: Type = Type::real("Time", &units::S);
const VALVE: Type = Type::enumeration("Valve", <Valve as Enumeration>::ITEMS);

variables! { for Tank, memory in since, was_poured;
    /// From other sources
    inflow = input(&FLOW) in inflow;
    /// Position of the valve
    valve = input(&VALVE) in valve;
    /// When it becomes true, a bucket is emptied into the tank
    bucket = input(&BOOLEAN) in bucket;
    /// Above the bottom
    level = output(&LEVEL).state().reinit() in level;
    /// Rate of the level
    der_level as "der(level)" = local(&RATE).derivative_of(level) by |tank| tank.rate(tank.level);
    /// Whether the pump is on
    pumping = output(&BOOLEAN).exact() in pumping;
    /// The number of times that the pump was switched
    switches = output(&INTEGER).exact() in switches;
    /// The time at which the pump was switched last
    switched_at = output(&DURATION).discrete() by |tank| tank.since;
    /// Time since the pump was switched
    duration = output(&DURATION) by |tank| tank.time - tank.since;
    /// Name of the mode
    mode = output(&STRING) by |tank| if tank.pumping { "filling" } else { "draining" }.to_owned();
    /// Cross section
    area = parameter(&AREA) in area;
    /// Flow of the pump
    pump = parameter(&FLOW) in pump;
    /// The pump starts here
    low = parameter(&LEVEL) in low;
    /// The pump stops here
    high = parameter(&LEVEL) in high;
    /// Content of the bucket
    poured = parameter(&VOLUME) in poured;
    /// Points of the characteristic, rising
    levels = parameter(&LEVEL) in levels;
    /// Flows through the open valve at these levels
    flows = parameter(&FLOW) in flows;
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

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self {
            inflow: 0.0,
            valve: Valve::Open,
            bucket: false,
            level: 1.0,
            pumping: false,
            switches: 0,
            area: 1.0,
            pump: 0.03,
            low: 0.5,
            high: 1.5,
            poured: 0.2,
            levels: [0.0, 1.0, 2.0, 3.0],
            flows: [0.0, 0.01, 0.02, 0.03],
            since: 0.0,
            was_poured: false,
            time: 0.0,
            log: Log::default(),
        })
    }

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

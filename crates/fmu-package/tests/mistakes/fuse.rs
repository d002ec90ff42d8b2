//! A model whose only events happen if its input moves. The inputs of a build do not, so only the author's own motion shows mistakes in
//! these events.
#![allow(missing_docs, unsafe_code)]

mod field;
mod mistake;

use field::Field;
use fmu_export::*;
use mistake::{mistake, read_mistake};
use std::sync::atomic::{AtomicI32, Ordering};

/// A fuse that a current heats, x' = u - x. It trips at x = 0.5, and is then cold again. [`mistake`] selects a mistake.
struct Fuse {
    u: f64,
    x: f64,
    wear: f64,
    trips: i32,
    /// The time of the last trip, s.
    tripped: Field<f64>,
    /// The time of the next sample, s, and the sampled heat.
    next: Field<f64>,
    sample: f64,
    steps: i32,
}

const CURRENT: Type = Type::real("Current", &units::ONE);

variables! { for Fuse, memory in tripped, next, steps;
    /// Current
    u = input(&CURRENT) in u;
    /// Heat
    x = output(&NUMBER).state().reinit() in x;
    /// Rate of the heat
    der_x as "der(x)" = local(&NUMBER).derivative_of(x) by |fuse| fuse.u - fuse.x;
    /// Wear
    wear = output(&NUMBER).state() in wear;
    /// Rate of the wear
    der_wear as "der(wear)" = local(&NUMBER).derivative_of(wear) by |fuse| fuse.rate_of_wear(fuse.wear);
    /// Number of trips
    trips = output(&INTEGER).exact() in trips;
    /// Time of the last trip
    tripped = output(&NUMBER).discrete() by |fuse| fuse.tripped.value;
    /// Heat at the last sample
    sample = output(&NUMBER).discrete().exact() in sample;
    /// Whether the fuse is warm
    warm = output(&BOOLEAN) by |fuse| mistake() == "warm" && fuse.x > 0.3;
    /// Noise
    noise = output(&NUMBER) by |fuse| fuse.x + if fuse.trips > 0 { fuse.noise() } else { 0.0 };
}

/// The number of trips of all instances.
static TRIPS: AtomicI32 = AtomicI32::new(0);

impl Clone for Fuse {
    fn clone(&self) -> Self {
        let Self { u, x, wear, trips, sample, steps, .. } = *self;
        let [tripped, next] = [&self.tripped, &self.next].map(Clone::clone);
        let tripped = if mistake() == "clone" { Field::new("tripped", 0.0) } else { tripped };
        Self { u, x, wear, trips, tripped, next, sample, steps }
    }
}

impl Fuse {
    fn rate_of_wear(&self, wear: f64) -> f64 {
        self.u - 2.0 * wear
    }

    fn noise(&self) -> f64 {
        match mistake() {
            "static" => f64::from(TRIPS.load(Ordering::Relaxed)),
            // Each step size has other values, as if they were random.
            "erratic" => (0.618 * f64::from(self.steps)).fract(),
            _ => 0.0,
        }
    }

    fn after(&self, x: f64, size: f64) -> f64 {
        // A step whose error halves with its size.
        let size = if mistake() == "coarse" { size * (1.0 + 20.0 * size) } else { size };
        self.u + (x - self.u) * (-size).exp()
    }
}

impl Model for Fuse {
    const INFO: Info = Info::new("Fuse", "fuse");

    fn new(setup: &Setup) -> Result<Self, Error> {
        read_mistake(setup);
        let [tripped, next] = ["tripped", "next"].map(|name| Field::new(name, 0.0));
        Ok(Self { u: 0.0, x: 0.0, wear: 0.0, trips: 0, tripped, next, sample: 0.0, steps: 0 })
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Error> {
        self.next.value = experiment.start_time + 10.5;
        Ok(())
    }
}

impl ModelExchange for Fuse {
    const INDICATORS: usize = 1;

    fn indicators(&self, indicators: &mut [f64]) {
        indicators[0] = 0.5 - self.x;
    }

    fn event(&mut self, time: f64) -> Result<Event, Error> {
        if time >= self.next.value {
            self.sample = self.x;
            self.next.value += 0.5;
        }
        let trips = self.x >= 0.5;
        if trips {
            self.x = 0.0;
            self.wear += if mistake() == "wear" { 0.1 } else { 0.0 };
            self.tripped.value = time;
            self.trips += 1;
            TRIPS.fetch_add(1, Ordering::Relaxed);
        }
        let next = (mistake() != "unannounced").then_some(self.next.value);
        Ok(Event { next, states_changed: trips && mistake() != "unreported", ..Event::default() })
    }
}

impl CoSimulation for Fuse {
    const EVENTS: Events = Events::Stop;

    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        let part = Step::new(step.time, step.size.min(self.next.value - step.time).max(0.0));
        let x = self.x;
        let trip = find_event(part, Crossing::Falling, 1e-9, |part| 0.5 - self.after(x, part.size));
        let until = trip.unwrap_or(part);
        self.x = self.after(x, until.size);
        self.steps += 1;
        self.wear = self.u / 2.0 + (self.wear - self.u / 2.0) * (-2.0 * until.size).exp();
        Ok(if trip.is_some() || self.next.value < step.end() {
            Stepped::Event(until.end())
        } else {
            Stepped::Done
        })
    }
}

export_fmu!(Fuse: CoSimulation + ModelExchange);

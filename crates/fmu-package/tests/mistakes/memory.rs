//! A model whose saved states lack one of the fields that it remembers.
#![allow(missing_docs, unsafe_code)]

mod field;
mod mistake;

use field::Field;
use fmu_export::*;
use mistake::{mistake, read_mistake};

/// Remembers the integral of its input, the last input, its output, the step size and the number of events. It also has a copy of the
/// gain, which needs no memory because `update` restores it.
#[derive(Clone)]
struct Memory {
    u: f64,
    gain: f64,
    cached: f64,
    sum: Field<f64>,
    last: Field<f64>,
    ticks: Field<i32>,
    shown: Field<f64>,
    is_moving: bool,
    size: Field<f64>,
}

variables! { for Memory, memory in gain, is_moving, sum, last, ticks, shown, size;
    /// Input
    u = input(&NUMBER) in u;
    /// Output of the last step
    y = output(&NUMBER) by |model| model.shown.value;
    /// Number of events
    n = output(&INTEGER) by |model| model.ticks.value;
}

impl Model for Memory {
    const INFO: Info = Info::new("Memory", "memory");

    fn new(setup: &Setup) -> Result<Self, Error> {
        read_mistake(setup);
        let [sum, last, shown, size] = ["sum", "last", "shown", "size"].map(|name| Field::new(name, 0.0));
        let ticks = Field::new("ticks", 0);
        Ok(Self { u: 1.0, gain: 2.0, cached: 2.0, sum, last, ticks, shown, is_moving: false, size })
    }

    fn update(&mut self) -> Result<(), Error> {
        self.cached = self.gain;
        if self.is_moving && self.size.value <= 0.0 {
            return Err(Error::new("there is no step size"));
        }
        Ok(())
    }
}

impl CoSimulation for Memory {
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        self.sum.value += self.u * step.size;
        self.shown.value = self.cached * self.sum.value + (self.u - self.last.value) / step.size;
        self.last.value = self.u;
        (self.is_moving, self.size.value) = (true, step.size);
        if mistake() == "random" {
            self.shown.value = dice();
        }
        Ok(Stepped::Done)
    }
}

/// Returns another number at each call, as if it were random.
fn dice() -> f64 {
    use std::sync::atomic::{AtomicI32, Ordering};
    static THROWS: AtomicI32 = AtomicI32::new(0);
    f64::from(THROWS.fetch_add(1, Ordering::Relaxed))
}

impl ModelExchange for Memory {
    fn event(&mut self, _: f64) -> Result<Event, Error> {
        self.ticks.value += 1;
        Ok(Event::default())
    }
}

export_fmu!(Memory: CoSimulation + ModelExchange);

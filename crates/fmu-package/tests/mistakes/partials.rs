//! A model with wrong partial derivatives, dependencies or values.
#![allow(missing_docs, unsafe_code)]

mod mistake;

use fmu_export::*;
use mistake::{mistake, read_mistake};

#[derive(Clone)]
struct Square {
    u: f64,
    gain: f64,
    time: f64,
}

variables! { for Square;
    /// Input
    u = input(&NUMBER) in u;
    /// Input without a Partials
    v = input(&NUMBER) in gain;
    /// Square of the input, plus the time
    y = output(&NUMBER).depends_on(&[u, Index::TIME]) by |model| {
        let offset = match mistake() {
            "not finite" => f64::NAN,
            "hidden" => model.time + 1e-3 * model.gain,
            _ => model.time,
        };
        model.u * model.u + offset
    };
    /// Product of both, whose derivatives the model does not provide
    z = output(&NUMBER).depends_on(&[u, v]) by |model| model.u * model.gain;
}

impl Model for Square {
    const INFO: Info = Info::new("Square", "square");

    fn new(setup: &Setup) -> Result<Self, Error> {
        read_mistake(setup);
        Ok(Self { u: 0.0, gain: 1.0, time: 0.0 })
    }

    fn calculate(&mut self, time: f64) {
        self.time = time;
    }
}

impl CoSimulation for Square {
    fn step(&mut self, _: Step) -> Result<Stepped, Error> {
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Square {}

impl Partials for Square {
    fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
        let factor = match mistake() {
            "partial" => 2.001,
            "no number" => f64::NAN,
            _ => 2.0,
        };
        match (unknown, known) {
            (Name::y, Name::u) => Some(factor * self.u),
            (Name::y, Name::v) => Some(0.0),
            _ => None,
        }
    }

    fn initial_partial(&self, unknown: Name, known: Name) -> Option<f64> {
        match (unknown, known) {
            (Name::y, Name::u) => Some(if mistake() == "initial_partial" { 0.0 } else { 2.0 * self.u }),
            _ => self.partial(unknown, known),
        }
    }

    fn partial_by_time(&self, unknown: Name) -> Option<f64> {
        let factor = if mistake() == "partial_by_time" { 0.0 } else { 1.0 };
        (unknown == Name::y).then_some(factor)
    }
}

export_fmu!(Square: CoSimulation + ModelExchange + Partials);

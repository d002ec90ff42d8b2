//! A model whose numbers live in every kind of place, and that steps at once if it can.

use fmu_export::*;
use std::ops::{Index, IndexMut};

#[derive(Clone, Default)]
pub struct Wire {
    value: f64,
    is_set: bool,
}

/// Two numbers whose first changes its place in memory with every step.
#[derive(Clone, Default)]
pub struct Ring {
    begin: usize,
    values: [f64; 2],
}

impl Index<usize> for Ring {
    type Output = f64;

    fn index(&self, index: usize) -> &f64 {
        &self.values[(self.begin + index) % 2]
    }
}

impl IndexMut<usize> for Ring {
    fn index_mut(&mut self, index: usize) -> &mut f64 {
        &mut self.values[(self.begin + index) % 2]
    }
}

/// Adds up its inputs. The level starts at one of them.
#[derive(Clone, Default)]
pub struct Meter {
    plain: f64,
    wires: [Wire; 2],
    boxed: Box<Wire>,
    list: Vec<f64>,
    ring: Ring,
    counted: i32,
    level: f64,
    has_started: bool,
    total: f64,
    steps_at_once: i32,
}

variables! { for Meter, memory in has_started, ring.begin, ring.values, counted, steps_at_once;
    /// In a field
    plain = input(&NUMBER) in plain;
    /// In an array, with a mark
    first = input(&NUMBER) in wires[0].value then wires[0].is_set;
    /// In an array, with a mark and an action
    second = input(&NUMBER) in wires[1].value then wires[1].is_set then |meter| { meter.counted += 1 };
    /// Behind a pointer, and so is its mark
    boxed = input(&NUMBER) in boxed.value then boxed.is_set;
    /// In a vector
    listed = input(&NUMBER) in list[1];
    /// In a place that changes
    moving = input(&NUMBER) in ring[0];
    /// The sum as it was calculated
    total = output(&NUMBER) from total;
    /// The same, calculated when it is read
    sum = output(&NUMBER) by |meter| meter.sum();
    /// How many of the marks are set, and how often the second wire was
    marks = output(&INTEGER) by |meter| {
        10 * meter.counted + meter.wires.iter().chain([&*meter.boxed]).map(|wire| i32::from(wire.is_set)).sum::<i32>()
    };
    /// Starts at the number in a field
    level = output(&NUMBER).state().calculated().depends_on(plain) in level then |meter| { meter.has_started = true };
    /// Its rate
    der_level as "der(level)" = local(&NUMBER).derivative_of(level) by |_| 1.0;
    /// Steps that were made at once
    steps_at_once = local(&INTEGER) by |meter| meter.steps_at_once;
}

impl Meter {
    fn sum(&self) -> f64 {
        let wires = self.wires.iter().chain([&*self.boxed]).map(|wire| wire.value);
        self.plain + wires.sum::<f64>() + self.list[1] + self.ring[0]
    }
}

impl Model for Meter {
    const INFO: Info = Info { guid: "{meter}", ..info!("Meter", "meter") };

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self { list: vec![0.0; 3], ..Self::default() })
    }

    fn calculate(&mut self, _: f64) {
        self.total = self.sum();
    }

    fn calculate_start(&mut self) {
        if !self.has_started {
            self.level = self.plain;
        }
    }
}

impl CoSimulation for Meter {
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        self.has_started = true;
        self.level += step.size;
        self.ring.begin += 1;
        self.wires.iter_mut().chain([&mut *self.boxed]).for_each(|wire| wire.is_set = false);
        if step.size == 2.0 {
            self.total = self.sum();
            return Ok(Stepped::Calculated);
        }
        Ok(Stepped::Done)
    }

    /// One of size 1 can be made at once.
    fn step_at_once(&mut self, size: f64) -> bool {
        if size != 1.0 {
            return false;
        }
        self.steps_at_once += 1;
        let stepped = self.step(Step::new(0.0, size));
        self.total = self.sum();
        stepped.is_ok()
    }
}

impl ModelExchange for Meter {
    fn continuous_time_entered(&mut self) {
        self.has_started = true;
    }
}

offer!(Meter: CoSimulation + ModelExchange);

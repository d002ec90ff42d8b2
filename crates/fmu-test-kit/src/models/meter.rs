//! A model that stores Reals wherever a model may store them, because the fast paths access plain fields by their offsets, and must leave all
//! others to the general path. It also has a state whose start value is calculated, and `step_fast`.

use fmu_export::*;
use std::ops::{Index, IndexMut};

/// A value, and a mark that its setter sets.
#[derive(Clone, Default)]
pub struct Marked {
    value: f64,
    is_set: bool,
}

/// Two numbers that exchange their indices in every step, so that element 0 changes its address.
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

/// Adds up its inputs. A level on a spring follows the first of them.
#[derive(Clone, Default)]
pub struct Meter {
    plain: f64,
    marked: [Marked; 2],
    boxed: Box<Marked>,
    list: Vec<f64>,
    ring: Ring,
    counted: i32,
    level: f64,
    stiffness: f64,
    has_started: bool,
    total: f64,
    fast_steps: i32,
}

const STIFFNESS: Type = Type::real("Stiffness", &units::ONE).min(0.5);

variables! { for Meter, memory in has_started, ring.begin, ring.values, counted, fast_steps,
    marked[0].is_set, marked[1].is_set, boxed.is_set;
    /// In a field
    plain = input(&NUMBER) in plain;
    /// In an array, with a mark
    first = input(&NUMBER) in marked[0].value then marked[0].is_set;
    /// In an array, with a mark and an action
    second = input(&NUMBER) in marked[1].value then marked[1].is_set then |meter| { meter.counted += 1 };
    /// Behind a pointer, and so is its mark
    boxed = input(&NUMBER) in boxed.value then boxed.is_set;
    /// In a vector
    listed = input(&NUMBER) in list[1];
    /// In an element that changes
    moving = input(&NUMBER) in ring[0];
    /// The sum as it was calculated
    total = output(&NUMBER) from total;
    /// Sum, calculated when it is read
    sum = output(&NUMBER) by |meter| meter.sum();
    /// Number of marks that are set, plus 10 times the number of times that the second input was set
    marks = output(&INTEGER) by |meter| {
        10 * meter.counted + meter.marked.iter().chain([&*meter.boxed]).map(|input| i32::from(input.is_set)).sum::<i32>()
    };
    /// Starts at rest: at the number in a field, divided by the stiffness
    level = output(&NUMBER).state().calculated().depends_on(&[plain, stiffness]) in level
        then |meter| { meter.has_started = true };
    /// Rate of the level
    der_level as "der(level)" = local(&NUMBER).derivative_of(level) by |meter| meter.plain - meter.stiffness * meter.level;
    /// Stiffness of the spring that carries the level
    stiffness = parameter(&STIFFNESS) in stiffness;
    /// Steps that `step_fast` made
    fast_steps = local(&INTEGER) by |meter| meter.fast_steps;
}

impl Meter {
    fn sum(&self) -> f64 {
        let marked = self.marked.iter().chain([&*self.boxed]).map(|input| input.value);
        self.plain + marked.sum::<f64>() + self.list[1] + self.ring[0]
    }
}

impl Model for Meter {
    const INFO: Info = info!("Meter", "meter");

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self { list: vec![0.0; 3], stiffness: 1.0, ..Self::default() })
    }

    fn calculate(&mut self, _: f64) {
        self.total = self.sum();
    }

    fn calculate_start(&mut self) {
        if !self.has_started {
            self.level = (self.plain / self.stiffness).clamp(f64::MIN, f64::MAX);
        }
    }
}

impl CoSimulation for Meter {
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        self.has_started = true;
        self.level += step.size;
        self.ring.begin += 1;
        self.marked.iter_mut().chain([&mut *self.boxed]).for_each(|input| input.is_set = false);
        if step.size == 2.0 {
            self.total = self.sum();
            return Ok(Stepped::Calculated);
        }
        Ok(Stepped::Done)
    }
}

/// Only steps of size 1 are fast.
impl FastSteps for Meter {
    fn step_fast(&mut self, size: f64) -> bool {
        if size != 1.0 {
            return false;
        }
        self.fast_steps += 1;
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

impl Partials for Meter {
    fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
        Some(match (unknown, known) {
            (Name::level, Name::level) | (Name::der_level, Name::plain) => 1.0,
            (Name::der_level, Name::level) => -self.stiffness,
            (Name::der_level, Name::stiffness) => -self.level,
            (Name::total | Name::sum, Name::level | Name::stiffness) => 0.0,
            (Name::total | Name::sum, _) => 1.0,
            _ => 0.0,
        })
    }

    /// In the initialization, level = plain / stiffness.
    fn initial_partial(&self, unknown: Name, known: Name) -> Option<f64> {
        Some(match (unknown, known) {
            (Name::total | Name::sum, _) => return self.partial(unknown, known),
            (Name::level, Name::plain) => 1.0 / self.stiffness,
            (Name::level, Name::stiffness) => -self.plain / (self.stiffness * self.stiffness),
            _ => 0.0,
        })
    }
}

offer!(Meter: CoSimulation + FastSteps + ModelExchange + Partials);

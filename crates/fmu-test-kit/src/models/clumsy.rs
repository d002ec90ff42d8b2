//! Models that overwrite their fields before they fail, for tests that the library undoes failed calls.

use fmu_export::*;

/// The call that fails, as a value of the parameter `fails`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum Fails {
    Nothing,
    Step,
    /// The step that begins at an event.
    StepAfterEvent,
    Event,
    Initialize,
    Update,
}

/// Defines such a model. `$memory` is the type of `trace`, which stores the last three numbers.
macro_rules! clumsy {
    ($model:ident, $names:ident, $memory:ty) => {
        #[derive(Clone, Default)]
        pub struct $model {
            u: f64,
            x: f64,
            count: i32,
            gain: f64,
            fails: i32,
            trace: $memory,
            /// Sum of `trace`, which is not saved; `restored` calculates it again.
            sum: f64,
            /// Gain times u, calculated by `update` and `calculate`.
            product: f64,
            next: f64,
            /// Equal to u until the first step.
            level: f64,
            has_stepped: bool,
            /// Calculated only by `calculate`.
            shown: f64,
        }

        variables! { for $model, names $names, memory in trace, next, level, has_stepped;
            /// Input
            u = input(&NUMBER) in u;
            /// State
            x = output(&NUMBER).state() in x;
            /// Its rate
            der_x as "der(x)" = local(&NUMBER).derivative_of(x) by |model| model.product;
            /// Number of events
            count = output(&INTEGER).exact() in count;
            /// Follows the memory
            sum = output(&NUMBER) from sum;
            /// The first u
            level = output(&NUMBER) by |model| model.level;
            /// Calculated
            shown = output(&NUMBER) from shown;
            /// Parameter
            gain = parameter(&NUMBER) in gain;
            /// What fails
            fails = parameter(&INTEGER) in fails;
        }

        impl $model {
            /// If `fails` is true, overwrites the fields and returns an error.
            fn fail_if(&mut self, fails: bool) -> Result<(), Error> {
                if !fails {
                    return Ok(());
                }
                (self.u, self.x, self.count, self.gain) = (-1e3, -2e3, -3, -4e3);
                (self.next, self.product, self.fails) = (-5e3, -6e3, 0);
                (self.level, self.shown) = (-8e3, -9e3);
                self.collect(-7e3);
                Err(Error::new("it has failed half-way"))
            }

            fn collect(&mut self, number: f64) {
                Collects::collect(&mut self.trace, number);
                self.sum = self.trace.iter().fold(0.0, |sum, number| sum + number);
            }
        }

        impl Model for $model {
            const INFO: Info = Info {
                ..info!(stringify!($model), "clumsy")
            };

            fn new(_: &Setup) -> Result<Self, Error> {
                Ok(Self { gain: 2.0, ..Self::default() })
            }

            fn update(&mut self) -> Result<(), Error> {
                self.fail_if(self.fails == Fails::Update as i32)?;
                self.product = self.gain * self.u;
                Ok(())
            }

            fn restored(&mut self) -> Result<(), Error> {
                self.sum = self.trace.iter().fold(0.0, |sum, number| sum + number);
                Ok(())
            }

            fn initialize(&mut self, experiment: &Experiment) -> Result<(), Error> {
                self.fail_if(self.fails == Fails::Initialize as i32)?;
                self.next = experiment.start_time + 1.0;
                Ok(())
            }

            fn calculate(&mut self, time: f64) {
                self.product = self.gain * self.u;
                self.shown = self.x + time;
            }

            fn calculate_start(&mut self) {
                if !self.has_stepped {
                    self.level = self.u;
                }
            }
        }

        impl CoSimulation for $model {
            const EVENTS: Events = Events::Stop;

            fn step(&mut self, step: Step) -> Result<Stepped, Error> {
                let end = (step.time + step.size).min(self.next);
                self.has_stepped = true;
                self.x += self.gain * self.u * (end - step.time);
                self.collect(self.x);
                self.fail_if(self.fails == Fails::Step as i32)?;
                let is_after_event = step.time == self.next - 1.0 && self.count > 0;
                self.fail_if(is_after_event && self.fails == Fails::StepAfterEvent as i32)?;
                Ok(if end == self.next { Stepped::Event(end) } else { Stepped::Done })
            }
        }

        impl ModelExchange for $model {
            fn continuous_time_entered(&mut self) {
                self.has_stepped = true;
            }

            fn event(&mut self, time: f64) -> Result<Event, Error> {
                if time >= self.next {
                    self.count = self.count.saturating_add(1);
                    self.next += 1.0;
                    self.collect(time);
                    self.fail_if(self.fails == Fails::Event as i32)?;
                }
                Ok(Event { next: Some(self.next), ..Event::default() })
            }
        }

        offer!($model: CoSimulation + ModelExchange);
    };
}

/// A memory of three numbers.
trait Collects {
    /// Adds a number, and removes the oldest one if there are already three.
    fn collect(&mut self, number: f64);
}

impl Collects for [f64; 3] {
    fn collect(&mut self, number: f64) {
        self.rotate_left(1);
        self[2] = number;
    }
}

impl Collects for Vec<f64> {
    fn collect(&mut self, number: f64) {
        if self.len() == 3 {
            self.remove(0);
        }
        self.push(number);
    }
}

clumsy!(Clumsy, ClumsyName, [f64; 3]);
clumsy!(ClumsyOnHeap, ClumsyOnHeapName, Vec<f64>);

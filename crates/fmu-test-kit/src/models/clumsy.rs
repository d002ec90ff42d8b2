//! Models that overwrite their fields before they fail, for tests that the library undoes failed calls. Their steps stop at
//! events, which have two iterations.

use fmu_export::*;

enumeration! {
    /// The call that fails.
    pub enum Failure {
        /// Nothing
        Nothing = 0,
        /// Every step
        Step = 1,
        /// A step that begins at an event
        StepAfterEvent = 2,
        /// The second iteration of an event
        Event = 3,
        /// The initialization
        Initialize = 4,
        /// The calculation that follows new parameters
        Update = 5,
    }
}

const FAILURE: Type = Type::enumeration("Failure", <Failure as Enumeration>::ITEMS);

/// Defines such a model. `$memory` is the type of `trace`, which stores the last three numbers, and `$log` the type of its log.
macro_rules! clumsy {
    ($model:ident, $names:ident, $memory:ty, $log:ty) => {
        variables! {
            pub struct $model {
                trace: $memory,
                sum: f64,
                level: f64,
                shown: f64,
                /// Gain times u, calculated by `update` and `calculate`.
                product: f64,
                next: f64,
                has_stepped: bool,
                log: $log,
            }, names $names, memory in trace, next, level, has_stepped;

            /// What fails
            fails: Failure = parameter(&FAILURE).start(Failure::Nothing);
            /// Input
            u: f64 = input(&NUMBER);
            /// State
            x: f64 = output(&NUMBER).state();
            /// Its rate
            der_x as "der(x)" = local(&NUMBER).derivative_of(x) by |model| model.product;
            /// Number of iterations of events
            rounds: i32 = output(&INTEGER).exact();
            /// Sum of the memory, which is not saved; `restored` calculates it again
            sum = output(&NUMBER) from sum;
            /// The input until the first step
            level = output(&NUMBER) by |model| model.level;
            /// State plus time, which only `calculate` calculates
            shown = output(&NUMBER) from shown;
            /// Parameter
            gain: f64 = parameter(&NUMBER).start(2.0);
        }

        impl $model {
            /// If `failure` is what fails, overwrites the fields and returns an error.
            fn fail_at(&mut self, failure: Failure) -> Result<(), Error> {
                if self.fails != failure {
                    return Ok(());
                }
                self.log.note(format!("{failure:?} will fail"));
                (self.u, self.x, self.rounds, self.gain) = (-1e3, -2e3, -3, -4e3);
                (self.next, self.product, self.fails) = (-5e3, -6e3, Failure::Nothing);
                (self.level, self.shown) = (-8e3, -9e3);
                self.collect(-7e3);
                Err(Error::new(format!("{failure:?} has failed half-way")))
            }

            fn collect(&mut self, number: f64) {
                Collects::collect(&mut self.trace, number);
                self.sum = self.trace.iter().fold(0.0, |sum, number| sum + number);
            }
        }

        impl Model for $model {
            const INFO: Info = Info { ..info!(stringify!($model), "clumsy") };

            fn new(_: &Setup) -> Result<Self, Error> {
                let mut model = Self::default();
                model.log.note("made".to_owned());
                Ok(model)
            }

            fn update(&mut self) -> Result<(), Error> {
                self.fail_at(Failure::Update)?;
                self.product = self.gain * self.u;
                Ok(())
            }

            fn restored(&mut self) -> Result<(), Error> {
                self.sum = self.trace.iter().fold(0.0, |sum, number| sum + number);
                Ok(())
            }

            fn initialize(&mut self, experiment: &Experiment) -> Result<(), Error> {
                self.fail_at(Failure::Initialize)?;
                self.next = experiment.start_time;
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

            fn log(&mut self) -> Option<&mut Log> {
                self.log.log()
            }
        }

        impl CoSimulation for $model {
            const EVENTS: Events = Events::Stop;

            fn step(&mut self, step: Step) -> Result<Stepped, Error> {
                let end = (step.time + step.size).min(self.next);
                self.has_stepped = true;
                self.x += self.gain * self.u * (end - step.time);
                self.collect(self.x);
                self.fail_at(Failure::Step)?;
                if step.time == self.next - 1.0 && self.rounds > 2 {
                    self.fail_at(Failure::StepAfterEvent)?;
                }
                if end < self.next {
                    return Ok(Stepped::Done);
                }
                self.log.note(format!("stops at {end}"));
                Ok(Stepped::Event(end))
            }
        }

        impl ModelExchange for $model {
            fn continuous_time_entered(&mut self) {
                self.has_stepped = true;
            }

            /// Begins at the start, and has two iterations every second.
            fn event(&mut self, time: f64) -> Result<Event, Error> {
                let mut again = false;
                if time >= self.next {
                    self.rounds = self.rounds.saturating_add(1);
                    self.collect(time);
                    again = self.rounds % 2 == 1;
                    if !again {
                        self.next += 1.0;
                        self.fail_at(Failure::Event)?;
                    }
                }
                Ok(Event { again, next: Some(self.next), ..Event::default() })
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

/// A log, or none.
trait Notes {
    fn note(&mut self, _: String) {}

    fn log(&mut self) -> Option<&mut Log> {
        None
    }
}

impl Notes for () {}

impl Notes for Log {
    fn note(&mut self, message: String) {
        self.event(message);
    }

    fn log(&mut self) -> Option<&mut Log> {
        Some(self)
    }
}

clumsy!(Clumsy, ClumsyName, [f64; 3], ());
clumsy!(ClumsyOnHeap, ClumsyOnHeapName, Vec<f64>, Log);

//! A model is rejected if its `memory` lacks a field, because the field would be missing in saved states.

use crate::{BOTH, described, model};
use fmu_export::*;
use fmu_package::{Changes, describe};

/// Declares models that differ only in the fields of their `memory`. Each model remembers the integral of its input, the last input,
/// its output, the step size and the number of events. It also has a copy of the gain, which needs no memory because `update`
/// restores it.
macro_rules! models {
    ($($case:ident: $($memory:ident),*;)+) => { $(
        mod $case {
            use super::*;

            #[derive(Clone)]
            pub struct Memory {
                u: f64,
                gain: f64,
                cached: f64,
                sum: f64,
                last: f64,
                ticks: i32,
                shown: f64,
                is_moving: bool,
                size: f64,
            }

            variables! { for Memory, memory in gain, is_moving $(, $memory)*;
                /// Input
                u = input(&NUMBER) in u;
                /// Output of the last step
                y = output(&NUMBER) by |model| model.shown;
                /// Number of events
                n = output(&INTEGER) by |model| model.ticks;
            }

            impl Model for Memory {
                const INFO: Info = Info::new("Memory", "memory");

                fn new(_: &Setup) -> Result<Self, Error> {
                    let (gain, is_moving) = (2.0, false);
                    let [sum, last, shown, size] = [0.0; 4];
                    Ok(Self { u: 1.0, gain, cached: gain, sum, last, ticks: 0, shown, is_moving, size })
                }

                fn update(&mut self) -> Result<(), Error> {
                    self.cached = self.gain;
                    if self.is_moving && self.size <= 0.0 {
                        return Err(Error::new("there is no step size"));
                    }
                    Ok(())
                }
            }

            impl CoSimulation for Memory {
                fn step(&mut self, step: Step) -> Result<Stepped, Error> {
                    self.sum += self.u * step.size;
                    self.shown = self.cached * self.sum + (self.u - self.last) / step.size;
                    self.last = self.u;
                    (self.is_moving, self.size) = (true, step.size);
                    Ok(Stepped::Done)
                }
            }

            impl ModelExchange for Memory {
                fn event(&mut self, _: f64) -> Result<Event, Error> {
                    self.ticks += 1;
                    Ok(Event::default())
                }
            }

            offer!(Memory: CoSimulation + ModelExchange);
        }
    )+ };
}

models! {
    whole: sum, last, shown, ticks, size;
    without_last: sum, shown, ticks, size;
    without_sum: last, shown, ticks, size;
    without_shown: last, sum, ticks, size;
    without_size: last, sum, shown, ticks;
    without_ticks: sum, last, shown, size;
}

/// Asserts that a model is rejected with this consequence of the missing field.
fn rejected<M: Exported>(consequence: &str) {
    for fmi in BOTH {
        let text = describe(&model::<M>(), fmi, &Changes::default()).unwrap_err().to_string();
        let remedy =
            "; name every field that initialize, a step or an event changes after `memory in` of variables!";
        assert!(text.starts_with("saved states lack something that Memory remembers: "), "{text}");
        assert!(text.ends_with(&format!("{consequence}{remedy}")), "{text}");
    }
}

#[test]
fn missing_fields_are_found() {
    described(&model::<whole::Memory>(), BOTH[0]);
    rejected::<without_last::Memory>("Co-Simulation, values differ after 1 more: y");
    rejected::<without_sum::Memory>("Co-Simulation, values differ after 1 more: y");
    rejected::<without_shown::Memory>("Co-Simulation, values differ immediately: y");
    rejected::<without_size::Memory>("Co-Simulation, it is rejected: there is no step size");
    rejected::<without_ticks::Memory>("Model Exchange, values differ immediately: n");
}

/// A model whose repetitions differ: each step takes the next number of a counter that all instances share, as if it were random.
/// Such differences prove nothing about saved states.
mod dice {
    use super::*;
    use std::sync::atomic::{AtomicI32, Ordering};

    static THROWS: AtomicI32 = AtomicI32::new(0);

    #[derive(Clone)]
    pub struct Dice {
        thrown: i32,
    }

    variables! { for Dice, memory in thrown;
        /// Number of the last throw
        pips = output(&INTEGER) by |dice| dice.thrown;
    }

    impl Model for Dice {
        const INFO: Info = Info::new("Dice", "dice");

        fn new(_: &Setup) -> Result<Self, Error> {
            Ok(Self { thrown: 0 })
        }
    }

    impl CoSimulation for Dice {
        fn step(&mut self, _: Step) -> Result<Stepped, Error> {
            self.thrown = THROWS.fetch_add(1, Ordering::Relaxed);
            Ok(Stepped::Done)
        }
    }

    offer!(Dice: CoSimulation);
}

#[test]
fn random_models_are_accepted() {
    described(&model::<dice::Dice>(), BOTH[0]);
}

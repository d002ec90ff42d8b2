//! A field that is missing in the `memory` of a model would be missing in saved states: the model is refused.

mod common;

use common::{fmi2, fmi3};
use fmu_export::*;
use fmu_package::Changes;

/// A model that remembers the sum of what it was given, the last of it, what it shows, the step size and how many events there
/// were; and a copy of the gain, which `update` makes anew.
macro_rules! models {
    ($($case:ident: $($memory:ident),*;)+) => { $(
        mod $case {
            use super::*;

            #[derive(Clone)]
            pub struct Toy {
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

            variables! { for Toy, memory in gain, is_moving $(, $memory)*;
                /// Input
                u = input(&NUMBER) in u;
                /// Output of the last step
                y = output(&NUMBER) by |toy| toy.shown;
                /// Number of events
                n = output(&INTEGER) by |toy| toy.ticks;
            }

            impl Model for Toy {
                const INFO: Info = Info::new("Toy", "toy", "{toy}");

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

            impl CoSimulation for Toy {
                fn step(&mut self, step: Step) -> Result<Stepped, Error> {
                    self.sum += self.u * step.size;
                    self.shown = self.cached * self.sum + (self.u - self.last) / step.size;
                    self.last = self.u;
                    (self.is_moving, self.size) = (true, step.size);
                    Ok(Stepped::Done)
                }
            }

            impl ModelExchange for Toy {
                fn event(&mut self, _: f64) -> Result<Event, Error> {
                    self.ticks += 1;
                    Ok(Event::default())
                }
            }

            offer!(Toy: CoSimulation + ModelExchange);
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

#[test]
fn what_is_missing_is_found() {
    let changes = Changes::default();
    fmi2::describe::<whole::Toy>(&changes).unwrap();
    for (described, consequence) in [
        (
            fmi2::describe::<without_last::Toy>(&changes),
            "Co-Simulation, there are other values after 1 more: y",
        ),
        (
            fmi3::describe::<without_sum::Toy>(&changes),
            "Co-Simulation, there are other values after 1 more: y",
        ),
        (fmi2::describe::<without_shown::Toy>(&changes), "Co-Simulation, there are other values at once: y"),
        (
            fmi2::describe::<without_size::Toy>(&changes),
            "Co-Simulation, it is refused: there is no step size",
        ),
        (fmi3::describe::<without_ticks::Toy>(&changes), "Model Exchange, there are other values at once: n"),
    ] {
        let text = described.unwrap_err().to_string();
        let remedy =
            "; name every field that initialize, a step or an event changes behind `memory in` of variables!";
        assert!(text.starts_with("saved states lack something that Toy remembers: "), "{text}");
        assert!(text.ends_with(&format!("{consequence}{remedy}")), "{text}");
    }
}

/// Every throw is another one: that says nothing about what is saved.
mod dice {
    use super::*;
    use std::sync::atomic::{AtomicI32, Ordering};

    static THROWS: AtomicI32 = AtomicI32::new(0);

    #[derive(Clone)]
    pub struct Dice {
        thrown: i32,
    }

    variables! { for Dice, memory in thrown;
        /// What was thrown
        pips = output(&INTEGER) by |dice| dice.thrown;
    }

    impl Model for Dice {
        const INFO: Info = Info::new("Dice", "dice", "{dice}");

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
fn models_that_play_dice_are_not_judged() {
    fmi2::describe::<dice::Dice>(&Changes::default()).unwrap();
}

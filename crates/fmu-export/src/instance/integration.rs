//! Integration of Model Exchange, as an importer does it, for the tests of authors.

use super::co_simulation::{CHATTER, MOST_EVENTS};
use super::{Instance, Outcome, reject};
use crate::capabilities::Step;
use crate::export::Exported;
use crate::integrate::{locate, runge_kutta};
use fmi_abi::BaseType;

/// Largest error of a step, relative to the value of a state or to its nominal value, whichever is larger.
const TOLERANCE: f64 = 1e-10;

/// Tolerance for the time of an event, relative to the step in which it is searched.
const TOLERANCE_OF_EVENT: f64 = 1e-10;

/// States at the end of a step, and the estimated error relative to the tolerance.
struct Stepped {
    states: Vec<f64>,
    error: f64,
}

impl<M: Exported> Instance<M> {
    /// Integrates from Event Mode to Event Mode, with steps of at most `longest`, until this time or until the model ends
    /// the simulation. Events are handled where they happen, and discrete inputs that were set before take effect.
    pub fn integrate(&mut self, until: f64, longest: f64) -> Outcome {
        let mut next = self.handle_event()?.next;
        let mut size = longest;
        let (mut events, mut counted_from) = (0, self.state.time);
        while self.state.time < until && !self.state.ended {
            self.enter_continuous_time_mode();
            let begin = self.state.time;
            let due = next.filter(|next| *next > begin && *next <= until);
            let crossed = self.advance(due.unwrap_or(until), longest, &mut size)?;
            let completed = self.step_completed();
            self.state.ended |= completed.terminate;
            self.enter_event_mode()?;
            if crossed || completed.event || due.is_some_and(|due| due <= self.state.time) {
                next = self.handle_event()?.next;
                events += 1;
            }
            if self.state.time - counted_from > longest {
                (events, counted_from) = (0, self.state.time);
            }
            if events > MOST_EVENTS {
                return reject(format!("there are more than {MOST_EVENTS} events in {longest} s; {CHATTER}"));
            }
        }
        Ok(())
    }

    /// Makes one step towards `end` whose error is within the tolerance, and chooses the size of the next one. If an event
    /// indicator changes its sign, the step ends right after that; returns whether it does.
    fn advance(&mut self, end: f64, longest: f64, size: &mut f64) -> Outcome<bool> {
        let (begin, states, signs) = (self.state.time, self.states()?, self.signs()?);
        let (step, stepped) = loop {
            let step = Step::new(begin, size.min(longest).min(end - begin));
            let stepped = self.twice(&states, step)?;
            let factor = (0.9 * stepped.error.powf(-0.2)).clamp(0.2, 4.0);
            if stepped.error <= 1.0 {
                // A step that an event or the end has shortened does not shorten the following ones.
                *size = if step.size < *size { size.max(factor * step.size) } else { factor * *size };
                *size = size.min(longest);
                break (step, stepped);
            }
            *size = factor * step.size;
            if begin + *size == begin {
                return reject(format!("the derivatives at {begin} s are too steep for any step"));
            }
        };
        let reached = if step.size == end - begin { end } else { step.end() };
        self.go_to(reached, &stepped.states)?;
        if self.signs()? == signs {
            return Ok(false);
        }
        let mut failed = Ok(());
        let part = locate(step, [1.0, -1.0], true, TOLERANCE_OF_EVENT * step.size, |part| {
            let same = self.twice(&states, part).and_then(|stepped| {
                self.go_to(part.end(), &stepped.states)?;
                Ok(self.signs()? == signs)
            });
            match same {
                Ok(false) => -1.0,
                Ok(true) => 1.0,
                Err(rejection) => {
                    failed = Err(rejection);
                    -1.0
                }
            }
        });
        failed?;
        if part.size < step.size {
            let stepped = self.twice(&states, part)?;
            self.go_to(part.end(), &stepped.states)?;
        }
        Ok(true)
    }

    /// Makes a step at once and in two halves, whose difference shows the error.
    fn twice(&mut self, states: &Vec<f64>, step: Step) -> Outcome<Stepped> {
        let mut rates = |time, states: Vec<f64>| {
            self.go_to(time, &states)?;
            self.reals(|state| state.derivative)
        };
        let half = Step { size: 0.5 * step.size, ..step };
        let whole = runge_kutta(states, step, &mut rates)?;
        let middle = runge_kutta(states, half, &mut rates)?;
        let mut states = runge_kutta(&middle, Step { time: half.end(), ..half }, &mut rates)?;
        let mut error = 0.0_f64;
        for ((state, whole), of) in states.iter_mut().zip(whole).zip(M::STATES) {
            let nominal = M::TABLE[of.state as usize].variable_type().nominal_or_one();
            // The method has order 4, so half the step has 1/16 of the error.
            let difference = (*state - whole) / 15.0;
            error = error.max(difference.abs() / (TOLERANCE * state.abs().max(nominal)));
            *state += difference;
        }
        Ok(Stepped { states, error })
    }

    fn go_to(&mut self, time: f64, states: &[f64]) -> Outcome {
        self.set_time(time)?;
        self.set_continuous_states(states)
    }

    fn states(&mut self) -> Outcome<Vec<f64>> {
        self.reals(|state| state.state)
    }

    fn reals(&mut self, which: fn(&crate::table::StateOfTable) -> u32) -> Outcome<Vec<f64>> {
        let indices: Vec<u32> = M::STATES.iter().map(which).collect();
        let mut values = Vec::with_capacity(indices.len());
        self.get(&indices, &[BaseType::Real], &mut |_, value| values.push(value.real()))?;
        Ok(values)
    }

    /// Returns for each event indicator whether it is above zero.
    fn signs(&mut self) -> Outcome<Vec<bool>> {
        Ok(self.indicators()?.into_iter().map(|indicator| indicator > 0.0).collect())
    }
}

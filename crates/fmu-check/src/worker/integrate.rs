//! Integrates an FMU in Model Exchange with steps of a fixed size and with events, as a simple importer does.

use super::executor::Executor;
use crate::call_sequence::{Arg, Integration, Kind, Outcome, Values};

/// Maximum number of events in an integration; a model with more is not compared.
const MOST_EVENTS: usize = 200;

/// Number of bisections that find the time of a state event.
const BISECTIONS: usize = 40;

/// Status of an integration that was not finished: Discard.
const UNFINISHED: i32 = 2;

/// An integration in progress.
struct Importer<'a> {
    executor: &'a Executor,
    instance: usize,
    how: &'a Integration,
    fmi3: bool,
    time: f64,
    /// Times of all events.
    events: Vec<f64>,
    /// Number of events other than time events: state events, and events that the FMU requests after a step.
    state_events: usize,
}

/// Status of a call that failed, or `UNFINISHED`.
type Failed = i32;

impl Importer<'_> {
    fn call(&self, function: &str, args: Vec<Arg>) -> Result<Outcome, Failed> {
        let mut outcome = Outcome::default();
        let name = format!("{}{function}", if self.fmi3 { "fmi3" } else { "fmi2" });
        self.executor.call(Some(self.instance), &name, &args, &mut outcome);
        match outcome.status {
            Some(0 | 1) => Ok(outcome),
            status => Err(status.unwrap_or(3)),
        }
    }

    /// Reads a vector of `count` numbers.
    fn vector(&self, function: &str, count: usize) -> Result<Vec<f64>, Failed> {
        if count == 0 {
            return Ok(Vec::new());
        }
        let outcome = self.call(function, vec![Arg::Out(Kind::F64, count), Arg::Integer(count as i64)])?;
        Ok(outcome.written.first().map(Values::numbers).unwrap_or_default())
    }

    /// Sets the time and the states.
    fn set(&self, time: f64, states: &[f64]) -> Result<(), Failed> {
        self.call("SetTime", vec![Arg::real(time)])?;
        if !states.is_empty() {
            let bits = states.iter().map(|state| state.to_bits()).collect();
            self.call(
                "SetContinuousStates",
                vec![Arg::In(Kind::F64, bits), Arg::Integer(states.len() as i64)],
            )?;
        }
        Ok(())
    }

    /// Returns the derivatives at a time and states.
    fn slopes(&self, time: f64, states: &[f64]) -> Result<Vec<f64>, Failed> {
        self.set(time, states)?;
        let name = if self.fmi3 { "GetContinuousStateDerivatives" } else { "GetDerivatives" };
        self.vector(name, self.how.states)
    }

    /// Advances from the states by a step of Euler's method or of the classical Runge-Kutta method. Sets the new states and
    /// returns them.
    fn advance(&self, states: &[f64], size: f64) -> Result<Vec<f64>, Failed> {
        let plus = |by: f64, slopes: &[f64]| -> Vec<f64> {
            states.iter().zip(slopes).map(|(state, slope)| state + by * slope).collect()
        };
        let first = self.slopes(self.time, states)?;
        let reached = if self.how.euler {
            plus(size, &first)
        } else {
            let middle = self.time + size / 2.0;
            let second = self.slopes(middle, &plus(size / 2.0, &first))?;
            let third = self.slopes(middle, &plus(size / 2.0, &second))?;
            let fourth = self.slopes(self.time + size, &plus(size, &third))?;
            let mean: Vec<f64> = (0..states.len())
                .map(|index| (first[index] + 2.0 * (second[index] + third[index]) + fourth[index]) / 6.0)
                .collect();
            plus(size, &mean)
        };
        self.set(self.time + size, &reached)?;
        Ok(reached)
    }

    /// Returns whether an event indicator has changed its sign.
    fn crosses(&self, before: &[f64]) -> Result<bool, Failed> {
        let now = self.vector("GetEventIndicators", self.how.indicators)?;
        Ok(before.iter().zip(&now).any(|(before, now)| (*before > 0.0) != (*now > 0.0)))
    }

    /// Advances by a step of this size, or to a state event within it; returns whether there is one.
    fn step(&mut self, mut size: f64) -> Result<bool, Failed> {
        let states = self.vector("GetContinuousStates", self.how.states)?;
        let before = self.vector("GetEventIndicators", self.how.indicators)?;
        self.advance(&states, size)?;
        let crosses = self.crosses(&before)?;
        if crosses {
            let mut low = 0.0;
            for _ in 0..BISECTIONS {
                let middle = f64::midpoint(low, size);
                self.advance(&states, middle)?;
                if self.crosses(&before)? { size = middle } else { low = middle }
            }
            // The event is at the end of the interval, where an indicator has changed.
            self.advance(&states, size)?;
        }
        self.time += size;
        Ok(crosses)
    }

    /// Integrates to the end.
    fn run(&mut self) -> Result<(), Failed> {
        let how = self.how;
        let size = (how.end - how.begin) / how.steps as f64;
        let close = 1e-9 * size;
        while self.time < how.end - close {
            let next = self.executor.next_event(self.instance);
            let until = (self.time + size).min(how.end).min(next.max(self.time));
            let crosses = until > self.time && self.step(until - self.time)?;
            if !crosses {
                // Sets the exact time, without the rounding error of the sum.
                self.time = if how.end - until < close { how.end } else { until };
                self.call("SetTime", vec![Arg::real(self.time)])?;
            }
            let flag = Arg::Out(if self.fmi3 { Kind::U8 } else { Kind::I32 }, 1);
            let outcome = self.call("CompletedIntegratorStep", vec![Arg::Integer(1), flag.clone(), flag])?;
            let is_set =
                |index: usize| outcome.written.get(index).is_some_and(|flag| flag.numbers() != [0.0]);
            if is_set(1) {
                return Err(UNFINISHED);
            }
            if crosses || is_set(0) || next <= self.time {
                self.event(crosses || is_set(0))?;
            }
        }
        Ok(())
    }

    /// Handles an event; fails if the model ends the simulation, has too many events, or defines a next event that is not later
    /// than this one.
    fn event(&mut self, is_state_event: bool) -> Result<(), Failed> {
        self.events.push(self.time);
        self.state_events += usize::from(is_state_event);
        self.call("EnterEventMode", vec![])?;
        let update = match self.fmi3 {
            true => {
                let mut args = vec![Arg::Out(Kind::U8, 1); 5];
                args.push(Arg::Out(Kind::F64, 1));
                self.call("UpdateDiscreteStates", args)?
            }
            false => self.call("NewDiscreteStates", vec![Arg::Out(Kind::U64, 4)])?,
        };
        self.call("EnterContinuousTimeMode", vec![])?;
        let ends = match (self.fmi3, update.written.get(usize::from(self.fmi3))) {
            (true, Some(flag)) => flag.numbers() == [1.0],
            (false, Some(Values::Numbers(_, words))) => words.first().is_some_and(|word| word >> 32 != 0),
            _ => false,
        };
        let stuck = self.executor.next_event(self.instance) <= self.time;
        if ends || stuck || self.events.len() > MOST_EVENTS { Err(UNFINISHED) } else { Ok(()) }
    }
}

/// Integrates an instance. The values of the outcome are the times of the first and the last event, which are infinite if there
/// is none, and the number of events other than time events.
pub fn integrate(executor: &Executor, instance: usize, how: &Integration, outcome: &mut Outcome) {
    let fmi3 = executor.setting.fmi3;
    let mut importer =
        Importer { executor, instance, how, fmi3, time: how.begin, events: Vec::new(), state_events: 0 };
    outcome.status = Some(importer.run().err().unwrap_or(0));
    let ends =
        [importer.events.first(), importer.events.last()].map(|time| time.copied().unwrap_or(f64::INFINITY));
    let numbers = [ends[0], ends[1], importer.state_events as f64];
    outcome.written = vec![Values::new(Kind::F64, numbers)];
}

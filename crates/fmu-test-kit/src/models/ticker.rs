//! A model with periodic events, its ticks, at which its steps stop.

use fmu_export::*;

/// Ticks once in every period; each tick adds the input `amount` to `sum`.
#[derive(Clone)]
pub struct Ticker {
    amount: f64,
    sum: f64,
    last: i32,
    next: f64,
    ticks: i32,
}

variables! { for Ticker, memory in next;
    /// Amount that a tick adds
    amount = input(&NUMBER).discrete() in amount;
    /// Sum of all ticks
    sum = output(&NUMBER).discrete().exact() in sum;
    /// Number of ticks
    ticks = output(&INTEGER).exact() in ticks;
    /// Number of ticks after which the simulation ends
    last = parameter(&INTEGER) in last;
}

const PERIOD: f64 = 0.25;

impl Model for Ticker {
    const INFO: Info = info!("Ticker", "ticker");

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self { amount: 1.0, sum: 0.0, last: 1000, next: 0.0, ticks: 0 })
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Error> {
        self.next = experiment.start_time;
        Ok(())
    }
}

impl ModelExchange for Ticker {
    fn event(&mut self, time: f64) -> Result<Event, Error> {
        if time >= self.next {
            if !(self.sum + self.amount).is_finite() {
                return Err(Error::new("the sum would not be finite"));
            }
            self.sum += self.amount;
            self.ticks = self.ticks.saturating_add(1);
            self.next += PERIOD;
        }
        let terminate = self.ticks >= self.last;
        Ok(Event { again: time >= self.next, next: Some(self.next), terminate, ..Event::default() })
    }
}

impl CoSimulation for Ticker {
    const EVENTS: Events = Events::Stop;

    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        if step.time + step.size >= self.next { Ok(Stepped::Event(self.next)) } else { Ok(Stepped::Done) }
    }
}

offer!(Ticker: CoSimulation + ModelExchange);

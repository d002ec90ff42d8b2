//! A counter with a fixed period: time events with several iterations, at which steps stop; discrete inputs.

use fmu_export::*;

const PERIOD: Type = Type::real("Period", &units::S).min(1e-3).max(1e3);
const DIGITS: Type = Type::integer("Digits").min_integer(2);

variables! {
    /// Adds its input to a count at the start and after every period. If the count reaches `full`, another iteration of the
    /// event keeps only the remainder of its division by `full`.
    pub struct Counter {
        /// Time of the next count; infinity after the last one.
        next: f64,
    }, memory in next;

    /// Whether it does not count
    paused: bool = input(&BOOLEAN);
    /// Increment
    increment: i32 = input(&INTEGER).start(1);
    /// Weight of the increments; changes at events only
    weight: f64 = input(&NUMBER).discrete().start(1.0);
    /// Count
    count: i32 = output(&INTEGER).exact();
    /// Weight of all increments
    sum: f64 = output(&NUMBER).discrete().exact();
    /// Time between two counts
    period: f64 = parameter(&PERIOD).start(0.25);
    /// Smallest count that is too large
    full: i32 = parameter(&DIGITS).start(10);
    /// Sum that ends the simulation
    limit: f64 = parameter(&NUMBER).start(1e9);
}

impl Counter {
    fn tick(&mut self) -> Result<(), Error> {
        if !self.paused {
            self.count = self.count.saturating_add(self.increment);
            self.sum += self.weight * f64::from(self.increment);
        }
        if !self.sum.is_finite() {
            return Err(Error::new("the sum would not be finite"));
        }
        self.next = if self.sum < self.limit { self.next + self.period } else { f64::INFINITY };
        Ok(())
    }
}

impl Model for Counter {
    const INFO: Info = Info { description: "Counts in regular intervals", ..info!("Counter", "counter") };

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Error> {
        self.next = experiment.start_time;
        Ok(())
    }
}

impl ModelExchange for Counter {
    /// Either divides or counts, not both. If more is due at the same time, the event requests another iteration (section
    /// 3.2.2 of FMI 2.0).
    fn event(&mut self, time: f64) -> Result<Event, Error> {
        if self.count >= self.full {
            self.count %= self.full;
        } else if time >= self.next {
            self.tick()?;
        }
        let again = self.count >= self.full || time >= self.next;
        let next = Some(self.next).filter(|next| next.is_finite());
        Ok(Event { again, next, terminate: next.is_none(), ..Event::default() })
    }
}

impl CoSimulation for Counter {
    const EVENTS: Events = Events::Stop;

    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        if step.time + step.size >= self.next { Ok(Stepped::Event(self.next)) } else { Ok(Stepped::Done) }
    }
}

offer!(Counter: CoSimulation + ModelExchange);

//! A counter with a fixed period: time events, event iteration, Integers and Booleans.

use fmu_export::*;

/// Adds its input to a count in every period. When the count reaches `full`, the counter divides it by `full`: the quotient
/// is added to `carries`, and the remainder stays.
#[derive(Clone)]
pub struct Counter {
    on: bool,
    increment: i32,
    weight: f64,
    count: i32,
    carries: i32,
    sum: f64,
    period: f64,
    full: i32,
    /// Time of the next count.
    next: f64,
}

const PERIOD: Type = Type::real("Period", &units::S).min(1e-3).max(1e3);
const DIGITS: Type = Type::integer("Digits").min_integer(2);

variables! { for Counter, memory in next;
    /// Whether it counts
    on = input(&BOOLEAN) in on;
    /// Increment
    increment = input(&INTEGER) in increment;
    /// Weight of the increments; changes at events only
    weight = input(&NUMBER).discrete() in weight;
    /// Count
    count = output(&INTEGER).exact() in count;
    /// How often the count was full
    carries = output(&INTEGER).exact() in carries;
    /// Weight of all increments
    sum = output(&NUMBER).discrete().exact() in sum;
    /// Whether the count is odd
    odd = output(&BOOLEAN) by |counter| counter.count % 2 != 0;
    /// Time between two counts
    period = parameter(&PERIOD) in period;
    /// Smallest count that is too large
    full = parameter(&DIGITS) in full;
}

impl Counter {
    fn tick(&mut self) -> Result<(), Error> {
        if self.on {
            self.count = self.count.saturating_add(self.increment);
            self.sum += self.weight * f64::from(self.increment);
        }
        if !self.sum.is_finite() {
            return Err(Error::new("the sum would not be finite"));
        }
        self.next += self.period;
        Ok(())
    }

    fn carry(&mut self) {
        self.carries = self.carries.wrapping_add(self.count / self.full);
        self.count %= self.full;
    }
}

impl Model for Counter {
    const INFO: Info = Info { description: "Counts in regular intervals", ..info!("Counter", "counter") };

    fn new(_: &Setup) -> Result<Self, Error> {
        let (on, increment, weight, count, carries, sum) = (false, 1, 1.0, 0, 0, 0.0);
        Ok(Self { on, increment, weight, count, carries, sum, period: 0.1, full: 10, next: 0.1 })
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Error> {
        self.next = experiment.start_time + self.period;
        Ok(())
    }
}

impl ModelExchange for Counter {
    /// Either carries or counts, not both. If more is due at the same time, the event requests another iteration (section
    /// 3.2.2 of FMI 2.0).
    fn event(&mut self, time: f64) -> Result<Event, Error> {
        if self.count >= self.full {
            self.carry();
        } else if time >= self.next {
            self.tick()?;
        }
        let again = self.count >= self.full || time >= self.next;
        Ok(Event { again, next: Some(self.next), ..Event::default() })
    }
}

impl CoSimulation for Counter {
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        const MOST: f64 = 1000.0;
        // A tick at the end of the step belongs to this step even if a rounding error puts it just after the end.
        let end = step.time + step.size + 1e-9 * self.period;
        if end - self.next > MOST * self.period || end + self.period == end {
            return Err(Error::new(format!(
                "a step may have at most {MOST} periods, and a period must not vanish when it is added to the time"
            )));
        }
        // A step that fails must leave the model as it was.
        let mut counter = self.clone();
        while counter.next <= end {
            counter.tick()?;
            if counter.count >= counter.full {
                counter.carry();
            }
        }
        *self = counter;
        Ok(Stepped::Done)
    }
}

offer!(Counter: CoSimulation + ModelExchange);

//! Detects chattering: events that follow each other while time hardly advances.

/// Counts the events within a short time.
#[derive(Debug)]
pub(crate) struct Chatter {
    /// Time from which on events are counted, s: the start time of the run, or the time of the first counted event.
    since: f64,
    count: usize,
}

/// Number of events within a short time at which the run fails, because the model chatters.
pub(crate) const MOST_EVENTS: usize = 1000;
/// Length of a short time, relative to the magnitude of the times of the run.
const SHORT: f64 = 1e-9;

impl Chatter {
    pub fn since(time: f64) -> Self {
        Self { since: time, count: 0 }
    }

    /// Counts an event at this time, s. `scale` is the magnitude of the times of the run, s. Returns the time from which on events
    /// were counted if there are too many.
    pub fn count(&mut self, time: f64, scale: f64) -> Option<f64> {
        if time - self.since > SHORT * scale {
            (self.since, self.count) = (time, 0);
        }
        self.count += 1;
        (self.count >= MOST_EVENTS).then_some(self.since)
    }
}

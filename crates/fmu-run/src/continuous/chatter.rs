//! Detects events that follow each other without progress.

/// Counts the events in a short part of a run.
#[derive(Debug)]
pub(super) struct Chatter {
    since: f64,
    count: usize,
}

/// Number of events in such a part of the times of the run after which the model is said to chatter.
pub(super) const MOST_EVENTS: usize = 1000;
const SHORT: f64 = 1e-9;

impl Chatter {
    pub fn since(time: f64) -> Self {
        Self { since: time, count: 0 }
    }

    /// Counts an event at this time, in a run whose times have the size `scale`. Returns the time of the first event if there are
    /// too many in a short time.
    pub fn count(&mut self, time: f64, scale: f64) -> Option<f64> {
        if time - self.since > SHORT * scale {
            (self.since, self.count) = (time, 0);
        }
        self.count += 1;
        (self.count >= MOST_EVENTS).then_some(self.since)
    }
}

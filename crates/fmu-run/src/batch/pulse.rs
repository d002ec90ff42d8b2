//! Regular calls of a function during runs.

use std::time::{Duration, Instant};

/// Clock for a loop of steps. Because reading the time takes as long as a short step, it is read only once in several short steps.
pub(super) struct Pulse {
    /// Number of steps until the time is read again.
    left: u32,
    /// Number of steps between two reads of the time.
    every: u32,
    /// Time of the last read.
    read: Instant,
    /// Time of the last pulse.
    due: Instant,
}

impl Default for Pulse {
    fn default() -> Self {
        let now = Instant::now();
        Self { left: 1, every: 1, read: now, due: now }
    }
}

impl Pulse {
    /// Time between two pulses.
    pub const INTERVAL: Duration = Duration::from_millis(100);

    /// Returns whether a pulse is due. Must be called at each step.
    #[inline]
    pub fn is_due(&mut self) -> bool {
        self.is_due_by(Instant::now)
    }

    #[inline]
    fn is_due_by(&mut self, clock: impl FnOnce() -> Instant) -> bool {
        self.left -= 1;
        self.left == 0 && self.read(clock())
    }

    #[cold]
    fn read(&mut self, now: Instant) -> bool {
        const MOST: u32 = 64;
        let are_short = now - self.read < Duration::from_millis(1);
        self.every = if are_short { (2 * self.every).min(MOST) } else { (self.every / 2).max(1) };
        (self.left, self.read) = (self.every, now);
        let is_due = now - self.due >= Self::INTERVAL;
        if is_due {
            self.due = now;
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::Pulse;
    use std::cell::Cell;
    use std::time::Duration;

    /// Returns the number of pulses, and the number of reads of the clock, in `steps` steps.
    fn count(pulse: &mut Pulse, now: &Cell<std::time::Instant>, steps: u32, step: Duration) -> [u32; 2] {
        let mut found = [0; 2];
        for _ in 0..steps {
            now.set(now.get() + step);
            let reads = Cell::new(0);
            let is_due = pulse.is_due_by(|| {
                reads.set(1);
                now.get()
            });
            found[0] += u32::from(is_due);
            found[1] += reads.get();
        }
        found
    }

    #[test]
    fn pulses_are_regular_and_the_clock_is_read_rarely() {
        let mut pulse = Pulse::default();
        let now = Cell::new(pulse.read);
        let [pulses, reads] = count(&mut pulse, &now, 1_000_000, Duration::from_micros(1));
        assert!((9..=10).contains(&pulses) && reads < 1_000_000 / 60, "{pulses} {reads}");
        // If steps become long, each of them has a pulse, after at most 64 + 32 + 16 + ... further steps.
        count(&mut pulse, &now, 128, Duration::from_secs(1));
        assert_eq!(count(&mut pulse, &now, 20, Duration::from_secs(1)), [20, 20]);
    }
}

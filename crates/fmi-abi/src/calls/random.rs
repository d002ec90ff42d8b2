//! Pseudorandom numbers for programs that test FMUs. They are the same in every run.

/// Generator; its field is the state, which is initially the seed.
#[derive(Debug)]
pub struct Random(pub u64);

impl Random {
    /// Creates a generator whose first numbers differ even if seeds are consecutive numbers.
    #[must_use]
    pub fn mixed(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// Returns 64 random bits.
    pub fn bits(&mut self) -> u64 {
        // Knuth's multiplier. The low bits are less random, so the high bits are mixed into them.
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 ^ (self.0 >> 33)
    }

    /// Returns a number in this range.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.bits() >> 11) as f64 / (1_u64 << 53) as f64)
    }

    /// Returns true with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.between(0.0, 1.0) < probability
    }

    /// Returns an integer below `count`.
    ///
    /// # Panics
    /// Panics if `count` is 0.
    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() >> 33) as usize % count
    }
}

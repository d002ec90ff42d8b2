//! The exact solution for a subsystem over one step during which its motor angle changes linearly.
//!
//! With the motor angle `u0 + w s` for `0 <= s <= h`, the solution of `z' = A z + b_angle u + b_rate w` is
//!
//! ```text
//! z(h) = z + growth (z - [1, 1, 0] u0) + ramp w
//! growth = exp(A h) - 1
//! ramp   = integral over 0..h of exp(A (h - s)) (b_angle s + b_rate) ds
//! ```
//!
//! This form follows from `A [1, 1, 0] + b_angle = 0`. Because each step adds an increment to z, a testbed at rest
//! stays exactly at rest, and tiny steps lose no precision although `exp(A h)` is close to 1.

use crate::balance::{Balance, rescaled};
use crate::decoupled::{Decoupled, Subsystem};
use crate::number::{Arithmetic, Number, TwoFloat};
use crate::pair::{Pair, PitchRoll};
use nalgebra::{Matrix3, Vector3};

/// The step matrices of one subsystem for one step size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Propagator<T = f64> {
    /// `exp(A h) - 1`.
    pub growth: Matrix3<T>,
    /// Increment of z per unit of the motor rate.
    pub ramp: Vector3<T>,
}

impl<T: Number> Propagator<T> {
    /// Computes the propagator for step size `h` in s.
    pub fn new(system: &Subsystem<T>, h: f64) -> Self {
        let balance = Balance::new(&system.a);
        Equations::new(system, balance).propagate(h, balance.doublings(h.log2())).in_rad_per_s(balance)
    }

    /// Converts a propagator of scaled equations to a velocity in rad/s.
    fn in_rad_per_s(self, Balance { scale, .. }: Balance) -> Self {
        Self {
            growth: rescaled(&self.growth, 1.0 / scale),
            ramp: Vector3::new(self.ramp.x, self.ramp.y, self.ramp.z * scale.into()),
        }
    }
}

/// Equations of one subsystem, or of both in pairs.
#[derive(Clone, Copy)]
struct Equations<T> {
    a: Matrix3<T>,
    b_angle: Vector3<T>,
    b_rate: Vector3<T>,
}

impl<T: Number> Equations<T> {
    /// Creates the equations of a subsystem with the velocity in the unit of its balance.
    fn new(system: &Subsystem<T>, Balance { scale, .. }: Balance) -> Self {
        let to_scale = |z: Vector3<T>| Vector3::new(z.x, z.y, z.z / scale);
        let Subsystem { a, b_angle, b_rate, .. } = system;
        Self { a: rescaled(a, scale), b_angle: to_scale(*b_angle), b_rate: to_scale(*b_rate) }
    }
}

impl<T: Arithmetic> Equations<T> {
    /// Computes growth and ramp for step size `h` in s. A Taylor series is evaluated for a fraction of the step that is
    /// short enough for fast convergence. Doublings extend the result to the full step.
    ///
    /// Two steps in sequence give the doubling: `growth(2h) = 2 growth + growth^2` and
    /// `ramp(2h) = 2 ramp + growth (ramp - [1, 1, 0] h)`.
    fn propagate(&self, h: f64, doublings: i32) -> Propagator<T> {
        // Two factors, because a single factor would underflow for the longest steps.
        let mut h = T::from(h * 0.5_f64.powi(doublings / 2) * 0.5_f64.powi(doublings - doublings / 2));
        let ah = self.a * h;
        let mut growth_term = ah;
        let mut growth = growth_term;
        // ramp = b_rate h + (A b_rate + b_angle) h^2/2 + A (A b_rate + b_angle) h^3/6 + ...
        let mut ramp_term = (ah * self.b_rate + self.b_angle * h) * (h * T::from(0.5));
        let mut ramp = self.b_rate * h + ramp_term;
        for n in 2..=T::TAYLOR_ORDER {
            growth_term = (growth_term * ah).map(|entry| entry / f64::from(n));
            growth += growth_term;
            ramp_term = (ah * ramp_term).map(|entry| entry / f64::from(n + 1));
            ramp += ramp_term;
        }
        // The state in which both shafts are at rest at 1 rad.
        let turned = Vector3::new(T::one(), T::one(), T::zero());
        let two = T::from(2.0);
        for _ in 0..doublings {
            ramp = ramp * two + growth * (ramp - turned * h);
            growth = growth * two + growth * growth;
            h *= two;
        }
        Propagator { growth, ramp }
    }
}

/// A propagator rounded to `f64`, as used for stepping.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rounded {
    growth: Matrix3<f64>,
    ramp: Vector3<f64>,
    /// 1, or 0 if at most half of the velocity remains after the step. With 0, the step replaces the velocity
    /// instead of adding to it, because the sum would have the rounding error of the larger old velocity.
    keeps_velocity: f64,
}

impl Rounded {
    fn new<T: Number>(exact: &Propagator<T>) -> Self {
        let mut growth = exact.growth.map(T::rounded);
        let left = (exact.growth[(2, 2)] + T::one()).rounded();
        let keeps = left > 0.5;
        if !keeps {
            growth[(2, 2)] = left;
        }
        Self { growth, ramp: exact.ramp.map(T::rounded), keeps_velocity: f64::from(u8::from(keeps)) }
    }

    /// Returns the change of z at the end of the step per unit jump of the motor angle at the start of the step.
    fn after_jump(&self, system: &Subsystem) -> Vector3<f64> {
        let jump = system.b_rate;
        self.growth * jump + Vector3::new(jump.x, jump.y, jump.z * self.keeps_velocity)
    }

    /// Computes the propagators of the pitch and the roll subsystem.
    ///
    /// Up to 8 doublings cost an `f64` at most 3 digits; more doublings may cost nearly all. Stiff testbeds have
    /// motions of very different rates. What remains after the fast motion is a small difference of large numbers, and
    /// so is the remainder of a strongly damped velocity. In these cases, twice the digits are used.
    fn pitch_and_roll(system: &Decoupled, h: f64) -> [Self; 2] {
        let Decoupled { pitch, roll, balances, .. } = system;
        let log2_of_h = h.log2();
        let doublings = balances.map(|balance| balance.doublings(log2_of_h));
        let is_damped = |s: &Subsystem| -s.a[(2, 2)] * h > std::f64::consts::LN_2;
        if doublings.into_iter().any(|doublings| doublings > 8) || is_damped(pitch) || is_damped(roll) {
            let exact = Subsystem::<TwoFloat>::pitch_and_roll(&system.parameters);
            let rounded = exact.map(|subsystem| Self::new(&Propagator::new(&subsystem, h)));
            // A TwoFloat that overflows is NaN; the matrices are then computed with f64.
            if rounded.iter().all(Self::is_finite) {
                return rounded;
            }
        }
        let [pitch, roll] = [Equations::new(pitch, balances[0]), Equations::new(roll, balances[1])];
        let pairs = Equations {
            a: pitch.a.zip_map(&roll.a, Pair::new),
            b_angle: pitch.b_angle.zip_map(&roll.b_angle, Pair::new),
            b_rate: pitch.b_rate.zip_map(&roll.b_rate, Pair::new),
        };
        // Propagates pitch and roll together; usually they need equal numbers of doublings.
        let of_pitch = pairs.propagate(h, doublings[0]);
        let of_roll = if doublings[0] == doublings[1] { of_pitch } else { pairs.propagate(h, doublings[1]) };
        let propagated = [(of_pitch, 0), (of_roll, 1)].map(|(Propagator { growth, ramp }, i)| Propagator {
            growth: growth.map(|pair| pair[i]),
            ramp: ramp.map(|pair| pair[i]),
        });
        [0, 1].map(|i| Self::new(&propagated[i].in_rad_per_s(balances[i])))
    }

    fn is_finite(&self) -> bool {
        self.growth.iter().chain(&self.ramp).all(|entry| entry.is_finite())
    }
}

/// The propagators of both subsystems for one step size; each pair contains the same entry of pitch and of roll.
/// The entries contain the factor 1/2, because they multiply sums and differences of the two sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepMatrices {
    half_growth: [[PitchRoll; 3]; 3],
    half_ramp: [PitchRoll; 3],
    /// Change of z at the end of the step per unit jump of the motor angle at the start of the step.
    half_jump: [PitchRoll; 3],
    /// Half of [`Rounded::keeps_velocity`] of both subsystems. `keeps_velocities` is true if both are 1.
    half_kept: PitchRoll,
    keeps_velocities: bool,
    /// 1 / step size, 1/s.
    inverse_h: f64,
}

impl StepMatrices {
    const UNUSED: Self = Self {
        half_growth: [[ZERO; 3]; 3],
        half_ramp: [ZERO; 3],
        half_jump: [ZERO; 3],
        half_kept: ZERO,
        keeps_velocities: true,
        inverse_h: 0.0,
    };

    /// Computes the matrices for step size `h` in s.
    pub fn new(system: &Decoupled, h: f64) -> Self {
        let [pitch, roll] = Rounded::pitch_and_roll(system, h);
        let half_pairs = |pitch: Vector3<f64>, roll: Vector3<f64>| {
            std::array::from_fn(|i| PitchRoll::new(pitch[i], roll[i]) * 0.5)
        };
        let column = |j| half_pairs(pitch.growth.column(j).into(), roll.growth.column(j).into());
        let half_kept = PitchRoll::new(pitch.keeps_velocity, roll.keeps_velocity) * 0.5;
        Self {
            half_growth: [0, 1, 2].map(column),
            half_ramp: half_pairs(pitch.ramp, roll.ramp),
            half_jump: half_pairs(pitch.after_jump(&system.pitch), roll.after_jump(&system.roll)),
            half_kept,
            keeps_velocities: half_kept == PitchRoll::both(0.5),
            inverse_h: 1.0 / h,
        }
    }

    /// Returns the part of the velocity to which the increment is added, for pitch and roll. `v` is the sum and
    /// the difference of the velocities at the start of the step. Returns `None` if the increment is added to the full
    /// velocity.
    #[inline]
    pub fn remaining_velocity(&self, v: PitchRoll) -> Option<PitchRoll> {
        if self.keeps_velocities { None } else { self.damped_velocity(v) }
    }

    #[cold]
    fn damped_velocity(&self, v: PitchRoll) -> Option<PitchRoll> {
        Some(self.half_kept * v)
    }

    /// Returns the change of `z = [q_I, q_II, v]` over the step. The arguments are sums and differences of
    /// the sides: deviations `z - [1, 1, 0] u` from the motors at the start, motor rates w, and jumps of the
    /// motor angles.
    #[inline]
    pub fn increment(&self, deviation: &[PitchRoll; 3], w: PitchRoll, jump: PitchRoll) -> [PitchRoll; 3] {
        let [of_q_i, of_q_ii, of_v] = &self.half_growth;
        let row = |i: usize| {
            ((of_q_i[i] * deviation[0] + of_q_ii[i] * deviation[1])
                + (of_v[i] * deviation[2] + self.half_ramp[i] * w))
                + self.half_jump[i] * jump
        };
        [row(0), row(1), row(2)]
    }
}

const ZERO: PitchRoll = PitchRoll::both(0.0);

/// The step matrices of the most recent step sizes. Most importers use one step size or alternate among a few. The
/// latter often happens by accident, because the differences of `np.arange(n) * 1e-3` vary in their last digits.
///
/// An entry belongs to exactly one step size. Sizes that differ by rounding are not merged, because results
/// would then depend on the sizes that were used before, and a restored state would not reproduce them.
#[derive(Debug, Default)]
pub struct StepCache {
    /// Step sizes of the entries, s; 0 marks an unused entry.
    sizes: [f64; Self::SIZE],
    /// Index of the entry of the last step, and its step size, s.
    current: usize,
    current_size: f64,
    /// Index of the entry that the next new size replaces.
    oldest: usize,
    /// Number of times that matrices were computed.
    computed: u64,
    /// Always [`SIZE`](Self::SIZE) entries, except that a [`default`](Self::default) cache is empty before its first step.
    entries: Vec<StepMatrices>,
}

impl StepCache {
    const SIZE: usize = 8;

    /// Creates an empty cache that has already allocated its memory, so that a step does not allocate. A
    /// [`default`](Self::default) cache allocates its memory at the first step.
    pub fn with_capacity() -> Self {
        Self { entries: vec![StepMatrices::UNUSED; Self::SIZE], ..Self::default() }
    }

    /// Forgets all matrices but keeps their memory allocated.
    pub fn clear(&mut self) {
        (self.sizes, self.current_size) = ([0.0; _], 0.0);
    }

    /// Returns the current matrices; `None` if the cache has not allocated its memory. They are valid only for a step
    /// size for which [`has`](Self::has) returns true.
    #[inline(always)]
    pub fn current(&self) -> Option<&StepMatrices> {
        self.entries.get(self.current)
    }

    /// Returns 1 / step size of the last step, 1/s.
    pub fn inverse_of_current(&self) -> f64 {
        self.current().map_or(0.0, |matrices| matrices.inverse_h)
    }

    /// Returns whether the [current](Self::current) matrices are for step size `h > 0`.
    #[inline(always)]
    pub fn has(&self, h: f64) -> bool {
        self.current_size == h
    }

    /// Makes the matrices for step size `h > 0` the current ones. Returns false if the cache does not contain
    /// them.
    #[inline]
    fn find(&mut self, h: f64) -> bool {
        let Some(found) = self.sizes.iter().position(|&size| size == h) else { return false };
        (self.current, self.current_size) = (found, h);
        true
    }

    /// Makes the matrices for step size `h > 0` the current ones, and computes them if the cache does not
    /// contain them.
    #[inline]
    pub fn prepare(&mut self, system: &Decoupled, h: f64) {
        if !(self.has(h) || self.find(h)) {
            self.compute(system, h);
        }
    }

    /// Computes the matrices for step size `h`. They replace the oldest entry.
    #[cold]
    #[inline(never)]
    fn compute(&mut self, system: &Decoupled, h: f64) {
        // Allocates the entries at the first step of a copied testbed; otherwise does nothing.
        self.entries.resize(Self::SIZE, StepMatrices::UNUSED);
        self.current = self.oldest;
        self.oldest = (self.oldest + 1) % Self::SIZE;
        self.computed += 1;
        self.entries[self.current] = StepMatrices::new(system, h);
        (self.sizes[self.current], self.current_size) = (h, h);
    }

    /// Returns the number of times that matrices were computed. It stays the same when a step finds its matrices in
    /// the cache.
    pub fn computed(&self) -> u64 {
        self.computed
    }
}

//! The exact step of a subsystem over which its motor angle moves on a straight line.
//!
//! With the motor angle `u0 + w s` for `0 <= s <= h`, the solution of `z' = A z + b_angle u + b_rate w` is
//!
//! ```text
//! z(h) = z + growth (z - [1, 1, 0] u0) + ramp w
//! growth = exp(A h) - 1
//! ramp   = integral over 0..h of exp(A (h - s)) (b_angle s + b_rate) ds
//! ```
//!
//! because `A [1, 1, 0] + b_angle = 0`. The step is an increment of z: a testbed at rest stays at rest to
//! the last bit, and tiny steps lose nothing to `exp(A h)` being close to 1.

use crate::decoupled::{Decoupled, Subsystem};
use crate::number::{Arithmetic, Number, TwoFloat};
use crate::pair::{Pair, PitchRoll};
use nalgebra::{Matrix3, Vector3};

/// The step matrices of one subsystem for one step size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Propagator<T = f64> {
    /// `exp(A h) - 1`.
    pub growth: Matrix3<T>,
    /// Increment per motor rate.
    pub ramp: Vector3<T>,
}

impl<T: Number> Propagator<T> {
    /// The propagator for step size `h` in s.
    pub fn new(system: &Subsystem<T>, h: f64) -> Self {
        let balance = Balance::new(&system.a);
        balance.propagator(balance.equations(system).propagate(h, balance.doublings(h.log2())))
    }
}

/// The equations of a subsystem; of two in pairs.
#[derive(Clone, Copy)]
struct Equations<T> {
    a: Matrix3<T>,
    b_angle: Vector3<T>,
    b_rate: Vector3<T>,
}

impl<T: Arithmetic> Equations<T> {
    /// Growth and ramp for step size `h` in s: a Taylor series over a fraction of the step in which it converges quickly,
    /// then doubled until the step is full.
    ///
    /// Doubling follows from taking two steps: `growth(2h) = 2 growth + growth^2` and
    /// `ramp(2h) = 2 ramp + growth (ramp - [1, 1, 0] h)`.
    fn propagate(&self, h: f64, doublings: i32) -> Propagator<T> {
        // In two factors, because one would underflow for the longest steps.
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
        // Both shafts turned, no velocity.
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

/// The unit of the velocity in which the series of a subsystem converges best, and the rate of convergence.
///
/// Angles and velocities differ in magnitude. With the velocity in this unit (a power of 2, so that nothing is rounded)
/// the entries that couple them have the same magnitude: the norm is smaller, and the error of the doublings with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balance {
    /// The unit of the velocity, rad/s.
    scale: f64,
    /// How often a step of 1 s must be halved for the series to converge. As logarithm: for a long step of a stiff
    /// system the product may be out of range.
    halvings: f64,
}

impl Balance {
    /// That of the state matrix `a`.
    pub fn new<T: Number>(a: &Matrix3<T>) -> Self {
        let rounded = a.map(T::rounded);
        let into_velocity = rounded[(2, 0)].abs().max(rounded[(2, 1)].abs());
        let from_velocity = rounded[(0, 2)].abs().max(rounded[(1, 2)].abs());
        let power = (-0.5 * (into_velocity / from_velocity).log2()).round().clamp(-300.0, 300.0) as i32;
        let scale = 0.5_f64.powi(power);
        let norm = rescaled(a, scale).map(T::rounded).abs().row_sum().max();
        Self { scale, halvings: (norm / 0.25).log2() }
    }

    /// How often a step must be halved whose size has this logarithm.
    fn doublings(&self, log2_of_h: f64) -> i32 {
        (self.halvings + log2_of_h).ceil().clamp(0.0, 2100.0) as i32
    }

    fn equations<T: Number>(&self, system: &Subsystem<T>) -> Equations<T> {
        let to_scale = |z: Vector3<T>| Vector3::new(z.x, z.y, z.z / self.scale);
        Equations {
            a: rescaled(&system.a, self.scale),
            b_angle: to_scale(system.b_angle),
            b_rate: to_scale(system.b_rate),
        }
    }

    /// A propagator of such equations with the velocity in rad/s.
    fn propagator<T: Number>(&self, Propagator { growth, ramp }: Propagator<T>) -> Propagator<T> {
        Propagator {
            growth: rescaled(&growth, 1.0 / self.scale),
            ramp: Vector3::new(ramp.x, ramp.y, ramp.z * self.scale.into()),
        }
    }
}

/// The matrix for a velocity in units of `scale`.
fn rescaled<T: Number>(a: &Matrix3<T>, scale: f64) -> Matrix3<T> {
    let mut b = *a;
    b[(2, 0)] = b[(2, 0)] / scale;
    b[(2, 1)] = b[(2, 1)] / scale;
    b[(0, 2)] *= scale.into();
    b[(1, 2)] *= scale.into();
    b
}

/// A propagator to step with.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rounded {
    growth: Matrix3<f64>,
    ramp: Vector3<f64>,
    /// 1, or 0 if little is left of the velocity: then the step does not add to it, but replaces it, for
    /// the sum would only keep the digits that the old velocity had.
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

    /// What is left at the end of the step of a jump of the motor angle by 1 at its begin.
    fn after_jump(&self, system: &Subsystem) -> Vector3<f64> {
        let jump = system.b_rate;
        self.growth * jump + Vector3::new(jump.x, jump.y, jump.z * self.keeps_velocity)
    }

    /// For the pitch and the roll subsystem.
    ///
    /// Up to 8 doublings cost an `f64` 3 digits at most. More may cost all of them: stiff testbeds have
    /// motions of very different rates, and what is left after the fast one is a small difference. So is
    /// what is left of a velocity that damping has used up. Both need twice the digits.
    fn pitch_and_roll(system: &Decoupled, h: f64) -> [Self; 2] {
        let Decoupled { pitch, roll, balances, .. } = system;
        let log2_of_h = h.log2();
        let doublings = balances.map(|balance| balance.doublings(log2_of_h));
        let uses_up = |s: &Subsystem| -s.a[(2, 2)] * h > std::f64::consts::LN_2;
        if doublings.into_iter().any(|doublings| doublings > 8) || uses_up(pitch) || uses_up(roll) {
            let exact = Subsystem::<TwoFloat>::pitch_and_roll(&system.parameters);
            let rounded = exact.map(|subsystem| Self::new(&Propagator::new(&subsystem, h)));
            // A TwoFloat that leaves the range of f64 on its way is no number.
            if rounded.iter().all(Self::is_finite) {
                return rounded;
            }
        }
        let [pitch, roll] = [balances[0].equations(pitch), balances[1].equations(roll)];
        let pairs = Equations {
            a: pitch.a.zip_map(&roll.a, Pair::new),
            b_angle: pitch.b_angle.zip_map(&roll.b_angle, Pair::new),
            b_rate: pitch.b_rate.zip_map(&roll.b_rate, Pair::new),
        };
        // Both at once; most often they need as many doublings.
        let of_pitch = pairs.propagate(h, doublings[0]);
        let of_roll = if doublings[0] == doublings[1] { of_pitch } else { pairs.propagate(h, doublings[1]) };
        let propagated = [(of_pitch, 0), (of_roll, 1)].map(|(Propagator { growth, ramp }, i)| Propagator {
            growth: growth.map(|pair| pair[i]),
            ramp: ramp.map(|pair| pair[i]),
        });
        [0, 1].map(|i| Self::new(&balances[i].propagator(propagated[i])))
    }

    fn is_finite(&self) -> bool {
        self.growth.iter().chain(&self.ramp).all(|entry| entry.is_finite())
    }
}

/// The propagators of both subsystems for one step size, entry beside entry, halved because they meet
/// sums and differences.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepMatrices {
    half_growth: [[PitchRoll; 3]; 3],
    half_ramp: [PitchRoll; 3],
    /// What a jump of the motor angle by 1 at the begin of the step adds to z at its end.
    half_jump: [PitchRoll; 3],
    /// See [`Rounded`]; halved like the rest, and whether both are kept whole.
    half_kept: PitchRoll,
    keeps_velocities: bool,
    /// Step size, s; 0 marks an unused entry.
    h: f64,
}

impl StepMatrices {
    const UNUSED: Self = Self {
        half_growth: [[ZERO; 3]; 3],
        half_ramp: [ZERO; 3],
        half_jump: [ZERO; 3],
        half_kept: ZERO,
        keeps_velocities: true,
        h: 0.0,
    };

    /// The matrices for step size `h` in s.
    pub fn new(system: &Decoupled, h: f64) -> Self {
        let [pitch, roll] = Rounded::pitch_and_roll(system, h);
        let beside = |pitch: Vector3<f64>, roll: Vector3<f64>| {
            std::array::from_fn(|i| PitchRoll::new(pitch[i], roll[i]) * 0.5)
        };
        let column = |j| beside(pitch.growth.column(j).into(), roll.growth.column(j).into());
        let half_kept = PitchRoll::new(pitch.keeps_velocity, roll.keeps_velocity) * 0.5;
        Self {
            half_growth: [0, 1, 2].map(column),
            half_ramp: beside(pitch.ramp, roll.ramp),
            half_jump: beside(pitch.after_jump(&system.pitch), roll.after_jump(&system.roll)),
            half_kept,
            keeps_velocities: half_kept == PitchRoll::both(0.5),
            h,
        }
    }

    /// What is left of the sides' velocities, if that is not all of them: what the velocity's increment
    /// adds to, from the sum and difference at the begin.
    #[inline]
    pub fn left_velocity(&self, v: PitchRoll) -> Option<PitchRoll> {
        if self.keeps_velocities { None } else { self.left_velocity_of(v) }
    }

    #[cold]
    fn left_velocity_of(&self, v: PitchRoll) -> Option<PitchRoll> {
        Some(self.half_kept * v)
    }

    /// The change of `z = [q_I, q_II, v]` over the step, from sums and differences of the sides'
    /// deviations `z - [1, 1, 0] u` from the motors at its begin, of the motor rates w, and of the jumps
    /// of the motor angles.
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

/// The step matrices of the step sizes used last. Masters use one step size or alternate among a few.
#[derive(Debug)]
pub struct StepCache {
    /// One of the others, at a place that needs no looking up.
    current: StepMatrices,
    /// As many as there is room for, so that a step does not allocate.
    entries: Vec<StepMatrices>,
    oldest: usize,
}

impl StepCache {
    const SIZE: usize = 8;

    /// A cache with room for a few step sizes. That of [`default`](Self::default) has room for the current one only.
    pub fn new() -> Self {
        Self { entries: Vec::with_capacity(Self::SIZE), ..Self::default() }
    }

    /// Forgets all of them.
    pub fn clear(&mut self) {
        self.current.h = 0.0;
        self.entries.clear();
        self.oldest = 0;
    }

    /// The matrices of the last step size.
    #[inline]
    pub fn current(&self) -> &StepMatrices {
        &self.current
    }

    /// Whether the [current](Self::current) matrices are those for step size `h > 0`.
    #[inline]
    pub fn has(&self, h: f64) -> bool {
        self.current.h == h
    }

    /// Makes the matrices for step size `h > 0` the current ones; computes them if they are not at hand.
    pub fn prepare(&mut self, system: &Decoupled, h: f64) {
        if self.has(h) {
            return;
        }
        if let Some(found) = self.entries.iter().find(|entry| entry.h == h) {
            self.current = *found;
            return;
        }
        self.current = StepMatrices::new(system, h);
        if self.entries.len() < self.entries.capacity() {
            self.entries.push(self.current);
        } else if let Some(oldest) = self.entries.get_mut(self.oldest) {
            *oldest = self.current;
            self.oldest = (self.oldest + 1) % self.entries.len();
        }
    }
}

impl Default for StepCache {
    /// A cache without entries.
    fn default() -> Self {
        Self { current: StepMatrices::UNUSED, entries: Vec::new(), oldest: 0 }
    }
}

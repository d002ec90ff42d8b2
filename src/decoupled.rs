//! The model split into pitch and roll.
//!
//! The testbed is mirror-symmetric, so the mean of its two sides and half their difference do not influence
//! each other. The mean is the pitch subsystem; the half difference is the roll subsystem. Both obey these
//! equations, each with its own inertia J and load damping c:
//!
//! ```text
//! (c1 + c2) q_I' = c1 w + c2 v - k1 (q_I - u) - k2 (q_I - q_II)        massless shaft, eq. (8) row 1
//! q_II'          = v
//! J v'           = c2 (q_I' - v) + k2 (q_I - q_II) - c v               SECT input shaft, eq. (8) row 3
//! ```
//!
//! Here u and w are the mean (or half difference) of the motor angles and rates. The code substitutes `q_I'` in
//! the last equation and uses the abbreviations [`stiffness_motor`](Side::stiffness_motor),
//! [`stiffness_sect`](Side::stiffness_sect) and [`damping`](Side::damping). This avoids differences of large
//! terms, so the results are accurate even for extreme parameters.

use crate::balance::Balance;
use crate::motor::Motion;
use crate::number::Number;
use crate::pair::{PerSide, PitchRoll};
use crate::parameters::{InvalidParameter, Parameters};
use nalgebra::{Matrix3, Vector3};
use std::ops::{Add, Mul, Sub};

/// Couplings of one side: motor - k1, c1 - massless shaft - k2, c2 - SECT.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side<T = f64> {
    /// `c1 / (c1 + c2)`: the share of the motor rate in the rate of the massless shaft.
    pub motor_share: T,
    /// `c2 / (c1 + c2)`: the share of the SECT shaft's rate in the rate of the massless shaft.
    pub sect_share: T,
    /// `k1 / (c1 + c2)`, 1/s.
    pub rate_motor: T,
    /// `k2 / (c1 + c2)`, 1/s.
    pub rate_sect: T,
    /// `c2 k1 / (c1 + c2)`, N.m/rad.
    pub stiffness_motor: T,
    /// `c1 k2 / (c1 + c2)`, N.m/rad.
    pub stiffness_sect: T,
    /// `c1 c2 / (c1 + c2)`, N.m.s/rad.
    pub damping: T,
}

impl<T: Number> Side<T> {
    /// Creates a side of a testbed with these parameters.
    pub fn new(p: &Parameters) -> Self {
        let [k1, k2, c1, c2] = [p.k1, p.k2, p.c1, p.c2].map(T::from);
        let c = c1 + c2;
        Self {
            motor_share: c1.over(c),
            sect_share: c2.over(c),
            rate_motor: k1.over(c),
            rate_sect: k2.over(c),
            stiffness_motor: c2.over(c) * k1,
            stiffness_sect: c1.over(c) * k2,
            damping: c1.over(c) * c2,
        }
    }
}

impl<T: Copy + Add<Output = T> + Sub<Output = T> + Mul<Output = T>> Side<T> {
    /// Returns the rate of the massless shaft: the first row of eq. (8), solved for `q_I'`. `T` is a number
    /// for one side, or [`PerSide`] for both.
    #[inline]
    pub fn shaft_rate(&self, q_i: T, q_ii: T, v: T, motor: Motion<T>) -> T {
        let Motion { angle: u, rate: w, .. } = motor;
        w * self.motor_share + v * self.sect_share
            - (q_i - u) * self.rate_motor
            - (q_i - q_ii) * self.rate_sect
    }

    /// Returns the sensor torque, eq. (9), with [`shaft_rate`](Self::shaft_rate) inserted. `T` is a number
    /// for one side, or [`PerSide`] for both.
    #[inline]
    pub fn torque(&self, q_i: T, q_ii: T, v: T, motor: Motion<T>) -> T {
        let Motion { angle: u, rate: w, .. } = motor;
        (q_i - u) * self.stiffness_motor - (q_i - q_ii) * self.stiffness_sect + (v - w) * self.damping
    }
}

impl Side {
    /// Returns the coefficients as pairs, to evaluate both sides at once.
    fn of_both(&self) -> Side<PerSide> {
        let Self { motor_share, sect_share, rate_motor, rate_sect, stiffness_motor, stiffness_sect, damping } =
            *self;
        Side {
            motor_share: PerSide::both(motor_share),
            sect_share: PerSide::both(sect_share),
            rate_motor: PerSide::both(rate_motor),
            rate_sect: PerSide::both(rate_sect),
            stiffness_motor: PerSide::both(stiffness_motor),
            stiffness_sect: PerSide::both(stiffness_sect),
            damping: PerSide::both(damping),
        }
    }
}

/// One of the two subsystems: `z = [q_I, q_II, v]`, `z' = A z + b_angle u + b_rate w`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Subsystem<T = f64> {
    /// Inertia J: J2 + H3/2 in pitch, J2 + J3 N^2/2M^2 in roll, kg.m2.
    pub inertia: T,
    /// Damping c of the load: c3/2 in pitch, c3 N^2/2M^2 in roll, N.m.s/rad.
    pub load_damping: T,
    /// State matrix.
    pub a: Matrix3<T>,
    /// Column of the input matrix for the motor angle. Equals `-a [1, 1, 0]`, because the subsystem stays at rest if its motor
    /// and both shafts are turned by the same angle.
    pub b_angle: Vector3<T>,
    /// Column of the input matrix for the motor rate; also the jump of z when the motor angle jumps by 1 rad.
    pub b_rate: Vector3<T>,
}

impl<T: Number> Subsystem<T> {
    /// Creates the pitch and the roll subsystem of a testbed with these parameters.
    pub fn pitch_and_roll(p: &Parameters) -> [Self; 2] {
        let side = Side::new(p);
        let [j2, j3, h3, c3, half] = [p.J2, p.J3, p.H3, p.c3, 0.5].map(T::from);
        let [lobes, rollers] = [p.M, p.N].map(|count| T::from(count.into()));
        let ratio = rollers.over(lobes);
        let roll_share = half * ratio * ratio;
        [Self::new(&side, j2 + half * h3, half * c3), Self::new(&side, j2 + roll_share * j3, roll_share * c3)]
    }

    fn new(side: &Side<T>, inertia: T, load_damping: T) -> Self {
        let Side { motor_share, sect_share, rate_motor, rate_sect, stiffness_motor, stiffness_sect, damping } =
            *side;
        Self {
            inertia,
            load_damping,
            a: Matrix3::new(
                -(rate_motor + rate_sect),
                rate_sect,
                sect_share,
                T::zero(),
                T::zero(),
                T::one(),
                (stiffness_sect - stiffness_motor).over(inertia),
                -stiffness_sect.over(inertia),
                -(damping + load_damping).over(inertia),
            ),
            b_angle: Vector3::new(rate_motor, T::zero(), stiffness_motor.over(inertia)),
            b_rate: Vector3::new(motor_share, T::zero(), damping.over(inertia)),
        }
    }
}

/// The decoupled testbed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decoupled {
    /// Parameters of the testbed.
    pub parameters: Parameters,
    /// Couplings of one side; both sides have equal couplings.
    pub side: Side,
    /// The coefficients of `side` as pairs, to evaluate both sides at once.
    pub both_sides: Side<PerSide>,
    /// Mean of the two sides.
    pub pitch: Subsystem,
    /// Half difference of the two sides.
    pub roll: Subsystem,
    /// Velocity units in which pitch and roll are propagated.
    pub balances: [Balance; 2],
    /// N / 2M of eq. (1).
    pub roll_ratio: f64,
    /// Factors that convert the sum and the difference of theta5 and theta6 to pitch and roll of the output shaft,
    /// eq. (1).
    pub output_shaft: PitchRoll,
}

impl Decoupled {
    /// Creates the testbed with these parameters.
    ///
    /// # Errors
    /// Fails if a parameter is out of its range, or if a coefficient of eq. (11) is not finite.
    pub fn new(p: &Parameters) -> Result<Self, InvalidParameter> {
        p.check()?;
        let [pitch, roll] = Subsystem::pitch_and_roll(p);
        for subsystem in [&pitch, &roll] {
            let coefficients = subsystem.a.iter().chain(&subsystem.b_angle).chain(&subsystem.b_rate);
            if !coefficients.copied().all(f64::is_finite) {
                return Err(InvalidParameter::new(
                    "the parameters are too far apart: a coefficient of eq. (11) is not a finite number",
                ));
            }
        }
        let (side, roll_ratio) = (Side::new(p), p.roll_ratio());
        Ok(Self {
            parameters: *p,
            side,
            both_sides: side.of_both(),
            pitch,
            roll,
            balances: [pitch.a, roll.a].map(|a| Balance::new(&a)),
            roll_ratio,
            output_shaft: PitchRoll::new(0.5, roll_ratio),
        })
    }

    /// Returns the inertias of pitch and of roll.
    pub fn inertia(&self) -> PitchRoll {
        PitchRoll::new(self.pitch.inertia, self.roll.inertia)
    }

    /// Returns the damping of the load in pitch and in roll.
    pub fn load_damping(&self) -> PitchRoll {
        PitchRoll::new(self.pitch.load_damping, self.roll.load_damping)
    }
}

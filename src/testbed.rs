//! The testbed: parameters, motors and state, advanced exactly from one communication point to the next.

use crate::decoupled::Decoupled;
use crate::motor::{Motions, Motors};
use crate::pair::{Sides, sides, sum_difference};
use crate::parameters::{InvalidParameter, Parameters};
use crate::propagator::StepCache;

/// The state x of eq. (11): `[theta3, theta4, theta5, theta6, omega5, omega6]`, rad and rad/s.
pub type State = [f64; 6];

/// The testbed between two communication points.
#[derive(Debug)]
pub struct Testbed {
    /// Parameters. Call [`parameters_changed`](Self::parameters_changed) after a change.
    pub parameters: Parameters,
    /// State x.
    pub state: State,
    /// Motors 1 and 2.
    pub motors: Motors,
    system: Decoupled,
    cache: StepCache,
}

impl Clone for Testbed {
    /// Copies neither the step matrices nor the capacity of the cache, because most copies are saved states.
    fn clone(&self) -> Self {
        Self { cache: StepCache::default(), ..*self }
    }
}

impl Testbed {
    /// Copies all fields except the step matrices, which stay valid if the parameters are equal. Returns
    /// whether the parameters differ.
    pub fn copy_from(&mut self, source: &Self) -> bool {
        let differs = self.parameters != source.parameters;
        if differs {
            self.cache.clear();
        }
        let Self { parameters, state, motors, system, cache: _ } = *source;
        (self.parameters, self.state, self.motors, self.system) = (parameters, state, motors, system);
        differs
    }

    /// Creates a testbed at rest at angle 0.
    ///
    /// # Errors
    /// Fails if the parameters are invalid.
    pub fn new(parameters: Parameters) -> Result<Self, InvalidParameter> {
        Ok(Self {
            parameters,
            state: [0.0; 6],
            motors: Motors::default(),
            system: Decoupled::new(&parameters)?,
            cache: StepCache::new(),
        })
    }

    /// Returns the equations for the current parameters.
    pub fn system(&self) -> &Decoupled {
        &self.system
    }

    /// Updates the fields that are derived from the parameters.
    ///
    /// # Errors
    /// Fails if the parameters are invalid; the derived fields then stay unchanged.
    pub fn parameters_changed(&mut self) -> Result<(), InvalidParameter> {
        self.system = Decoupled::new(&self.parameters)?;
        self.cache.clear();
        Ok(())
    }

    /// Advances the state by step size `h > 0` in s; exact for motors on straight lines.
    ///
    /// If an angle differs from the end of the last line, it jumps by d. The jump passes through the dampers
    /// as an impulse: x jumps by B2 d, where B2 are the rate columns of B in eq. (11).
    ///
    /// Returns false and changes nothing if the state would overflow.
    #[must_use]
    pub fn step(&mut self, h: f64) -> bool {
        self.cache.prepare(&self.system, h);
        let is_possible = self.step_from(&self.motors.sampled(), self.motors.jumps(), h);
        if is_possible {
            self.motors.times.shift(h);
        }
        is_possible
    }

    /// Does the same [step](Self::step) with fewer checks, if the size is that of the last two steps. Returns
    /// false if the size differs or the state would overflow.
    #[inline(always)]
    #[must_use]
    pub fn step_at_once(&mut self, h: f64) -> bool {
        self.motors.are_steady(h)
            && self.cache.has(h)
            && self.step_from(&self.motors.steady(), self.motors.theta() - self.motors.path_end.angle, h)
    }

    #[inline(always)]
    fn step_from(&mut self, motions: &Motions, jumps: Sides, h: f64) -> bool {
        let Self { state, motors, cache, .. } = self;
        let matrices = cache.current();
        let [q_i, q_ii, v] = by_sides(state);
        let u = motions.angle;
        let deviation = [sum_difference(q_i - u), sum_difference(q_ii - u), sum_difference(v)];
        let [d_i, d_ii, d_v] =
            matrices.increment(&deviation, sum_difference(motions.rate), sum_difference(jumps));
        let q_i = q_i + sides(d_i);
        let q_ii = q_ii + sides(d_ii);
        let v = match matrices.left_velocity(deviation[2]) {
            None => v + sides(d_v),
            Some(left) => sides(left + d_v),
        };

        // A sum is finite only if all its terms are finite.
        let end = motions.after(h);
        let [sum1, sum2] = ((q_i + q_ii) + v + (end.angle + end.rate)).array();
        let sum = sum1 + sum2;
        // `f64::is_finite` takes twice as many instructions.
        if (sum * 0.0).is_nan() {
            return false;
        }
        let ([theta3, theta4], [theta5, theta6], [omega5, omega6]) = (q_i.array(), q_ii.array(), v.array());
        *state = [theta3, theta4, theta5, theta6, omega5, omega6];
        motors.finish_step(u, &end);
        true
    }
}

/// Returns the pairs `[q_I, q_II, v]` of a state.
#[inline]
pub fn by_sides(x: &State) -> [Sides; 3] {
    [0, 2, 4].map(|i| Sides::new(x[i], x[i + 1]))
}

//! The testbed: parameters, motors and state, advanced exactly from one communication point to the next.

use crate::decoupled::Decoupled;
use crate::motor::{Motions, Motors};
use crate::pair::{PerSide, from_modes, to_modes};
use crate::parameters::{InvalidParameter, Parameters};
use crate::propagator::StepCache;

/// The state x of eq. (11): `[theta3, theta4, theta5, theta6, omega5, omega6]`, rad and rad/s.
pub type State = [f64; 6];

/// A state x in pairs of both sides: `[q_I, q_II, v]` of eq. (8), rad and rad/s.
pub type StateBySide = [PerSide; 3];

/// The testbed, which steps from one communication point to the next.
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
    /// The copy starts with an empty cache of step matrices, because most copies are saved states and should stay
    /// small. It allocates the cache at its first step.
    fn clone(&self) -> Self {
        Self { cache: StepCache::default(), ..*self }
    }
}

impl Testbed {
    /// Copies all fields except the step matrices. If the parameters are equal, their derived fields are not copied, and
    /// the step matrices stay valid; otherwise the step matrices are discarded. Returns whether the parameters differ.
    pub fn copy_from(&mut self, source: &Self) -> bool {
        let differs = self.parameters != source.parameters;
        if differs {
            (self.parameters, self.system) = (source.parameters, source.system);
            self.cache.clear();
        }
        (self.state, self.motors) = (source.state, source.motors);
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
            cache: StepCache::with_capacity(),
        })
    }

    /// Returns the number of times that step matrices were computed.
    pub fn computed_matrices(&self) -> u64 {
        self.cache.computed()
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

    /// Advances the state by step size `h > 0` in s; exact if the motor angles are linear over the step.
    ///
    /// If an angle was set that differs by d from the extrapolated end of the previous step, the motor jumps by d. The
    /// jump passes through the dampers as an impulse: x jumps by B2 d, where B2 are the rate columns of B in eq. (11).
    ///
    /// Returns false and changes neither state nor motors if a state, an angle or a rate would overflow.
    #[must_use]
    pub fn step(&mut self, h: f64) -> bool {
        self.step_to(h).is_some()
    }

    /// Does the same as [`step`](Self::step), but returns the new state, or `None` instead of false.
    #[inline]
    pub fn step_to(&mut self, h: f64) -> Option<StateBySide> {
        self.cache.prepare(&self.system, h);
        let state = self.step_from(&self.motors.extrapolate(), self.motors.input_jumps(), h)?;
        self.motors.times.shift(h, self.cache.inverse_of_current());
        Some(state)
    }

    /// Does the same as [`step_to`](Self::step_to) with fewer checks, but only if the last two steps also had the size `h`
    /// and their matrices are still in the cache. Otherwise, and at an overflow, returns `None` and changes nothing.
    #[inline(always)]
    pub fn step_fast(&mut self, h: f64) -> Option<StateBySide> {
        if !(self.motors.has_constant_step(h) && self.cache.has(h)) {
            return None;
        }
        self.step_from(
            &self.motors.extrapolate_fast(),
            self.motors.theta() - self.motors.segment_end.angle,
            h,
        )
    }

    #[inline(always)]
    fn step_from(&mut self, motions: &Motions, jumps: PerSide, h: f64) -> Option<StateBySide> {
        let Self { state, motors, cache, .. } = self;
        let matrices = cache.current()?;
        let [q_i, q_ii, v] = split_by_side(state);
        let u = motions.angle;
        let deviation = [to_modes(q_i - u), to_modes(q_ii - u), to_modes(v)];
        let [d_i, d_ii, d_v] = matrices.increment(&deviation, to_modes(motions.rate), to_modes(jumps));
        let q_i = q_i + from_modes(d_i);
        let q_ii = q_ii + from_modes(d_ii);
        let v = match matrices.remaining_velocity(deviation[2]) {
            None => v + from_modes(d_v),
            Some(left) => from_modes(left + d_v),
        };

        // A sum is finite only if all its terms are finite.
        let end = motions.after(h);
        let [sum1, sum2] = ((q_i + q_ii) + v + (end.angle + end.rate)).array();
        let sum = sum1 + sum2;
        // `f64::is_finite` takes twice as many instructions.
        if (sum * 0.0).is_nan() {
            return None;
        }
        let ([theta3, theta4], [theta5, theta6], [omega5, omega6]) = (q_i.array(), q_ii.array(), v.array());
        *state = [theta3, theta4, theta5, theta6, omega5, omega6];
        motors.finish_step(u, &end);
        Some([q_i, q_ii, v])
    }
}

/// Returns the pairs `[q_I, q_II, v]` of a state.
#[inline]
pub fn split_by_side(x: &State) -> StateBySide {
    [0, 2, 4].map(|i| PerSide::new(x[i], x[i + 1]))
}

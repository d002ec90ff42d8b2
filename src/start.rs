//! Initial state.

use crate::pair::PerSide;
use crate::testbed::State;

/// Initial state, and whether the simulation has started.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Whether the testbed starts at rest at the current motor angles.
    pub at_rest: bool,
    /// Initial state if `at_rest` is false: x of eq. (11), rad and rad/s.
    pub state: State,
    /// Whether the simulation has started or the importer has set a state. If so, the state no longer follows from the
    /// other fields.
    pub is_over: bool,
}

impl Default for Start {
    fn default() -> Self {
        Self { at_rest: true, state: State::default(), is_over: false }
    }
}

impl Start {
    /// Returns the initial state for motor angles `theta`, rad. At rest, no coupling is twisted: the shafts
    /// of each side have the angle of the motor.
    pub fn from(&self, theta: PerSide) -> State {
        match self.at_rest {
            true => [theta[0], theta[1], theta[0], theta[1], 0.0, 0.0],
            false => self.state,
        }
    }
}

//! Where the motion begins.

use crate::pair::Sides;
use crate::testbed::State;

/// Where the testbed starts, and whether it has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Whether it starts at rest, wherever the motors are then.
    pub at_rest: bool,
    /// Where it starts otherwise: x of eq. (11), rad and rad/s.
    pub state: State,
    /// Whether it has started, so that its state no longer follows from these.
    pub is_over: bool,
}

impl Default for Start {
    fn default() -> Self {
        Self { at_rest: true, state: State::default(), is_over: false }
    }
}

impl Start {
    /// The state to start from with the motors at `theta`, rad. At rest nothing is twisted: the shafts of each side are
    /// where its motor is.
    pub fn from(&self, theta: Sides) -> State {
        match self.at_rest {
            true => [theta[0], theta[1], theta[0], theta[1], 0.0, 0.0],
            false => self.state,
        }
    }
}

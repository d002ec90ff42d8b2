//! Origin of a serialized state.

use super::{Outcome, reject};
use fmi_abi::{Interface, Standard};
use std::fmt;

/// FMI version and interface type of the instance that serialized a state. An instance of another version or type
/// rejects the state, because there the mode of the state may not exist, or may allow other calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Origin(pub Standard, pub Interface);

impl Origin {
    const ALL: [Self; 4] = [
        Self(Standard::Fmi2, Interface::ModelExchange),
        Self(Standard::Fmi2, Interface::CoSimulation),
        Self(Standard::Fmi3, Interface::ModelExchange),
        Self(Standard::Fmi3, Interface::CoSimulation),
    ];

    /// Returns the byte that represents the origin in a serialized state.
    pub fn byte(self) -> u8 {
        2 * self.0 as u8 + self.1 as u8
    }

    pub fn from_byte(byte: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|origin| origin.byte() == byte)
    }

    /// Rejects a state whose origin differs from the origin of the instance, `own`.
    pub fn check(self, own: Self) -> Outcome {
        if self == own {
            return Ok(());
        }
        reject(format!(
            "the state comes from {self}, this instance is {own}; states stay within their standard and interface type"
        ))
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {}", self.1, self.0)
    }
}

//! Where a serialized state comes from.

use super::{Outcome, refuse};
use fmi_abi::{Interface, Standard};
use std::fmt;

/// Where a serialized state comes from, and what it is tied to: what is allowed next is another question in each standard and
/// interface type, and some modes are in one of them only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Origin(pub Standard, pub Interface);

impl Origin {
    const ALL: [Self; 4] = [
        Self(Standard::Fmi2, Interface::ModelExchange),
        Self(Standard::Fmi2, Interface::CoSimulation),
        Self(Standard::Fmi3, Interface::ModelExchange),
        Self(Standard::Fmi3, Interface::CoSimulation),
    ];

    /// As serialized states have it.
    pub fn byte(self) -> u8 {
        2 * self.0 as u8 + self.1 as u8
    }

    pub fn from_byte(byte: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|origin| origin.byte() == byte)
    }

    /// Why an instance does not take a state from elsewhere.
    pub fn check(self, own: Self) -> Outcome {
        if self == own {
            return Ok(());
        }
        refuse(format!(
            "the state comes from {self}, this instance is {own}; states stay within their standard and interface type"
        ))
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {}", self.1, self.0)
    }
}

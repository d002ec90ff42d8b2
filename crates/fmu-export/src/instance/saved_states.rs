//! Saved states (section 2.1.8 of FMI 2.0, 2.2.7.4 of FMI 3.0).

use super::{Instance, Outcome, State, refuse, serialized};
use crate::export::Exported;
use fmi_abi::{Interface, Mode, Standard};
use std::fmt;

/// Where a saved state comes from, and what it is tied to: what is allowed next is another question in each standard and
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
    pub fn check(self, own: Self) -> Result<(), String> {
        if self == own {
            return Ok(());
        }
        Err(format!(
            "the state comes from {self}, this instance is {own}; states stay within their standard and interface type"
        ))
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {}", self.1, self.0)
    }
}

/// A saved state.
pub(crate) struct SavedState<M> {
    origin: Origin,
    state: State<M>,
}

impl<M: Exported> Instance<M> {
    fn origin(&self) -> Origin {
        Origin(self.standard(), self.interface())
    }

    pub fn save(&self) -> SavedState<M> {
        SavedState { origin: self.origin(), state: self.state.clone() }
    }

    /// How many bytes a saved state takes now, with all that it points to.
    #[cfg(target_family = "wasm")]
    pub fn size_of_state(&mut self) -> usize {
        size_of::<SavedState<M>>() + serialized::size_in_place(&mut self.state)
    }

    /// Saves into a state that exists already, without allocation if the model clones without.
    pub fn save_into(&self, saved: &mut SavedState<M>) {
        saved.origin = self.origin();
        saved.state.clone_from(&self.state);
    }

    pub fn restore(&mut self, saved: &SavedState<M>) -> Outcome {
        saved.origin.check(self.origin()).or_else(refuse)?;
        self.check_event_mode(&saved.state)?;
        self.state.clone_from(&saved.state);
        self.refused.clear();
        self.enter(self.state.mode);
        Ok(())
    }

    pub fn serialized_size(&self, saved: &SavedState<M>) -> usize {
        serialized::size(&saved.state)
    }

    /// Fills `bytes`, which must have the length that [`serialized_size`](Self::serialized_size) tells.
    pub fn serialize(&self, saved: &SavedState<M>, bytes: &mut [u8]) {
        serialized::write(&saved.state, saved.origin, bytes);
    }

    pub fn deserialize(&self, bytes: &[u8]) -> Outcome<SavedState<M>> {
        let state = serialized::read(bytes, self.origin(), &self.state).or_else(refuse)?;
        self.check_event_mode(&state)?;
        Ok(SavedState { origin: self.origin(), state })
    }

    /// In Co-Simulation not every instance has an event mode.
    fn check_event_mode(&self, state: &State<M>) -> Outcome {
        if self.interface() == Interface::CoSimulation
            && state.mode == Mode::Event
            && !self.importer.event_mode
        {
            return refuse("the state is one of event mode, which this instance was made without");
        }
        Ok(())
    }
}

//! Saved states (section 2.1.8).

use super::{Instance, Outcome, State, refuse, serialized};
use crate::export::Exported;
use crate::mode::Interface;

/// A saved state, tied to the interface type it came from.
pub(crate) struct SavedState<M> {
    interface: Interface,
    state: State<M>,
}

impl<M: Exported> Instance<M> {
    pub fn save(&self) -> SavedState<M> {
        SavedState { interface: self.interface(), state: self.state.clone() }
    }

    /// Saves into a state that exists already, without allocation if the model clones without.
    pub fn save_into(&self, saved: &mut SavedState<M>) {
        saved.interface = self.interface();
        saved.state.clone_from(&self.state);
    }

    pub fn restore(&mut self, saved: &SavedState<M>) -> Outcome {
        if saved.interface != self.interface() {
            return refuse(format!(
                "the state comes from {}, this instance is {}",
                saved.interface,
                self.interface()
            ));
        }
        self.state.clone_from(&saved.state);
        self.enter(self.state.mode);
        Ok(())
    }

    pub fn serialized_size(&self, saved: &SavedState<M>) -> usize {
        serialized::size(&saved.state)
    }

    /// Fills `bytes`, which must have the length that [`serialized_size`](Self::serialized_size) tells.
    pub fn serialize(&self, saved: &SavedState<M>, bytes: &mut [u8]) {
        serialized::write(&saved.state, saved.interface, bytes);
    }

    pub fn deserialize(&self, bytes: &[u8]) -> Outcome<SavedState<M>> {
        let state = serialized::read(bytes, self.interface(), &self.state).or_else(refuse)?;
        Ok(SavedState { interface: self.interface(), state })
    }
}

//! Saved states (section 2.1.8).

use super::{Instance, SavedState};
use crate::call_table::Interface;
use crate::logger::Sink;
use crate::model::Model;
use crate::refusal::{Outcome, refuse};
use crate::state;

impl<M: Model, S: Sink> Instance<M, S> {
    pub fn save(&self) -> SavedState<M> {
        SavedState { interface: self.interface, state: self.state.clone() }
    }

    /// Saves into a state that exists already, without allocation if the model clones without.
    pub fn save_into(&self, saved: &mut SavedState<M>) {
        saved.interface = self.interface;
        saved.state.clone_from(&self.state);
    }

    pub fn restore(&mut self, saved: &SavedState<M>) -> Outcome {
        self.check_interface(saved)?;
        self.state.clone_from(&saved.state);
        Ok(())
    }

    pub fn serialized_size(&self, saved: &SavedState<M>) -> Outcome<usize> {
        self.check_serializes()?;
        Ok(state::serialized_size(&saved.state))
    }

    pub fn serialize(&self, saved: &SavedState<M>, bytes: &mut [u8]) -> Outcome {
        let size = self.serialized_size(saved)?;
        if bytes.len() != size {
            return refuse(format!(
                "the state needs {size} bytes, the buffer has {}; ask fmi2SerializedFMUstateSize",
                bytes.len()
            ));
        }
        state::serialize(&saved.state, saved.interface, bytes);
        Ok(())
    }

    pub fn deserialize(&self, bytes: &[u8]) -> Outcome<SavedState<M>> {
        self.check_serializes()?;
        let mut state = state::deserialize(bytes, self.interface, &self.state).or_else(refuse)?;
        state.model.parameters_changed()?;
        Ok(SavedState { interface: self.interface, state })
    }

    fn check_serializes(&self) -> Outcome {
        let offered = match self.interface {
            Interface::CoSimulation => M::INFO.co_simulation.is_some_and(|offer| offer.serializes_state),
            Interface::ModelExchange => M::INFO.model_exchange.is_some_and(|offer| offer.serializes_state),
        };
        if offered {
            Ok(())
        } else {
            refuse("this FMU does not serialize states (canSerializeFMUstate is false)")
        }
    }

    fn check_interface(&self, saved: &SavedState<M>) -> Outcome {
        if saved.interface == self.interface {
            return Ok(());
        }
        refuse(format!("the state comes from {}, this instance is {}", saved.interface, self.interface))
    }
}

//! Saved states (section 2.1.8 of FMI 2.0, 2.2.7.4 of FMI 3.0).

use super::origin::Origin;
use super::{Instance, Outcome, State, refuse, serialized};
use crate::export::Exported;
use fmi_abi::{Interface, Mode};
use std::collections::BTreeMap;

/// The states that an importer keeps. It knows them by their addresses, which are only ever looked up here: one that
/// was freed, another instance's or no state at all is no address of these, and is never followed.
///
/// They are the instance's, whose end frees them (section 2.1.5 of FMI 2.0, 2.3.1 of FMI 3.0).
pub(super) type Kept<M> = BTreeMap<usize, Box<State<M>>>;

/// The handle of no state.
const NULL: usize = 0;

impl<M: Exported> Instance<M> {
    fn origin(&self) -> Origin {
        Origin(self.standard(), self.interface())
    }

    /// How many bytes a saved state takes now, with all that it points to.
    #[cfg(target_family = "wasm")]
    pub fn size_of_state(&mut self) -> usize {
        size_of::<State<M>>() + serialized::size(&mut self.state)
    }

    /// Saves into the state of this handle, without allocation if the model clones without, or into a new one; gives
    /// its handle.
    pub fn save(&mut self, handle: usize) -> Outcome<usize> {
        if handle == NULL {
            return Ok(self.keep(self.state.clone()));
        }
        find(&mut self.kept, handle)?.clone_from(&self.state);
        Ok(handle)
    }

    fn keep(&mut self, state: State<M>) -> usize {
        let state = Box::new(state);
        let handle = (&raw const *state).addr();
        self.kept.insert(handle, state);
        handle
    }

    pub fn restore(&mut self, handle: usize) -> Outcome {
        self.state.clone_from(find(&mut self.kept, handle)?);
        self.refused.clear();
        self.enter(self.state.mode);
        Ok(())
    }

    /// Gives the state away, to be dropped.
    pub fn give(&mut self, handle: usize) -> Outcome<impl Sized + use<M>> {
        find(&mut self.kept, handle)?;
        Ok(self.kept.remove(&handle))
    }

    /// Gives any of its states away, as long as there are some.
    pub fn give_any(&mut self) -> Option<impl Sized + use<M>> {
        self.before.take().or_else(|| self.kept.pop_first().map(|(_, state)| state))
    }

    pub fn serialized_size(&mut self, handle: usize) -> Outcome<usize> {
        Ok(serialized::size(find(&mut self.kept, handle)?))
    }

    /// Fills `bytes`, which must have the length that [`serialized_size`](Self::serialized_size) tells.
    pub fn serialize(&mut self, handle: usize, bytes: &mut [u8]) -> Outcome {
        let origin = self.origin();
        serialized::write(find(&mut self.kept, handle)?, origin, bytes)
    }

    /// Into the state of this handle or a new one, whose handle this gives.
    pub fn deserialize(&mut self, bytes: &[u8], handle: usize) -> Outcome<usize> {
        if handle != NULL {
            find(&mut self.kept, handle)?;
        }
        let mut state = self.state.clone();
        let read = serialized::read(bytes, self.origin(), &mut state);
        self.logger.listen(&mut *state.model);
        read?;
        self.check_event_mode(&state)?;
        if handle == NULL {
            return Ok(self.keep(state));
        }
        *find(&mut self.kept, handle)? = state;
        Ok(handle)
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

fn find<M>(kept: &mut Kept<M>, handle: usize) -> Outcome<&mut State<M>> {
    kept.get_mut(&handle).map_or_else(|| refuse_handle(handle), |state| Ok(&mut **state))
}

#[cold]
fn refuse_handle<T>(handle: usize) -> Outcome<T> {
    refuse(if handle == NULL {
        "the state is NULL; save one first"
    } else {
        "the handle holds no state of this instance: it was freed, never set to NULL, or is another instance's, which \
         can be serialized there and de-serialized here"
    })
}

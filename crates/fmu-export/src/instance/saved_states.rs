//! Saved states (section 2.1.8 of FMI 2.0, 2.2.7.4 of FMI 3.0).

use super::handles::{Handles, NULL};
use super::origin::Origin;
use super::{Instance, Outcome, State, reject, serialized};
use crate::export::Exported;
use crate::memory::{Boxed, try_box};
use fmi_abi::{Interface, Mode};

/// States that the importer has saved. Handles are looked up and never dereferenced, so a wrong handle cannot corrupt
/// memory. The handle of a freed state stays invalid, because a handle contains a number that counts how often its
/// slot has been freed.
///
/// The instance owns the states. When it is freed, they are freed too (section 2.1.5 of FMI 2.0, 2.3.1 of FMI 3.0).
pub(super) type SavedStates<M> = Handles<Boxed<State<M>>>;

impl<M: Exported> Instance<M> {
    fn origin(&self) -> Origin {
        Origin(self.standard(), self.interface())
    }

    /// Returns two numbers of bytes for the current state: its size, and the size of its content, which includes the data
    /// to which it points.
    #[cfg(target_family = "wasm")]
    pub fn size_of_state(&mut self) -> [usize; 2] {
        [size_of::<State<M>>(), serialized::size(&mut self.state)]
    }

    /// Saves the current state and returns its handle. If `handle` is not NULL, the state of this handle is
    /// overwritten; this allocates nothing, unless the model's `clone_from` does.
    pub fn save(&mut self, handle: usize) -> Outcome<usize> {
        if handle == NULL {
            return self.insert(self.state.clone());
        }
        find(&mut self.saved, handle)?.clone_from(&self.state);
        Ok(handle)
    }

    fn insert(&mut self, state: State<M>) -> Outcome<usize> {
        match self.saved.insert(try_box(state)?) {
            Some(handle) => Ok(handle),
            None => reject("the instance has too many saved states; free some"),
        }
    }

    pub fn restore(&mut self, handle: usize) -> Outcome {
        self.state.clone_from(find(&mut self.saved, handle)?);
        self.rejected.clear();
        self.enter(self.state.mode);
        Ok(())
    }

    /// Removes a state and returns it, so that the caller can drop it.
    pub fn remove(&mut self, handle: usize) -> Outcome<impl Sized + use<M>> {
        find(&mut self.saved, handle)?;
        Ok(self.saved.remove(handle))
    }

    /// Removes any state, for example the backup for a failed step, and returns it; `None` if there are no more. Used
    /// when the instance is freed.
    pub fn remove_any(&mut self) -> Option<impl Sized + use<M>> {
        self.rollback.take().or_else(|| self.saved.pop())
    }

    pub fn serialized_size(&mut self, handle: usize) -> Outcome<usize> {
        Ok(serialized::size(find(&mut self.saved, handle)?))
    }

    /// Fills `bytes`, which must have the length from [`serialized_size`](Self::serialized_size).
    pub fn serialize(&mut self, handle: usize, bytes: &mut [u8]) -> Outcome {
        let origin = self.origin();
        serialized::write(find(&mut self.saved, handle)?, origin, bytes)
    }

    /// De-serializes a state and returns its handle. If `handle` is not NULL, the state of this handle is
    /// overwritten.
    pub fn deserialize(&mut self, bytes: &[u8], handle: usize) -> Outcome<usize> {
        if handle != NULL {
            find(&mut self.saved, handle)?;
        }
        let mut state = self.state.clone();
        let read = serialized::read(bytes, self.origin(), &mut state);
        self.logger.listen(state.model.log());
        read?;
        self.check_event_mode(&state)?;
        if handle == NULL {
            return self.insert(state);
        }
        *find(&mut self.saved, handle)? = state;
        Ok(handle)
    }

    /// Rejects a state in Event Mode if this instance of Co-Simulation has no Event Mode.
    fn check_event_mode(&self, state: &State<M>) -> Outcome {
        if self.interface() == Interface::CoSimulation
            && state.mode == Mode::Event
            && !self.importer.event_mode
        {
            return reject(
                "the state was saved in Event Mode, but this instance was created without Event Mode (eventModeUsed)",
            );
        }
        Ok(())
    }
}

fn find<M>(saved: &mut SavedStates<M>, handle: usize) -> Outcome<&mut State<M>> {
    saved.get_mut(handle).map_or_else(|| reject_handle(handle), |state| Ok(&mut state[0]))
}

#[cold]
fn reject_handle<T>(handle: usize) -> Outcome<T> {
    reject(if handle == NULL {
        "the state is NULL; save one first"
    } else {
        "unknown state handle: it was freed, was not initialized to NULL, or belongs to another instance (to move a state, \
         serialize it there and de-serialize it here)"
    })
}

//! Saves, restores and serializes the state of an instance.

use super::instance::{Instance, call};
use super::rejection::Rejection;
use super::saved::Saved;
use crate::c_types::{c_int, c_void};
use crate::calls::Functions;
use std::alloc::{Layout, alloc_zeroed};
use std::ptr::null_mut;

impl Instance {
    /// Saves the state.
    ///
    /// # Errors
    /// The FMU rejects the call, or returns no state.
    pub fn save(&mut self) -> Result<Saved, Rejection> {
        let mut state = null_mut();
        call!(self, fmi2GetFMUstate(&mut state), fmi3GetFMUState(&mut state))?;
        self.insert(state, "save")
    }

    /// Stores a handle that the FMU returned. Fails if it is NULL.
    fn insert(&mut self, state: *mut c_void, function: &'static str) -> Result<Saved, Rejection> {
        if state.is_null() {
            return Err(self.own_rejection(function, "the FMU returned no state".to_owned()));
        }
        Ok(self.states.insert(state))
    }

    /// Returns the handle of a saved state.
    fn state(&self, saved: Saved, function: &'static str) -> Result<*mut c_void, Rejection> {
        self.states
            .get(saved)
            .ok_or_else(|| self.own_rejection(function, "there is no such saved state".to_owned()))
    }

    /// Restores a saved state.
    ///
    /// # Errors
    /// The FMU rejects the call, or there is no such state.
    pub fn restore(&mut self, saved: Saved) -> Result<(), Rejection> {
        let state = self.state(saved, "restore")?;
        call!(self, fmi2SetFMUstate(state), fmi3SetFMUState(state))
    }

    /// Frees a saved state. Does nothing if there is no such state.
    ///
    /// # Errors
    /// The FMU rejects the call.
    pub fn forget(&mut self, saved: Saved) -> Result<(), Rejection> {
        let Some(mut state) = self.states.remove(saved) else { return Ok(()) };
        call!(self, fmi2FreeFMUstate(&mut state), fmi3FreeFMUState(&mut state))
    }

    /// Frees all saved states.
    pub(crate) fn forget_all(&mut self) {
        for saved in self.states.indices() {
            _ = self.forget(saved);
        }
    }

    /// Serializes a saved state to bytes.
    ///
    /// # Errors
    /// There is no such state, or the FMU rejects a call, or reports a size for which there is not enough memory.
    pub fn serialize(&mut self, saved: Saved) -> Result<Vec<u8>, Rejection> {
        let (state, mut size) = (self.state(saved, "serialize")?, 0);
        call!(
            self,
            fmi2SerializedFMUstateSize(state, &mut size),
            fmi3SerializedFMUStateSize(state, &mut size)
        )?;
        let Some(mut bytes) = zeros(size) else {
            let text =
                format!("the FMU reports a state of {size} bytes, for which there is not enough memory");
            return Err(self.own_rejection("serialize", text));
        };
        let to = bytes.as_mut_ptr();
        call!(self, fmi2SerializeFMUstate(state, to.cast(), size), fmi3SerializeFMUState(state, to, size))?;
        Ok(bytes)
    }

    /// Creates a saved state from serialized bytes.
    ///
    /// # Errors
    /// The FMU rejects the bytes, or returns no state.
    pub fn deserialize(&mut self, bytes: &[u8]) -> Result<Saved, Rejection> {
        let (from, size, mut state) = (bytes.as_ptr(), bytes.len(), null_mut());
        call!(
            self,
            fmi2DeSerializeFMUstate(from.cast(), size, &mut state),
            fmi3DeserializeFMUState(from, size, &mut state)
        )?;
        self.insert(state, "deserialize")
    }
}

/// Returns `size` bytes that are 0, or `None` if there is not enough memory. The system provides the memory pages only
/// when the FMU writes to them.
fn zeros(size: usize) -> Option<Vec<u8>> {
    if size == 0 {
        return Some(Vec::new());
    }
    let layout = Layout::array::<u8>(size).ok()?;
    // SAFETY: the layout has a size above 0.
    let memory = unsafe { alloc_zeroed(layout) };
    // SAFETY: memory of the global allocator with this layout, which is initialized.
    (!memory.is_null()).then(|| unsafe { Vec::from_raw_parts(memory, size, size) })
}

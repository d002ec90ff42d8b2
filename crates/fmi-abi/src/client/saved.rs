//! The handles of saved states. Callers get indices instead of handles, so that they cannot pass a pointer that the FMU did not
//! return.

use crate::c_types::c_void;
use std::ptr::null_mut;

/// Index of a state that an instance has saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Saved(usize);

impl Saved {
    /// Returns the index. It is reused after [`Instance::forget`](super::Instance::forget).
    pub fn index(self) -> usize {
        self.0
    }
}

/// States that an instance has saved.
#[derive(Debug, Default)]
pub(crate) struct States {
    /// Handles; NULL marks a free entry.
    all: Vec<*mut c_void>,
    /// Indices of the free entries.
    free: Vec<usize>,
}

impl States {
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.all.len() == self.free.len()
    }

    pub fn insert(&mut self, state: *mut c_void) -> Saved {
        let index = self.free.pop().unwrap_or(self.all.len());
        self.all.resize(self.all.len().max(index + 1), null_mut());
        self.all[index] = state;
        Saved(index)
    }

    pub fn get(&self, saved: Saved) -> Option<*mut c_void> {
        self.all.get(saved.0).copied().filter(|state| !state.is_null())
    }

    /// Removes a state and returns its handle, which the caller frees.
    pub fn remove(&mut self, saved: Saved) -> Option<*mut c_void> {
        let state = self.get(saved)?;
        self.all[saved.0] = null_mut();
        self.free.push(saved.0);
        Some(state)
    }

    /// Returns the indices of all entries, free ones included.
    pub fn indices(&self) -> impl Iterator<Item = Saved> + use<> {
        (0..self.all.len()).map(Saved)
    }
}

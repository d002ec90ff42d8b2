//! Errors of an FMU or of a request.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Maximum number of characters of an error message; longer messages are shortened.
const LONGEST: usize = 1000;

/// Error of a whole call. The error of a single run is [part of the results](crate::Runs::errors).
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Error {
    /// A file is not an FMU or SSP file that can be run on this machine, or an FMU does not support what is requested, such as the
    /// interface type. Also if all instances fail, an FMU rejects a serialized state, or no threads can be created.
    Fmu(String),
    /// The request does not fit the FMU, or is inconsistent.
    Request(String),
    /// Memory does not suffice for the results or the instances.
    Memory(String),
    /// The caller has [cancelled](crate::Watch::cancel) the runs.
    Cancelled,
}

impl Error {
    /// Returns the error for a batch whose results do not fit in memory.
    pub fn too_much() -> Self {
        Self::Memory(
            "the trajectories need more memory than there is; return only measures, store fewer sample times (increase `every`), or \
            split the runs"
                .to_owned(),
        )
    }
}

/// Returns an [`Error::Request`].
pub(crate) fn request<T>(message: String) -> Result<T, Error> {
    Err(Error::Request(message))
}

/// Locks a mutex, also after a panic of another thread.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the item with this name. The error names all items.
pub(crate) fn named<T: Copy>(all: &[(&str, T)], kind: &str, name: &str) -> Result<T, String> {
    let found = all.iter().find(|(known, _)| *known == name);
    found.map(|(_, item)| *item).ok_or_else(|| {
        let names: Vec<_> = all.iter().map(|(known, _)| *known).collect();
        format!("there is no {kind} {name:?}; there are {}", names.join(", "))
    })
}

/// Calls `body` for a run or an instance. If it panics, for example because of an absurd value that an FMU returns, the result is a
/// message, so that all others can continue. The caller must not rely on what `body` has changed.
pub(crate) fn caught<T>(body: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(body)).map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("unknown reason");
        format!("fmu_run itself has failed; please report it with the FMU: {text}")
    })
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fmu(message) | Self::Request(message) | Self::Memory(message) => {
                // Messages contain names from the FMU, which may be long or contain control characters that a terminal would
                // interpret.
                f.write_str(&fmi_abi::shown_to(message, LONGEST))
            }
            Self::Cancelled => f.write_str("cancelled"),
        }
    }
}

impl std::error::Error for Error {}

#[cfg(test)]
mod tests {
    use super::caught;

    #[test]
    fn a_panic_becomes_a_message() {
        assert_eq!(caught(|| 1), Ok(1));
        let beyond = caught(|| [0.0; 0][std::hint::black_box(3)]).unwrap_err();
        assert!(beyond.contains("please report it") && beyond.contains("index out of bounds"), "{beyond}");
    }
}

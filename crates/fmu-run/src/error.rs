//! What can be wrong with an FMU or with what it is asked for.

use std::fmt;

/// Why nothing can be run. What a single run is refused for is told [with that run](crate::Runs::errors).
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Error {
    /// The file is no FMU, or none that can be run here.
    Fmu(String),
    /// What is asked for does not fit the FMU, or itself.
    Request(String),
    /// The results or the instances need more memory than there is.
    Memory(String),
    /// The caller has [cancelled](crate::Watch::cancel).
    Cancelled,
}

impl Error {
    /// The results of a batch fit into no memory.
    pub fn too_much() -> Self {
        Self::Memory(
            "the trajectories need more memory than there is; take measures, keep fewer times (every), or split the runs"
                .to_owned(),
        )
    }
}

pub(crate) fn request<T>(message: String) -> Result<T, Error> {
    Err(Error::Request(message))
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fmu(message) | Self::Request(message) | Self::Memory(message) => f.write_str(message),
            Self::Cancelled => f.write_str("cancelled"),
        }
    }
}

impl std::error::Error for Error {}

//! The standards, and the types of interface that both have.

use std::fmt;

/// The standard that an importer speaks with an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standard {
    /// FMI 2.0.
    Fmi2 = 0,
    /// FMI 3.0.
    Fmi3 = 1,
}

impl Standard {
    /// The value reference that fmu-export gives the variable at this place of a model's list: in FMI 2.0 the place itself,
    /// in FMI 3.0 counted from 1.
    pub const fn reference(self, place: u32) -> u32 {
        place.wrapping_add(self as u32)
    }
}

impl fmt::Display for Standard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Fmi2 => "FMI 2.0",
            Self::Fmi3 => "FMI 3.0",
        })
    }
}

/// The type of interface that an instance was made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// The importer integrates.
    ModelExchange = 0,
    /// The FMU steps itself.
    CoSimulation = 1,
}

impl fmt::Display for Interface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ModelExchange => "Model Exchange",
            Self::CoSimulation => "Co-Simulation",
        })
    }
}

//! FMI versions and interface types.

use std::fmt;

/// FMI version of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standard {
    /// FMI 2.0.
    Fmi2 = 0,
    /// FMI 3.0.
    Fmi3 = 1,
}

impl Standard {
    /// Returns the value reference that fmu-export assigns to the variable at this index of a model's list.
    /// It is the index in FMI 2.0, and the index plus 1 in FMI 3.0.
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

/// Interface type of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// Model Exchange: the importer integrates.
    ModelExchange = 0,
    /// Co-Simulation: the FMU performs its own steps.
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

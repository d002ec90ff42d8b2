//! Versions of FMI.

use std::fmt;

/// A version of FMI that FMUs are made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Fmi {
    /// FMI 2.0
    #[value(name = "2")]
    V2,
    /// FMI 3.0
    #[value(name = "3")]
    V3,
}

impl fmt::Display for Fmi {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::V2 => "FMI 2.0",
            Self::V3 => "FMI 3.0",
        })
    }
}

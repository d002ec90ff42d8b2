#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! [`Fmu`] is an FMU for Co-Simulation, of FMI 2.0 or 3.0, unpacked and loaded, and runs it as often as a [`Batch`] says, on
//! all processors. Below it: `description` reads `modelDescription.xml`, `library` loads the functions, `instance` calls
//! them. `unsafe` is in these two alone, and for the caller where an FMU is [opened](Fmu::open).

mod batch;
mod description;
mod error;
mod fmu;
mod instance;
mod library;
mod machine;

pub use batch::{Batch, Course, Measure, Planned, Runs, Size, Start, Watch};
pub use description::{Description, Offer, Variable};
pub use error::Error;
pub use fmi_abi::{BaseType, Interface, Standard};
pub use fmu::Fmu;

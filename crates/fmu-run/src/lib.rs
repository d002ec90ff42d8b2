#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! [`Fmu`] is an FMU for Co-Simulation, of FMI 2.0 or 3.0, and runs it as often as a [`Batch`] says, on all processors.
//!
//! Below it is an importer that does nothing of its own: the functions of FMI 2.0 as methods of an instance that frees
//! itself, [`Importer`]; in [`fmi3`] those of FMI 3.0.
//!
//! [`load`] takes the shared library of any FMU; [`Functions::of`](fmu_export::fmi2::Functions::of) those of a model in
//! the same program. [`testing`] has what tests of FMUs need, [`either`] what they do in both
//! standards, [`serialized`] the bytes of saved states, [`c_programs`] what tests with C programs need. With the feature `careless` there is an importer that makes any calls in any order,
//! with `realtime` a check that code may run in a control loop.

#![cfg_attr(docsrs, feature(doc_cfg))]

mod batch;
pub mod c_programs;
#[cfg(feature = "careless")]
pub mod careless;
mod description;
pub mod either;
mod error;
pub mod fmi3;
mod fmu;
mod importer;
mod library;
mod machine;
#[cfg(feature = "realtime")]
pub mod realtime;
pub mod serialized;
pub mod testing;

pub use batch::{Batch, Course, Measure, Planned, Runs, Size, Start, Watch};
pub use description::{Description, Standard, Variable};
pub use error::Error;
pub use fmu::Fmu;
pub use fmu_export::fmi2::Functions;
pub use importer::{Arguments, Borrowed, FUNCTIONS, Importer, Message};
pub use library::{Library, functions_of, load};

#![doc = include_str!("../README.md")]
//!
//! ## Structure of the crate
//!
//! [`Fmu`] is an unpacked and loaded FMU of FMI 2.0 or 3.0. A [`Batch`] runs it many times on all processors; [`Instances`] are
//! stateful and controlled by the caller. The module `continuous` integrates runs in Model Exchange, and `clocks` ticks the clocks of
//! FMI 3.0 in runs. In `description`, array elements are variables, which `instance` and `values` read and set through `fmi_abi::client`. A caller needs `unsafe` only to open an
//! [FMU](Fmu::open) or a [system](System::open).

mod arrays;
mod batch;
mod change;
mod clocks;
mod connector;
mod continuous;
mod description;
mod error;
mod files;
mod fmu;
mod index;
mod instance;
mod instances;
mod library;
mod lookup;
mod messages;
mod platform;
mod pool;
mod selection;
mod start;
mod system;
mod system_instance;
mod threads;
mod values;

pub use batch::{Batch, Column, Finished, Measure, Occurrence, Planned, Runs, Size, Trajectory, Watch};
pub use continuous::{Integration, Solver};
pub use description::{Attributes, Dependencies, Description, Variable};
pub use error::Error;
pub use fmi_abi::client::Message;
pub use fmi_abi::client::{Continuous, Event};
pub use fmi_abi::description::{ModelDescription, Offer, Unknown};
pub use fmi_abi::{
    BaseType, BaseUnit, Causality, DisplayUnit, Interface, Standard, Status, Unit, Value, Variability,
};
pub use instance::Tolerance;
pub use instances::{Instances, Mask, Setup, States};
pub use messages::Logged;
pub use selection::Selection;
pub use start::Start;
#[cfg(feature = "write")]
pub use system::{CheckedStructure, SystemStructure};
pub use system::{Composition, Elements, Fmu, Order, System, Variables, nearest};
#[doc(hidden)]
pub use threads::process;

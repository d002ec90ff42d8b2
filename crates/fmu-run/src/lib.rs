#![doc = include_str!("../README.md")]
//!
//! ## Structure of the crate
//!
//! [`Fmu`] is an unpacked and loaded FMU of FMI 2.0 or 3.0. A [`Batch`] runs it many times on all processors;
//! [`Instances`] are stateful and controlled by the caller. `description` makes array elements variables,
//! `library` loads the functions, `instance` and `values` call them, and `log` collects their messages. Only these
//! four contain `unsafe` code. A caller needs `unsafe` only to [open](Fmu::open) an FMU.

mod arrays;
mod batch;
mod description;
mod error;
mod fmu;
mod found;
mod instance;
mod instances;
mod library;
mod log;
mod machine;
mod rejection;
mod running;
mod selection;
mod start;
mod system;
mod values;

pub use batch::{Batch, Measure, Planned, Runs, Size, Trajectory, Watch};
pub use description::{Description, Variable};
pub use error::Error;
pub use fmi_abi::description::{ModelDescription, Offer, Unknown};
pub use fmi_abi::{BaseType, Interface, Standard, Status};
pub use instance::{Continuous, Event};
pub use instances::{Instances, Mask, Setup, States};
pub use rejection::Message;
pub use selection::Selection;
pub use start::Start;
pub use system::{Composition, Fmu, Order, StartValue, System, nearest};

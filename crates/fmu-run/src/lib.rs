#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! [`Fmu`] is an FMU, of FMI 2.0 or 3.0, unpacked and loaded. It runs as often as a [`Batch`] says, on all processors; or
//! its [`Instances`] are in your hands. Below them: `description` reads `modelDescription.xml`, `library` loads the
//! functions, `instance` calls them, `log` hears what they say. `unsafe` is in these last three alone, and for the caller
//! where an FMU is [opened](Fmu::open).

mod arrays;
mod batch;
mod description;
mod error;
mod fmu;
mod instance;
mod instances;
mod library;
mod log;
mod machine;
mod refusal;
mod running;
mod selection;
mod start;
mod system;

pub use batch::{Batch, Course, Measure, Planned, Runs, Size, Watch};
pub use description::{Description, Offer, Variable};
pub use error::Error;
pub use fmi_abi::{BaseType, Interface, Standard, Status};
pub use fmu::Fmu;
pub use instance::{Continuous, Event};
pub use instances::{Instances, Mask, Setup, States};
pub use refusal::Message;
pub use selection::Selection;
pub use start::Start;
pub use system::{Order, StartValue, System, Wiring, nearest};

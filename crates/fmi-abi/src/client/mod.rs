//! Calls any FMU (FMI 2.0 and 3.0) through its C interface, safely.
//!
//! A program that calls FMUs may work with your own FMUs and crash with the next one, because FMUs expect different things from their
//! importer. Some need the memory callbacks, some pass an unknown pointer to the logger, and some log from their own threads or expect
//! the importer to expand `printf` formats. This module handles all of these cases. Loading is `unsafe`, since a library may do
//! anything. The methods of an instance are safe, because they check lengths and keep the library loaded while it is used.
//!
//! ```rust,no_run
//! use fmi_abi::client::{Instance, Settings, load};
//! use fmi_abi::{BaseType, Interface, Standard};
//! use std::sync::Arc;
//!
//! fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     // SAFETY: the library of a trusted FMU for FMI 2.0.
//!     let library = unsafe { load("binaries/linux64/model.so".as_ref(), Standard::Fmi2) }?;
//!     let settings = Settings { token: "{guid}", ..Settings::new(Interface::CoSimulation) };
//!     let mut instance = Instance::new(&Arc::new(library), &settings)?;
//!     instance.initialize(0.0, Some(1.0), None)?;
//!     instance.exit_initialization_mode()?;
//!     instance.set_numbers(BaseType::Real, &[1], &[0.5])?;
//!     instance.step(0.0, 0.01)?;
//!     let mut outputs = [0.0];
//!     instance.get_numbers(BaseType::Real, &[2], &mut outputs)?;
//!     Ok(())
//! }
//! ```
//!
//! [`load`] loads the functions of an FMU, and [`Instance`] calls them. Module `instance` contains the life cycle, steps, events
//! and derivatives, `clocks` ticks clocks, `values` gets and sets variables, and `states` saves and restores states, whose handles are
//! stored in `saved`.
//! `log` receives messages and keeps a list of the living instances, because the pointer that an FMU passes to the logger cannot be
//! trusted. `format` expands `printf` formats, whose arguments cannot be trusted either. `rejection` contains the errors, and
//! `float` restores the floating-point environment after calls in which some FMUs change it.

mod clocks;
mod float;
mod format;
mod instance;
mod library;
mod log;
mod rejection;
mod saved;
mod states;
mod values;

pub use crate::calls::{Library, LoadError};
pub use clocks::{Interval, Qualifier};
pub use instance::{Continuous, Event, Instance, MOST_ITERATIONS, Settings, Stepped};
pub use library::load;
pub use log::{LogListener, VariableNames};
pub use rejection::{Message, Rejection, reason};
pub use saved::Saved;

#![doc = include_str!("../README.md")]
//!
//! ## Structure of the crate
//!
//! [`Library`] contains the functions of an FMU. [`Instance`] calls them: `instance` the life cycle, `values` variables, `states`
//! and `saved` saved states. `log` receives messages and knows the living instances, because the pointer that an FMU passes to the logger
//! cannot be trusted; `format` expands formats of `printf` without trusting their arguments.

mod float;
mod format;
mod instance;
mod library;
mod log;
mod rejection;
mod saved;
mod states;
mod values;

pub use instance::{Continuous, Event, Instance, Settings};
pub use library::{Functions, Library};
pub use log::{LogListener, callbacks, log_of_fmi3};
pub use rejection::{Message, Rejection, reason};
pub use saved::Saved;

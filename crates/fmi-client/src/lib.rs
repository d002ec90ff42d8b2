#![doc = include_str!("../README.md")]
//!
//! ## Structure of the crate
//!
//! [`Library`] holds the functions of an FMU, and [`Instance`] calls them. Module `instance` contains the life cycle, steps, events
//! and derivatives, `values` gets and sets variables, and `states` saves and restores states, whose handles are stored in `saved`.
//! `log` receives messages and keeps a list of the living instances, because the pointer that an FMU passes to the logger cannot be
//! trusted. `format` expands `printf` formats, whose arguments cannot be trusted either. `rejection` contains the errors, and
//! `float` restores the floating-point environment after calls in which some FMUs change it.

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
pub use log::{LogListener, VariableNames, callbacks, log_of_fmi3};
pub use rejection::{Message, Rejection, reason};
pub use saved::Saved;

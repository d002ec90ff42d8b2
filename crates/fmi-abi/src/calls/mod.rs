//! Calls any FMU (FMI 2.0 and 3.0) with any arguments. To use an FMU, call it through [`client`](crate::client), which is safe.
//!
//! This module is for programs that test FMUs. They must also make the calls that a safe client prevents, for example with a NULL pointer
//! or in a forbidden order, so nothing is checked here. [`Library`] loads an FMU, and [`Functions`] contains its functions.
//! [`Functions::instantiate`] takes the arguments of all instantiation functions as one [`Instantiation`]. The other functions are called
//! as fields of the structures in [`Functions`], or by name with [`Functions::call`], for which [`signatures`] lists the types of the
//! arguments. Log messages go to a [`LogReceiver`]. [`Random`] generates numbers for arguments.

mod functions;
mod instantiation;
mod library;
mod log;
mod random;
mod signatures;

pub use functions::Functions;
pub use instantiation::Instantiation;
pub use library::{Library, LoadError, provide_symbols};
pub use log::{LogMessage, LogReceiver, LogValues, callbacks, log_callback, string};
pub use random::Random;
pub use signatures::{Argument, Signature, signature, signatures, without_instance};

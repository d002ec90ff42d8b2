//! What tests, fuzzing and benchmarks of FMUs share; not published.
//!
//! An importer that does nothing of its own: the functions of FMI 2.0 as methods of an instance that frees itself,
//! [`Importer`]; in [`fmi3`] those of FMI 3.0; in [`either`] what tests do in both standards. [`testing`] has what they
//! ask of an instance, [`serialized`] the bytes of saved states, [`c_programs`] what tests with C programs need.
//! [`careless`] is an importer that makes any calls in any order, [`realtime`] checks that code may run in a control loop.

pub mod c_programs;
pub mod careless;
pub mod either;
pub mod fmi3;
mod importer;
mod library;
pub mod realtime;
pub mod serialized;
pub mod testing;

pub use fmi_abi::fmi2::Functions;
pub use importer::{Arguments, Borrowed, FUNCTIONS, Importer, Message};
pub use library::{functions_of, load};

//! What tests, fuzzing and benchmarks of FMUs share; not published.
//!
//! An importer that does nothing of its own: the functions of FMI 2.0 as methods of an instance that frees itself,
//! [`Importer`]; in [`fmi3`] those of FMI 3.0. What both have, and what tests ask of an instance, is [`Either`];
//! [`serialized`] has the bytes of saved states, [`c_programs`] what tests with C programs need. [`careless`] is an importer
//! that makes any calls in any order, [`realtime`] checks that code may run in a control loop; [`checks`] holds for every FMU.

// Under Miri, the logger is variadic as in C.
#![cfg_attr(miri, feature(c_variadic))]

pub mod c_programs;
pub mod careless;
pub mod checks;
mod either;
pub mod fmi2;
pub mod fmi3;
mod importer;
mod library;
mod random;
pub mod realtime;
pub mod serialized;

pub use either::{Either, Updated};
pub use fmi2::{FUNCTIONS, Functions, Importer};
pub use importer::{Arguments, Borrowed, Message};
pub use library::{functions_of, load};
pub use random::Random;

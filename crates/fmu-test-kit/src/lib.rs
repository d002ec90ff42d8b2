//! Code that tests, fuzzing and benchmarks of FMUs share; not published.
//!
//! [`Importer`] is a plain importer of FMI 2.0: the C functions as methods of an instance that frees itself.
//! [`fmi3`] contains the importer of FMI 3.0. [`Either`] contains the operations that both share, and
//! assertions. [`serialized`] describes the bytes of saved states; [`c_programs`] supports tests with C
//! programs. [`fault_injection`] is a fault-injecting importer that makes any calls in any order. [`realtime`]
//! checks that code may run in a control loop. [`checks`] contains checks that hold for every FMU,
//! [`history`] and [`costs`] check instances that have already run for a while.

// Under Miri, the logger is variadic as in C.
#![cfg_attr(miri, feature(c_variadic))]

pub mod c_programs;
pub mod checks;
pub mod costs;
mod either;
pub mod fault_injection;
pub mod fmi2;
pub mod fmi3;
pub mod history;
mod importer;
mod instructions;
mod library;
mod random;
pub mod realtime;
pub mod serialized;

pub use either::{Either, Updated, Version};
pub use fmi_abi::calls;
pub use fmi2::{FUNCTIONS, Functions, Importer};
pub use importer::{Arguments, Hook, Message};
pub use instructions::instructions;
pub use library::{functions_of, load};
pub use random::Random;

//! Code shared by the tests, fuzzing and benchmarks of FMUs; not published.
//!
//! * [`Importer`] owns an instance of an FMU for FMI 2.0: its methods call the C functions, and dropping it frees the instance.
//!   [`fmi3::Importer`] does the same for FMI 3.0. [`Either`] contains the operations that both share, and assertions.
//! * [`serialized`] describes the bytes of saved states.
//! * [`c_models`] compiles and packs test FMUs that are written in C.
//! * [`c_programs`] compiles and runs C programs that load FMUs.
//! * [`fault_injection`] is a fault-injecting importer, which makes any calls in any order.
//! * [`models`] is the shelf of test models in Rust; each begins with a comment on what it is for.
//! * [`realtime`] checks that code may run in a control loop.
//! * [`checks`] contains checks that every FMU must pass; [`history`] and [`costs`] contain checks of instances that have
//!   already run for a while.
//! * [`load`] and [`functions_of`] return the functions of an FMU's library, [`instructions()`] counts the instructions of
//!   some work, and [`Random`] generates numbers.

pub mod c_models;
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
pub mod models;
pub mod realtime;
pub mod serialized;

pub use either::{Either, Updated, Version};
pub use fmi_abi::calls::{self, Random};
pub use fmi2::{FUNCTIONS, Functions, Importer};
pub use importer::{Arguments, Hook, Message};
pub use instructions::instructions;
pub use library::{functions_of, load};

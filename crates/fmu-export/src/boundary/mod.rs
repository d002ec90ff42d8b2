//! What the C functions of all versions of FMI have in common: an instance behind a pointer, calls on it, arrays of the
//! importer's. With [`fmi2`](crate::fmi2) and [`fmi3`](crate::fmi3), which are on top of it, the only place with pointers
//! and `unsafe`.

mod arrays;
mod call;
mod instances;
mod settings;
mod states;
mod texts;
pub(crate) mod webassembly;

pub(crate) use arrays::{array, output, place, string};
pub(crate) use call::{Callback, Component, ImporterLog, call, forget_panic, panic_message};
pub(crate) use instances::{Arguments, free, instantiate};
pub(crate) use settings::set_debug_logging;
pub(crate) use states::*;
pub(crate) use texts::{get_texts, set_texts};

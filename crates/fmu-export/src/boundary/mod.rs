//! The code that the C functions of both FMI versions share: it turns the importer's pointers into an instance, slices
//! and strings, and carries out calls on the instance. It also contains the bodies of functions that differ between the
//! FMI versions only in their names.

mod arrays;
mod call;
mod derivatives;
mod gate;
mod importer_log;
mod instances;
pub(crate) mod life_cycle;
pub(crate) mod model_exchange;
pub(crate) mod short;
pub(crate) mod states;
pub(crate) mod values;
pub(crate) mod webassembly;

pub(crate) use arrays::{apart, in_slice, of_elements, out_slice, out_value, reserve, same, string};
pub(crate) use call::{Component, call, call_fast, forget_panic, panic_message};
pub(crate) use derivatives::{output_derivatives, partial_derivatives};
pub(crate) use gate::Gate;
pub(crate) use importer_log::{Callback, ImporterLog};
pub(crate) use instances::{Arguments, free, instantiate};

use crate::export::Exported;
use crate::instance::Instance;
use fmi_abi::Standard;

/// Returns the name of an argument in the FMI version of the instance.
fn argument_name<M: Exported>(
    instance: &Instance<M>,
    fmi2: &'static str,
    fmi3: &'static str,
) -> &'static str {
    match instance.standard() {
        Standard::Fmi2 => fmi2,
        Standard::Fmi3 => fmi3,
    }
}

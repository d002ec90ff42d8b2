#![doc = include_str!("../README.md")]
//!
//! ## Structure of the crate
//!
//! An author writes a [`Model`] with a table of [`variables!`], implements capabilities and calls [`export_fmu!`].
//! `instance` contains the checks and effects of each call, without pointers, for both FMI versions. [`fmi2`] and
//! [`fmi3`] contain the C functions, and `boundary` contains the code that they share; [`fmi_abi`] contains their
//! types and the tables of allowed calls. `offsets` reads and writes fields of a model by their offsets, and
//! `filling` fills arrays at compile time. [`describe`](describe()) returns the description of the model for
//! fmu-package, which builds the FMU. All `unsafe` code is in `boundary`, `fmi2`, `fmi3`, `offsets`, `filling` and
//! `describe`, and in the code that the macros generate.

mod boundary;
mod capabilities;
mod describe;
mod export;
mod files;
mod filling;
pub mod fmi2;
pub mod fmi3;
mod hash;
mod info;
mod instance;
mod integrate;
mod log;
mod lookup;
mod memory;
mod model;
mod offsets;
mod saved;
mod settable;
mod simulation;
mod stamp;
mod symbols;
mod table;
mod types;
pub mod units;
mod value;
mod variable;

pub use capabilities::{
    CoSimulation, Event, Events, FastSteps, InputDerivatives, ModelExchange, OutputDerivatives, Partials,
    Step, StepCompleted, Stepped,
};
pub use describe::describe;
pub use export::{CoSimulationOffer, Exported, ModelExchangeOffer};
pub use fmi_abi::{
    AllowedStates, BaseType, Category, Causality, Initial, Interface, Mode, Rule, Standard, Status, Value,
    Variability,
};
pub use info::{DefaultExperiment, Info};
pub use integrate::{Crossing, find_event, find_first_event, rk4};
pub use log::Log;
pub use lookup::{LookupTable, interpolate};
pub use model::{Error, Experiment, Model, Setup, read_resource};
pub use saved::{Saved, StateVisitor};
pub use simulation::Simulation;
pub use stamp::guid;
pub use table::Variables;
pub use types::{Attributes, BINARY, BOOLEAN, INTEGER, Item, NUMBER, STRING, TIME, Type};
pub use units::{BaseUnit, DisplayUnit, Unit};
pub use value::{Enumeration, Place, Scalar};
pub use variable::{Index, Variable};

#[doc(hidden)]
pub use {
    describe::{Receive, pass_description, pass_panics},
    fmi_abi::stamp::Stamp,
    fmi_abi::{fmi2_functions, fmi3_functions},
    offsets::{both_offsets, offset_in, offset_of_real},
    stamp::hash_of_interface,
    table::{
        StateOfTable, check_line, count_elements, count_letters, count_states, find_states, spread,
        write_names,
    },
    value::{Dimensions, visit_enumeration},
    variable::{
        Read, Shape, Store, read_real, read_real_by, read_reals, read_reals_by, read_value, read_value_by,
        reject, set_real, set_value, shape_of_calculation, shape_of_field, type_of,
    },
};

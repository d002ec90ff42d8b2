#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! What an author writes: [`Model`] with a table of [`variables!`], the capabilities, [`export_fmu!`]. Below it, from
//! the inside out: `instance` has what each call checks and does, free of pointers and of versions of FMI; `boundary`
//! what C functions have in common; [`fmi2`] and [`fmi3`] the C functions of the standards, whose types and tables of
//! allowed calls are in [`fmi_abi`]. All `unsafe` is in these three. [`describe`](describe()) is the library's description of its
//! model, which the program reads that makes the FMU.

mod boundary;
mod capabilities;
mod describe;
mod export;
pub mod fmi2;
pub mod fmi3;
mod info;
mod instance;
mod log;
mod model;
mod saved;
mod settable;
mod simulation;
mod symbols;
mod table;
mod types;
pub mod units;
mod value;
mod variable;

pub use capabilities::{
    CoSimulation, Event, Events, InputDerivatives, ModelExchange, OutputDerivatives, Partials, Step,
    StepCompleted, Stepped,
};
pub use describe::describe;
pub use export::{CoSimulationOffer, Exported, ModelExchangeOffer};
pub use fmi_abi::{
    BaseType, Category, Causality, Initial, Interface, Mode, Rule, Situations, Standard, Status, Value,
    Variability,
};
pub use info::{DefaultExperiment, Info};
pub use log::Log;
pub use model::{Error, Experiment, Model, Setup};
pub use saved::{Saved, StateVisitor};
pub use simulation::Simulation;
pub use table::Variables;
pub use types::{Attributes, BINARY, BOOLEAN, INTEGER, Item, NUMBER, STRING, TIME, Type};
pub use units::{BaseUnit, DisplayUnit, Unit};
pub use value::{Enumeration, Place, Scalar};
pub use variable::{Index, Variable};

#[doc(hidden)]
pub use {
    boundary::{both_offsets, offset_in, offset_of_real},
    describe::{Receive, pass_description},
    fmi_abi::{fmi2_functions, fmi3_functions},
    table::{
        StateOfTable, check_line, count_elements, count_letters, count_states, find_states, spread,
        spread_names, write_names,
    },
    value::{Dimensions, visit_enumeration},
    variable::{
        Read, ReadAt, Shape, Store, StoreAt, read, read_real, read_reals, read_value, set_real, set_value,
        shape_of_calculation, shape_of_place,
    },
};

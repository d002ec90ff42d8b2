#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! From the outside in: [`boundary`] has the C functions and all `unsafe`; `instance` has what
//! each call checks and does; [`call_table`] says which call is allowed when.

#![deny(missing_docs)]

pub mod boundary;
pub mod call_table;
mod description;
mod instance;
mod logger;
mod macros;
mod model;
mod refusal;
mod state;
pub mod types;
pub mod units;

pub use call_table::Interface;
pub use description::{
    BaseType, BaseUnit, Causality, CoSimulation, DefaultExperiment, DisplayUnit, Initial, Kind,
    ModelExchange, ModelInfo, RealType, Unit, Variability, Variable,
};
pub use logger::Category;
pub use model::{Model, ModelError};
pub use state::StateVisitor;

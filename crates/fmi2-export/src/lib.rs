#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! From the outside in: `boundary` has the C functions and all `unsafe`; `instance` has what
//! each call checks and does; [`call_table`] says which call is allowed when.

#![deny(missing_docs)]

#[doc(hidden)]
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
mod variable;

pub use call_table::Interface;
pub use description::{CoSimulation, DefaultExperiment, ModelExchange, ModelInfo};
pub use logger::Category;
pub use model::{Model, ModelError};
pub use state::StateVisitor;
pub use units::{BaseUnit, DisplayUnit, Unit};
pub use variable::{BaseType, Causality, Initial, Kind, RealType, Variability, Variable};

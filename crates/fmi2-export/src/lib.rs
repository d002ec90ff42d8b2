//! Write FMI 2.0 FMUs in Rust, for Co-Simulation and Model Exchange.
//!
//! A model is a type that implements [`Model`]: it says what its variables are ([`variables!`]), holds
//! their values and steps itself. [`export_fmi2!`] makes a shared library of it with the 44 functions of
//! FMI 2.0: pointers and values are checked, calls out of order refused, panics caught, messages logged,
//! states saved and serialized. The crate `fmi2-package` writes the model description and packs the FMU.
//!
//! A whole FMU, a first-order lag:
//!
//! ```
//! use fmi2_export::*;
//!
//! const NUMBER: RealType = RealType::new("Number", &units::ONE);
//!
//! variables! {
//!     /// Input
//!     u = Variable::input(&NUMBER, 0.0);
//!     /// Output, follows the input
//!     x = Variable::output(&NUMBER).state(0.0);
//!     /// Its rate
//!     der_x = Variable::local(&NUMBER).derivative_of(vr::x).named("der(x)");
//! }
//!
//! #[derive(Clone, Default)]
//! struct Lag { u: f64, x: f64 }
//!
//! impl Model for Lag {
//!     const INFO: ModelInfo = ModelInfo {
//!         description: "First-order lag with time constant 1 s",
//!         co_simulation: Some(CoSimulation { variable_step_size: true, ..CoSimulation::PLAIN }),
//!         model_exchange: Some(ModelExchange::PLAIN),
//!         ..ModelInfo::new("Lag", "lag", "{8a7b1f62-0a8e-4f0c-9f43-5d3a1c2b7e90}", VARIABLES)
//!     };
//!     fn new(_: Interface) -> Self { Self::default() }
//!     fn real(&self, variable: u32) -> f64 {
//!         match variable { vr::u => self.u, vr::x => self.x, _ => self.u - self.x }
//!     }
//!     fn set_real(&mut self, variable: u32, value: f64) {
//!         if variable == vr::u { self.u = value } else { self.x = value }
//!     }
//!     fn do_step(&mut self, _time: f64, step_size: f64) -> Result<(), ModelError> {
//!         self.x += (self.u - self.x) * (1.0 - (-step_size).exp());
//!         Ok(())
//!     }
//! }
//!
//! export_fmi2!(Lag);
//! # fn main() {}
//! ```
//!
//! Inside, from the outside in: [`boundary`] has the C functions and all `unsafe`; `instance` has what
//! each call checks and does; [`call_table`] says which call is allowed when.

pub mod boundary;
pub mod call_table;
mod description;
mod instance;
mod logger;
mod macros;
mod model;
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

//! Reads model descriptions, and accepts faulty ones as far as possible: missing attributes get the defaults of the FMI
//! standard or stay empty, and each [`Fault`] is listed. An attribute whose value cannot be read is such a fault.

mod clock;
mod faults;
mod offer;
mod read;
mod variable;

use crate::{DependencyKind, Interface, Standard, Unit};
pub use clock::{Clock, Timing};
pub use faults::Fault;
pub use offer::Offer;
use std::collections::{BTreeMap, BTreeSet};
pub use variable::{Alias, Variable};

/// Maximum number of values in all arrays together. The size of an array that would exceed it counts as unknown.
pub const MAX_VALUES: usize = 1 << 22;

/// An unknown of the model structure.
#[derive(Clone, Debug, PartialEq)]
pub struct Unknown {
    /// Index of the variable.
    pub variable: usize,
    /// Indices of the variables on which the unknown depends; `None` if the attribute is missing.
    pub dependencies: Option<Vec<usize>>,
    /// `dependenciesKind`, in the order of the dependencies; empty if the attribute is missing or has another length.
    pub kinds: Vec<DependencyKind>,
}

/// Content of a model description.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelDescription {
    /// FMI version.
    pub standard: Standard,
    /// `fmiVersion` as written.
    pub version: String,
    /// Name of the model.
    pub model_name: String,
    /// `guid` of FMI 2.0, `instantiationToken` of FMI 3.0.
    pub token: String,
    /// Capabilities in Co-Simulation, if the FMU supports it.
    pub co_simulation: Option<Offer>,
    /// Capabilities in Model Exchange, if the FMU supports it.
    pub model_exchange: Option<Offer>,
    /// Whether the FMU supports Scheduled Execution.
    pub scheduled_execution: bool,
    /// Start time, stop time and step size of the default experiment, s, if given.
    pub default_experiment: [Option<f64>; 3],
    /// Relative tolerance of the default experiment, if given.
    pub default_tolerance: Option<f64>,
    /// Variables, in the order of the file.
    pub variables: Vec<Variable>,
    /// Outputs of the model structure.
    pub outputs: Vec<Unknown>,
    /// Derivatives of the continuous states.
    pub derivatives: Vec<Unknown>,
    /// Unknowns of the initialization.
    pub initial_unknowns: Vec<Unknown>,
    /// Number of event indicators; `None` if it is unknown.
    pub event_indicators: Option<usize>,
    /// Names of the log categories.
    pub log_categories: Vec<String>,
    /// Units by name.
    pub units: BTreeMap<String, Unit>,
    /// Names of the declared types.
    pub types: BTreeSet<String>,
    /// Name and number of each item of an enumeration, by the name of the enumeration's type.
    pub enumerations: BTreeMap<String, Vec<(String, i64)>>,
    /// Whether the names of variables are structured (`variableNamingConvention`).
    pub structured_names: bool,
    /// Faults, each with a message.
    pub faults: Vec<(Fault, String)>,
}

impl ModelDescription {
    /// Returns the capabilities for this interface type, if the FMU supports it.
    pub fn offer(&self, interface: Interface) -> Option<&Offer> {
        match interface {
            Interface::CoSimulation => self.co_simulation.as_ref(),
            Interface::ModelExchange => self.model_exchange.as_ref(),
        }
    }
}

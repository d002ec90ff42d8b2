//! Reads model descriptions, and accepts faulty ones as far as possible: missing attributes get the defaults of the FMI
//! standard or stay empty, and each [`Fault`] is listed. An attribute whose value cannot be read is such a fault.

mod attributes;
mod clock;
mod faults;
mod offer;
mod read;
mod variable;
#[cfg(feature = "write")]
mod write;

use crate::{DependencyKind, Interface, Standard, Unit};
pub use attributes::{Attributes, Item, Type};
pub use clock::{Clock, Timing};
pub use faults::Fault;
use indexmap::IndexMap;
pub use offer::Offer;
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

/// Author, version and other facts about a model; each is empty if it is missing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct About {
    /// Description of the model.
    pub description: String,
    /// Author of the model.
    pub author: String,
    /// Version of the model.
    pub version: String,
    /// Copyright of the model.
    pub copyright: String,
    /// License of the model.
    pub license: String,
    /// Program that made the FMU (`generationTool`).
    pub generation_tool: String,
}

/// A category of log messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogCategory {
    /// Name.
    pub name: String,
    /// Description; empty if missing.
    pub description: String,
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
    /// What the description says of the model to people.
    pub about: About,
    /// Capabilities in Co-Simulation, if the FMU supports it.
    pub co_simulation: Option<Offer>,
    /// Capabilities in Model Exchange, if the FMU supports it.
    pub model_exchange: Option<Offer>,
    /// Capabilities in Scheduled Execution, if the FMU supports it.
    pub scheduled_execution: Option<Offer>,
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
    /// Variables that are event indicators (FMI 3.0).
    pub indicators: Vec<Unknown>,
    /// Log categories.
    pub log_categories: Vec<LogCategory>,
    /// Units by name, in the order of the file.
    pub units: IndexMap<String, Unit>,
    /// Declared types by name, in the order of the file.
    pub types: IndexMap<String, Type>,
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

    /// Returns the items of an enumeration; `None` if it is not a declared type with items.
    pub fn items_of(&self, declared_type: Option<&str>) -> Option<&[Item]> {
        let declared = self.types.get(declared_type?)?;
        Some(&*declared.items).filter(|items| !items.is_empty())
    }
}

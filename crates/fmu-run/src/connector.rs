//! Inputs and outputs of systems.

use crate::change::Change;
use crate::description::Variable;

/// An input or output of a system.
#[derive(Clone, Debug)]
pub(crate) struct Connector {
    /// The variable of the first end, in the unit of the connector.
    pub variable: Variable,
    /// Whether callers can only read it.
    pub is_output: bool,
    /// The variables that it denotes.
    pub ends: Vec<End>,
}

/// A variable of a component. Its name in the system, `component.variable`, could be another variable's too, because both parts may
/// contain dots.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Place {
    /// Index of the component.
    pub component: usize,
    /// Name of the variable in its FMU.
    pub variable: String,
}

/// A connection between an input or output of a system and a variable of a component.
#[derive(Clone, Debug)]
pub(crate) struct End {
    pub place: Place,
    /// Change from the value of the connector to the value of the variable.
    pub into: Change,
    /// The opposite change.
    pub out: Change,
}

/// Returns the name of a variable in a system.
pub(crate) fn joined(component: &str, name: &str) -> String {
    if component.is_empty() { name.to_owned() } else { format!("{component}.{name}") }
}

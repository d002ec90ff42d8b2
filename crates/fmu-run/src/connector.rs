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

/// A connection between an input or output of a system and a variable of a component.
#[derive(Clone, Debug)]
pub(crate) struct End {
    /// Name of the variable.
    pub variable: String,
    /// Change from the value of the connector to the value of the variable.
    pub into: Change,
    /// The opposite change.
    pub out: Change,
}

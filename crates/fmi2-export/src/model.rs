//! What a model author writes: [`Model`].

use crate::call_table::Interface;
use crate::description::ModelInfo;
use crate::state::StateVisitor;
use std::fmt;

/// A model that can be exported as an FMU.
///
/// The model holds the values of its variables and calculates the others on demand; this crate does
/// the rest: the C interface, the order of calls, the checks, the log, the saved states. A model needs
/// no `unsafe` and knows nothing of FMI but its value references (the constants that
/// [`variables!`](crate::variables) makes).
///
/// Of the methods only [`new`](Self::new), [`real`](Self::real) and [`set_real`](Self::set_real) are needed by every
/// model; what else is needed follows from the capabilities in [`INFO`](Self::INFO):
///
/// | capability | methods |
/// |---|---|
/// | Co-Simulation | [`do_step`](Self::do_step) |
/// | Model Exchange | states and derivatives in the table of variables; [`set_time`](Self::set_time) if the model uses time |
/// | saved states | nothing: a state is a clone of the model |
/// | serialized states | [`visit_state`](Self::visit_state) |
/// | directional derivatives | [`partial_derivative`](Self::partial_derivative) |
/// | input derivatives | [`set_input_derivative`](Self::set_input_derivative) |
/// | output derivatives | [`output_derivative`](Self::output_derivative) |
///
pub trait Model: Clone {
    /// The facts about the model.
    const INFO: ModelInfo;

    /// The model with its start values, to be used through this interface type.
    fn new(interface: Interface) -> Self;

    /// The value of a Real variable, at the current time and with the current inputs.
    fn real(&self, vr: u32) -> f64;

    /// Sets a Real variable that [`INFO`](Self::INFO) lets the importer set. The value is finite and,
    /// for a parameter, within the range of its type.
    fn set_real(&mut self, vr: u32, value: f64);

    /// The value of an Integer variable.
    fn integer(&self, vr: u32) -> i32 {
        unreachable!("no Integer variable {vr}")
    }

    /// Sets an Integer variable; the value is within its range.
    fn set_integer(&mut self, vr: u32, _value: i32) {
        unreachable!("no Integer variable {vr}")
    }

    /// The value of a Boolean variable.
    fn boolean(&self, vr: u32) -> bool {
        unreachable!("no Boolean variable {vr}")
    }

    /// Sets a Boolean variable.
    fn set_boolean(&mut self, vr: u32, _value: bool) {
        unreachable!("no Boolean variable {vr}")
    }

    /// Called after parameters or start values have changed: checks what concerns several of them and
    /// prepares what depends on them.
    ///
    /// # Errors
    /// When the values do not fit together. The change is then undone and the importer told.
    fn parameters_changed(&mut self) -> Result<(), ModelError> {
        Ok(())
    }

    /// Called when the initialization begins, with the start time in s.
    ///
    /// # Errors
    /// When the model cannot start there.
    fn initialize(&mut self, _start_time: f64) -> Result<(), ModelError> {
        Ok(())
    }

    /// Co-Simulation: goes from communication point `time` to `time + step_size`, both in s.
    ///
    /// # Errors
    /// When the step cannot be carried out; the model must then be as it was before.
    fn do_step(&mut self, _time: f64, _step_size: f64) -> Result<(), ModelError> {
        Err(ModelError::new("the model has no Co-Simulation"))
    }

    /// Co-Simulation: takes the time derivative of an input, of order 1 or higher, at the current
    /// communication point. Orders that the model has no use for are ignored.
    fn set_input_derivative(&mut self, _vr: u32, _order: u32, _value: f64) {}

    /// Co-Simulation: the time derivative of order 1 or higher of any Real variable; 0 for orders
    /// above the model's.
    fn output_derivative(&self, _vr: u32, _order: u32) -> f64 {
        0.0
    }

    /// Model Exchange: takes the time in s.
    fn set_time(&mut self, _time: f64) {}

    /// The partial derivative of one Real variable with respect to another. The unknown is an output
    /// or a state's derivative, the known an input, a state or, while initializing, a parameter.
    ///
    /// `None` if the model does not know it.
    fn partial_derivative(&self, _unknown: u32, _known: u32) -> Option<f64> {
        None
    }

    /// Shows every value that the future depends on to the visitor, always in the same order: the
    /// same list serves to write a state and to read one back. What can be computed from the rest is
    /// computed in [`parameters_changed`](Self::parameters_changed), which is called after reading.
    fn visit_state(&mut self, _visitor: &mut impl StateVisitor) {}
}

/// Why a model cannot do what it was asked for, in a sentence that says what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelError(String);

impl ModelError {
    /// An error with this message.
    pub fn new(message: impl Into<String>) -> Self {
        Self(message.into())
    }
}

impl fmt::Display for ModelError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ModelError {}

//! One instance of a model: the order of calls, the checks, the effect. No pointers here.
//!
//! Every method checks all its arguments before it changes anything; a refusal leaves the instance as
//! it was.

mod co_simulation;
mod derivatives;
mod model_exchange;
mod saved_states;
mod values;

use crate::call_table::{Function, Interface, Mode};
use crate::logger::{Category, Logger, Sink};
use crate::model::Model;
use crate::refusal::{Outcome, Refusal, refuse, refuse_with};
use crate::state::InstanceState;
use crate::types::Status;
use crate::variable::{BaseType, Variable};

/// An instance of model `M` that logs to `S`.
///
/// Processors fetch cache lines of 64 bytes in pairs: instances side by side on the heap share none, so that
/// threads that step them do not take them from each other.
#[repr(align(128))]
pub(crate) struct Instance<M, S> {
    interface: Interface,
    logger: Logger<S>,
    state: InstanceState<M>,
}

/// A saved state, tied to the interface type it came from.
pub(crate) struct SavedState<M> {
    interface: Interface,
    state: InstanceState<M>,
}

/// Checks, log and life cycle (sections 2.1.5 and 2.1.6); the other rooms have a file each.
impl<M: Model, S: Sink> Instance<M, S> {
    pub fn new(interface: Interface, logger: Logger<S>, state: InstanceState<M>) -> Self {
        Self { interface, logger, state }
    }

    /// Refuses a call that the table of allowed calls does not have in the current mode.
    #[inline]
    pub fn check_call(&self, function: Function) -> Outcome {
        if function.rule().accepted(self.interface).contains(self.state.mode) {
            return Ok(());
        }
        self.refuse_call(function)
    }

    #[cold]
    fn refuse_call(&self, function: Function) -> Outcome {
        let accepted = function.rule().accepted(self.interface);
        let message = format!(
            "not allowed in state '{}' of {}; allowed in: {accepted}",
            self.state.mode, self.interface
        );
        let status = if self.state.mode == Mode::Fatal { Status::Fatal } else { Status::Error };
        Err(Box::new(Refusal { status, message }))
    }

    #[cold]
    pub fn log_refusal(&self, function: Function, refusal: &Refusal) {
        let category = match refusal.status {
            Status::Fatal => Category::Fatal,
            Status::Discard => Category::Discard,
            _ => Category::Error,
        };
        self.logger.log(refusal.status, category, &format!("{}: {}", function.rule().name, refusal.message));
    }

    pub fn log_event(&self, message: &str) {
        self.logger.log(Status::Ok, Category::Events, message);
    }

    /// After a panic: nothing but freeing is left.
    #[cold]
    pub fn break_down(&mut self, function: Function, panic_message: &str) {
        self.state.mode = Mode::Fatal;
        let message = format!(
            "{}: internal failure ({panic_message}); free this instance, others are not affected",
            function.rule().name
        );
        self.logger.log(Status::Fatal, Category::Fatal, &message);
    }

    pub fn set_debug_logging(&mut self, on: bool, categories: Option<u8>) {
        match categories {
            None => self.logger.set_all(on),
            Some(categories) => self.logger.set(categories, on),
        }
    }

    pub fn setup_experiment(
        &mut self,
        tolerance: Option<f64>,
        start_time: f64,
        stop_time: Option<f64>,
    ) -> Outcome {
        if let Some(tolerance) = tolerance
            && !(tolerance.is_finite() && tolerance >= 0.0)
        {
            return refuse(format!("tolerance must be a number not below 0, it is {tolerance}"));
        }
        if !start_time.is_finite() {
            return refuse(format!("startTime must be a finite number, it is {start_time}"));
        }
        if let Some(stop_time) = stop_time
            && !(stop_time.is_finite() && stop_time >= start_time)
        {
            return refuse(format!(
                "stopTime must be a finite number not before startTime ({start_time}), it is {stop_time}"
            ));
        }
        self.state.start_time = start_time;
        self.state.time = start_time;
        self.state.stop_time = stop_time;
        Ok(())
    }

    pub fn enter_initialization_mode(&mut self) -> Outcome {
        self.state.model.initialize(self.state.start_time)?;
        self.state.mode = Mode::Initialization;
        Ok(())
    }

    pub fn exit_initialization_mode(&mut self) {
        self.state.mode = match self.interface {
            Interface::CoSimulation => Mode::StepComplete,
            Interface::ModelExchange => Mode::Event,
        };
        self.log_event("initialized");
    }

    pub fn terminate(&mut self) {
        self.state.mode = Mode::Terminated;
        self.log_event("terminated");
    }

    pub fn reset(&mut self) {
        self.state = InstanceState::new(self.interface);
        self.log_event("reset to the start values");
    }
}

/// The variable of this value reference, if it has the type.
#[inline]
fn variable<M: Model>(vr: u32, base_type: BaseType) -> Outcome<&'static Variable> {
    match M::INFO.variables.get(vr as usize) {
        Some(variable) if variable.kind.base_type() == base_type => Ok(variable),
        other => refuse_variable(vr, other, base_type),
    }
}

#[cold]
#[inline(never)]
fn refuse_variable<T>(vr: u32, variable: Option<&Variable>, base_type: BaseType) -> Outcome<T> {
    match variable {
        Some(variable) => {
            refuse(format!("{} is of type {:?}, not {base_type:?}", variable.name, variable.kind.base_type()))
        }
        None => refuse(format!("there is no variable with value reference {vr}")),
    }
}

fn name<M: Model>(vr: u32) -> &'static str {
    M::INFO.variables.get(vr as usize).map_or("?", |variable| variable.name)
}

#[inline]
fn finite<M: Model>(vr: u32, value: f64) -> Outcome<f64> {
    if value.is_finite() {
        return Ok(value);
    }
    refuse_with(move || {
        format!(
            "{} is out of the range of numbers; look for extreme inputs, states or parameters",
            name::<M>(vr)
        )
    })
}

//! One instance of a model: the order of calls, the checks, the effect. No pointers here.
//!
//! Every method checks all its arguments before it changes anything; a refusal leaves the instance as
//! it was.

use crate::call_table::{Function, Interface, Mode};
use crate::description::{BaseType, Causality, Kind, Variability, Variable};
use crate::logger::{Category, Logger, Sink};
use crate::model::{Model, ModelError};
use crate::state::{self, InstanceState};
use crate::types::{Status, StatusKind, fmi2String};

/// Why a call was refused.
#[derive(Debug)]
pub(crate) struct Refusal {
    pub status: Status,
    pub message: String,
}

pub(crate) type Outcome<T = ()> = Result<T, Refusal>;

/// A refusal with `fmi2Error`.
#[cold]
pub(crate) fn refuse<T>(message: impl Into<String>) -> Outcome<T> {
    Err(Refusal { status: Status::Error, message: message.into() })
}

impl From<ModelError> for Refusal {
    fn from(error: ModelError) -> Self {
        Self { status: Status::Error, message: error.to_string() }
    }
}

/// An instance of model `M` that logs to `S`.
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

// --- Checks, log, life cycle (sections 2.1.5 and 2.1.6) ---
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
        Err(Refusal { status, message })
    }

    #[cold]
    pub fn log_refusal(&self, function: Function, refusal: &Refusal) {
        let category = match refusal.status {
            Status::Fatal => Category::Fatal,
            Status::Discard => Category::Warning,
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

// --- Values (section 2.1.7) ---
impl<M: Model, S: Sink> Instance<M, S> {
    #[inline]
    pub fn get_real(&self, vr: &[u32], values: &mut [f64]) -> Outcome {
        for vr in vr {
            variable::<M>(*vr, BaseType::Real)?;
        }
        for (vr, value) in vr.iter().zip(values) {
            *value = finite::<M>(*vr, self.state.model.real(*vr))?;
        }
        Ok(())
    }

    pub fn get_integer(&self, vr: &[u32], values: &mut [i32]) -> Outcome {
        for vr in vr {
            variable::<M>(*vr, BaseType::Integer)?;
        }
        for (vr, value) in vr.iter().zip(values) {
            *value = self.state.model.integer(*vr);
        }
        Ok(())
    }

    pub fn get_boolean(&self, vr: &[u32], values: &mut [i32]) -> Outcome {
        for vr in vr {
            variable::<M>(*vr, BaseType::Boolean)?;
        }
        for (vr, value) in vr.iter().zip(values) {
            *value = i32::from(self.state.model.boolean(*vr));
        }
        Ok(())
    }

    /// There are no String variables: every value reference is of another type or unknown.
    pub fn get_string(&self, vr: &[u32], _values: &mut [fmi2String]) -> Outcome {
        vr.iter().try_for_each(|vr| variable::<M>(*vr, BaseType::String).map(|_| ()))
    }

    /// See [`get_string`](Self::get_string).
    pub fn set_string(&mut self, vr: &[u32], _values: &[fmi2String]) -> Outcome {
        self.get_string(vr, &mut [])
    }

    #[inline]
    pub fn set_real(&mut self, vr: &[u32], values: &[f64]) -> Outcome {
        let mut parameters = false;
        for (vr, value) in vr.iter().zip(values) {
            let variable = variable::<M>(*vr, BaseType::Real)?;
            self.check_settable(variable)?;
            if !value.is_finite() {
                return refuse(format!("{} must be a finite number, it is {value}", variable.name));
            }
            if variable.causality == Causality::Parameter {
                parameters = true;
                check_real_range(variable, *value)?;
            }
        }
        self.assign(parameters, |model| {
            for (vr, value) in vr.iter().zip(values) {
                model.set_real(*vr, *value);
            }
        })
    }

    pub fn set_integer(&mut self, vr: &[u32], values: &[i32]) -> Outcome {
        for (vr, value) in vr.iter().zip(values) {
            let variable = variable::<M>(*vr, BaseType::Integer)?;
            self.check_settable(variable)?;
            if let Kind::Integer { min, max, .. } = variable.kind
                && !(min..=max).contains(value)
            {
                return refuse(format!("{} must be between {min} and {max}, it is {value}", variable.name));
            }
        }
        self.assign(true, |model| {
            for (vr, value) in vr.iter().zip(values) {
                model.set_integer(*vr, *value);
            }
        })
    }

    pub fn set_boolean(&mut self, vr: &[u32], values: &[i32]) -> Outcome {
        for (vr, value) in vr.iter().zip(values) {
            let variable = variable::<M>(*vr, BaseType::Boolean)?;
            self.check_settable(variable)?;
            if !(0..=1).contains(value) {
                return refuse(format!("{} must be 0 (false) or 1 (true), it is {value}", variable.name));
            }
        }
        self.assign(true, |model| {
            for (vr, value) in vr.iter().zip(values) {
                model.set_boolean(*vr, *value == 1);
            }
        })
    }

    #[inline]
    fn check_settable(&self, variable: &Variable) -> Outcome {
        let modes = match self.interface {
            Interface::CoSimulation => variable.settable.co_simulation,
            Interface::ModelExchange => variable.settable.model_exchange,
        };
        if modes.contains(self.state.mode) {
            return Ok(());
        }
        refuse(format!(
            "{} cannot be set in state '{}' of {}; it can be set in: {modes}",
            variable.name, self.state.mode, self.interface
        ))
    }

    /// Inputs and states are just set; a change of parameters is tried on a copy first, because the
    /// model may refuse the combination.
    #[inline]
    fn assign(&mut self, parameters: bool, set: impl Fn(&mut M)) -> Outcome {
        if !parameters {
            set(&mut self.state.model);
            return Ok(());
        }
        let mut draft = self.state.model.clone();
        set(&mut draft);
        draft.parameters_changed()?;
        self.state.model = draft;
        Ok(())
    }
}

// --- Saved states (section 2.1.8) ---
impl<M: Model, S: Sink> Instance<M, S> {
    pub fn save(&self) -> SavedState<M> {
        SavedState { interface: self.interface, state: self.state.clone() }
    }

    /// Saves into a state that exists already, without allocation if the model clones without.
    pub fn save_into(&self, saved: &mut SavedState<M>) {
        saved.interface = self.interface;
        saved.state.clone_from(&self.state);
    }

    pub fn restore(&mut self, saved: &SavedState<M>) -> Outcome {
        self.check_interface(saved)?;
        self.state.clone_from(&saved.state);
        Ok(())
    }

    pub fn serialized_size(&self, saved: &SavedState<M>) -> Outcome<usize> {
        self.check_serializes()?;
        Ok(state::serialized_size(&saved.state))
    }

    pub fn serialize(&self, saved: &SavedState<M>, bytes: &mut [u8]) -> Outcome {
        let size = self.serialized_size(saved)?;
        if bytes.len() != size {
            return refuse(format!(
                "the state needs {size} bytes, the buffer has {}; ask fmi2SerializedFMUstateSize",
                bytes.len()
            ));
        }
        state::serialize(&saved.state, saved.interface, bytes);
        Ok(())
    }

    pub fn deserialize(&self, bytes: &[u8]) -> Outcome<SavedState<M>> {
        self.check_serializes()?;
        let mut state = state::deserialize(bytes, self.interface, &self.state).or_else(refuse)?;
        state.model.parameters_changed()?;
        Ok(SavedState { interface: self.interface, state })
    }

    fn check_serializes(&self) -> Outcome {
        let offered = match self.interface {
            Interface::CoSimulation => M::INFO.co_simulation.is_some_and(|offer| offer.serializes_state),
            Interface::ModelExchange => M::INFO.model_exchange.is_some_and(|offer| offer.serializes_state),
        };
        if offered {
            Ok(())
        } else {
            refuse("this FMU does not serialize states (canSerializeFMUstate is false)")
        }
    }

    fn check_interface(&self, saved: &SavedState<M>) -> Outcome {
        if saved.interface == self.interface {
            return Ok(());
        }
        refuse(format!("the state comes from {}, this instance is {}", saved.interface, self.interface))
    }
}

// --- Derivatives with respect to variables and to time (sections 2.1.9 and 4.2.1) ---
impl<M: Model, S: Sink> Instance<M, S> {
    pub fn directional_derivative(
        &self,
        unknown: &[u32],
        known: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Outcome {
        let offered = match self.interface {
            Interface::CoSimulation => {
                M::INFO.co_simulation.is_some_and(|offer| offer.directional_derivative)
            }
            Interface::ModelExchange => {
                M::INFO.model_exchange.is_some_and(|offer| offer.directional_derivative)
            }
        };
        if !offered {
            return refuse(
                "this FMU has no directional derivatives (providesDirectionalDerivative is false)",
            );
        }
        for vr in unknown {
            let variable = variable::<M>(*vr, BaseType::Real)?;
            if variable.causality != Causality::Output && !variable.is_state_derivative() {
                return refuse(format!(
                    "{} is no unknown: neither output nor state derivative",
                    variable.name
                ));
            }
        }
        for (vr, seed) in known.iter().zip(seed) {
            let variable = variable::<M>(*vr, BaseType::Real)?;
            let parameter =
                variable.causality == Causality::Parameter && self.state.mode == Mode::Initialization;
            if variable.causality != Causality::Input && !variable.state && !parameter {
                return refuse(format!("{} is no known: neither input nor state", variable.name));
            }
            if !seed.is_finite() {
                return refuse(format!(
                    "the seed of {} must be a finite number, it is {seed}",
                    variable.name
                ));
            }
        }
        for (unknown, result) in unknown.iter().zip(result) {
            let mut sum = 0.0;
            for (known, seed) in known.iter().zip(seed) {
                let Some(partial) = self.state.model.partial_derivative(*unknown, *known) else {
                    return refuse(format!(
                        "the derivative of {} with respect to {} is not provided",
                        name::<M>(*unknown),
                        name::<M>(*known)
                    ));
                };
                sum += partial * seed;
            }
            *result = finite::<M>(*unknown, sum)?;
        }
        Ok(())
    }

    pub fn set_input_derivatives(&mut self, vr: &[u32], orders: &[i32], values: &[f64]) -> Outcome {
        if !M::INFO.co_simulation.is_some_and(|offer| offer.interpolates_inputs) {
            return refuse("this FMU does not use input derivatives (canInterpolateInputs is false)");
        }
        for ((vr, order), value) in vr.iter().zip(orders).zip(values) {
            let variable = variable::<M>(*vr, BaseType::Real)?;
            if variable.causality != Causality::Input || variable.variability != Variability::Continuous {
                return refuse(format!("{} is no continuous input", variable.name));
            }
            check_order(variable, *order)?;
            if !value.is_finite() {
                return refuse(format!(
                    "the derivative of {} must be a finite number, it is {value}",
                    variable.name
                ));
            }
        }
        for ((vr, order), value) in vr.iter().zip(orders).zip(values) {
            self.state.model.set_input_derivative(*vr, order.unsigned_abs(), *value);
        }
        Ok(())
    }

    pub fn get_output_derivatives(&self, vr: &[u32], orders: &[i32], values: &mut [f64]) -> Outcome {
        if M::INFO.co_simulation.is_none_or(|offer| offer.max_output_derivative_order == 0) {
            return refuse("this FMU has no output derivatives (maxOutputDerivativeOrder is 0)");
        }
        for (vr, order) in vr.iter().zip(orders) {
            check_order(variable::<M>(*vr, BaseType::Real)?, *order)?;
        }
        for ((vr, order), value) in vr.iter().zip(orders).zip(values) {
            *value = finite::<M>(*vr, self.state.model.output_derivative(*vr, order.unsigned_abs()))?;
        }
        Ok(())
    }
}

// --- Co-Simulation (section 4.2) ---
impl<M: Model, S: Sink> Instance<M, S> {
    #[inline]
    pub fn do_step(&mut self, point: f64, step_size: f64) -> Outcome {
        let end = point + step_size;
        if !(point.is_finite() && step_size > 0.0 && end.is_finite()) {
            return refuse(format!(
                "the communication point must be finite and the step size finite and > 0, they are {point} and {step_size}"
            ));
        }
        if end <= point {
            return refuse(format!(
                "the step size {step_size} vanishes beside the communication point {point}"
            ));
        }
        let rounding = rounding(point, step_size);
        if (point - self.state.time).abs() > rounding {
            return refuse(format!(
                "the communication point is {point}, but the last step ended at {}; go on from there or set a saved state",
                self.state.time
            ));
        }
        if let Some(stop_time) = self.state.stop_time
            && end > stop_time + rounding + STOP_TIME_ROUNDING * (stop_time - self.state.start_time)
        {
            return refuse(format!("the step would end at {end}, after the stop time {stop_time}"));
        }
        self.state.model.do_step(point, step_size)?;
        self.state.time = end;
        Ok(())
    }

    /// `fmi2GetStatus`: only asynchronous steps have one.
    pub fn no_status(&self, kind: StatusKind) -> Outcome {
        let message = match kind {
            StatusKind::DoStepStatus | StatusKind::PendingStatus => {
                "no step is pending: fmi2DoStep works synchronously"
            }
            StatusKind::LastSuccessfulTime => "fmi2LastSuccessfulTime is a Real: ask fmi2GetRealStatus",
            StatusKind::Terminated => "fmi2Terminated is a Boolean: ask fmi2GetBooleanStatus",
        };
        Err(Refusal { status: Status::Discard, message: message.to_owned() })
    }

    pub fn last_successful_time(&self) -> f64 {
        self.state.time
    }
}

// --- Model Exchange (section 3.2) ---
impl<M: Model, S: Sink> Instance<M, S> {
    pub fn enter_event_mode(&mut self) {
        self.state.mode = Mode::Event;
    }

    pub fn enter_continuous_time_mode(&mut self) {
        self.state.mode = Mode::ContinuousTime;
    }

    pub fn set_time(&mut self, time: f64) -> Outcome {
        if !time.is_finite() {
            return refuse(format!("the time must be a finite number, it is {time}"));
        }
        self.state.time = time;
        self.state.model.set_time(time);
        Ok(())
    }

    pub fn set_continuous_states(&mut self, x: &[f64]) -> Outcome {
        check_count::<M>(x.len())?;
        for (vr, value) in M::INFO.states().zip(x) {
            if !value.is_finite() {
                return refuse(format!("{} must be a finite number, it is {value}", name::<M>(vr)));
            }
        }
        for (vr, value) in M::INFO.states().zip(x) {
            self.state.model.set_real(vr, *value);
        }
        Ok(())
    }

    pub fn get_continuous_states(&self, x: &mut [f64]) -> Outcome {
        self.fill(M::INFO.states(), x)
    }

    pub fn get_derivatives(&self, derivatives: &mut [f64]) -> Outcome {
        self.fill(M::INFO.derivatives(), derivatives)
    }

    fn fill(&self, vrs: impl Iterator<Item = u32>, values: &mut [f64]) -> Outcome {
        check_count::<M>(values.len())?;
        for (vr, value) in vrs.zip(values) {
            *value = finite::<M>(vr, self.state.model.real(vr))?;
        }
        Ok(())
    }

    pub fn get_nominals(&self, nominals: &mut [f64]) -> Outcome {
        check_count::<M>(nominals.len())?;
        for (vr, value) in M::INFO.states().zip(nominals) {
            if let Kind::Real { of, .. } = M::INFO.variables[vr as usize].kind {
                *value = of.nominal.unwrap_or(1.0);
            }
        }
        Ok(())
    }

    /// There are no event indicators, so the only array that fits is empty.
    pub fn get_event_indicators(&self, count: usize) -> Outcome {
        if count == 0 { Ok(()) } else { refuse(format!("there are no event indicators, not {count}")) }
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
    refuse(format!(
        "{} is out of the range of numbers; look for extreme inputs, states or parameters",
        name::<M>(vr)
    ))
}

fn check_real_range(variable: &Variable, value: f64) -> Outcome {
    if let Kind::Real { of, .. } = variable.kind {
        if let Some(min) = of.min
            && value < min
        {
            return refuse(format!("{} must not be below {min}, it is {value}", variable.name));
        }
        if let Some(max) = of.max
            && value > max
        {
            return refuse(format!("{} must not be above {max}, it is {value}", variable.name));
        }
    }
    Ok(())
}

fn check_order(variable: &Variable, order: i32) -> Outcome {
    if order >= 1 {
        return Ok(());
    }
    refuse(format!("the order of the derivative of {} must be at least 1, it is {order}", variable.name))
}

fn check_count<M: Model>(count: usize) -> Outcome {
    let states = M::INFO.states().count();
    if count == states {
        return Ok(());
    }
    refuse(format!("the model has {states} continuous states, the array has {count} elements"))
}

/// How far the last step may end after the stop time, of the whole simulated time: masters that count in
/// nanoseconds round a step of 1/60 s up, every time.
const STOP_TIME_ROUNDING: f64 = 1e-7;

/// How far a communication point may be off: masters count in nanoseconds, add up step sizes or
/// multiply them, and lose the last digits each in their own way.
#[inline]
fn rounding(point: f64, step_size: f64) -> f64 {
    (0.01 * step_size).min(1e-9) + 8.0 * f64::EPSILON * point.abs()
}

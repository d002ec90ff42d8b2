//! One instance of a model: the checks and the effect of every call. No pointers here, and no version of FMI.
//!
//! Every method checks all its arguments before it changes anything; a refusal leaves the instance as it was.

mod co_simulation;
mod derivatives;
mod model_exchange;
mod refusal;
mod saved_states;
mod serialized;
mod values;

pub(crate) use co_simulation::no_status;
pub(crate) use refusal::{Outcome, Refusal, refuse, refuse_with};
pub(crate) use saved_states::SavedState;

use crate::export::Exported;
use crate::log::Logger;
use crate::mode::{Interface, Mode, Situation};
use crate::model::{Error, Experiment, Setup};
use crate::status::Status;
use crate::types::BaseType;
use crate::variable::Variable;

/// An instance of model `M`.
pub(crate) struct Instance<M> {
    pub logger: Logger,
    /// The states of the standards' state machines and the interface type, as one bit; follows from both.
    situation: Situation,
    setup: Setup,
    state: State<M>,
    /// Texts that the importer reads until the next call.
    pub texts: Vec<std::ffi::CString>,
}

/// What a saved state brings back.
struct State<M> {
    mode: Mode,
    /// Whether the model must calculate before anything is read.
    stale: bool,
    /// Whether the model wants the simulation to end.
    ended: bool,
    time: f64,
    experiment: Experiment,
    model: M,
}

impl<M: Clone> Clone for State<M> {
    fn clone(&self) -> Self {
        Self { model: self.model.clone(), ..*self }
    }

    /// Passes on to the model, which may have a way to clone into what is there already.
    fn clone_from(&mut self, source: &Self) {
        let Self { mode, stale, ended, time, experiment, model } = source;
        (self.mode, self.stale, self.ended, self.time) = (*mode, *stale, *ended, *time);
        self.experiment = *experiment;
        self.model.clone_from(model);
    }
}

impl<M: Exported> State<M> {
    /// The state of a new instance and after a reset.
    fn new(setup: &Setup) -> Result<Self, Error> {
        Ok(Self {
            mode: Mode::Instantiated,
            stale: true,
            ended: false,
            time: 0.0,
            experiment: Experiment::default(),
            model: M::new(setup)?,
        })
    }
}

/// Life cycle (sections 2.1.5 and 2.1.6); the other rooms have a file each.
impl<M: Exported> Instance<M> {
    pub fn new(setup: Setup, logging_on: bool) -> Outcome<Self> {
        match setup.interface {
            Interface::ModelExchange if M::MODEL_EXCHANGE.is_none() => {
                return refuse("this FMU has no Model Exchange");
            }
            Interface::CoSimulation if M::CO_SIMULATION.is_none() => {
                return refuse("this FMU has no Co-Simulation");
            }
            _ => {}
        }
        let state = State::new(&setup)?;
        let mut instance = Self {
            logger: Logger::new(logging_on),
            situation: Situation::new(setup.interface, state.mode),
            setup,
            state,
            texts: Vec::new(),
        };
        instance.logger.log(Status::Ok, "instantiated");
        Ok(instance)
    }

    pub fn interface(&self) -> Interface {
        self.setup.interface
    }

    pub fn mode(&self) -> Mode {
        self.state.mode
    }

    #[inline]
    pub fn situation(&self) -> Situation {
        self.situation
    }

    fn enter(&mut self, mode: Mode) {
        self.state.mode = mode;
        self.situation = Situation::new(self.setup.interface, mode);
    }

    /// Replaces everything that a saved state holds.
    fn replace(&mut self, state: State<M>) {
        self.state = state;
        self.enter(self.state.mode);
    }

    /// After a panic: nothing but freeing is left.
    #[cold]
    pub fn break_down(&mut self) {
        self.enter(Mode::Fatal);
    }

    /// Takes over what the model has to say.
    #[inline]
    pub fn listen(&mut self) {
        if let Some(log) = self.state.model.log()
            && !log.is_empty()
        {
            log.take().into_iter().for_each(|message| self.logger.add(message));
        }
    }

    pub fn setup_experiment(&mut self, experiment: Experiment) -> Outcome {
        let Experiment { start_time, stop_time, tolerance } = experiment;
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
        self.state.experiment = experiment;
        self.state.time = start_time;
        self.state.stale = true;
        Ok(())
    }

    pub fn enter_initialization_mode(&mut self) -> Outcome {
        let experiment = self.state.experiment;
        self.try_on_copy(|model| model.initialize(&experiment))?;
        self.enter(Mode::Initialization);
        Ok(())
    }

    pub fn exit_initialization_mode(&mut self) {
        self.enter(match self.setup.interface {
            Interface::CoSimulation => Mode::StepComplete,
            Interface::ModelExchange => Mode::Event,
        });
        self.logger.log(Status::Ok, "initialized");
    }

    pub fn terminate(&mut self) {
        self.enter(Mode::Terminated);
        self.logger.log(Status::Ok, "terminated");
    }

    pub fn reset(&mut self) -> Outcome {
        self.replace(State::new(&self.setup)?);
        self.logger.log(Status::Ok, "reset to the start values");
        Ok(())
    }

    /// What a model may refuse is tried on a copy first; nothing has changed if it does.
    #[cold]
    #[inline(never)]
    fn try_on_copy<T>(&mut self, change: impl FnOnce(&mut M) -> Result<T, Error>) -> Outcome<T> {
        let mut draft = self.state.model.clone();
        let changed = change(&mut draft)?;
        self.state.model = draft;
        self.state.stale = true;
        Ok(changed)
    }

    /// The model with all calculated that is read.
    #[inline]
    fn calculated(&mut self) -> &M {
        if self.state.stale {
            self.state.stale = false;
            self.state.model.calculate(self.state.time);
        }
        &self.state.model
    }
}

/// The variable of this value reference, if it has the type.
#[inline]
fn variable<M: Exported>(vr: u32, base: BaseType) -> Outcome<&'static Variable<M>> {
    match M::TABLE.get(vr as usize) {
        Some(variable) if variable.base() == base => Ok(variable),
        other => refuse_variable(vr, other, base),
    }
}

#[cold]
#[inline(never)]
fn refuse_variable<T, M>(vr: u32, variable: Option<&Variable<M>>, base: BaseType) -> Outcome<T> {
    match variable {
        Some(variable) => refuse(format!("{} is of type {}, not {base}", variable.name(), variable.base())),
        None => refuse(format!("there is no variable with value reference {vr}")),
    }
}

#[inline]
fn finite<M>(variable: &Variable<M>, value: f64) -> Outcome<f64> {
    if value.is_finite() {
        return Ok(value);
    }
    refuse_with(|| {
        format!(
            "{} is out of the range of numbers; look for extreme inputs, states or parameters",
            variable.name()
        )
    })
}

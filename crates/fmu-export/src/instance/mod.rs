//! An instance of a model. Its methods check and carry out the calls of both FMI versions. They take Rust types
//! instead of pointers.
//!
//! Every method checks all its arguments before it changes anything, or undoes its changes, so an error leaves the
//! instance unchanged, except for the records of rejected start values.

mod co_simulation;
mod derivatives;
mod handles;
mod integration;
mod model_exchange;
mod origin;
mod reference;
mod rejection;
mod saved_states;
mod serialized;
mod sorted;
mod values;

pub(crate) use reference::{FromOne, Reference};
pub(crate) use rejection::{Outcome, Rejection, discard, reject, reject_with};
pub(crate) use values::too_long;

use self::sorted::Sorted;
use crate::capabilities::Events;
use crate::export::Exported;
use crate::log::Logger;
use crate::memory::{Boxed, try_box};
use crate::model::{Error, Experiment, Setup};
use crate::offsets::Placed;
use crate::stamp::new_model;
use crate::types::{NUMBER, TIME};
use crate::variable::{Read, Variable, shape_of_calculation};
use fmi_abi::BaseType;
use fmi_abi::Causality;
use fmi_abi::Status;
use fmi_abi::Value;
use fmi_abi::{FmiState, Interface, Mode, Standard};

/// An instance of model `M`.
pub(crate) struct Instance<M> {
    pub logger: Logger,
    /// State of the FMI state machine, FMI version and interface type, as one bit. It is derived from other fields,
    /// to make the check of allowed calls fast.
    fmi_state: FmiState,
    importer: Importer,
    setup: Setup,
    state: State<M>,
    /// Messages of rejected start values by the index of the variable. Setting the variable to a valid value removes
    /// its message.
    rejected: Sorted<u32, String>,
    /// States that the importer has saved and not freed.
    saved: saved_states::SavedStates<M>,
    /// Backup of the state at the start of the last step, if a failed step may have to be undone; see
    /// [`needs_undo`](Self::needs_undo).
    rollback: Option<Boxed<State<M>>>,
    /// Strings that the last call has returned, which the importer may read until the next call.
    pub strings: Vec<std::ffi::CString>,
    /// Binary values that the last call has returned, which the importer may read until the next call.
    pub bytes: Vec<Vec<u8>>,
    /// Reusable buffer for models with arrays: the indices of all array elements and scalars that a call accesses.
    pub elements: Vec<u32>,
}

/// Properties of the importer, which do not change after the instantiation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Importer {
    pub standard: Standard,
    /// Whether the importer handles events in Co-Simulation.
    pub event_mode: bool,
    /// Whether the importer accepts steps that end early. Importers of FMI 2.0 accept them, because the step then
    /// returns `fmi2Discard`.
    pub early_return: bool,
}

impl Importer {
    /// An importer of FMI 2.0.
    pub const FMI2: Self = Self { standard: Standard::Fmi2, event_mode: false, early_return: true };
}

/// State of an instance, and the content of a saved state.
struct State<M> {
    mode: Mode,
    /// Whether [`calculate`](crate::Model::calculate) of the model must be called before a value is read.
    stale: bool,
    /// Whether the model has made a step or entered Continuous-Time Mode. After a de-serialization this is unknown, so
    /// the value is false.
    started: bool,
    /// Whether the model has requested the end of the simulation.
    ended: bool,
    time: f64,
    experiment: Experiment,
    model: Placed<M>,
}

impl<M: Clone> Clone for State<M> {
    fn clone(&self) -> Self {
        Self { model: self.model.clone(), ..*self }
    }

    /// Calls `clone_from` of the model, which may reuse its allocations.
    fn clone_from(&mut self, source: &Self) {
        let Self { mode, stale, started, ended, time, experiment, model } = source;
        (self.mode, self.stale, self.started) = (*mode, *stale, *started);
        (self.ended, self.time) = (*ended, *time);
        self.experiment = *experiment;
        self.model.clone_from(model);
    }
}

impl<M: Exported> State<M> {
    /// Whether a backup contains only the fields that the table lists, and its `memory`. This is so for a model with
    /// heap memory, because cloning the whole model may allocate.
    const COPIES_VALUES: bool = std::mem::needs_drop::<M>();

    /// Copies the parts of `source` that [`undo`](Self::undo) needs.
    fn back_up(&mut self, source: &Self) {
        if !Self::COPIES_VALUES {
            return self.clone_from(source);
        }
        let Self { mode, stale, started, ended, time, experiment, model } = source;
        (self.mode, self.stale, self.started) = (*mode, *stale, *started);
        (self.ended, self.time) = (*ended, *time);
        self.experiment = *experiment;
        self.model.copy_values(model);
    }

    /// Restores a state that was [backed up](Self::back_up).
    ///
    /// # Panics
    /// Panics if the model rejects the state, although it was in this state before.
    #[cold]
    fn undo(&mut self, before: &Self) {
        self.back_up(before);
        if Self::COPIES_VALUES {
            self.stale = true;
            let model = &mut *self.model;
            if let Err(error) = model.restored().and_then(|()| model.update()) {
                panic!(
                    "a failed step cannot be undone, because the model rejects its state before the step: {error}"
                );
            }
        }
    }

    /// Creates the state that an instance has after instantiation or a reset.
    fn new(setup: &Setup) -> Result<Self, Error> {
        Ok(Self {
            mode: Mode::Instantiated,
            stale: true,
            started: false,
            ended: false,
            time: 0.0,
            experiment: Experiment::default(),
            model: Placed::new(new_model(setup)?),
        })
    }
}

/// Functions of the life cycle (sections 2.1.5 and 2.1.6 of FMI 2.0, 2.3 of FMI 3.0). The submodules contain the
/// other functions.
impl<M: Exported> Instance<M> {
    pub fn new(setup: Setup, importer: Importer, logging_on: bool) -> Outcome<Self> {
        match setup.interface {
            Interface::ModelExchange if M::MODEL_EXCHANGE.is_none() => {
                return reject("this FMU has no Model Exchange");
            }
            Interface::CoSimulation if M::CO_SIMULATION.is_none() => {
                return reject("this FMU has no Co-Simulation");
            }
            _ => {}
        }
        if importer.event_mode && M::CO_SIMULATION.is_none_or(|offer| !offer.has_event_mode()) {
            return reject("this FMU has no event mode in Co-Simulation (hasEventMode is false)");
        }
        let state = State::new(&setup)?;
        let needs_undo = setup.interface == Interface::CoSimulation && Self::needs_undo(importer);
        let mut instance = Self {
            logger: Logger::new(importer.standard, logging_on),
            fmi_state: FmiState::new(importer.standard, setup.interface, state.mode),
            importer,
            setup,
            rollback: needs_undo.then(|| try_box(state.clone())).transpose()?,
            state,
            rejected: Sorted::new(),
            saved: handles::Handles::new(),
            strings: Vec::new(),
            bytes: Vec::new(),
            elements: Vec::with_capacity(if M::ARRAYS { M::TABLE.len() } else { 0 }),
        };
        instance.listen();
        instance.logger.log(Status::Ok, "instantiated");
        Ok(instance)
    }

    pub fn interface(&self) -> Interface {
        self.setup.interface
    }

    pub fn standard(&self) -> Standard {
        self.importer.standard
    }

    pub fn mode(&self) -> Mode {
        self.state.mode
    }

    #[inline]
    pub fn fmi_state(&self) -> FmiState {
        self.fmi_state
    }

    fn enter(&mut self, mode: Mode) {
        self.state.mode = mode;
        self.fmi_state = FmiState::new(self.importer.standard, self.setup.interface, mode);
    }

    /// Replaces the whole state of the instance.
    fn replace(&mut self, state: State<M>) {
        self.state = state;
        self.rejected.clear();
        self.enter(self.state.mode);
    }

    /// Marks the instance as fatal after a panic: the importer may only free it.
    #[cold]
    pub fn break_down(&mut self) {
        self.enter(Mode::Fatal);
    }

    /// Takes the messages from the log of the model. Returns whether there were any.
    #[inline]
    pub fn listen(&mut self) -> bool {
        self.logger.listen(self.state.model.log())
    }

    pub fn setup_experiment(&mut self, experiment: Experiment) -> Outcome {
        let Experiment { start_time, stop_time, tolerance } = experiment;
        if let Some(tolerance) = tolerance
            && !(tolerance.is_finite() && tolerance >= 0.0)
        {
            return reject(format!("tolerance must be a number not below 0, it is {tolerance}"));
        }
        if !start_time.is_finite() {
            return reject(format!("startTime must be a finite number, it is {start_time}"));
        }
        if let Some(stop_time) = stop_time
            && !(stop_time.is_finite() && stop_time >= start_time)
        {
            return reject(format!(
                "stopTime must be a finite number not before startTime ({start_time}), it is {stop_time}"
            ));
        }
        self.state.experiment = experiment;
        self.state.time = start_time;
        self.state.stale = true;
        Ok(())
    }

    pub fn enter_initialization_mode(&mut self) -> Outcome {
        self.check_start_values()?;
        let experiment = self.state.experiment;
        self.try_change(|model| model.initialize(&experiment))?;
        self.enter(Mode::Initialization);
        Ok(())
    }

    /// Sets up the experiment and enters Initialization Mode, which is one call in FMI 3.0.
    pub fn enter_initialization_mode_at(&mut self, experiment: Experiment) -> Outcome {
        let before = (self.state.experiment, self.state.time);
        self.setup_experiment(experiment)?;
        self.enter_initialization_mode().inspect_err(|_| {
            (self.state.experiment, self.state.time) = before;
        })
    }

    pub fn exit_initialization_mode(&mut self) -> Outcome {
        self.check_start_values()?;
        let mode = match self.setup.interface {
            Interface::CoSimulation if self.importer.event_mode => Mode::Event,
            Interface::CoSimulation => {
                if M::CO_SIMULATION.is_some_and(|offer| offer.events == Events::Stop) {
                    self.handle_event()?;
                }
                Mode::StepComplete
            }
            Interface::ModelExchange => Mode::Event,
        };
        self.enter(mode);
        self.logger.log(Status::Ok, "initialized");
        Ok(())
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

    /// Applies a change to the model, and undoes the change if it fails.
    ///
    /// The change applies to the model itself, and a copy is the backup, not the other way around. A copy may lack
    /// allocated memory and cached results of the original, so this way an accepted change does not make the instance
    /// slower.
    #[cold]
    #[inline(never)]
    fn try_change<T, E: Into<Box<Rejection>>>(
        &mut self,
        change: impl FnOnce(&mut M) -> Result<T, E>,
    ) -> Outcome<T> {
        // Takes the messages before and after the change, because the change or the backup may replace the model, and
        // its log with it.
        self.listen();
        let before = M::clone(&self.state.model);
        let changed = change(&mut self.state.model);
        self.listen();
        match changed {
            Ok(changed) => {
                self.state.stale = true;
                Ok(changed)
            }
            Err(rejection) => {
                (*self.state.model).clone_from(&before);
                Err(rejection.into())
            }
        }
    }

    /// Returns the model, after the calculation that reading its values may require.
    #[inline]
    fn calculated(&mut self) -> &Placed<M> {
        if self.state.stale {
            self.state.stale = false;
            self.state.model.calculate(self.state.time);
        }
        &self.state.model
    }
}

impl<M: Exported> Instance<M> {
    /// Returns the variable at this index: in the table or, in FMI 3.0, an additional one after it.
    #[inline]
    fn find(&self, index: u32) -> Option<&'static Variable<M>> {
        match M::TABLE.get(index as usize) {
            None if self.importer.standard == Standard::Fmi3 => implicit(index),
            found => found,
        }
    }

    /// Returns the variable at this index, or an error if there is none or its type is not `base`.
    #[inline]
    pub fn variable(&self, index: u32, base: BaseType) -> Outcome<&'static Variable<M>> {
        match self.find(index) {
            Some(variable) if variable.base() == base => Ok(variable),
            other => self.reject_variable(index, other, base),
        }
    }

    #[cold]
    #[inline(never)]
    fn reject_variable<T>(&self, index: u32, variable: Option<&Variable<M>>, base: BaseType) -> Outcome<T> {
        match variable {
            Some(variable) => {
                reject(format!("{} is of type {}, not {base}", variable.name(), variable.base()))
            }
            None => self.reject_index(index),
        }
    }

    /// Returns the number of values of these variables together. In FMI 3.0, a value reference may denote an array. Fails at the first
    /// reference without a variable, and at an element of an array.
    pub fn count_elements<R: Reference>(&self, vr: &[R]) -> Outcome<usize> {
        if !(M::ARRAYS && R::ARRAYS) {
            return Ok(vr.len());
        }
        let mut count = 0;
        for index in vr.iter().map(|vr| vr.index()) {
            match self.find(index) {
                Some(of) if of.element() == 0 => count += of.length(),
                // If the length is wrong, the next reference may be outside of the importer's array, so none is read.
                _ => return self.reject_index(index),
            }
        }
        Ok(count)
    }

    /// Fails unless each reference belongs to a variable.
    #[cold]
    #[inline(never)]
    pub fn check_references<R: Reference>(&self, vr: &[R]) -> Outcome {
        match vr.iter().find(|vr| self.find(vr.index()).is_none()) {
            Some(unknown) => self.reject_index(unknown.index()),
            None => Ok(()),
        }
    }

    fn reject_index<T>(&self, index: u32) -> Outcome<T> {
        let reference = self.standard().reference(index);
        reject(format!("there is no variable with value reference {reference}"))
    }
}

/// Returns the indices of all elements of an array whose first element has this index; for a scalar, only its index.
pub(crate) fn elements_of<M: crate::Variables>(index: u32) -> impl Iterator<Item = u32> {
    let length = M::TABLE.get(index as usize).map_or(1, |of| of.length() as u32);
    (0..length).map(move |number| index.wrapping_add(number))
}

struct Implicit<M>(std::marker::PhantomData<M>);

impl<M: 'static> Implicit<M> {
    const TIME: &'static Variable<M> = &Variable::independent(&TIME).finished("time", "Simulation time");

    /// Describes every event indicator. The functions that read a value are never called, because the model calculates
    /// the values of all indicators together.
    const INDICATOR: &'static Variable<M> = &Variable::local(&NUMBER)
        .read_by(
            shape_of_calculation(std::marker::PhantomData::<M>, |_| f64::NAN),
            Read { real: |_, _| f64::NAN, reals: None, value: |_, _| Value::Real(f64::NAN) },
        )
        .finished("eventIndicator", "An event happens where it changes its sign");
}

/// Returns an additional variable of FMI 3.0, whose index is after the table. These variables are the time (section
/// 2.4.7.4), if the table does not contain it, and the event indicators (section 2.4.8).
#[cold]
fn implicit<M: Exported>(index: u32) -> Option<&'static Variable<M>> {
    let (time, variable) = independent::<M>();
    let variable = (index == time).then_some(variable);
    variable.or_else(|| indicator::<M>(index).map(|_| Implicit::INDICATOR))
}

/// Returns the number of the event indicator at this index, counted from 0; `None` if another variable has the index.
fn indicator<M: Exported>(index: u32) -> Option<usize> {
    let number = index.checked_sub(first_indicator::<M>())? as usize;
    (number < Instance::<M>::INDICATORS).then_some(number)
}

/// Returns the value of an additional variable: the time, or an event indicator.
#[cold]
fn implicit_value<M: Exported>(model: &M, time: f64, index: u32) -> f64 {
    let Some(number) = indicator::<M>(index) else { return time };
    let mut indicators = vec![0.0; Instance::<M>::INDICATORS];
    model.exported_indicators(&mut indicators);
    indicators[number]
}

/// Returns the index of the first event indicator, which follows the table and the time.
pub(crate) fn first_indicator<M: crate::Variables>() -> u32 {
    let (time, _) = independent::<M>();
    (M::TABLE.len() as u32).max(time + 1)
}

impl<M: crate::Variables> Implicit<M> {
    const INDEPENDENT: (u32, &'static Variable<M>) = {
        let mut index = 0;
        while index < M::TABLE.len() && !matches!(M::TABLE[index].causality(), Causality::Independent) {
            index += 1;
        }
        (index as u32, if index < M::TABLE.len() { &M::TABLE[index] } else { Self::TIME })
    };
}

/// Returns the index of the time and its variable, in the table or after it.
#[inline]
pub(crate) fn independent<M: crate::Variables>() -> (u32, &'static Variable<M>) {
    Implicit::INDEPENDENT
}

#[inline]
fn finite<M>(variable: &Variable<M>, value: f64) -> Outcome<f64> {
    if value.is_finite() {
        return Ok(value);
    }
    reject_with(|| {
        format!("{} is not a finite number; look for extreme inputs, states or parameters", variable.name())
    })
}

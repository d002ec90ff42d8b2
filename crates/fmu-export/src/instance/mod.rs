//! One instance of a model: the checks and the effect of every call. No pointers here, and no version of FMI.
//!
//! Every method checks all its arguments before it changes anything; a refusal leaves the instance as it was.

mod co_simulation;
mod derivatives;
mod model_exchange;
mod origin;
mod refusal;
mod saved_states;
mod serialized;
mod sorted;
mod values;

pub(crate) use co_simulation::no_status;
pub(crate) use refusal::{Outcome, Refusal, refuse, refuse_with};

use self::sorted::Sorted;
use crate::boundary::Placed;
use crate::capabilities::Events;
use crate::export::Exported;
use crate::log::Logger;
use crate::model::{Error, Experiment, Setup};
use crate::types::{NUMBER, TIME};
use crate::variable::{Read, ReadAt, Variable, shape_of_calculation};
use fmi_abi::BaseType;
use fmi_abi::Causality;
use fmi_abi::Status;
use fmi_abi::Value;
use fmi_abi::{Interface, Mode, Situation, Standard};

/// An instance of model `M`.
pub(crate) struct Instance<M> {
    pub logger: Logger,
    /// The state of the standards' state machines, the standard and the interface type, as one bit; follows from
    /// them.
    situation: Situation,
    /// The same once the model has started, before that nowhere: then Reals are set in their places.
    started_in: Situation,
    /// The latest end of a step that needs no further look; follows from the state, too.
    latest_end: f64,
    importer: Importer,
    setup: Setup,
    state: State<M>,
    /// Why start values were refused, of the variables that have been set to no other since.
    refused: Sorted<u32, String>,
    /// The states that the importer has saved and not freed.
    kept: saved_states::Kept<M>,
    /// Where the last step began, if one may fail half way: of FMI 3.0, unless each early end and event is the
    /// importer's at once.
    before: Option<Box<State<M>>>,
    /// Texts that the importer reads until the next call.
    pub texts: Vec<std::ffi::CString>,
    /// Bytes that the importer reads until the next call.
    pub bytes: Vec<Vec<u8>>,
    /// Room for the places of variables that a call is about, of arrays each element; for models with arrays.
    pub elements: Vec<u32>,
}

/// What an importer has said when it made an instance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Importer {
    pub standard: Standard,
    /// It handles events in Co-Simulation.
    pub event_mode: bool,
    /// It copes with steps that end early. Those of FMI 2.0 end with `fmi2Discard`.
    pub early_return: bool,
}

impl Importer {
    /// One of FMI 2.0.
    pub const FMI2: Self = Self { standard: Standard::Fmi2, event_mode: false, early_return: true };
}

/// How an importer calls a variable: by a number that stands for its place in the table, or behind it.
pub(crate) trait Reference: Copy {
    /// Whether one may stand for a whole array.
    const ARRAYS: bool;
    /// What the standard calls an array of these, and one of values.
    const REFERENCES: &str;
    const VALUES: &str;

    fn place(self) -> u32;

    /// An importer's array, as one of these.
    fn cast(array: *const u32) -> *const Self;
}

/// Of FMI 2.0: the place itself.
impl Reference for u32 {
    const ARRAYS: bool = false;
    const REFERENCES: &str = "vr";
    const VALUES: &str = "value";

    #[inline]
    fn cast(array: *const u32) -> *const Self {
        array
    }

    #[inline]
    fn place(self) -> u32 {
        self
    }
}

/// What a saved state brings back.
struct State<M> {
    mode: Mode,
    /// Whether the model must calculate before anything is read.
    stale: bool,
    /// Whether the model has stepped or been in Continuous-Time Mode, as far as the instance knows.
    started: bool,
    /// Whether the model wants the simulation to end.
    ended: bool,
    time: f64,
    experiment: Experiment,
    model: Placed<M>,
}

impl<M: Clone> Clone for State<M> {
    fn clone(&self) -> Self {
        Self { model: self.model.clone(), ..*self }
    }

    /// Passes on to the model, which may have a way to clone into what is there already.
    fn clone_from(&mut self, source: &Self) {
        let Self { mode, stale, started, ended, time, experiment, model } = source;
        (self.mode, self.stale, self.started) = (*mode, *stale, *started);
        (self.ended, self.time) = (*ended, *time);
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
            started: false,
            ended: false,
            time: 0.0,
            experiment: Experiment::default(),
            model: Placed::new(M::new(setup)?),
        })
    }
}

/// Life cycle (sections 2.1.5 and 2.1.6 of FMI 2.0, 2.3 of FMI 3.0); the other rooms have a file each.
impl<M: Exported> Instance<M> {
    pub fn new(setup: Setup, importer: Importer, logging_on: bool) -> Outcome<Self> {
        match setup.interface {
            Interface::ModelExchange if M::MODEL_EXCHANGE.is_none() => {
                return refuse("this FMU has no Model Exchange");
            }
            Interface::CoSimulation if M::CO_SIMULATION.is_none() => {
                return refuse("this FMU has no Co-Simulation");
            }
            _ => {}
        }
        if importer.event_mode && M::CO_SIMULATION.is_none_or(|offer| !offer.has_event_mode()) {
            return refuse("this FMU has no event mode in Co-Simulation (hasEventMode is false)");
        }
        let state = State::new(&setup)?;
        let may_fail_half_way = Self::ENDS_EARLY
            && setup.interface == Interface::CoSimulation
            && importer.standard == Standard::Fmi3
            && !(importer.event_mode && importer.early_return);
        let mut instance = Self {
            logger: Logger::new(importer.standard, logging_on),
            situation: Situation::new(importer.standard, setup.interface, state.mode),
            started_in: Situation::NOWHERE,
            latest_end: f64::NEG_INFINITY,
            importer,
            setup,
            before: may_fail_half_way.then(|| Box::new(state.clone())),
            state,
            refused: Sorted::new(),
            kept: Sorted::new(),
            texts: Vec::new(),
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
    pub fn situation(&self) -> Situation {
        self.situation
    }

    fn enter(&mut self, mode: Mode) {
        self.state.mode = mode;
        self.situation = Situation::new(self.importer.standard, self.setup.interface, mode);
        (self.started_in, self.latest_end) = match self.state.started {
            true => (self.situation, self.state.experiment.stop_time.unwrap_or(f64::MAX)),
            false => (Situation::NOWHERE, f64::NEG_INFINITY),
        };
    }

    /// While messages are delivered nothing is allowed.
    #[cold]
    pub fn while_delivering(&mut self, is_delivering: bool) {
        self.enter(self.state.mode);
        if is_delivering {
            self.situation = Situation::NOWHERE;
        }
    }

    /// Replaces everything that a saved state holds.
    fn replace(&mut self, state: State<M>) {
        self.state = state;
        self.refused.clear();
        self.enter(self.state.mode);
    }

    /// After a panic: nothing but freeing is left.
    #[cold]
    pub fn break_down(&mut self) {
        self.enter(Mode::Fatal);
    }

    /// Takes over what the model has to say. Returns whether it said anything.
    #[inline]
    pub fn listen(&mut self) -> bool {
        self.logger.listen(&mut *self.state.model)
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
        self.check_start_values()?;
        let experiment = self.state.experiment;
        self.try_on_copy(|model| model.initialize(&experiment))?;
        self.enter(Mode::Initialization);
        Ok(())
    }

    /// Both in one, as FMI 3.0 has it.
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

    /// What a model may refuse is tried on a copy first; nothing has changed if it does.
    #[cold]
    #[inline(never)]
    fn try_on_copy<T, E: Into<Box<Refusal>>>(
        &mut self,
        change: impl FnOnce(&mut M) -> Result<T, E>,
    ) -> Outcome<T> {
        // A copy has nothing to say yet, and one that is dropped has been heard.
        self.listen();
        let mut draft = M::clone(&self.state.model);
        let changed = change(&mut draft);
        self.logger.listen(&mut draft);
        let changed = changed.map_err(Into::into)?;
        *self.state.model = draft;
        self.state.stale = true;
        Ok(changed)
    }

    /// The model with all calculated that is read.
    #[inline]
    fn calculated(&mut self) -> &M {
        self.calculated_in_place()
    }

    #[inline]
    fn calculated_in_place(&mut self) -> &Placed<M> {
        if self.state.stale {
            self.state.stale = false;
            self.state.model.calculate(self.state.time);
        }
        &self.state.model
    }
}

impl<M: Exported> Instance<M> {
    /// The variable at this place.
    #[inline]
    fn find(&self, place: u32) -> Option<&'static Variable<M>> {
        match M::TABLE.get(place as usize) {
            None if self.importer.standard == Standard::Fmi3 => implicit(place),
            found => found,
        }
    }

    /// The variable at this place, if it has the type.
    #[inline]
    fn variable(&self, place: u32, base: BaseType) -> Outcome<&'static Variable<M>> {
        match self.find(place) {
            Some(variable) if variable.base() == base => Ok(variable),
            other => self.refuse_variable(place, other, base),
        }
    }

    #[cold]
    #[inline(never)]
    fn refuse_variable<T>(&self, place: u32, variable: Option<&Variable<M>>, base: BaseType) -> Outcome<T> {
        match variable {
            Some(variable) => {
                refuse(format!("{} is of type {}, not {base}", variable.name(), variable.base()))
            }
            None => self.refuse_place(place),
        }
    }

    /// How many values the variables have that an importer names, in FMI 3.0 arrays among them.
    pub fn count_elements<R: Reference>(&self, vr: &[R]) -> Outcome<usize> {
        if !(M::ARRAYS && R::ARRAYS) {
            return Ok(vr.len());
        }
        let mut count = 0;
        for place in vr.iter().map(|vr| vr.place()) {
            if M::TABLE.get(place as usize).is_some_and(|of| of.element() > 0) {
                return self.refuse_place(place);
            }
            count += elements_of::<M>(place).count();
        }
        Ok(count)
    }

    fn refuse_place<T>(&self, place: u32) -> Outcome<T> {
        let reference = self.standard().reference(place);
        refuse(format!("there is no variable with value reference {reference}"))
    }
}

/// The places of the elements of an array of FMI 3.0, whose first has this place; of a scalar its own.
pub(crate) fn elements_of<M: crate::Variables>(place: u32) -> impl Iterator<Item = u32> {
    let length = M::TABLE.get(place as usize).map_or(1, |of| of.length() as u32);
    (0..length).map(move |number| place.wrapping_add(number))
}

struct Implicit<M>(std::marker::PhantomData<M>);

impl<M: 'static> Implicit<M> {
    const TIME: &'static Variable<M> = &Variable::independent(&TIME).finished("time", "Simulation time");

    /// Any of them: who reads it has its value from the model.
    const INDICATOR: &'static Variable<M> = &Variable::local(&NUMBER)
        .read_by(
            Read {
                shape: shape_of_calculation(|_: &M| f64::NAN),
                real: |_| f64::NAN,
                value: |_| Value::Real(f64::NAN),
            },
            ReadAt { reals: |_, _, _| f64::NAN, value: |_, _| Value::Real(f64::NAN) },
        )
        .finished("eventIndicator", "An event happens where it changes its sign");
}

/// What FMI 3.0 asks for in every model, behind the table: the time (section 2.4.7.4), if the table has none; then the
/// event indicators (section 2.4.8).
#[cold]
fn implicit<M: Exported>(place: u32) -> Option<&'static Variable<M>> {
    let (time, variable) = independent::<M>();
    let variable = (place == time).then_some(variable);
    variable.or_else(|| indicator::<M>(place).map(|_| Implicit::INDICATOR))
}

/// Which of the event indicators is at this place.
fn indicator<M: Exported>(place: u32) -> Option<usize> {
    let number = place.checked_sub(first_indicator::<M>())? as usize;
    (number < Instance::<M>::INDICATORS).then_some(number)
}

/// The value of a variable behind the table.
#[cold]
fn implicit_value<M: Exported>(model: &M, time: f64, place: u32) -> f64 {
    let Some(number) = indicator::<M>(place) else { return time };
    let mut indicators = vec![0.0; Instance::<M>::INDICATORS];
    model.exported_indicators(&mut indicators);
    indicators[number]
}

/// The place of the first event indicator: behind the table and behind the time.
pub(crate) fn first_indicator<M: crate::Variables>() -> u32 {
    let (time, _) = independent::<M>();
    (M::TABLE.len() as u32).max(time + 1)
}

impl<M: crate::Variables> Implicit<M> {
    const INDEPENDENT: (u32, &'static Variable<M>) = {
        let mut place = 0;
        while place < M::TABLE.len() && !matches!(M::TABLE[place].causality(), Causality::Independent) {
            place += 1;
        }
        (place as u32, if place < M::TABLE.len() { &M::TABLE[place] } else { Self::TIME })
    };
}

/// The independent variable as FMI 3.0 has it, with its place.
#[inline]
pub(crate) fn independent<M: crate::Variables>() -> (u32, &'static Variable<M>) {
    Implicit::INDEPENDENT
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

//! What a model can do: a trait for each capability. The description says what is implemented.

use crate::model::{Error, Model};

/// The model steps itself (section 4 of FMI 2.0).
pub trait CoSimulation: Model {
    /// Whether steps may have any size, also one unlike the last.
    const VARIABLE_STEP_SIZE: bool = true;

    /// Whether steps stop at events ([`Stepped::Event`]), which [`ModelExchange::event`] handles. An importer of FMI 3.0
    /// may then have an event mode (`hasEventMode`), at the begin of the simulation and whenever it likes.
    const EVENTS: Events = Events::None;

    /// Whether steps may end early ([`Stepped::Early`], [`Stepped::Terminate`]). Importers of FMI 3.0 are told
    /// (`mightReturnEarlyFromDoStep`): those that cannot cope with it need not refuse a model whose steps, but for
    /// errors, always reach their end.
    const ENDS_EARLY: bool = false;

    /// Goes on from a communication point.
    ///
    /// # Errors
    /// When the step cannot be carried out; the model must then be as it was before.
    fn step(&mut self, step: Step) -> Result<Stepped, Error>;

    /// Carries out a step of this size, with the same result as [`step`](Self::step), and what [`calculate`](Model::calculate)
    /// calculates after it, if the model can do both quickly, without events and messages. If not, it returns false and has
    /// changed nothing; then `step` is called.
    ///
    /// Not called before the first `step`, nor if steps may end early.
    #[inline]
    fn step_at_once(&mut self, _size: f64) -> bool {
        false
    }
}

/// Whether the steps of Co-Simulation stop at events.
///
/// Where this crate handles them, a step may have 10,000, and each may take 10,000 rounds: more count as a loop without
/// end. In FMI 2.0 the step ends early then; in FMI 3.0 it is undone, and the importer told to make shorter ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Events {
    /// No step stops at an event.
    None,
    /// Every step stops at events. Importers of FMI 3.0 may handle them; for all others, those of FMI 2.0 among them,
    /// this crate calls [`ModelExchange::event`] at the begin of the simulation and wherever a step stops.
    Stop,
    /// A step stops at events only where [`Step::stop_at_events`] is set, which it is for importers that handle events.
    /// For all others the model handles them itself within its step, and `event` is not called. This suits models that
    /// wait for the inputs of the next step, such as a sampled controller.
    StopIfHandled,
}

/// A step from a communication point to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The communication point, s.
    pub time: f64,
    /// The step size, s; finite and above 0.
    pub size: f64,
    /// Whether the step is to stop at the first event, also at one at its end.
    pub stop_at_events: bool,
}

impl Step {
    /// A step that need not stop at events.
    pub fn new(time: f64, size: f64) -> Self {
        Self { time, size, stop_at_events: false }
    }
}

/// How a step ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stepped {
    /// At the next communication point.
    Done,
    /// There as well, and what [`calculate`](Model::calculate) would calculate is calculated already.
    Calculated,
    /// At an earlier time, s, which the model has reached: the importer is told. Only if
    /// [`ENDS_EARLY`](CoSimulation::ENDS_EARLY) or [`EVENTS`](CoSimulation::EVENTS) says so. In FMI 2.0 (`fmi2Discard`) it goes
    /// back to a saved state or ends the simulation. In FMI 3.0 (`earlyReturn`) it goes on from there; if it has not
    /// allowed it, the step is undone (`fmi3Discard`), and it may make a shorter one.
    Early(f64),
    /// At an event, at an earlier time, s, which the model has reached, or at the next communication point. Only if
    /// [`EVENTS`](CoSimulation::EVENTS) says so.
    ///
    /// An importer of FMI 3.0 that wants to handles the event itself (`eventHandlingNeeded`). Otherwise, and in FMI
    /// 2.0, this crate does: it calls [`ModelExchange::event`], and the rest of the step follows as another step.
    Event(f64),
    /// At an earlier time, s, or the next point: the model wants to end the simulation. Only if it may end early.
    Terminate(f64),
}

/// The importer integrates the model (section 3 of FMI 2.0).
pub trait ModelExchange: Model {
    /// The number of event indicators.
    const INDICATORS: usize = 0;

    /// Whether the model wants to know when a step of the integrator is complete.
    const STEP_COMPLETED: bool = false;

    /// Fills in the event indicators: an event happens where one of them changes its sign.
    fn indicators(&self, _indicators: &mut [f64]) {}

    /// An event at a time, s: at the begin of the simulation, where an indicator has changed its sign, at the time
    /// that the last event has asked for, or when the importer likes. Called again while events ask for it.
    ///
    /// # Errors
    /// When the model cannot go on. It is then as it was before.
    fn event(&mut self, _time: f64) -> Result<Event, Error> {
        Ok(Event::default())
    }

    /// The importer goes on to integrate: after the events at the begin of the simulation, and after every other event.
    fn continuous_time_entered(&mut self) {}

    /// The integrator has completed a step. Called if [`STEP_COMPLETED`](Self::STEP_COMPLETED).
    fn step_completed(&mut self, _time: f64) -> StepCompleted {
        StepCompleted::default()
    }

    /// Changes the orders of magnitude of the states, in the order of the table, which come as the types say.
    fn nominals(&self, _nominals: &mut [f64]) {}
}

/// What an event did (section 3.2.2).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Event {
    /// There is another event at the same time.
    pub again: bool,
    /// The model wants to end the simulation.
    pub terminate: bool,
    /// The orders of magnitude of the states have changed.
    pub nominals_changed: bool,
    /// The event has changed states. Say so as well when it makes the derivatives jump: FMPy, for one, restarts its
    /// integrator only then.
    pub states_changed: bool,
    /// When the next event is due, s.
    pub next: Option<f64>,
}

/// What the model wants after a step of the integrator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepCompleted {
    /// An event.
    pub event: bool,
    /// The end of the simulation.
    pub terminate: bool,
}

/// The model knows its partial derivatives (section 2.1.9 of FMI 2.0, 2.2.11 of FMI 3.0): directional and adjoint ones
/// follow. fmu-package compares all of them with differences before it describes the model.
pub trait Partials: Model {
    /// The partial derivative of one Real variable with respect to another, once the model is initialized: of the value
    /// that a getter returns when only the known has been set, at this point and before any step. The unknown is an
    /// output or a state's derivative, the known an input, a state or a parameter.
    ///
    /// `None` if the model does not know it: the importer is then refused.
    fn partial(&self, unknown: Self::Name, known: Self::Name) -> Option<f64>;

    /// The same in Initialization Mode, where states that are [`calculated`](crate::Variable::calculated) are unknowns,
    /// too, and follow from inputs and parameters: so does what is calculated from them, by the chain rule. The knowns
    /// are the inputs and all that is exact (section 2.2.8 of FMI 2.0).
    ///
    /// Without such states, and where the equations are the same as later, it is the [`partial`](Self::partial).
    fn initial_partial(&self, unknown: Self::Name, known: Self::Name) -> Option<f64> {
        self.partial(unknown, known)
    }

    /// The partial derivative of a Real variable with respect to the time alone, inputs and states held: 0 where the
    /// equations do not name the time.
    fn partial_by_time(&self, _unknown: Self::Name) -> Option<f64> {
        Some(0.0)
    }

    /// All three for models with arrays, whose elements count from 0, row by row; a scalar is its element 0. The known is
    /// `None` for the time; `initial` in Initialization Mode.
    ///
    /// Without it, all elements of an array have the same derivatives.
    #[inline]
    fn element_partial(
        &self,
        unknown: (Self::Name, usize),
        known: Option<(Self::Name, usize)>,
        initial: bool,
    ) -> Option<f64> {
        match known {
            None => self.partial_by_time(unknown.0),
            Some((known, _)) if initial => self.initial_partial(unknown.0, known),
            Some((known, _)) => self.partial(unknown.0, known),
        }
    }

    /// All derivatives with respect to one known, as a function of the unknown. For models in which they have work in
    /// common, which is then done once; without it, each is an [`element_partial`](Self::element_partial).
    #[inline]
    fn partials(
        &self,
        known: Option<(Self::Name, usize)>,
        initial: bool,
    ) -> impl Fn((Self::Name, usize)) -> Option<f64> {
        move |unknown| self.element_partial(unknown, known, initial)
    }
}

/// The model uses time derivatives of inputs in Co-Simulation (section 4.2.1).
pub trait InputDerivatives: CoSimulation {
    /// Takes the time derivative of an input, of order 1 or higher, at the current communication point. Orders that
    /// the model has no use for are ignored.
    fn set_input_derivative(&mut self, of: Self::Name, order: u32, value: f64);

    /// The same for models with arrays among their inputs, whose elements count from 0, row by row; a scalar is its
    /// element 0. Without it, that of each element goes to [`set_input_derivative`](Self::set_input_derivative).
    #[inline]
    fn set_element_derivative(&mut self, of: Self::Name, _element: usize, order: u32, value: f64) {
        self.set_input_derivative(of, order, value);
    }
}

/// The model knows time derivatives of its variables in Co-Simulation (section 4.2.1).
pub trait OutputDerivatives: CoSimulation {
    /// The highest order it knows (`maxOutputDerivativeOrder`); the importer is refused higher ones.
    const HIGHEST: u32 = 1;

    /// The time derivative of an order from 1 to [`HIGHEST`](Self::HIGHEST) of any Real variable that is no parameter,
    /// now.
    fn output_derivative(&self, of: Self::Name, order: u32) -> f64;

    /// The same for models with arrays, whose elements count from 0, row by row; a scalar is its element 0. Without it,
    /// all elements have that of [`output_derivative`](Self::output_derivative).
    #[inline]
    fn element_derivative(&self, of: Self::Name, _element: usize, order: u32) -> f64 {
        self.output_derivative(of, order)
    }
}

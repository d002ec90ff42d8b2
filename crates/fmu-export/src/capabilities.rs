//! Capabilities of a model: one trait for each. The model description lists the implemented ones.

use crate::model::{Error, Model};

/// A model that performs its own steps (section 4 of FMI 2.0).
pub trait CoSimulation: Model {
    /// Whether the step size may vary.
    const VARIABLE_STEP_SIZE: bool = true;

    /// Whether steps stop at events ([`Stepped::Event`]), which [`ModelExchange::event`] handles. If so, an
    /// importer of FMI 3.0 may use Event Mode (`hasEventMode`), at the start of the simulation and at any
    /// communication point.
    const EVENTS: Events = Events::None;

    /// Whether steps may end early ([`Stepped::Early`], [`Stepped::Terminate`]). The model description of FMI
    /// 3.0 reports it (`mightReturnEarlyFromDoStep`). An importer without support for early returns can thus
    /// accept models whose steps always reach their end.
    const ENDS_EARLY: bool = false;

    /// Whether a [`step`](Self::step) that fails leaves the model unchanged, because it checks everything that can
    /// fail first. This crate undoes every other failed step. For that it copies the model before each step, which
    /// costs a few nanoseconds for a small model, so a model that must be very fast may declare that its steps are
    /// atomic.
    ///
    /// If the model has no heap memory, the copy is a `clone_from`. Otherwise it consists of the places and the
    /// `memory` of the [table](crate::variables), which are also the content of a serialized state. Copying them needs
    /// no allocation as long as strings and vectors do not grow. After an error, they are copied back, and
    /// [`restored`](Model::restored) and [`update`](Model::update) follow.
    const ATOMIC_STEP: bool = false;

    /// Advances the model by one step.
    ///
    /// # Errors
    /// Fails if the step cannot be carried out. The model may have changed by then: this crate undoes the step, unless
    /// the model declares [`ATOMIC_STEP`](Self::ATOMIC_STEP).
    fn step(&mut self, step: Step) -> Result<Stepped, Error>;

    /// Carries out a step and calculates like [`calculate`](Model::calculate), if the model can do both
    /// quickly, without events and messages. The result must equal the result of [`step`](Self::step).
    /// Otherwise the function returns false and changes nothing; then this crate calls
    /// [`step_any_size`](Self::step_any_size).
    ///
    /// This crate calls it only after the first `step`, and only if steps cannot end early. It is inlined into the
    /// C function, so it should do only the most frequent step, and call no function that is not inlined.
    #[inline]
    fn step_fast(&mut self, _size: f64) -> bool {
        false
    }

    /// Does the same as [`step_fast`](Self::step_fast) for steps that it leaves out, such as steps of another size
    /// than the last. If this returns false as well, this crate calls [`step`](Self::step).
    #[inline]
    fn step_any_size(&mut self, _size: f64) -> bool {
        false
    }
}

/// Whether the steps of Co-Simulation stop at events.
///
/// If this crate handles the events, a step may have up to 10,000 events with up to 10,000 iterations each.
/// More count as an endless loop. In FMI 2.0 the step then ends early (`fmi2Discard`). In FMI 3.0 the step is undone,
/// and a message asks for shorter steps. If an event or the step after it fails, the whole step is undone in both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Events {
    /// No step stops at an event.
    None,
    /// Every step stops at events. Importers of FMI 3.0 may handle them. For all other importers, this crate
    /// calls [`ModelExchange::event`] at the start of the simulation and when a step stops.
    Stop,
    /// A step stops at events only if [`Step::stop_at_events`] is set, which means that the importer handles
    /// events. Otherwise the model handles events within its step, and this crate does not call `event`. This
    /// suits models that wait for the inputs of the next step, such as a sampled controller.
    StopIfHandled,
}

/// A step from one communication point to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The communication point, s.
    pub time: f64,
    /// The step size, s; finite and above 0.
    pub size: f64,
    /// Whether the step must stop at the first event, including an event at its end.
    pub stop_at_events: bool,
}

impl Step {
    /// Creates a step that need not stop at events.
    pub fn new(time: f64, size: f64) -> Self {
        Self { time, size, stop_at_events: false }
    }
}

/// The end of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stepped {
    /// The step ended at the next communication point.
    Done,
    /// The step ended at the next communication point, and the model has already calculated the results of
    /// [`calculate`](Model::calculate).
    Calculated,
    /// The step ended at an earlier time, s. Requires [`ENDS_EARLY`](CoSimulation::ENDS_EARLY) or
    /// [`EVENTS`](CoSimulation::EVENTS). The model is then at this time, and this crate informs the importer.
    /// In FMI 2.0 (`fmi2Discard`), the importer restores a saved state or ends the simulation. In FMI 3.0
    /// (`earlyReturn`), the importer continues from there. If the importer does not allow early returns, the
    /// step is undone (`fmi3Discard`), and the importer may try a shorter one.
    Early(f64),
    /// The step stopped at an event, at an earlier time, s, or at the next communication point. The model is
    /// then at this time. Requires [`EVENTS`](CoSimulation::EVENTS).
    ///
    /// An importer of FMI 3.0 can handle the event itself (`eventHandlingNeeded`). Otherwise, and in FMI 2.0,
    /// this crate calls [`ModelExchange::event`] and performs the rest of the step as another step.
    Event(f64),
    /// The step ended at an earlier time, s, or at the next point, and the model requests the end of the
    /// simulation. Requires [`ENDS_EARLY`](CoSimulation::ENDS_EARLY).
    Terminate(f64),
}

/// A model that the importer integrates (section 3 of FMI 2.0).
pub trait ModelExchange: Model {
    /// The number of event indicators.
    const INDICATORS: usize = 0;

    /// Whether this crate must call [`step_completed`](Self::step_completed).
    const STEP_COMPLETED: bool = false;

    /// Writes the event indicators. A change of sign signals an event.
    fn indicators(&self, _indicators: &mut [f64]) {}

    /// Handles an event at a time, s. The importer triggers events at the start of the simulation, at a
    /// change of sign of an indicator, and at the time that the last event requested. It may trigger further
    /// events. This crate calls it again while its result has `again` set.
    ///
    /// # Errors
    /// Fails if the model cannot continue. The model may have changed by then, so this crate undoes the event.
    fn event(&mut self, _time: f64) -> Result<Event, Error> {
        Ok(Event::default())
    }

    /// Notifies the model that the integration starts or continues: after the events at the start of the
    /// simulation and after each later event.
    fn continuous_time_entered(&mut self) {}

    /// Notifies the model that the integrator has completed a step. Requires
    /// [`STEP_COMPLETED`](Self::STEP_COMPLETED).
    fn step_completed(&mut self, _time: f64) -> StepCompleted {
        StepCompleted::default()
    }

    /// Changes the nominal values of the states, in the order of the table. The initial values of the slice
    /// come from the types.
    fn nominals(&self, _nominals: &mut [f64]) {}
}

/// Result of an event (section 3.2.2 of FMI 2.0).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Event {
    /// Whether another event happens at the same time.
    pub again: bool,
    /// Whether the model requests the end of the simulation.
    pub terminate: bool,
    /// Whether the nominal values of the states have changed.
    pub nominals_changed: bool,
    /// Whether the event has changed states. Set it as well if derivatives jump, because some importers, for
    /// example FMPy, restart their integrator only then.
    pub states_changed: bool,
    /// Time of the next event, s.
    pub next: Option<f64>,
}

/// Requests of the model after a step of the integrator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepCompleted {
    /// Whether the model requests an event.
    pub event: bool,
    /// Whether the model requests the end of the simulation.
    pub terminate: bool,
}

/// A model that provides its partial derivatives (section 2.1.9 of FMI 2.0, 2.2.12 of FMI 3.0). This crate
/// computes directional and adjoint derivatives from them. Before fmu-package describes the model, it
/// compares all of them with finite differences.
pub trait Partials: Model {
    /// Returns the partial derivative of one Real variable with respect to another, after initialization. It
    /// is the change of the value that a getter returns at this point when only the known is set, before any
    /// step. The unknown is an output or a state's derivative; the known is an input, a state or a parameter.
    ///
    /// Returns `None` if the model does not provide the derivative; the importer then gets an error.
    fn partial(&self, unknown: Self::Name, known: Self::Name) -> Option<f64>;

    /// Returns the partial derivative in Initialization Mode. There,
    /// [`calculated`](crate::Variable::calculated) states are unknowns too, because they depend on inputs and
    /// parameters. By the chain rule, the variables calculated from these states depend on inputs and
    /// parameters as well. The knowns are the inputs and all variables with `initial` "exact" (section 2.2.8
    /// of FMI 2.0).
    ///
    /// The default is [`partial`](Self::partial), which is correct if no state is calculated and the
    /// equations are the same as after initialization.
    fn initial_partial(&self, unknown: Self::Name, known: Self::Name) -> Option<f64> {
        self.partial(unknown, known)
    }

    /// Returns the partial derivative of a Real variable with respect to time, with inputs and states
    /// constant. It is 0 if the equations do not contain the time.
    fn partial_by_time(&self, _unknown: Self::Name) -> Option<f64> {
        Some(0.0)
    }

    /// Returns the derivative for models with arrays; replaces the three functions above. Elements count from
    /// 0, row by row; a scalar is its element 0. The known is `None` for the time; `initial` is true in
    /// Initialization Mode.
    ///
    /// By default, all elements of an array have equal derivatives.
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

    /// Returns all derivatives with respect to one known, as a function of the unknown. A model can override
    /// it to compute common terms once. By default, each derivative is an
    /// [`element_partial`](Self::element_partial).
    #[inline]
    fn partials(
        &self,
        known: Option<(Self::Name, usize)>,
        initial: bool,
    ) -> impl Fn((Self::Name, usize)) -> Option<f64> {
        move |unknown| self.element_partial(unknown, known, initial)
    }
}

/// A model that uses time derivatives of inputs in Co-Simulation (section 4.2.1 of FMI 2.0).
pub trait InputDerivatives: CoSimulation {
    /// Sets the time derivative of an input, of order 1 or higher, at the current communication point. The
    /// model ignores orders that it does not use.
    fn set_input_derivative(&mut self, of: Self::Name, order: u32, value: f64);

    /// Sets the time derivative of an element of an array input. Elements count from 0, row by row; a scalar
    /// is its element 0. By default, passes the derivative to
    /// [`set_input_derivative`](Self::set_input_derivative).
    #[inline]
    fn set_element_derivative(&mut self, of: Self::Name, _element: usize, order: u32, value: f64) {
        self.set_input_derivative(of, order, value);
    }
}

/// A model that provides time derivatives of its variables in Co-Simulation (section 4.2.1 of FMI 2.0).
pub trait OutputDerivatives: CoSimulation {
    /// Highest order (`maxOutputDerivativeOrder`); higher orders are errors.
    const HIGHEST: u32 = 1;

    /// Returns the current time derivative of a Real variable that is not a parameter. The order is between 1
    /// and [`HIGHEST`](Self::HIGHEST).
    fn output_derivative(&self, of: Self::Name, order: u32) -> f64;

    /// Returns the time derivative of an element. Elements count from 0, row by row; a scalar is its element
    /// 0. By default, all elements have the derivative from [`output_derivative`](Self::output_derivative).
    #[inline]
    fn element_derivative(&self, of: Self::Name, _element: usize, order: u32) -> f64 {
        self.output_derivative(of, order)
    }
}

//! Capabilities of a model, with one trait for each. The model description lists the capabilities that the model
//! implements.

use crate::model::{Error, Model};

/// A model that performs its own steps (section 4 of FMI 2.0).
pub trait CoSimulation: Model {
    /// Whether the step size may vary.
    const VARIABLE_STEP_SIZE: bool = true;

    /// Whether steps stop at events ([`Stepped::Event`]), which [`ModelExchange::event`] handles. If they do, an
    /// importer of FMI 3.0 may use Event Mode (`hasEventMode`), at the start of the simulation and at any
    /// communication point.
    const EVENTS: Events = Events::None;

    /// Whether steps may end early ([`Stepped::Early`], [`Stepped::Terminate`]). The model description of FMI 3.0
    /// contains this (`mightReturnEarlyFromDoStep`), so that an importer that does not support early returns can
    /// accept all models whose steps always reach their end.
    const ENDS_EARLY: bool = false;

    /// Whether a [`step`](Self::step) that fails leaves the model unchanged, because it first checks everything that
    /// can fail. If this is false, this crate copies the model before each call of `step`, in order to undo a failed
    /// one. For a small model the copy takes only a few nanoseconds, so the declaration is worthwhile only for a model
    /// that must be very fast.
    ///
    /// A model without heap memory is copied by `clone_from`. Of any other model, only the content of a serialized
    /// state is copied: the fields after `in`, and the `memory`, of the [table](crate::variables). This needs no
    /// allocation as long as strings and vectors do not grow. After an error, the values are copied back, and this
    /// crate calls [`restored`](Model::restored) and [`update`](Model::update).
    const ATOMIC_STEP: bool = false;

    /// Advances the model by one step.
    ///
    /// # Errors
    /// Fails if the step cannot be carried out. This crate then undoes the step, so `step` may fail after it has
    /// changed the model, unless the model declares [`ATOMIC_STEP`](Self::ATOMIC_STEP).
    fn step(&mut self, step: Step) -> Result<Stepped, Error>;
}

/// Fast paths for the usual steps of a model whose steps cannot end early. They are worthwhile only if a step takes a few
/// hundred instructions, of which they save about 30.
pub trait FastSteps: CoSimulation {
    /// Makes a step of this size, s, and calculates like [`calculate`](Model::calculate), if the model can do both
    /// fast, and without events or messages. The result must equal the result of [`step`](CoSimulation::step). In all
    /// other cases the function must return false and change nothing; this crate then calls
    /// [`step_any_size`](Self::step_any_size).
    ///
    /// This crate calls it only after the first `step`. The compiler inlines it into the C function, so keep it short:
    /// handle only the most frequent steps, and call only functions that can be inlined as well, because any other
    /// call makes every step save registers.
    fn step_fast(&mut self, size: f64) -> bool;

    /// Does the same for steps that [`step_fast`](Self::step_fast) does not handle, such as a step of another size
    /// than the last. If it also returns false, this crate calls [`step`](CoSimulation::step).
    #[inline]
    fn step_any_size(&mut self, _size: f64) -> bool {
        false
    }
}

/// Whether the steps of Co-Simulation stop at events.
///
/// If this crate handles the events, a step may have up to 10,000 events, with up to 10,000 iterations each. After
/// more events, the step ends early in FMI 2.0 (`fmi2Discard`); in FMI 3.0 it is undone, and a message asks for
/// shorter steps. If an event needs more iterations or fails, or if the rest of the step fails, the whole step is
/// undone in both versions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Events {
    /// No step stops at an event.
    None,
    /// Every step stops at events. Importers of FMI 3.0 may handle them. For all other importers, this crate
    /// calls [`ModelExchange::event`] at the start of the simulation and when a step stops.
    Stop,
    /// A step stops at events only if [`Step::stop_at_events`] is true, which means that the importer handles events.
    /// Otherwise the model handles events within its step, and this crate does not call `event`. This is useful for a
    /// model whose event at the end of a step needs the inputs of the next step, such as a sampled controller.
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
    /// Creates a step that does not have to stop at events.
    pub fn new(time: f64, size: f64) -> Self {
        Self { time, size, stop_at_events: false }
    }
}

/// How a step ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stepped {
    /// The step ended at the next communication point.
    Done,
    /// The step ended at the next communication point, and the model has already calculated the results of
    /// [`calculate`](Model::calculate).
    Calculated,
    /// The step ended at an earlier time, s, and the model is at this time. Requires
    /// [`ENDS_EARLY`](CoSimulation::ENDS_EARLY) or [`EVENTS`](CoSimulation::EVENTS). In FMI 2.0 the importer gets
    /// `fmi2Discard`, and then restores a saved state or ends the simulation. In FMI 3.0 the importer gets
    /// `earlyReturn` and continues from this time. If it does not allow early returns, the step is undone and returns
    /// `fmi3Discard`, and the importer may try a shorter step.
    Early(f64),
    /// The step stopped at an event, at an earlier time, s, or at the next communication point, and the model is at
    /// this time. Requires [`EVENTS`](CoSimulation::EVENTS).
    ///
    /// An importer of FMI 3.0 can handle the event itself (`eventHandlingNeeded`). Otherwise, and in FMI 2.0,
    /// this crate calls [`ModelExchange::event`] and performs the rest of the step as another step.
    Event(f64),
    /// The step ended at an earlier time, s, or at the next communication point, and the model requests the end of the
    /// simulation. Requires [`ENDS_EARLY`](CoSimulation::ENDS_EARLY) or [`EVENTS`](CoSimulation::EVENTS).
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

    /// Handles an event at a time, s. The importer triggers an event at the start of the simulation, when an
    /// indicator changes its sign, at the time that the last event requested, and at any other time it chooses. The
    /// function is called again as long as its result contains `again`.
    ///
    /// # Errors
    /// Fails if the model cannot continue. This crate then undoes the event, so the function may fail after it has
    /// changed the model.
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

    /// Replaces nominal values of the states, in the order of the table. Before the call, the slice contains the
    /// nominal values of their types.
    fn nominals(&self, _nominals: &mut [f64]) {}
}

/// Result of an event (section 3.2.2 of FMI 2.0).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Event {
    /// Whether the event needs another iteration at the same time.
    pub again: bool,
    /// Whether the model requests the end of the simulation.
    pub terminate: bool,
    /// Whether the nominal values of the states have changed.
    pub nominals_changed: bool,
    /// Whether the event has changed states. Set it also if only derivatives jump, because some importers, for
    /// example FMPy, restart their integrator only if it is set.
    pub states_changed: bool,
    /// Time of the next time event, s; `None` if the model has none.
    pub next: Option<f64>,
}

/// Requests of the model after a completed step of the integrator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepCompleted {
    /// Whether the model requests an event.
    pub event: bool,
    /// Whether the model requests the end of the simulation.
    pub terminate: bool,
}

/// A model that provides its partial derivatives (section 2.1.9 of FMI 2.0, 2.2.12 of FMI 3.0). This crate computes
/// directional and adjoint derivatives from them. When fmu-package builds the FMU, it compares all partial
/// derivatives with finite differences.
pub trait Partials: Model {
    /// Returns the partial derivative of one Real variable with respect to another, after initialization: the rate at
    /// which the value of the unknown changes if only the known is set, without a step. The unknown is an output or
    /// the derivative of a state; the known is an input, a state or a parameter.
    ///
    /// Returns `None` if the model does not provide the derivative; the importer then gets an error.
    fn partial(&self, unknown: Self::Name, known: Self::Name) -> Option<f64>;

    /// Returns the partial derivative in Initialization Mode. In this mode,
    /// [`calculated`](crate::Variable::calculated) states are unknowns too, because they depend on inputs and
    /// parameters. The derivatives of variables that depend on these states follow from the chain rule. The knowns
    /// are the inputs and all variables with `initial` "exact" (section 2.2.8 of FMI 2.0).
    ///
    /// By default, returns [`partial`](Self::partial), which is correct if no state is calculated and the equations
    /// are the same as after initialization.
    fn initial_partial(&self, unknown: Self::Name, known: Self::Name) -> Option<f64> {
        self.partial(unknown, known)
    }

    /// Returns the partial derivative of a Real variable with respect to time, for constant inputs and states. It is
    /// 0, the default, if the equations do not contain the time.
    fn partial_by_time(&self, _unknown: Self::Name) -> Option<f64> {
        Some(0.0)
    }

    /// Returns the partial derivative of one element with respect to another. Models with arrays override it; this
    /// crate then no longer calls the three functions above. Elements count from 0, row by row; a scalar is its
    /// element 0. The known is `None` for the time; `initial` is true in Initialization Mode.
    ///
    /// By default, calls the three functions above, so all elements of an array have the same derivative.
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

    /// Returns the partial derivatives with respect to one known, as a function of the unknown. A model can override
    /// it to compute common terms only once. By default, the function calls
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
    /// Sets the time derivative of an input at the current communication point. The order is 1 or higher; the model
    /// must ignore orders that it does not use.
    fn set_input_derivative(&mut self, of: Self::Name, order: u32, value: f64);

    /// Sets the time derivative of an element of an array input. Elements count from 0, row by row; a scalar is its
    /// element 0. By default, calls [`set_input_derivative`](Self::set_input_derivative), which ignores the element.
    #[inline]
    fn set_element_derivative(&mut self, of: Self::Name, _element: usize, order: u32, value: f64) {
        self.set_input_derivative(of, order, value);
    }
}

/// A model that provides time derivatives of its variables in Co-Simulation (section 4.2.1 of FMI 2.0).
pub trait OutputDerivatives: CoSimulation {
    /// Highest order (`maxOutputDerivativeOrder`). A call with a higher order returns an error to the importer.
    const HIGHEST: u32 = 1;

    /// Returns the current time derivative of a Real variable that is neither a parameter nor the time. The order is
    /// between 1 and [`HIGHEST`](Self::HIGHEST).
    fn output_derivative(&self, of: Self::Name, order: u32) -> f64;

    /// Returns the time derivative of an element. Elements count from 0, row by row; a scalar is its element 0. By
    /// default, calls [`output_derivative`](Self::output_derivative), so all elements have the same derivative.
    #[inline]
    fn element_derivative(&self, of: Self::Name, _element: usize, order: u32) -> f64 {
        self.output_derivative(of, order)
    }
}

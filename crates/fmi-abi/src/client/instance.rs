//! The life cycle, steps, events and derivatives of an instance, for both FMI versions. Safe functions wrap the C
//! calls: they check lengths, keep the library loaded, and do not call the instance after a fatal error.

use super::float::keeping_environment;
use super::log::{Log, LogListener, VariableNames};
use super::rejection::{Message, Rejection};
use super::saved::States;
use crate::c_types::{c_int, c_void};
use crate::calls::{Functions, Instantiation, Library, callbacks, log_callback};
use crate::fmi2::types::*;
use crate::fmi3::types::*;
use crate::{Interface, Standard, Status, shown_number};
use std::ffi::{CStr, CString};
use std::fmt;
use std::ptr::null;
use std::sync::Arc;
use std::time::Duration;

/// Arguments for instantiating an FMU.
#[derive(Clone)]
pub struct Settings<'a> {
    /// Instance name that is passed to the FMU.
    pub name: &'a str,
    /// Label of the instance in error messages; may be empty.
    pub label: &'a str,
    /// `guid` of FMI 2.0, `instantiationToken` of FMI 3.0.
    pub token: &'a str,
    /// Location of the resources, in the form that [`Standard::resources`] returns; `None` if the FMU has no resources.
    pub resources: Option<&'a CStr>,
    /// Interface type.
    pub interface: Interface,
    /// Whether debug logging is on (`loggingOn`).
    pub logging_on: bool,
    /// Whether the caller handles events in Co-Simulation (FMI 3.0).
    pub event_mode: bool,
    /// Whether a step may end early (FMI 3.0).
    pub early_return: bool,
    /// Receiver of all messages, and the number that identifies this instance to it.
    pub listener: Option<(Arc<dyn LogListener>, usize)>,
    /// Names of the variables, which replace references to them in messages of FMI 2.0.
    pub names: Option<Arc<dyn VariableNames>>,
}

impl Settings<'_> {
    /// Returns settings with the name "instance", and without a token, resources and optional capabilities.
    pub fn new(interface: Interface) -> Self {
        Self {
            name: "instance",
            label: "",
            token: "",
            resources: None,
            interface,
            logging_on: false,
            event_mode: false,
            early_return: false,
            listener: None,
            names: None,
        }
    }
}

/// An instance, freed when dropped. It keeps its library loaded.
pub struct Instance {
    /// NULL after fmi2Fatal or fmi3Fatal, when even freeing is forbidden (section 2.1.3 of FMI 2.0).
    handle: *mut c_void,
    log: Arc<Log>,
    /// Callbacks, which must live as long as the instance (section 2.1.5 of FMI 2.0).
    _callbacks: Box<fmi2CallbackFunctions>,
    pub(crate) library: Arc<Library>,
    pub(crate) states: States,
    label: Box<str>,
    /// Whether a step may end early.
    early_return: bool,
}

impl fmt::Debug for Instance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Instance")
            .field("handle", &self.handle)
            .field("label", &self.label)
            .finish_non_exhaustive()
    }
}

/// Result of an event (section 3.2.2 of FMI 2.0, 2.3.5 of FMI 3.0).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Event {
    /// Whether the FMU requests the end of the simulation.
    pub terminate: bool,
    /// Whether the nominal values of the states have changed.
    pub nominals_changed: bool,
    /// Whether the states have changed.
    pub states_changed: bool,
    /// Time of the next event, s.
    pub next: Option<f64>,
}

/// Result of a step of Co-Simulation with event mode (section 4.2.1 of FMI 3.0).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stepped {
    /// Time that the FMU has reached, s.
    pub time: f64,
    /// Whether the FMU returned early, so that it has not reached the requested time.
    pub early: bool,
    /// Whether the FMU needs an event at the time that it has reached.
    pub event: bool,
}

/// Quantities in Model Exchange with one value for each state or event indicator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Continuous {
    /// Continuous states.
    States,
    /// Derivatives of the states.
    Derivatives,
    /// Event indicators.
    EventIndicators,
    /// Nominal values of the states.
    Nominals,
}

/// Maximum number of iterations of an event.
pub const MOST_ITERATIONS: usize = 10_000;

/// `fmi2Pending`: the step is performed asynchronously.
const PENDING: c_int = Status::Pending as c_int;

// SAFETY: the FMI standards permit use of an instance from any thread, one thread at a time.
unsafe impl Send for Instance {}

impl Drop for Instance {
    fn drop(&mut self) {
        if !self.handle.is_null() {
            self.forget_all();
            // SAFETY: the library made the instance, which is freed only here.
            keeping_environment(|| unsafe { self.library.functions().free(self.handle) });
        }
        // Comes last, because freeing the instance may log messages.
        self.log.unregister();
    }
}

/// Calls a function of FMI 2.0 or its counterpart in FMI 3.0. If the FMI version does not have the function, the result is an error.
macro_rules! call {
    ($self:ident, $fmi2:ident ( $($of_fmi2:expr),* ) $(, $fmi3:ident ( $($of_fmi3:expr),* ))?) => {{
        let handle = $self.handle(stringify!($fmi2))?;
        // SAFETY: the instance is alive; array arguments are slices with the passed lengths, and single
        // values are live references.
        let (function, code) = unsafe {
            match $self.library.functions() {
                Functions::Fmi2(of) => (stringify!($fmi2), (of.$fmi2)(handle $(, $of_fmi2)*)),
                $(Functions::Fmi3(of) => (stringify!($fmi3), (of.$fmi3)(handle $(, $of_fmi3)*)),)?
                #[allow(unreachable_patterns, reason = "where FMI 3.0 has the function")]
                Functions::Fmi3(_) => (stringify!($fmi2), crate::Status::Error as c_int),
            }
        };
        $self.check(function, code)
    }};
    (fmi3 $self:ident, $fmi3:ident ( $($of_fmi3:expr),* )) => {{
        let handle = $self.handle(stringify!($fmi3))?;
        // SAFETY: as above.
        let code = unsafe {
            match $self.library.functions() {
                Functions::Fmi2(_) => crate::Status::Error as c_int,
                Functions::Fmi3(of) => (of.$fmi3)(handle $(, $of_fmi3)*),
            }
        };
        $self.check(stringify!($fmi3), code)
    }};
}

pub(crate) use call;

impl Instance {
    /// Creates an instance.
    ///
    /// # Errors
    /// The FMU returns NULL. The error contains the FMU's messages.
    pub fn new(library: &Arc<Library>, settings: &Settings) -> Result<Self, Rejection> {
        let log = Log::register(settings.listener.clone(), settings.names.clone());
        let environment = log.environment();
        let [name, token] =
            [settings.name, settings.token].map(|text| CString::new(text).unwrap_or_default());
        let callbacks = Box::new(callbacks::<Log>(environment));
        let arguments = Instantiation {
            interface: settings.interface as c_int,
            name: name.as_ptr(),
            token: token.as_ptr(),
            resources: settings.resources.map_or(null(), CStr::as_ptr),
            logging_on: settings.logging_on.into(),
            callbacks: &raw const *callbacks,
            environment,
            log: Some(log_callback::<Log>()),
            event_mode_used: settings.event_mode.into(),
            early_return_allowed: settings.early_return.into(),
            ..Instantiation::ZEROS
        };
        let function = arguments.function(library.functions().standard());
        // SAFETY: all strings are live; callbacks and log live as long as the instance.
        let handle = keeping_environment(|| unsafe { library.functions().instantiate(&arguments) });
        if handle.is_null() {
            let messages = log.take();
            log.unregister();
            return Err(Rejection::new(settings.label, function, Status::Error, messages));
        }
        let (library, label) = (Arc::clone(library), settings.label.into());
        Ok(Self {
            handle,
            log,
            _callbacks: callbacks,
            library,
            states: Default::default(),
            label,
            early_return: settings.early_return,
        })
    }

    /// Returns the FMI version.
    pub fn standard(&self) -> Standard {
        self.library.functions().standard()
    }

    /// Returns the library of the instance.
    pub fn library(&self) -> &Arc<Library> {
        &self.library
    }

    /// Returns the handle for a call; an error if the FMU has returned fmi2Fatal or fmi3Fatal.
    #[inline]
    pub(crate) fn handle(&self, function: &'static str) -> Result<*mut c_void, Rejection> {
        if self.is_alive() {
            Ok(self.handle)
        } else {
            Err(self.rejection(function, Status::Fatal, Vec::new()))
        }
    }

    /// Returns an error of this instance.
    #[cold]
    pub fn rejection(&self, function: &'static str, status: Status, log: Vec<Message>) -> Rejection {
        Rejection::new(&self.label, function, status, log)
    }

    /// Returns an error of this instance that does not come from the FMU.
    #[cold]
    pub fn own_rejection(&self, function: &'static str, text: String) -> Rejection {
        let message = Message { status: Status::Error, category: String::new(), text };
        self.rejection(function, Status::Error, vec![message])
    }

    /// Converts the status code of a call to a `Result`.
    #[inline]
    pub(crate) fn check(&mut self, function: &'static str, code: c_int) -> Result<(), Rejection> {
        if code == Status::Ok as c_int { Ok(()) } else { self.not_ok(function, code) }
    }

    #[cold]
    fn not_ok(&mut self, function: &'static str, code: c_int) -> Result<(), Rejection> {
        let status = Status::from_c(code);
        // Messages of a warning are removed, so that they are not taken for the reason of a later error.
        let log = self.log.take();
        if status == Status::Warning {
            return Ok(());
        }
        if status == Status::Fatal {
            self.handle = std::ptr::null_mut();
        }
        Err(self.rejection(function, status, log))
    }

    /// Returns whether the instance can still be used.
    #[inline]
    pub fn is_alive(&self) -> bool {
        !self.handle.is_null()
    }

    /// Removes the messages so far, so that they are not taken for the reason of a later error.
    pub fn forget_log(&self) {
        self.log.take();
    }

    /// Sets up the experiment in FMI 2.0. Does nothing in FMI 3.0, where
    /// [`enter_initialization_mode`](Self::enter_initialization_mode) passes the experiment. Times are in s; the
    /// tolerance is relative.
    ///
    /// # Errors
    /// The FMU rejects the call.
    pub fn set_up(
        &mut self,
        start_time: f64,
        stop_time: Option<f64>,
        tolerance: Option<f64>,
    ) -> Result<(), Rejection> {
        if self.standard() == Standard::Fmi3 {
            return Ok(());
        }
        let (stop, relative) = (stop_time.unwrap_or(start_time), tolerance.unwrap_or(0.0));
        let [has_stop, has_tolerance] = [stop_time, tolerance].map(|value| value.is_some().into());
        call!(self, fmi2SetupExperiment(has_tolerance, relative, start_time, has_stop, stop))
    }

    /// Enters Initialization Mode. Only FMI 3.0 uses the arguments, because in FMI 2.0 [`set_up`](Self::set_up) passes them.
    ///
    /// # Errors
    /// The FMU rejects the call.
    pub fn enter_initialization_mode(
        &mut self,
        start_time: f64,
        stop_time: Option<f64>,
        tolerance: Option<f64>,
    ) -> Result<(), Rejection> {
        let (stop, relative) = (stop_time.unwrap_or(start_time), tolerance.unwrap_or(0.0));
        let [has_stop, has_tolerance] = [stop_time, tolerance].map(|value| value.is_some().into());
        keeping_environment(|| {
            call!(
                self,
                fmi2EnterInitializationMode(),
                fmi3EnterInitializationMode(has_tolerance, relative, start_time, has_stop, stop)
            )
        })
    }

    /// Sets up the experiment and enters Initialization Mode.
    ///
    /// # Errors
    /// The FMU rejects a call.
    pub fn initialize(
        &mut self,
        start_time: f64,
        stop_time: Option<f64>,
        tolerance: Option<f64>,
    ) -> Result<(), Rejection> {
        self.set_up(start_time, stop_time, tolerance)?;
        self.enter_initialization_mode(start_time, stop_time, tolerance)
    }

    /// Leaves Initialization Mode.
    ///
    /// # Errors
    /// The FMU rejects the call.
    pub fn exit_initialization_mode(&mut self) -> Result<(), Rejection> {
        keeping_environment(|| call!(self, fmi2ExitInitializationMode(), fmi3ExitInitializationMode()))
    }

    /// Enters Configuration Mode, where structural parameters are set (section 2.3.6 of FMI 3.0).
    ///
    /// # Errors
    /// The FMU rejects the call, or is of FMI 2.0, which does not have this mode.
    pub fn enter_configuration_mode(&mut self) -> Result<(), Rejection> {
        call!(fmi3 self, fmi3EnterConfigurationMode())
    }

    /// Leaves Configuration Mode.
    ///
    /// # Errors
    /// The FMU rejects the call, or is of FMI 2.0.
    pub fn exit_configuration_mode(&mut self) -> Result<(), Rejection> {
        call!(fmi3 self, fmi3ExitConfigurationMode())
    }

    /// Enters Step Mode after an event in Co-Simulation (FMI 3.0).
    ///
    /// # Errors
    /// The FMU rejects the call, or is of FMI 2.0.
    pub fn enter_step_mode(&mut self) -> Result<(), Rejection> {
        call!(fmi3 self, fmi3EnterStepMode())
    }

    /// Sets time derivatives of inputs; `orders` contains the order of each. FMI 3.0 does not have this function, so
    /// the call returns an error there.
    ///
    /// # Errors
    /// The FMU rejects the call.
    ///
    /// # Panics
    /// Panics if the lengths differ.
    #[inline]
    pub fn set_input_derivatives(
        &mut self,
        vr: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), Rejection> {
        assert!(vr.len() == values.len() && vr.len() == orders.len());
        let (vr, n, orders, values) = (vr.as_ptr(), vr.len(), orders.as_ptr(), values.as_ptr());
        call!(self, fmi2SetRealInputDerivatives(vr, n, orders, values))
    }

    /// Reads the first time derivatives of outputs. If some outputs are arrays, there are more values than variables.
    ///
    /// # Errors
    /// The FMU rejects the call.
    ///
    /// # Panics
    /// Panics if there are fewer values than variables.
    pub fn get_output_derivatives(&mut self, vr: &[u32], values: &mut [f64]) -> Result<(), Rejection> {
        let (orders, count) = (vec![1; vr.len()], values.len());
        assert!(count >= vr.len());
        let (vr, n, orders, values) = (vr.as_ptr(), vr.len(), orders.as_ptr(), values.as_mut_ptr());
        call!(
            self,
            fmi2GetRealOutputDerivatives(vr, n, orders, values),
            fmi3GetOutputDerivatives(vr, n, orders, values, count)
        )
    }

    /// Performs a step of Co-Simulation and returns the time that the FMU has reached, s. Waits for the end of the step if the FMU
    /// performs it asynchronously.
    ///
    /// # Errors
    /// The FMU rejects the step, ends the simulation (see [`Rejection::ended`]), or ends the step early although this
    /// is not allowed.
    #[inline]
    pub fn step(&mut self, time: f64, size: f64) -> Result<f64, Rejection> {
        // While there are saved states, one of them may be restored (section 4.2.2 of FMI 2.0, noSetFMUStatePriorToCurrentPoint).
        let no_return = self.states.is_empty();
        let (mut event, mut terminate, mut early, mut reached) =
            (fmi3False, fmi3False, fmi3False, time + size);
        let handle = self.handle("fmi2DoStep")?;
        // SAFETY: the instance is alive; the pointers are live references.
        let (function, code) = unsafe {
            match self.library.functions() {
                Functions::Fmi2(of) => {
                    let code = (of.fmi2DoStep)(handle, time, size, no_return.into());
                    if code == PENDING { wait(of, handle) } else { ("fmi2DoStep", code) }
                }
                Functions::Fmi3(of) => {
                    let step = of.fmi3DoStep;
                    let no_return = no_return.into();
                    let code = step(
                        handle,
                        time,
                        size,
                        no_return,
                        &mut event,
                        &mut terminate,
                        &mut early,
                        &mut reached,
                    );
                    ("fmi3DoStep", code)
                }
            }
        };
        match self.check(function, code) {
            Ok(()) if terminate == fmi3False && (early == fmi3False || self.early_return) => Ok(reached),
            Ok(()) => Err(self.stopped(terminate != fmi3False, time, reached)),
            Err(rejection) => Err(self.ended(rejection, time)),
        }
    }

    /// Performs a step of Co-Simulation with event mode (FMI 3.0). Unlike after [`step`](Self::step), the caller handles the event if the
    /// FMU needs one.
    ///
    /// # Errors
    /// The FMU rejects the step, ends the simulation (see [`Rejection::ended`]), returns early although this is not allowed, or is of
    /// FMI 2.0.
    pub fn step_to_event(&mut self, time: f64, size: f64) -> Result<Stepped, Rejection> {
        let no_return = self.states.is_empty().into();
        let ([mut event, mut terminate, mut early], mut reached) = ([fmi3False; 3], time + size);
        call!(fmi3 self, fmi3DoStep(time, size, no_return, &mut event, &mut terminate, &mut early, &mut reached))?;
        if terminate != fmi3False || early != fmi3False && !self.early_return {
            return Err(self.stopped(terminate != fmi3False, time, reached));
        }
        Ok(Stepped { time: reached, early: early != fmi3False, event: event != fmi3False })
    }

    /// Adds the end time to the error of a discarded step if the FMU requests the end of the simulation (section 4.2.3 of FMI 2.0).
    #[cold]
    fn ended(&self, rejection: Rejection, time: f64) -> Rejection {
        let (mut wanted, mut reached) = (fmi2False, time);
        let kinds =
            [StatusKind::Terminated, StatusKind::LastSuccessfulTime].map(|kind| kind as fmi2StatusKind);
        let Functions::Fmi2(functions) = self.library.functions() else { return rejection };
        if rejection.status() != Status::Discard {
            return rejection;
        }
        // SAFETY: the instance is alive after fmi2Discard; the pointers are live references.
        let [terminated, last_time] = unsafe {
            [
                (functions.fmi2GetBooleanStatus)(self.handle, kinds[0], &mut wanted),
                (functions.fmi2GetRealStatus)(self.handle, kinds[1], &mut reached),
            ]
        };
        if terminated != Status::Ok as c_int || wanted == fmi2False {
            return rejection;
        }
        let is_known = last_time == Status::Ok as c_int && reached.is_finite();
        rejection.at_end(if is_known { reached } else { time })
    }

    /// Returns the error of a step after which the FMU requests the end of the simulation, or of a step that ended early although
    /// this was not allowed (section 4.2.1 of FMI 3.0).
    #[cold]
    fn stopped(&self, wanted: bool, time: f64, reached: f64) -> Rejection {
        let (function, status) = ("fmi3DoStep", Status::Discard);
        let mut log = self.log.take();
        if !wanted {
            let text = format!("the step ended early, at {} s", shown_number(reached));
            log.push(Message { status, category: String::new(), text });
        }
        let rejection = self.rejection(function, status, log);
        if wanted { rejection.at_end(if reached.is_finite() { reached } else { time }) } else { rejection }
    }

    /// Computes directional derivatives of unknowns for a seed, which has a value for each known (section 2.1.9 of FMI 2.0, 2.2.12 of
    /// FMI 3.0). Arrays have several values each.
    ///
    /// # Errors
    /// The FMU rejects the call.
    ///
    /// # Panics
    /// Panics if there are fewer values than variables.
    pub fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), Rejection> {
        assert!(knowns.len() <= seed.len() && unknowns.len() <= result.len());
        let (unknown, m) = (unknowns.as_ptr(), unknowns.len());
        let (known, n) = (knowns.as_ptr(), knowns.len());
        let (seed, seeds, result, count) = (seed.as_ptr(), seed.len(), result.as_mut_ptr(), result.len());
        call!(
            self,
            fmi2GetDirectionalDerivative(unknown, m, known, n, seed, result),
            fmi3GetDirectionalDerivative(unknown, m, known, n, seed, seeds, result, count)
        )
    }

    /// Enters Event Mode.
    ///
    /// # Errors
    /// The FMU rejects the call.
    pub fn enter_event_mode(&mut self) -> Result<(), Rejection> {
        call!(self, fmi2EnterEventMode(), fmi3EnterEventMode())
    }

    /// Enters Continuous-Time Mode.
    ///
    /// # Errors
    /// The FMU rejects the call.
    pub fn enter_continuous_time_mode(&mut self) -> Result<(), Rejection> {
        call!(self, fmi2EnterContinuousTimeMode(), fmi3EnterContinuousTimeMode())
    }

    /// Updates the discrete states until the FMU needs no further iteration or requests the end of the simulation. The
    /// instance must be in Event Mode.
    ///
    /// # Errors
    /// The FMU rejects a call, or the event does not end within 10,000 iterations.
    pub fn event(&mut self) -> Result<Event, Rejection> {
        let mut all = Event::default();
        for _ in 0..MOST_ITERATIONS {
            if !self.update_discrete_states(&mut all)? {
                return Ok(all);
            }
        }
        Err(self.endless_event())
    }

    /// Returns the error for an event that does not end.
    #[cold]
    pub fn endless_event(&self) -> Rejection {
        self.own_rejection("event", format!("the event does not end within {MOST_ITERATIONS} iterations"))
    }

    /// Updates the discrete states once. Adds the result to that of the event's earlier iterations, and returns whether the event needs
    /// a further one.
    ///
    /// # Errors
    /// The FMU rejects the call.
    #[inline]
    pub fn update_discrete_states(&mut self, all: &mut Event) -> Result<bool, Rejection> {
        let mut of_fmi2 = fmi2EventInfo::default();
        let [mut again, mut terminate, mut nominals, mut states, mut is_next] = [fmi3False; 5];
        let mut next = 0.0;
        call!(
            self,
            fmi2NewDiscreteStates(&mut of_fmi2),
            fmi3UpdateDiscreteStates(
                &mut again,
                &mut terminate,
                &mut nominals,
                &mut states,
                &mut is_next,
                &mut next
            )
        )?;
        if self.standard() == Standard::Fmi2 {
            let boolean = |value: fmi2Boolean| fmi3Boolean::from(value != fmi2False);
            again = boolean(of_fmi2.new_discrete_states_needed);
            terminate = boolean(of_fmi2.terminate_simulation);
            nominals = boolean(of_fmi2.nominals_of_continuous_states_changed);
            states = boolean(of_fmi2.values_of_continuous_states_changed);
            is_next = boolean(of_fmi2.next_event_time_defined);
            next = of_fmi2.next_event_time;
        }
        all.terminate |= terminate != fmi3False;
        all.nominals_changed |= nominals != fmi3False;
        all.states_changed |= states != fmi3False;
        all.next = (is_next != fmi3False).then_some(next);
        Ok(again != fmi3False && !all.terminate)
    }

    /// Tells the FMU that an integrator step is complete. Returns whether the FMU requests an event, and whether it requests the end
    /// of the simulation.
    ///
    /// # Errors
    /// The FMU rejects the call.
    pub fn completed_integrator_step(&mut self) -> Result<[bool; 2], Rejection> {
        let no_return = self.states.is_empty();
        let [mut event2, mut end2] = [fmi2False; 2];
        let [mut event3, mut end3] = [fmi3False; 2];
        call!(
            self,
            fmi2CompletedIntegratorStep(no_return.into(), &mut event2, &mut end2),
            fmi3CompletedIntegratorStep(no_return.into(), &mut event3, &mut end3)
        )?;
        Ok([event2 != fmi2False || event3 != fmi3False, end2 != fmi2False || end3 != fmi3False])
    }

    /// Sets the time, s, in Model Exchange.
    ///
    /// # Errors
    /// The FMU rejects the call.
    pub fn set_time(&mut self, time: f64) -> Result<(), Rejection> {
        call!(self, fmi2SetTime(time), fmi3SetTime(time))
    }

    /// Sets the continuous states.
    ///
    /// # Errors
    /// The FMU rejects the call.
    pub fn set_continuous_states(&mut self, x: &[f64]) -> Result<(), Rejection> {
        let (x, n) = (x.as_ptr(), x.len());
        call!(self, fmi2SetContinuousStates(x, n), fmi3SetContinuousStates(x, n))
    }

    /// Reads a continuous quantity.
    ///
    /// # Errors
    /// The FMU rejects the call.
    pub fn get_continuous(&mut self, what: Continuous, values: &mut [f64]) -> Result<(), Rejection> {
        let (x, n) = (values.as_mut_ptr(), values.len());
        match what {
            Continuous::States => call!(self, fmi2GetContinuousStates(x, n), fmi3GetContinuousStates(x, n)),
            Continuous::Derivatives => {
                call!(self, fmi2GetDerivatives(x, n), fmi3GetContinuousStateDerivatives(x, n))
            }
            Continuous::EventIndicators => {
                call!(self, fmi2GetEventIndicators(x, n), fmi3GetEventIndicators(x, n))
            }
            Continuous::Nominals => {
                call!(self, fmi2GetNominalsOfContinuousStates(x, n), fmi3GetNominalsOfContinuousStates(x, n))
            }
        }
    }

    /// Terminates the simulation.
    ///
    /// # Errors
    /// The FMU rejects the call.
    pub fn terminate(&mut self) -> Result<(), Rejection> {
        call!(self, fmi2Terminate(), fmi3Terminate())
    }

    /// Resets the instance to the state after its creation.
    ///
    /// # Errors
    /// The FMU rejects the call.
    pub fn reset(&mut self) -> Result<(), Rejection> {
        call!(self, fmi2Reset(), fmi3Reset())
    }
}

/// Waits for the end of an asynchronous step. Returns the function that failed, if one has, and the status of the step. Asks for the
/// status repeatedly, because this crate passes no `stepFinished` callback (section 4.2.2 of FMI 2.0).
#[cold]
fn wait(functions: &crate::fmi2::Functions, handle: *mut c_void) -> (&'static str, c_int) {
    const LONGEST_PAUSE: Duration = Duration::from_millis(1);
    let mut pause = Duration::from_micros(10);
    loop {
        let mut status = PENDING;
        let kind = StatusKind::DoStepStatus as fmi2StatusKind;
        // SAFETY: the instance is alive; the pointer is a live reference.
        let code = unsafe { (functions.fmi2GetStatus)(handle, kind, &mut status) };
        if code != Status::Ok as c_int && code != Status::Warning as c_int {
            return ("fmi2GetStatus, after fmi2DoStep had returned Pending,", code);
        }
        if status != PENDING {
            return ("fmi2DoStep", status);
        }
        std::thread::sleep(pause);
        pause = (2 * pause).min(LONGEST_PAUSE);
    }
}

//! An instance of an FMU of any version. Safe functions wrap the C calls: they check lengths, keep the
//! library loaded, and call nothing after fmi2Fatal.

use crate::arrays::{Arrays, Expanded};
use crate::fmu::Loaded;
use crate::library::{Functions, Library};
use crate::log::{Log, log_of_fmi3, logger_of_fmi2};
use crate::rejection::{Message, Rejection, reason};
use fmi_abi::c_types::{c_int, c_void};
use fmi_abi::fmi2::types::*;
use fmi_abi::fmi3::types::*;
use fmi_abi::{Interface, Status};
use std::collections::HashMap;
use std::ffi::CString;
use std::ptr::null_mut;
use std::rc::Rc;
use std::sync::Arc;

/// An instance, freed when dropped. It keeps its library loaded.
#[derive(Debug)]
pub struct Instance {
    /// NULL after fmi2Fatal, when even freeing is forbidden (section 2.1.3 of FMI 2.0).
    handle: *mut c_void,
    log: Arc<Log>,
    /// Callbacks, which must live as long as the instance (section 2.1.5 of FMI 2.0).
    _callbacks: Rc<fmi2CallbackFunctions>,
    pub(crate) library: Arc<Library>,
    /// States that the instance has saved; NULL marks a free entry.
    saved: Vec<*mut c_void>,
    /// Name of the component; empty if there is only one.
    name: String,
    pub(crate) arrays: Arc<Arrays>,
    /// Values of arrays set before the initialization, when they cannot be read; `None` after its start.
    pub(crate) early: Option<EarlyValues>,
}

/// Values of arrays that were set before the initialization, by array index. They cannot be read then.
#[derive(Debug, Default)]
pub(crate) struct EarlyValues {
    pub(crate) numbers: HashMap<usize, Vec<f64>>,
    pub(crate) texts: HashMap<usize, Vec<CString>>,
}

/// Index of a state that an instance has saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Saved(usize);

impl Saved {
    pub fn index(self) -> usize {
        self.0
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

/// Limit of iterations of an event.
const MOST_ITERATIONS: usize = 10_000;

// SAFETY: the FMI standards permit use of an instance from any thread, one thread at a time.
unsafe impl Send for Instance {}

impl Drop for Instance {
    fn drop(&mut self) {
        if self.handle.is_null() {
            return;
        }
        for index in 0..self.saved.len() {
            _ = self.forget(Saved(index));
        }
        // SAFETY: the library made the instance, which is freed only here.
        unsafe {
            match &self.library.functions {
                Functions::Fmi2(functions) => (functions.fmi2FreeInstance)(self.handle),
                Functions::Fmi3(functions) => (functions.fmi3FreeInstance)(self.handle),
            }
        }
    }
}

/// Calls a function of FMI 2.0 or its counterpart in FMI 3.0; without a counterpart, FMI 3.0 gets an error.
macro_rules! call {
    ($self:ident, $fmi2:ident ( $($of_fmi2:expr),* ) $(, $fmi3:ident ( $($of_fmi3:expr),* ))?) => {{
        let handle = $self.handle(stringify!($fmi2))?;
        // SAFETY: the instance is alive; array arguments are slices with the passed lengths, and single
        // values are live references.
        let (function, code) = unsafe {
            match &$self.library.functions {
                Functions::Fmi2(of) => (stringify!($fmi2), (of.$fmi2)(handle $(, $of_fmi2)*)),
                $(Functions::Fmi3(of) => (stringify!($fmi3), (of.$fmi3)(handle $(, $of_fmi3)*)),)?
                #[allow(unreachable_patterns, reason = "where FMI 3.0 has the function")]
                Functions::Fmi3(_) => (stringify!($fmi2), fmi_abi::Status::Error as c_int),
            }
        };
        $self.check(function, code)
    }};
}

pub(crate) use call;

impl Instance {
    /// Creates an instance for an interface type. The error contains the reason, and whether the FMU gave it.
    /// The instance has the name of its component.
    pub(crate) fn new(
        fmu: &Loaded,
        component: &str,
        interface: Interface,
        logging_on: bool,
    ) -> Result<Self, (String, bool)> {
        let library = fmu.library(interface).map_err(|error| (error.to_string(), false))?;
        let log = Arc::new(if logging_on { Log::keeping() } else { Log::default() });
        let environment = Arc::as_ptr(&log).cast_mut().cast();
        let token = CString::new(fmu.description.token.as_str()).unwrap_or_default();
        let own_name = if component.is_empty() { "instance" } else { component };
        let own_name = CString::new(own_name).unwrap_or_default();
        let (name, token, resources) = (own_name.as_ptr(), token.as_ptr(), library.resources.as_ptr());
        let library = Arc::clone(library);

        let callbacks = Rc::new(fmi2CallbackFunctions {
            logger: Some(logger_of_fmi2()),
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: environment,
        });
        // SAFETY: all strings are live; callbacks and log live as long as the instance.
        let handle = unsafe {
            match &library.functions {
                Functions::Fmi2(functions) => (functions.fmi2Instantiate)(
                    name,
                    interface as fmi2Type,
                    token,
                    resources,
                    Rc::as_ptr(&callbacks),
                    fmi2False,
                    logging_on.into(),
                ),
                Functions::Fmi3(functions) if interface == Interface::ModelExchange => (functions
                    .fmi3InstantiateModelExchange)(
                    name,
                    token,
                    resources,
                    fmi3False,
                    logging_on.into(),
                    environment,
                    Some(log_of_fmi3),
                ),
                Functions::Fmi3(functions) => (functions.fmi3InstantiateCoSimulation)(
                    name,
                    token,
                    resources,
                    fmi3False,
                    logging_on.into(),
                    fmi3False,
                    fmi3False,
                    std::ptr::null(),
                    0,
                    environment,
                    Some(log_of_fmi3),
                    None,
                ),
            }
        };
        if handle.is_null() {
            let log = log.take();
            let no_message =
                || format!("{} makes no instance, and logs no message", fmu.description.model_name);
            let why = reason(&log).map_or_else(no_message, |message| message.text.trim().to_owned());
            let prefix = if component.is_empty() { String::new() } else { format!("{component}: ") };
            return Err((prefix + &why, log.is_empty()));
        }
        let (saved, name) = (Vec::new(), component.to_owned());
        let (arrays, early) = (Arc::clone(&fmu.description.arrays), Some(EarlyValues::default()));
        Ok(Self { handle, log, _callbacks: callbacks, library, saved, name, arrays, early })
    }

    /// Returns the handle for a call, unless the FMU has returned fmi2Fatal.
    #[inline]
    pub(crate) fn handle(&self, function: &'static str) -> Result<*mut c_void, Rejection> {
        if self.is_alive() {
            Ok(self.handle)
        } else {
            Err(self.rejection(function, Status::Fatal, Vec::new()))
        }
    }

    #[cold]
    fn rejection(&self, function: &'static str, status: Status, log: Vec<Message>) -> Rejection {
        Rejection::new(&self.name, function, status, log)
    }

    /// Converts the status of a call.
    #[inline]
    pub(crate) fn check(&mut self, function: &'static str, code: c_int) -> Result<(), Rejection> {
        if code == Status::Ok as c_int { Ok(()) } else { self.not_ok(function, Status::from_c(code)) }
    }

    #[cold]
    fn not_ok(&mut self, function: &'static str, status: Status) -> Result<(), Rejection> {
        // Messages of a warning are removed, so that they are not taken for the reason of a later error.
        let log = self.log.take();
        if status == Status::Warning {
            return Ok(());
        }
        if status == Status::Fatal {
            self.handle = null_mut();
        }
        Err(self.rejection(function, status, log))
    }

    fn is_of_fmi2(&self) -> bool {
        matches!(self.library.functions, Functions::Fmi2(_))
    }

    /// Returns whether the instance can still be used.
    pub(crate) fn is_alive(&self) -> bool {
        !self.handle.is_null()
    }

    pub(crate) fn forget_log(&self) {
        self.log.take();
    }

    /// Returns the messages since the last call, if logging is on.
    pub(crate) fn take_messages(&self) -> Vec<Message> {
        self.log.take_all()
    }

    /// Sets up the experiment in FMI 2.0, before the start values are set.
    pub(crate) fn set_up(&mut self, start_time: f64, stop_time: Option<f64>) -> Result<(), Rejection> {
        match &self.library.functions {
            // FMI 3.0 passes the times when it enters Initialization Mode.
            Functions::Fmi3(_) => Ok(()),
            Functions::Fmi2(_) => {
                let stop = stop_time.unwrap_or(start_time);
                call!(self, fmi2SetupExperiment(fmi2False, 0.0, start_time, stop_time.is_some().into(), stop))
            }
        }
    }

    pub(crate) fn enter_initialization_mode(
        &mut self,
        start_time: f64,
        stop_time: Option<f64>,
    ) -> Result<(), Rejection> {
        let (defined, stop) = (stop_time.is_some().into(), stop_time.unwrap_or(start_time));
        call!(
            self,
            fmi2EnterInitializationMode(),
            fmi3EnterInitializationMode(fmi3False, 0.0, start_time, defined, stop)
        )?;
        self.early = None;
        Ok(())
    }

    pub(crate) fn exit_initialization_mode(&mut self) -> Result<(), Rejection> {
        call!(self, fmi2ExitInitializationMode(), fmi3ExitInitializationMode())
    }

    /// Sets time derivatives of inputs, of order 1. FMI 3.0 has no function for this.
    #[inline]
    pub(crate) fn set_input_derivatives(
        &mut self,
        vr: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), Rejection> {
        assert!(vr.len() == values.len() && vr.len() == orders.len());
        let (vr, n, orders, values) = (vr.as_ptr(), vr.len(), orders.as_ptr(), values.as_ptr());
        call!(self, fmi2SetRealInputDerivatives(vr, n, orders, values))
    }

    /// Gets time derivatives of outputs, of order 1.
    pub(crate) fn get_output_derivatives(&mut self, vr: &[u32], values: &mut [f64]) -> Result<(), Rejection> {
        assert_eq!(vr.len(), values.len());
        let Expanded { references, count, indices, .. } = self.arrays.expanded(vr);
        let (orders, mut all) = (vec![1; references.len()], vec![0.0; count]);
        let (vr, n, orders, all_values) =
            (references.as_ptr(), references.len(), orders.as_ptr(), all.as_mut_ptr());
        call!(
            self,
            fmi2GetRealOutputDerivatives(vr, n, orders, all_values),
            fmi3GetOutputDerivatives(vr, n, orders, all_values, count)
        )?;
        indices.iter().zip(values).for_each(|(index, value)| *value = all[*index]);
        Ok(())
    }

    /// Performs a step. Returns an error also if the FMU ends the simulation.
    #[inline]
    pub(crate) fn step(&mut self, time: f64, size: f64) -> Result<(), Rejection> {
        let (mut event, mut terminate, mut early, mut reached) = (fmi3False, fmi3False, fmi3False, time);
        let stepped = call!(
            self,
            fmi2DoStep(time, size, fmi2True),
            fmi3DoStep(time, size, fmi3True, &mut event, &mut terminate, &mut early, &mut reached)
        );
        match stepped {
            Ok(()) if terminate == fmi3False && early == fmi3False => Ok(()),
            Ok(()) => Err(self.stopped(terminate != fmi3False, reached)),
            Err(rejection) => Err(self.ended(rejection, time)),
        }
    }

    /// Detects whether a discarded step is a request to end the simulation (section 4.2.3 of FMI 2.0).
    #[cold]
    fn ended(&self, rejection: Rejection, time: f64) -> Rejection {
        let (mut wanted, mut reached) = (fmi2False, time);
        let kinds =
            [StatusKind::Terminated, StatusKind::LastSuccessfulTime].map(|kind| kind as fmi2StatusKind);
        let Functions::Fmi2(functions) = &self.library.functions else { return rejection };
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

    /// Returns the error for a requested end of the simulation, or for an early return, which was not allowed
    /// (section 4.2.1 of FMI 3.0).
    #[cold]
    fn stopped(&self, wanted: bool, reached: f64) -> Rejection {
        let (function, status) = ("fmi3DoStep", Status::Discard);
        let mut log = self.log.take();
        if !wanted {
            let text = format!("the step ended early, at {reached} s");
            log.push(Message { status, category: String::new(), text });
        }
        let rejection = self.rejection(function, status, log);
        if wanted { rejection.at_end(reached) } else { rejection }
    }

    /// Saves the state under a free index.
    pub(crate) fn save(&mut self) -> Result<Saved, Rejection> {
        let mut state = null_mut();
        call!(self, fmi2GetFMUstate(&mut state), fmi3GetFMUState(&mut state))?;
        Ok(self.keep(state))
    }

    fn keep(&mut self, state: *mut c_void) -> Saved {
        let free = self.saved.iter().position(|known| known.is_null());
        let index = free.unwrap_or(self.saved.len());
        self.saved.resize(self.saved.len().max(index + 1), null_mut());
        self.saved[index] = state;
        Saved(index)
    }

    /// Returns the saved state of an index.
    fn state(&self, saved: Saved, function: &'static str) -> Result<*mut c_void, Rejection> {
        let state = self.saved.get(saved.0).copied().filter(|state| !state.is_null());
        state.ok_or_else(|| self.rejection(function, Status::Error, Vec::new()))
    }

    pub(crate) fn restore(&mut self, saved: Saved) -> Result<(), Rejection> {
        let state = self.state(saved, "restore")?;
        call!(self, fmi2SetFMUstate(state), fmi3SetFMUState(state))
    }

    pub(crate) fn forget(&mut self, saved: Saved) -> Result<(), Rejection> {
        let Ok(mut state) = self.state(saved, "forget") else { return Ok(()) };
        self.saved[saved.0] = null_mut();
        call!(self, fmi2FreeFMUstate(&mut state), fmi3FreeFMUState(&mut state))
    }

    pub(crate) fn serialize(&mut self, saved: Saved) -> Result<Vec<u8>, Rejection> {
        let (state, mut size) = (self.state(saved, "serialize")?, 0);
        call!(
            self,
            fmi2SerializedFMUstateSize(state, &mut size),
            fmi3SerializedFMUStateSize(state, &mut size)
        )?;
        let mut bytes = vec![0_u8; size];
        let to = bytes.as_mut_ptr();
        call!(self, fmi2SerializeFMUstate(state, to.cast(), size), fmi3SerializeFMUState(state, to, size))?;
        Ok(bytes)
    }

    pub(crate) fn deserialize(&mut self, bytes: &[u8]) -> Result<Saved, Rejection> {
        let (from, size, mut state) = (bytes.as_ptr(), bytes.len(), null_mut());
        call!(
            self,
            fmi2DeSerializeFMUstate(from.cast(), size, &mut state),
            fmi3DeserializeFMUState(from, size, &mut state)
        )?;
        Ok(self.keep(state))
    }

    /// Computes directional derivatives of unknowns for a seed (section 2.1.9 of FMI 2.0, 2.2.12 of FMI 3.0).
    pub(crate) fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), Rejection> {
        assert!(knowns.len() == seed.len() && unknowns.len() == result.len());
        if !self.arrays.among(unknowns) && !self.arrays.among(knowns) {
            return self.derivative_of_variables(unknowns, knowns, seed, result);
        }
        let (unknowns, knowns) = (self.arrays.expanded(unknowns), self.arrays.expanded(knowns));
        // The seed of all other elements is 0.
        let (mut seeds, mut results) = (vec![0.0; knowns.count], vec![0.0; unknowns.count]);
        knowns.indices.iter().zip(seed).for_each(|(index, seed)| seeds[*index] += seed);
        self.derivative_of_variables(&unknowns.references, &knowns.references, &seeds, &mut results)?;
        unknowns.indices.iter().zip(result).for_each(|(index, value)| *value = results[*index]);
        Ok(())
    }

    /// Calls the function with all elements of arrays.
    fn derivative_of_variables(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), Rejection> {
        let (unknown, m) = (unknowns.as_ptr(), unknowns.len());
        let (known, n) = (knowns.as_ptr(), knowns.len());
        let (seed, seeds, result, count) = (seed.as_ptr(), seed.len(), result.as_mut_ptr(), result.len());
        call!(
            self,
            fmi2GetDirectionalDerivative(unknown, m, known, n, seed, result),
            fmi3GetDirectionalDerivative(unknown, m, known, n, seed, seeds, result, count)
        )
    }

    pub(crate) fn enter_event_mode(&mut self) -> Result<(), Rejection> {
        call!(self, fmi2EnterEventMode(), fmi3EnterEventMode())
    }

    pub(crate) fn enter_continuous_time_mode(&mut self) -> Result<(), Rejection> {
        call!(self, fmi2EnterContinuousTimeMode(), fmi3EnterContinuousTimeMode())
    }

    /// Updates the discrete states until the event is over. The instance must be in Event Mode.
    pub(crate) fn event(&mut self) -> Result<Event, Rejection> {
        let mut all = Event::default();
        for _ in 0..MOST_ITERATIONS {
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
            if self.is_of_fmi2() {
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
            if again == fmi3False || all.terminate {
                return Ok(all);
            }
        }
        let text = format!("the event does not end within {MOST_ITERATIONS} iterations");
        let message = Message { status: Status::Error, category: String::new(), text };
        Err(self.rejection("event", Status::Error, vec![message]))
    }

    /// Returns whether the FMU requests an event and the end of the simulation after a step of the
    /// integrator.
    pub(crate) fn completed_integrator_step(&mut self) -> Result<[bool; 2], Rejection> {
        let [mut event2, mut end2] = [fmi2False; 2];
        let [mut event3, mut end3] = [fmi3False; 2];
        call!(
            self,
            fmi2CompletedIntegratorStep(fmi2True, &mut event2, &mut end2),
            fmi3CompletedIntegratorStep(fmi3True, &mut event3, &mut end3)
        )?;
        Ok([event2 != fmi2False || event3 != fmi3False, end2 != fmi2False || end3 != fmi3False])
    }

    pub(crate) fn set_time(&mut self, time: f64) -> Result<(), Rejection> {
        call!(self, fmi2SetTime(time), fmi3SetTime(time))
    }

    pub(crate) fn set_continuous_states(&mut self, x: &[f64]) -> Result<(), Rejection> {
        let (x, n) = (x.as_ptr(), x.len());
        call!(self, fmi2SetContinuousStates(x, n), fmi3SetContinuousStates(x, n))
    }

    pub(crate) fn get_continuous(&mut self, what: Continuous, values: &mut [f64]) -> Result<(), Rejection> {
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

    pub(crate) fn terminate(&mut self) -> Result<(), Rejection> {
        call!(self, fmi2Terminate(), fmi3Terminate())
    }

    pub(crate) fn reset(&mut self) -> Result<(), Rejection> {
        call!(self, fmi2Reset(), fmi3Reset())?;
        self.early = Some(EarlyValues::default());
        Ok(())
    }
}

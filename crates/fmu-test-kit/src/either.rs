//! Operations on an instance of either FMI version, and assertions for tests.

use crate::fmi2;
use crate::fmi3::{self, Stepped};
use crate::importer::{Arguments, Hook, Log, Message, lock, to_bool};
use crate::library::functions_of;
use fmi_abi::fmi2::types::fmi2EventInfo;
use fmu_export::Mode::{self, *};
use fmu_export::fmi3::reference;
use fmu_export::{Exported, Interface, Standard, Status};
use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr::{null, null_mut};

/// Result of an event: `fmi2EventInfo`, or the results of `fmi3UpdateDiscreteStates`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(missing_docs, reason = "as in the standards: section 3.2.2 of FMI 2.0, 2.3.5 of FMI 3.0")]
pub struct Updated {
    pub again: bool,
    pub terminate: bool,
    pub nominals_changed: bool,
    pub states_changed: bool,
    pub next: Option<f64>,
}

/// Importer of either FMI version.
#[derive(Debug)]
pub enum Version<'a> {
    /// Importer of FMI 2.0.
    Fmi2(&'a fmi2::Importer),
    /// Importer of FMI 3.0.
    Fmi3(&'a fmi3::Importer),
}

/// Defines the methods for functions that differ only in their names in FMI 2.0 and 3.0, and the setters and getters of
/// one value.
macro_rules! methods {
    (
        calls { $($name:ident $fmi2:ident $fmi3:ident ($($argument:ident: $type:ty),*);)+ }
        values { $($set:ident $set2:ident $set3:ident, $get:ident $get2:ident $get3:ident: $value:ty;)+ }
    ) => {
        $(
            #[doc = concat!("Calls `", stringify!($fmi2), "` or `", stringify!($fmi3), "`.")]
            fn $name(&self $(, $argument: $type)*) -> Status {
                match self.version() {
                    Version::Fmi2(fmu) => fmu.$fmi2($($argument),*),
                    Version::Fmi3(fmu) => fmu.$fmi3($($argument),*),
                }
            }
        )+
        $(
            #[doc = concat!("Calls `", stringify!($set2), "` or `", stringify!($set3), "` for one variable.")]
            #[allow(clippy::useless_conversion, reason = "some types are equal")]
            fn $set(&self, index: u32, value: $value) -> Status {
                match self.version() {
                    Version::Fmi2(fmu) => fmu.$set2(&index, 1, &value.into()),
                    Version::Fmi3(fmu) => fmu.$set3(&reference(index), 1, &value.into(), 1),
                }
            }

            #[doc = concat!("Calls `", stringify!($get2), "` or `", stringify!($get3), "` for one variable.")]
            #[allow(clippy::useless_conversion, reason = "some types are equal")]
            fn $get(&self, index: u32, value: &mut $value) -> Status {
                match self.version() {
                    Version::Fmi2(fmu) => {
                        let mut found = (*value).into();
                        let status = fmu.$get2(&index, 1, &mut found);
                        *value = found.try_into().expect("a small number");
                        status
                    }
                    Version::Fmi3(fmu) => {
                        let mut found = (*value).into();
                        let status = fmu.$get3(&reference(index), 1, &mut found, 1);
                        *value = found.try_into().expect("a small number");
                        status
                    }
                }
            }
        )+
    };
}

/// Returns the value references of up to 16 variables in FMI 3.0. Allocates nothing, because tests of control
/// loops count allocations.
fn references(indices: &[u32]) -> [u32; 16] {
    let mut references = [0; 16];
    references[..indices.len()].copy_from_slice(indices);
    references.map(reference)
}

fn log_of<'a>(version: &Version<'a>) -> &'a Log {
    match version {
        Version::Fmi2(fmu) => fmu.log(),
        Version::Fmi3(fmu) => fmu.log(),
    }
}

/// An instance of FMI 2.0 or FMI 3.0, as an importer uses it. A variable is identified by its index in the variable
/// table.
///
/// Unless their documentation says otherwise, methods that return neither a status nor a `Result` assert that their calls
/// succeed.
#[allow(clippy::missing_panics_doc, reason = "the functions that assert panic on purpose")]
pub trait Either: Send {
    /// Returns the FMI version.
    fn standard() -> Standard
    where
        Self: Sized;

    /// Returns the names of the functions that take an instance.
    fn functions() -> &'static [&'static str]
    where
        Self: Sized;

    /// Instantiates a model in this program.
    ///
    /// # Errors
    /// Returns the log messages if instantiation fails.
    fn make<M: Exported>(arguments: &Arguments) -> Result<Self, Vec<Message>>
    where
        Self: Sized;

    /// Returns an importer without an instance: its functions pass NULL.
    fn null_instance<M: Exported>() -> Self
    where
        Self: Sized;

    /// Returns the importer, for the functions of its FMI version.
    fn version(&self) -> Version<'_>;

    methods! {
        calls {
            exit_initialization_mode fmi2ExitInitializationMode fmi3ExitInitializationMode ();
            terminate fmi2Terminate fmi3Terminate ();
            reset fmi2Reset fmi3Reset ();
            get_state fmi2GetFMUstate fmi3GetFMUState (state: *mut *mut c_void);
            set_state fmi2SetFMUstate fmi3SetFMUState (state: *mut c_void);
            free_state fmi2FreeFMUstate fmi3FreeFMUState (state: *mut *mut c_void);
            state_size fmi2SerializedFMUstateSize fmi3SerializedFMUStateSize (state: *mut c_void, size: *mut usize);
            enter_event_mode fmi2EnterEventMode fmi3EnterEventMode ();
            enter_continuous_time_mode fmi2EnterContinuousTimeMode fmi3EnterContinuousTimeMode ();
            set_time fmi2SetTime fmi3SetTime (time: f64);
            set_states fmi2SetContinuousStates fmi3SetContinuousStates (x: *const f64, count: usize);
            get_states fmi2GetContinuousStates fmi3GetContinuousStates (x: *mut f64, count: usize);
            get_derivatives fmi2GetDerivatives fmi3GetContinuousStateDerivatives (rates: *mut f64, count: usize);
            get_nominals fmi2GetNominalsOfContinuousStates fmi3GetNominalsOfContinuousStates
                (nominals: *mut f64, count: usize);
            get_indicators fmi2GetEventIndicators fmi3GetEventIndicators (indicators: *mut f64, count: usize);
        }
        values {
            set_integer fmi2SetInteger fmi3SetInt32, get_integer fmi2GetInteger fmi3GetInt32: i32;
            set_boolean fmi2SetBoolean fmi3SetBoolean, get_boolean fmi2GetBoolean fmi3GetBoolean: u8;
            set_string fmi2SetString fmi3SetString, get_string fmi2GetString fmi3GetString: *const c_char;
            set_item fmi2SetInteger fmi3SetInt64, get_item fmi2GetInteger fmi3GetInt64: i32;
        }
    }

    /// Returns the modes of an interface type, except the one after a fatal error, which only a model that panics enters.
    fn modes_of(interface: Interface) -> &'static [Mode]
    where
        Self: Sized,
    {
        match (Self::standard(), interface) {
            (Standard::Fmi2, Interface::CoSimulation) => {
                &[Instantiated, Initialization, StepComplete, StepFailed, Terminated, Error]
            }
            (Standard::Fmi2, Interface::ModelExchange) => {
                &[Instantiated, Initialization, Event, ContinuousTime, Terminated, Error]
            }
            (Standard::Fmi3, Interface::CoSimulation) => {
                &[Instantiated, Initialization, Event, StepComplete, Terminated]
            }
            (Standard::Fmi3, Interface::ModelExchange) => {
                &[Instantiated, Initialization, Event, ContinuousTime, Terminated]
            }
        }
    }

    /// Calls the function of this name with arguments as 64-bit words; missing arguments are 0 or NULL.
    ///
    /// # Safety
    /// The words must be valid arguments of the function, as in C.
    ///
    /// # Panics
    /// Panics if the FMI version has no function of this name.
    unsafe fn call(&self, name: &str, words: &[u64]) -> Status {
        // SAFETY: the instance is NULL or alive; the caller guarantees the arguments.
        let code = unsafe {
            match self.version() {
                Version::Fmi2(fmu) => fmu.functions().call(name, fmu.instance(), words),
                Version::Fmi3(fmu) => fmu.functions().call(name, fmu.instance(), words),
            }
        };
        Status::from_c(code.unwrap_or_else(|| panic!("there is no function {name}")))
    }

    /// Calls the function of this name with all arguments 0 or NULL.
    ///
    /// # Panics
    /// Panics if the FMI version has no function of this name.
    fn call_with_zeros(&self, name: &str) -> Status {
        // SAFETY: NULL pointers are never dereferenced.
        unsafe { self.call(name, &[]) }
    }

    /// Returns the messages since the last call of this function.
    fn take_log(&self) -> Vec<Message> {
        log_of(&self.version()).take()
    }

    /// Runs this code in the log callback for every later message.
    fn on_message(&self, hook: Hook) {
        *lock(&log_of(&self.version()).hook) = Some(hook);
    }

    /// Enters Initialization Mode, in FMI 2.0 after `fmi2SetupExperiment`.
    fn enter_initialization_mode(&self, start_time: f64, stop_time: Option<f64>) -> Status {
        let (defined, stop_time) = (stop_time.is_some(), stop_time.unwrap_or(f64::NAN));
        match self.version() {
            Version::Fmi2(fmu) => {
                match fmu.fmi2SetupExperiment(0, f64::NAN, start_time, defined.into(), stop_time) {
                    Status::Ok => fmu.fmi2EnterInitializationMode(),
                    rejected => rejected,
                }
            }
            Version::Fmi3(fmu) => {
                fmu.fmi3EnterInitializationMode(0, f64::NAN, start_time, defined.into(), stop_time)
            }
        }
    }

    /// Reads Reals. Allocates nothing for up to 16 variables.
    fn try_get(&self, indices: &[u32], values: &mut [f64]) -> Status {
        let (count, value) = (indices.len(), values.as_mut_ptr());
        assert_eq!(count, values.len());
        match self.version() {
            Version::Fmi2(fmu) => fmu.fmi2GetReal(indices.as_ptr(), count, value),
            Version::Fmi3(fmu) if count <= 16 => {
                fmu.fmi3GetFloat64(references(indices).as_ptr(), count, value, count)
            }
            Version::Fmi3(fmu) => {
                let vr: Vec<_> = indices.iter().map(|index| reference(*index)).collect();
                fmu.fmi3GetFloat64(vr.as_ptr(), count, value, count)
            }
        }
    }

    /// Sets Reals, in FMI 3.0 at most 16.
    fn try_set(&self, indices: &[u32], values: &[f64]) -> Status {
        let (count, value) = (indices.len(), values.as_ptr());
        assert_eq!(count, values.len());
        match self.version() {
            Version::Fmi2(fmu) => fmu.fmi2SetReal(indices.as_ptr(), count, value),
            Version::Fmi3(fmu) => fmu.fmi3SetFloat64(references(indices).as_ptr(), count, value, count),
        }
    }

    /// Performs a step.
    fn try_step(&self, point: f64, step_size: f64) -> Status {
        match self.version() {
            Version::Fmi2(fmu) => fmu.fmi2DoStep(point, step_size, 1),
            Version::Fmi3(fmu) => fmu.do_step(point, step_size).err().unwrap_or(Status::Ok),
        }
    }

    /// Performs a step. Asserts that it is complete and that the time of the FMU is then exactly `point + step_size`.
    /// Allocates nothing.
    #[track_caller]
    fn step(&self, point: f64, step_size: f64) {
        const LAST_SUCCESSFUL_TIME: i32 = 2;
        let last_successful_time = point + step_size;
        match self.version() {
            Version::Fmi2(fmu) => {
                self.ok(self.try_step(point, step_size));
                let mut time = f64::NAN;
                self.ok(fmu.fmi2GetRealStatus(LAST_SUCCESSFUL_TIME, &mut time));
                assert_eq!(time, last_successful_time);
            }
            Version::Fmi3(fmu) => {
                let [event_handling_needed, terminate, early_return] = [false; 3];
                let complete =
                    Stepped { event_handling_needed, terminate, early_return, last_successful_time };
                assert_eq!(fmu.do_step(point, step_size), Ok(complete), "log: {:#?}", self.take_log());
            }
        }
    }

    /// Sets the first time derivatives of up to 8 inputs. Does nothing in FMI 3.0, which has no function for this.
    #[track_caller]
    fn set_input_derivatives(&self, indices: &[u32], values: &[f64]) {
        let (orders, count) = ([1; 8], indices.len());
        assert!(count == values.len() && count <= orders.len());
        if let Version::Fmi2(fmu) = self.version() {
            let (vr, orders) = (indices.as_ptr(), orders.as_ptr());
            self.ok(fmu.fmi2SetRealInputDerivatives(vr, count, orders, values.as_ptr()));
        }
    }

    /// Reads the time derivative of this order of a variable.
    fn try_rate(&self, index: u32, order: i32, rate: &mut f64) -> Status {
        match self.version() {
            Version::Fmi2(fmu) => fmu.fmi2GetRealOutputDerivatives(&index, 1, &order, rate),
            Version::Fmi3(fmu) => fmu.fmi3GetOutputDerivatives(&reference(index), 1, &order, rate, 1),
        }
    }

    /// Reads the directional derivatives of up to 16 unknowns with respect to up to 16 knowns.
    ///
    /// In FMI 3.0, also reads the adjoint derivatives of each unknown and asserts that their scalar product with the seed
    /// equals the directional derivative within rounding error. For one known, both must be bit-identical, except zeros.
    fn try_directional(&self, unknowns: &[u32], knowns: &[u32], seed: &[f64], results: &mut [f64]) -> Status {
        let [us, ks] = [unknowns.len(), knowns.len()];
        assert_eq!([seed.len(), results.len()], [ks, us]);
        let (seeds, result) = (seed.as_ptr(), results.as_mut_ptr());
        let fmu = match self.version() {
            Version::Fmi2(fmu) => {
                let (unknowns, knowns) = (unknowns.as_ptr(), knowns.as_ptr());
                return fmu.fmi2GetDirectionalDerivative(unknowns, us, knowns, ks, seeds, result);
            }
            Version::Fmi3(fmu) => fmu,
        };
        let (unknowns, knowns) = (references(unknowns), references(knowns));
        let (u, k) = (unknowns.as_ptr(), knowns.as_ptr());
        let status = fmu.fmi3GetDirectionalDerivative(u, us, k, ks, seeds, ks, result, us);
        for (unknown, forward) in unknowns.iter().zip(results).filter(|_| status == Status::Ok) {
            let mut adjoint = [f64::NAN; 16];
            self.ok(fmu.fmi3GetAdjointDerivative(unknown, 1, k, ks, &1.0, 1, adjoint.as_mut_ptr(), ks));
            let terms = || adjoint.iter().zip(seed).map(|(adjoint, seed)| adjoint * seed);
            let (sum, scale) = (terms().sum::<f64>(), terms().map(f64::abs).sum::<f64>());
            assert!(ks != 1 || sum.to_bits() == forward.to_bits() || sum == 0.0, "{adjoint:?} {forward}");
            assert!((sum - *forward).abs() <= 1e-14 * scale, "{adjoint:?} {seed:?} {forward}");
        }
        status
    }

    /// Performs one iteration of the event handling.
    ///
    /// # Errors
    /// Returns the status if it is not OK.
    fn try_update(&self) -> Result<Updated, Status> {
        let (flags, status, next) = match self.version() {
            Version::Fmi2(fmu) => {
                let mut info = fmi2EventInfo {
                    new_discrete_states_needed: 2,
                    terminate_simulation: 2,
                    nominals_of_continuous_states_changed: 2,
                    values_of_continuous_states_changed: 2,
                    next_event_time_defined: 2,
                    next_event_time: f64::NAN,
                };
                let status = fmu.fmi2NewDiscreteStates(&mut info);
                let flags = [
                    info.new_discrete_states_needed,
                    info.terminate_simulation,
                    info.nominals_of_continuous_states_changed,
                    info.values_of_continuous_states_changed,
                    info.next_event_time_defined,
                ];
                (flags, status, info.next_event_time)
            }
            Version::Fmi3(fmu) => {
                let (mut flags, mut next) = ([2; 5], f64::NAN);
                let [again, terminate, nominals, states, defined] = &mut flags;
                let status =
                    fmu.fmi3UpdateDiscreteStates(again, terminate, nominals, states, defined, &mut next);
                (flags.map(i32::from), status, next)
            }
        };
        if status != Status::Ok {
            return Err(status);
        }
        let [again, terminate, nominals_changed, states_changed, defined] = flags.map(to_bool);
        Ok(Updated { again, terminate, nominals_changed, states_changed, next: defined.then_some(next) })
    }

    /// Calls `fmi2CompletedIntegratorStep` or `fmi3CompletedIntegratorStep`. Returns whether the importer must enter Event
    /// Mode, and whether it must end the simulation.
    ///
    /// # Errors
    /// Returns the status if it is not OK.
    fn try_completed_step(&self) -> Result<[bool; 2], Status> {
        let (flags, status) = match self.version() {
            Version::Fmi2(fmu) => {
                let [mut event, mut terminate] = [2; 2];
                let status = fmu.fmi2CompletedIntegratorStep(1, &mut event, &mut terminate);
                ([event, terminate], status)
            }
            Version::Fmi3(fmu) => {
                let [mut event, mut terminate] = [2; 2];
                let status = fmu.fmi3CompletedIntegratorStep(1, &mut event, &mut terminate);
                ([event, terminate].map(i32::from), status)
            }
        };
        if status == Status::Ok { Ok(flags.map(to_bool)) } else { Err(status) }
    }

    /// Serializes a saved state.
    fn serialize_into(&self, state: *mut c_void, bytes: *mut u8, size: usize) -> Status {
        match self.version() {
            Version::Fmi2(fmu) => fmu.fmi2SerializeFMUstate(state, bytes.cast(), size),
            Version::Fmi3(fmu) => fmu.fmi3SerializeFMUState(state, bytes, size),
        }
    }

    /// De-serializes a state.
    fn deserialize(&self, bytes: *const u8, size: usize, state: *mut *mut c_void) -> Status {
        match self.version() {
            Version::Fmi2(fmu) => fmu.fmi2DeSerializeFMUstate(bytes.cast(), size, state),
            Version::Fmi3(fmu) => fmu.fmi3DeserializeFMUState(bytes, size, state),
        }
    }

    /// Creates an instance of a model in this program. In FMI 2.0, the environment variable `FMU_LIBRARY` can name another
    /// library of the model.
    #[track_caller]
    fn new<M: Exported>(interface: Interface) -> Self
    where
        Self: Sized,
    {
        Self::make::<M>(&Arguments::new::<M>(interface)).expect("an instance")
    }

    /// Creates an instance for Co-Simulation and initializes it at this time.
    fn initialized_at<M: Exported>(start_time: f64) -> Self
    where
        Self: Sized,
    {
        let fmu = Self::new::<M>(Interface::CoSimulation);
        fmu.initialize(start_time);
        fmu
    }

    /// Creates an instance in this mode, with Event Mode if it is supported. The modes `StepFailed` and `Error` are set by
    /// de-serializing a state: only models that end steps early enter the first, and no call leads to the second,
    /// because a rejected call leaves the mode unchanged.
    fn in_mode<M: Exported>(interface: Interface, mode: Mode) -> Self
    where
        Self: Sized,
    {
        let fmu = Self::make::<M>(&Arguments::with_events::<M>(interface)).expect("an instance");
        if mode == Instantiated {
            return fmu;
        }
        fmu.enter_initialization(0.0, None);
        if mode == Initialization {
            return fmu;
        }
        fmu.ok(fmu.exit_initialization_mode());
        match mode {
            ContinuousTime => _ = fmu.enter_continuous_time(),
            Terminated => fmu.ok(fmu.terminate()),
            StepFailed | Error => fmu.restore(&crate::serialized::with_mode(fmu.bytes(), mode)),
            StepComplete => fmu.leave_event_mode(),
            _ => {}
        }
        fmu
    }

    /// Enters Step Mode in FMI 3.0 if the instance is in Event Mode.
    fn leave_event_mode(&self) {
        if let Version::Fmi3(fmu) = self.version()
            && fmu.fmi3EnterStepMode() != Status::Ok
        {
            self.take_log();
        }
    }

    /// Calls each function with all arguments 0 or NULL. Returns the statuses with the names of the functions.
    fn call_all(&self) -> Vec<(&'static str, Status)>
    where
        Self: Sized,
    {
        Self::functions().iter().map(|name| (*name, self.call_with_zeros(name))).collect()
    }

    /// Asserts that the status is OK.
    #[track_caller]
    fn ok(&self, status: Status) {
        assert_eq!(status, Status::Ok, "log: {:#?}", self.take_log());
    }

    /// Asserts that a call is rejected: it returns an error, logs one clean message that begins with `fmi2` or `fmi3`, like
    /// the name of a function, and leaves the instance unchanged. Returns the message.
    #[track_caller]
    fn rejected(&self, label: &str, call: impl FnOnce(&Self) -> Status) -> String
    where
        Self: Sized,
    {
        let before = self.serialized();
        self.take_log();
        let status = call(self);
        let log = self.take_log();
        assert_eq!(status, Status::Error, "{label} is not rejected");
        let [message] = log.as_slice() else { panic!("{label}: one message expected, not {log:#?}") };
        let found = (message.status, message.category.as_str());
        assert_eq!(found, (Status::Error, "logStatusError"), "{label}");
        message.assert_clean();
        let prefix = &Self::functions()[0][..4];
        assert!(
            message.message.starts_with(prefix),
            "{label}: the message does not name the function: {}",
            message.message
        );
        assert_eq!(before, self.serialized(), "{label} changed the instance");
        self.take_log();
        message.message.clone()
    }

    /// Asserts that a call is rejected with a message that contains all these strings.
    #[track_caller]
    fn rejected_with(&self, words: &[&str], call: impl FnOnce(&Self) -> Status)
    where
        Self: Sized,
    {
        let message = self.rejected(&words.join(", "), call);
        words.iter().for_each(|word| assert!(message.contains(word), "'{word}' is not in: {message}"));
    }

    /// Returns the serialized state; `None` if the FMU cannot serialize it.
    fn serialized(&self) -> Option<Vec<u8>> {
        let mut state = null_mut();
        if self.get_state(&mut state) != Status::Ok {
            return None;
        }
        let (mut size, mut bytes) = (0, Vec::new());
        let mut status = self.state_size(state, &mut size);
        if status == Status::Ok {
            bytes.resize(size, 0);
            status = self.serialize_into(state, bytes.as_mut_ptr(), size);
        }
        self.forget(state);
        (status == Status::Ok).then_some(bytes)
    }

    /// Returns the serialized state; asserts success.
    #[track_caller]
    fn bytes(&self) -> Vec<u8> {
        self.serialized().expect("the FMU must serialize its state")
    }

    /// Asserts that de-serializing these bytes is rejected and that the handle stays NULL; returns the message.
    #[track_caller]
    fn rejected_bytes(&self, bytes: &[u8]) -> String
    where
        Self: Sized,
    {
        let mut state = null_mut();
        let message =
            self.rejected("malformed bytes", |fmu| fmu.deserialize(bytes.as_ptr(), bytes.len(), &mut state));
        assert!(state.is_null());
        assert!(message[4..].to_lowercase().starts_with("deserializefmustate: "), "{message}");
        message
    }

    /// Restores a serialized state.
    #[track_caller]
    fn restore(&self, bytes: &[u8]) {
        let mut state = null_mut();
        self.ok(self.deserialize(bytes.as_ptr(), bytes.len(), &mut state));
        self.ok(self.set_state(state));
        self.forget(state);
    }

    /// Saves the state and returns its handle.
    #[track_caller]
    fn save(&self) -> *mut c_void {
        let mut state = null_mut();
        self.ok(self.get_state(&mut state));
        state
    }

    /// Frees a saved state.
    #[track_caller]
    fn forget(&self, mut state: *mut c_void) {
        self.ok(self.free_state(&mut state));
        assert!(state.is_null(), "the handle must be NULL");
    }

    /// Enters Initialization Mode; asserts success.
    #[track_caller]
    fn enter_initialization(&self, start_time: f64, stop_time: Option<f64>) {
        self.ok(self.enter_initialization_mode(start_time, stop_time));
    }

    /// Initializes a new or reset instance, up to the first communication point or Event Mode.
    #[track_caller]
    fn initialize(&self, start_time: f64) {
        self.enter_initialization(start_time, None);
        self.ok(self.exit_initialization_mode());
    }

    /// Iterates in Event Mode until the discrete states are final, and then enters Continuous-Time Mode. Returns the
    /// combined results of the iterations.
    #[track_caller]
    fn enter_continuous_time(&self) -> Updated {
        let mut all = Updated::default();
        loop {
            let now = self.update();
            all = Updated {
                again: false,
                terminate: all.terminate | now.terminate,
                nominals_changed: all.nominals_changed | now.nominals_changed,
                states_changed: all.states_changed | now.states_changed,
                next: now.next,
            };
            if !now.again {
                self.ok(self.enter_continuous_time_mode());
                return all;
            }
        }
    }

    /// Returns the value of an Integer.
    #[track_caller]
    fn integer(&self, index: u32) -> i32 {
        let mut value = i32::MIN;
        self.ok(self.get_integer(index, &mut value));
        value
    }

    /// Returns the value of an Enumeration.
    #[track_caller]
    fn item(&self, index: u32) -> i32 {
        let mut value = i32::MIN;
        self.ok(self.get_item(index, &mut value));
        value
    }

    /// Returns the value of a Boolean.
    #[track_caller]
    fn boolean(&self, index: u32) -> bool {
        let mut value = 7;
        self.ok(self.get_boolean(index, &mut value));
        to_bool(value.into())
    }

    /// Returns the value of a String.
    #[track_caller]
    fn string(&self, index: u32) -> String {
        let mut value = null();
        self.ok(self.get_string(index, &mut value));
        // SAFETY: the FMU's string is valid until the next call.
        unsafe { CStr::from_ptr(value) }.to_str().expect("UTF-8").to_owned()
    }

    /// Sets a String.
    #[track_caller]
    fn write_string(&self, index: u32, value: &str) {
        let value = CString::new(value).expect("no NUL");
        self.ok(self.set_string(index, value.as_ptr()));
    }

    /// Returns the first time derivative of a variable.
    #[track_caller]
    fn rate(&self, index: u32) -> f64 {
        let mut rate = f64::NAN;
        self.ok(self.try_rate(index, 1, &mut rate));
        rate
    }

    /// Returns the first time derivatives of variables.
    #[track_caller]
    fn rates<const COUNT: usize>(&self, indices: [u32; COUNT]) -> [f64; COUNT]
    where
        Self: Sized,
    {
        indices.map(|index| self.rate(index))
    }

    /// Returns the partial derivative of an unknown with respect to a known.
    #[track_caller]
    fn partial(&self, unknown: u32, known: u32) -> f64 {
        let mut partial = f64::NAN;
        self.ok(self.try_directional(&[unknown], &[known], &[1.0], std::slice::from_mut(&mut partial)));
        partial
    }

    /// Returns the directional derivatives of the unknowns.
    #[track_caller]
    fn directional(&self, unknowns: &[u32], knowns: &[u32], seed: &[f64]) -> Vec<f64> {
        let mut results = vec![f64::NAN; unknowns.len()];
        self.ok(self.try_directional(unknowns, knowns, seed, &mut results));
        results
    }

    /// Performs one iteration of the event handling; asserts success.
    #[track_caller]
    fn update(&self) -> Updated {
        self.try_update().unwrap_or_else(|status| panic!("{status:?}, log: {:#?}", self.take_log()))
    }

    /// Does the same as [`try_completed_step`](Self::try_completed_step); asserts success.
    #[track_caller]
    fn completed_step(&self) -> [bool; 2] {
        self.try_completed_step().unwrap_or_else(|status| panic!("{status:?}, log: {:#?}", self.take_log()))
    }

    /// Returns the values of Reals as a vector.
    #[track_caller]
    fn read(&self, indices: &[u32]) -> Vec<f64> {
        let mut values = vec![f64::NAN; indices.len()];
        self.ok(self.try_get(indices, &mut values));
        values
    }

    /// Returns the values of Reals as an array.
    #[track_caller]
    fn get<const COUNT: usize>(&self, indices: [u32; COUNT]) -> [f64; COUNT]
    where
        Self: Sized,
    {
        let mut values = [f64::NAN; COUNT];
        self.ok(self.try_get(&indices, &mut values));
        values
    }

    /// Sets Reals.
    #[track_caller]
    fn set(&self, indices: &[u32], values: &[f64]) {
        assert_eq!(indices.len(), values.len());
        self.ok(self.try_set(indices, values));
    }

    /// Returns all continuous states.
    #[track_caller]
    fn states<const COUNT: usize>(&self) -> [f64; COUNT]
    where
        Self: Sized,
    {
        let mut x = [f64::NAN; COUNT];
        self.ok(self.get_states(x.as_mut_ptr(), COUNT));
        x
    }

    /// Returns the derivatives of all continuous states.
    #[track_caller]
    fn derivatives<const COUNT: usize>(&self) -> [f64; COUNT]
    where
        Self: Sized,
    {
        let mut rates = [f64::NAN; COUNT];
        self.ok(self.get_derivatives(rates.as_mut_ptr(), COUNT));
        rates
    }
}

/// Implements the operations for the importer of an FMI version.
macro_rules! either {
    ($standard:ident $module:ident $($functions_of:ident)::+) => {
        impl Either for $module::Importer {
            fn standard() -> Standard {
                Standard::$standard
            }

            fn functions() -> &'static [&'static str] {
                $module::FUNCTIONS
            }

            fn make<M: Exported>(arguments: &Arguments) -> Result<Self, Vec<Message>> {
                Self::instantiate($($functions_of)::+::<M>(), arguments)
            }

            fn null_instance<M: Exported>() -> Self {
                Self::without_instance($($functions_of)::+::<M>())
            }

            fn version(&self) -> Version<'_> {
                Version::$standard(self)
            }
        }
    };
}
either!(Fmi2 fmi2 functions_of);
either!(Fmi3 fmi3 fmu_export::fmi3::functions);

//! An importer for tests: every function of the C interface on a handle, and a logger that remembers.
//!
//! The test crate that includes this module has the FMU's functions as `crate::fmi2_functions` and its
//! guid as `crate::GUID`. All `unsafe` of the tests is here.
#![allow(unsafe_code)]
#![allow(dead_code, reason = "no test crate needs everything")]
#![allow(non_snake_case, reason = "the names of the C functions")]

use fmi2_export::types::*;
use fmi2_export::{Category, Interface};
use std::ffi::CStr;
use std::ptr::{null, null_mut};
use std::sync::Mutex;

/// The statuses of section 2.1.3, under a name that is free in the tests.
pub use fmi2_export::types::Status;

/// What the logger was told.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    pub instance_name: String,
    pub status: Status,
    pub category: String,
    pub text: String,
}

/// The importer's log; its address is the component environment.
#[derive(Default)]
pub struct Log(Mutex<Vec<Message>>);

impl Log {
    pub fn take(&self) -> Vec<Message> {
        std::mem::take(&mut self.0.lock().unwrap())
    }
}

/// The logger without its `...`, which stable Rust cannot define. The FMU passes no variadic
/// arguments, and on every platform of this project named arguments travel the same way in variadic
/// and plain calls. C programs check the variadic side.
unsafe extern "C" fn remember(
    environment: fmi2ComponentEnvironment,
    instance_name: fmi2String,
    status: Status,
    category: fmi2String,
    message: fmi2String,
) {
    // SAFETY: section 2.1.5: all are zero-terminated strings.
    let text = |pointer| unsafe { CStr::from_ptr(pointer) }.to_str().unwrap().to_owned();
    let [instance_name, category, text] = [instance_name, category, message].map(text);
    // SAFETY: NULL or the `Log` that was handed to fmi2Instantiate and lives as long as the instance.
    if let Some(log) = unsafe { environment.cast::<Log>().as_ref() } {
        log.0.lock().unwrap().push(Message { instance_name, status, category, text });
    }
}

/// The arguments of `fmi2Instantiate`. `callbacks: false` passes NULL instead of the structure,
/// `logger: false` a structure without logger, `environment: false` one without environment (then
/// messages are read and forgotten).
pub struct Arguments<'a> {
    pub instance_name: Option<&'a CStr>,
    pub fmu_type: fmi2Type,
    pub guid: Option<&'a CStr>,
    pub resource_location: Option<&'a CStr>,
    pub callbacks: bool,
    pub logger: bool,
    pub environment: bool,
    pub visible: bool,
    pub logging_on: bool,
}

impl Arguments<'static> {
    /// What a careful importer passes.
    pub fn new(interface: Interface) -> Self {
        Self {
            instance_name: Some(c"wrist"),
            fmu_type: interface as fmi2Type,
            guid: Some(crate::GUID),
            resource_location: Some(c"file:///tmp/fmu/resources"),
            callbacks: true,
            logger: true,
            environment: true,
            visible: false,
            logging_on: false,
        }
    }
}

/// An instance with its log; freed when dropped.
pub struct Fmu {
    component: fmi2Component,
    log: Box<Log>,
}

// SAFETY: an instance may be used from any one thread at a time (masters have thread pools).
unsafe impl Send for Fmu {}

impl Drop for Fmu {
    fn drop(&mut self) {
        // SAFETY: NULL, or from fmi2Instantiate and freed only here.
        unsafe { crate::fmi2_functions::fmi2FreeInstance(self.component) }
    }
}

/// What comes back instead of an instance.
pub type Refused = Vec<Message>;

impl Fmu {
    /// `fmi2Instantiate`. The callbacks structure and the instance name are overwritten afterwards: the
    /// FMU must have copied them.
    pub fn instantiate(arguments: &Arguments) -> Result<Self, Refused> {
        let log = Box::<Log>::default();
        let pointer = |text: Option<&CStr>| text.map_or(null(), CStr::as_ptr);
        let mut name = arguments.instance_name.map(|name| name.to_bytes_with_nul().to_vec());
        let remember: unsafe extern "C" fn(_, _, _, _, _) = remember;
        let mut callbacks = fmi2CallbackFunctions {
            // SAFETY: see `remember`.
            logger: arguments
                .logger
                .then(|| unsafe { std::mem::transmute::<_, fmi2CallbackLogger>(remember) }),
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: if arguments.environment {
                (&raw const *log).cast_mut().cast()
            } else {
                null_mut()
            },
        };
        // SAFETY: NULL or living values, all of them.
        let component = unsafe {
            crate::fmi2_functions::fmi2Instantiate(
                name.as_ref().map_or(null(), |name| name.as_ptr().cast()),
                arguments.fmu_type,
                pointer(arguments.guid),
                pointer(arguments.resource_location),
                if arguments.callbacks { &raw const callbacks } else { null() },
                arguments.visible.into(),
                arguments.logging_on.into(),
            )
        };
        callbacks.logger = None;
        callbacks.component_environment = null_mut();
        if let Some(name) = &mut name {
            name.fill(b'X');
        }
        std::hint::black_box((&callbacks, &name));
        if component.is_null() { Err(log.take()) } else { Ok(Self { component, log }) }
    }

    /// A fresh instance.
    pub fn new(interface: Interface) -> Self {
        Self::instantiate(&Arguments::new(interface)).expect("the instance is made")
    }

    /// What an importer has that ignored a NULL from `fmi2Instantiate`.
    pub fn null() -> Self {
        Self { component: null_mut(), log: Box::default() }
    }

    /// The messages since the last call.
    pub fn take_log(&self) -> Vec<Message> {
        self.log.take()
    }

    /// Asserts `fmi2OK`.
    #[track_caller]
    pub fn ok(&self, status: Status) {
        assert_eq!(status, Status::Ok, "log: {:#?}", self.take_log());
    }

    /// The promises about a refused call: `fmi2Error`, one clean message that names the function, and
    /// an instance that is as it was. Returns the message.
    #[track_caller]
    pub fn refused(&self, label: &str, call: impl FnOnce(&Self) -> Status) -> String {
        let before = self.serialized();
        self.take_log();
        let status = call(self);
        let log = self.take_log();
        assert_eq!(status, Status::Error, "{label} is not refused");
        let [message] = log.as_slice() else { panic!("{label}: one message expected, not {log:#?}") };
        assert_eq!((message.status, message.category.as_str()), (Status::Error, "logStatusError"), "{label}");
        assert_clean(message);
        assert!(message.text.starts_with("fmi2"), "{label}: which function? {}", message.text);
        assert_eq!(before, self.serialized(), "{label} changed the instance");
        self.take_log();
        message.text.clone()
    }

    /// The state as bytes; `None` if the FMU does not serialize.
    pub fn serialized(&self) -> Option<Vec<u8>> {
        let mut state = null_mut();
        if self.fmi2GetFMUstate(&mut state) != Status::Ok {
            return None;
        }
        let mut size = 0;
        let mut bytes = Vec::new();
        let mut status = self.fmi2SerializedFMUstateSize(state, &mut size);
        if status == Status::Ok {
            bytes.resize(size, 0);
            status = self.fmi2SerializeFMUstate(state, bytes.as_mut_ptr().cast(), size);
        }
        self.forget(state);
        (status == Status::Ok).then_some(bytes)
    }

    /// The state as bytes.
    #[track_caller]
    pub fn bytes(&self) -> Vec<u8> {
        self.serialized().expect("the FMU serializes its state")
    }

    /// Continues from a serialized state.
    #[track_caller]
    pub fn restore(&self, bytes: &[u8]) {
        let mut state = null_mut();
        self.ok(self.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut state));
        self.ok(self.fmi2SetFMUstate(state));
        self.forget(state);
    }

    /// A new saved state.
    #[track_caller]
    pub fn save(&self) -> fmi2FMUstate {
        let mut state = null_mut();
        self.ok(self.fmi2GetFMUstate(&mut state));
        state
    }

    /// Frees a saved state.
    #[track_caller]
    pub fn forget(&self, mut state: fmi2FMUstate) {
        self.ok(self.fmi2FreeFMUstate(&mut state));
        assert!(state.is_null(), "the handle is cleared");
    }

    /// From instantiated to initialization mode.
    #[track_caller]
    pub fn enter_initialization(&self, start_time: f64, stop_time: Option<f64>) {
        let (defined, stop_time) = (stop_time.is_some().into(), stop_time.unwrap_or(f64::NAN));
        self.ok(self.fmi2SetupExperiment(fmi2False, f64::NAN, start_time, defined, stop_time));
        self.ok(self.fmi2EnterInitializationMode());
    }

    /// From instantiated to the first communication point or to event mode.
    #[track_caller]
    pub fn initialize(&self, start_time: f64) {
        self.enter_initialization(start_time, None);
        self.ok(self.fmi2ExitInitializationMode());
    }

    #[track_caller]
    pub fn get<const COUNT: usize>(&self, vr: [u32; COUNT]) -> [f64; COUNT] {
        let mut values = [f64::NAN; COUNT];
        self.ok(self.fmi2GetReal(vr.as_ptr(), COUNT, values.as_mut_ptr()));
        values
    }

    pub fn try_set(&self, vr: &[u32], values: &[f64]) -> Status {
        assert_eq!(vr.len(), values.len());
        self.fmi2SetReal(vr.as_ptr(), vr.len(), values.as_ptr())
    }

    #[track_caller]
    pub fn set(&self, vr: &[u32], values: &[f64]) {
        self.ok(self.try_set(vr, values));
    }

    pub fn try_step(&self, point: f64, step_size: f64) -> Status {
        self.fmi2DoStep(point, step_size, fmi2True)
    }

    #[track_caller]
    pub fn step(&self, point: f64, step_size: f64) {
        self.ok(self.try_step(point, step_size));
    }

    /// Output derivatives of order 1.
    #[track_caller]
    pub fn rates<const COUNT: usize>(&self, vr: [u32; COUNT]) -> [f64; COUNT] {
        let mut values = [f64::NAN; COUNT];
        self.ok(self.fmi2GetRealOutputDerivatives(
            vr.as_ptr(),
            COUNT,
            [1; COUNT].as_ptr(),
            values.as_mut_ptr(),
        ));
        values
    }

    /// Input derivatives of order 1.
    #[track_caller]
    pub fn set_rates<const COUNT: usize>(&self, vr: [u32; COUNT], values: [f64; COUNT]) {
        self.ok(self.fmi2SetRealInputDerivatives(vr.as_ptr(), COUNT, [1; COUNT].as_ptr(), values.as_ptr()));
    }

    /// `fmi2SetDebugLogging` with these categories.
    pub fn set_debug_logging(&self, on: bool, categories: &[&CStr]) -> Status {
        let pointers: Vec<_> = categories.iter().map(|category| category.as_ptr()).collect();
        self.fmi2SetDebugLogging(on.into(), pointers.len(), pointers.as_ptr())
    }
}

/// A message that every importer shows as it is: nothing in it that `printf` or section 2.1.5 give
/// a meaning to.
#[track_caller]
pub fn assert_clean(message: &Message) {
    assert!(!message.text.contains(['%', '#', '\n']), "{message:?}");
    assert!(message.text.len() > 10, "{message:?}");
    let known = Category::ALL.map(|category| category.name().to_str().unwrap());
    assert!(known.contains(&message.category.as_str()), "{message:?}");
}

/// What needs no instance (section 2.1.4).
pub fn version_and_platform() -> [&'static CStr; 2] {
    use crate::fmi2_functions::{fmi2GetTypesPlatform, fmi2GetVersion};
    // SAFETY: both are strings that the library keeps.
    [fmi2GetVersion(), fmi2GetTypesPlatform()].map(|text| unsafe { CStr::from_ptr(text) })
}

/// 0, or NULL.
trait Zero {
    const ZERO: Self;
}

macro_rules! zero {
    ($($type:ty: $zero:expr),+) => { $(impl Zero for $type { const ZERO: Self = $zero; })+ };
}

zero!(i32: 0, usize: 0, f64: 0.0);

impl<T> Zero for *const T {
    const ZERO: Self = null();
}

impl<T> Zero for *mut T {
    const ZERO: Self = null_mut();
}

/// The functions that take a component, with their C arguments as sections 2.1, 3.2 and 4.2 have them.
macro_rules! functions {
    ($($name:ident($($argument:ident: $type:ty),*);)+) => {
        impl Fmu {
            $(pub fn $name(&self $(, $argument: $type)*) -> Status {
                // SAFETY: the component is NULL or alive, and the tests pass NULL or pointers to as many
                // values as they say.
                unsafe { crate::fmi2_functions::$name(self.component $(, $argument)*) }
            })+
        }

        /// The names of the functions above.
        pub const FUNCTIONS_OF_COMPONENTS: &[&str] = &[$(stringify!($name)),+];

        /// Calls each of them, with zeros and NULL for arguments.
        pub fn call_all(fmu: &Fmu) -> Vec<(&'static str, Status)> {
            vec![$((stringify!($name), fmu.$name($(<$type as Zero>::ZERO),*))),+]
        }
    };
}

functions! {
    fmi2SetDebugLogging(on: fmi2Boolean, count: usize, categories: *const fmi2String);
    fmi2SetupExperiment(
        tolerance_defined: fmi2Boolean, tolerance: f64, start: f64, stop_defined: fmi2Boolean, stop: f64
    );
    fmi2EnterInitializationMode();
    fmi2ExitInitializationMode();
    fmi2Terminate();
    fmi2Reset();
    fmi2GetReal(vr: *const u32, count: usize, values: *mut f64);
    fmi2GetInteger(vr: *const u32, count: usize, values: *mut i32);
    fmi2GetBoolean(vr: *const u32, count: usize, values: *mut i32);
    fmi2GetString(vr: *const u32, count: usize, values: *mut fmi2String);
    fmi2SetReal(vr: *const u32, count: usize, values: *const f64);
    fmi2SetInteger(vr: *const u32, count: usize, values: *const i32);
    fmi2SetBoolean(vr: *const u32, count: usize, values: *const i32);
    fmi2SetString(vr: *const u32, count: usize, values: *const fmi2String);
    fmi2GetFMUstate(state: *mut fmi2FMUstate);
    fmi2SetFMUstate(state: fmi2FMUstate);
    fmi2FreeFMUstate(state: *mut fmi2FMUstate);
    fmi2SerializedFMUstateSize(state: fmi2FMUstate, size: *mut usize);
    fmi2SerializeFMUstate(state: fmi2FMUstate, bytes: *mut fmi2Byte, size: usize);
    fmi2DeSerializeFMUstate(bytes: *const fmi2Byte, size: usize, state: *mut fmi2FMUstate);
    fmi2GetDirectionalDerivative(
        unknown: *const u32, unknown_count: usize, known: *const u32, known_count: usize,
        seed: *const f64, result: *mut f64
    );
    fmi2EnterEventMode();
    fmi2NewDiscreteStates(info: *mut fmi2EventInfo);
    fmi2EnterContinuousTimeMode();
    fmi2CompletedIntegratorStep(
        no_set_state_prior: fmi2Boolean, enter_event_mode: *mut fmi2Boolean, terminate: *mut fmi2Boolean
    );
    fmi2SetTime(time: f64);
    fmi2SetContinuousStates(x: *const f64, count: usize);
    fmi2GetDerivatives(derivatives: *mut f64, count: usize);
    fmi2GetEventIndicators(indicators: *mut f64, count: usize);
    fmi2GetContinuousStates(x: *mut f64, count: usize);
    fmi2GetNominalsOfContinuousStates(nominals: *mut f64, count: usize);
    fmi2SetRealInputDerivatives(vr: *const u32, count: usize, order: *const i32, values: *const f64);
    fmi2GetRealOutputDerivatives(vr: *const u32, count: usize, order: *const i32, values: *mut f64);
    fmi2DoStep(point: f64, step_size: f64, no_set_state_prior: fmi2Boolean);
    fmi2CancelStep();
    fmi2GetStatus(kind: fmi2StatusKind, value: *mut Status);
    fmi2GetRealStatus(kind: fmi2StatusKind, value: *mut f64);
    fmi2GetIntegerStatus(kind: fmi2StatusKind, value: *mut i32);
    fmi2GetBooleanStatus(kind: fmi2StatusKind, value: *mut i32);
    fmi2GetStringStatus(kind: fmi2StatusKind, value: *mut fmi2String);
}

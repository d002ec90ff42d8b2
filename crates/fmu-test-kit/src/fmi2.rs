//! FMI 2.0: an instance as an importer uses it.

use crate::either::{methods, truth};
use crate::importer::{Log, importer, lock, remember};
use crate::{Arguments, Either, Hook, Message, Updated, library::functions_of};
use fmi_abi::calls;
pub use fmi_abi::fmi2::Functions;
use fmi_abi::fmi2::types::*;
use fmu_export::Mode::{self, *};
use fmu_export::{Exported, Interface, Standard};
use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr::{null, null_mut};

fmi_abi::fmi2_functions!(importer, fmi2FreeInstance;);

/// The logger without its `...`, which stable Rust cannot define. The function ignores variadic arguments. On
/// every platform of this project, variadic and plain calls pass named arguments in the same way. Miri checks
/// the calling convention, so it gets a variadic function.
unsafe extern "C" fn log_message(
    environment: fmi2ComponentEnvironment,
    instance_name: fmi2String,
    status: c_int,
    category: fmi2String,
    message: fmi2String,
    #[cfg(miri)] _: ...
) {
    // SAFETY: section 2.1.5 requires NULL or NUL-terminated strings, and NULL or the log.
    unsafe { remember(environment, instance_name, status, category, message) }
}

/// Calls `fmi2Instantiate`. Afterwards overwrites the callbacks structure and the instance name, because the
/// FMU must have copied them.
fn make(functions: &Functions, arguments: &Arguments, log: &Log) -> fmi2Component {
    let pointer = |text: Option<&CStr>| text.map_or(null(), CStr::as_ptr);
    let mut name = arguments.instance_name.map(|name| name.to_bytes_with_nul().to_vec());
    #[cfg(not(miri))]
    let logger: unsafe extern "C" fn(_, _, _, _, _) = log_message;
    #[cfg(miri)]
    let logger: fmi2CallbackLogger = log_message;
    let mut callbacks = fmi2CallbackFunctions {
        // SAFETY: the documentation of `log_message` explains why both types have compatible calls.
        logger: arguments.logger.then(|| unsafe { std::mem::transmute::<_, fmi2CallbackLogger>(logger) }),
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: match arguments.environment {
            true => (&raw const *log).cast_mut().cast(),
            false => null_mut(),
        },
    };
    // SAFETY: each pointer is NULL or points to a live value.
    let component = unsafe {
        (functions.fmi2Instantiate)(
            name.as_ref().map_or(null(), |name| name.as_ptr().cast()),
            arguments.fmu_type,
            pointer(arguments.guid.as_deref()),
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
    component
}

/// Functions that exist only in FMI 2.0.
#[allow(clippy::missing_panics_doc, reason = "that is what they are for")]
impl Importer {
    /// Returns version and platform, which need no instance (section 2.1.4).
    pub fn version_and_platform(&self) -> [&CStr; 2] {
        let Functions { fmi2GetVersion, fmi2GetTypesPlatform, .. } = self.functions;
        // SAFETY: both functions return strings that the library keeps.
        [fmi2GetVersion, fmi2GetTypesPlatform].map(|text| unsafe { CStr::from_ptr(text()) })
    }

    /// Sets input derivatives of order 1.
    #[track_caller]
    pub fn set_rates<const COUNT: usize>(&self, vr: [u32; COUNT], values: [f64; COUNT]) {
        self.give_rates(&vr, &values);
    }

    /// Calls `fmi2SetDebugLogging` with these categories.
    pub fn set_debug_logging(&self, on: bool, categories: &[&CStr]) -> Status {
        let pointers: Vec<_> = categories.iter().map(|category| category.as_ptr()).collect();
        self.fmi2SetDebugLogging(on.into(), pointers.len(), pointers.as_ptr())
    }
}

impl Either for Importer {
    methods!(fmi2);

    fn standard() -> Standard {
        Standard::Fmi2
    }

    fn modes_of(interface: Interface) -> &'static [Mode] {
        match interface {
            Interface::CoSimulation => {
                &[Instantiated, Initialization, StepComplete, StepFailed, Terminated, Error]
            }
            Interface::ModelExchange => {
                &[Instantiated, Initialization, Event, ContinuousTime, Terminated, Error]
            }
        }
    }

    fn enter_initialization_mode(&self, start_time: f64, stop_time: Option<f64>) -> Status {
        let (defined, stop_time) = (stop_time.is_some().into(), stop_time.unwrap_or(f64::NAN));
        match self.fmi2SetupExperiment(fmi2False, f64::NAN, start_time, defined, stop_time) {
            Status::Ok => self.fmi2EnterInitializationMode(),
            rejected => rejected,
        }
    }

    fn try_get(&self, vr: &[u32], values: &mut [f64]) -> Status {
        assert_eq!(vr.len(), values.len());
        self.fmi2GetReal(vr.as_ptr(), vr.len(), values.as_mut_ptr())
    }

    fn try_set(&self, vr: &[u32], values: &[f64]) -> Status {
        assert_eq!(vr.len(), values.len());
        self.fmi2SetReal(vr.as_ptr(), vr.len(), values.as_ptr())
    }

    fn try_step(&self, point: f64, step_size: f64) -> Status {
        self.fmi2DoStep(point, step_size, fmi2True)
    }

    #[track_caller]
    fn step(&self, point: f64, step_size: f64) {
        const LAST_SUCCESSFUL_TIME: i32 = 2;
        self.ok(self.try_step(point, step_size));
        let mut time = f64::NAN;
        self.ok(self.fmi2GetRealStatus(LAST_SUCCESSFUL_TIME, &mut time));
        assert_eq!(time, point + step_size);
    }

    #[track_caller]
    fn give_rates(&self, vr: &[u32], values: &[f64]) {
        let orders = [1; 8];
        assert!(vr.len() == values.len() && vr.len() <= orders.len());
        let (vr, count) = (vr.as_ptr(), vr.len());
        self.ok(self.fmi2SetRealInputDerivatives(vr, count, orders.as_ptr(), values.as_ptr()));
    }

    fn try_rate(&self, vr: u32, order: i32, rate: &mut f64) -> Status {
        self.fmi2GetRealOutputDerivatives(&vr, 1, &order, rate)
    }

    fn try_directional(&self, unknowns: &[u32], knowns: &[u32], seed: &[f64], results: &mut [f64]) -> Status {
        assert_eq!([seed.len(), results.len()], [knowns.len(), unknowns.len()]);
        let (unknown, known) = (unknowns.as_ptr(), knowns.as_ptr());
        let (counts, results) = ([unknowns.len(), knowns.len()], results.as_mut_ptr());
        self.fmi2GetDirectionalDerivative(unknown, counts[0], known, counts[1], seed.as_ptr(), results)
    }

    fn try_update(&self) -> Result<Updated, Status> {
        let mut info = fmi2EventInfo {
            new_discrete_states_needed: 2,
            terminate_simulation: 2,
            nominals_of_continuous_states_changed: 2,
            values_of_continuous_states_changed: 2,
            next_event_time_defined: 2,
            next_event_time: f64::NAN,
        };
        match self.fmi2NewDiscreteStates(&mut info) {
            Status::Ok => Ok(Updated {
                again: truth(info.new_discrete_states_needed),
                terminate: truth(info.terminate_simulation),
                nominals_changed: truth(info.nominals_of_continuous_states_changed),
                states_changed: truth(info.values_of_continuous_states_changed),
                next: truth(info.next_event_time_defined).then_some(info.next_event_time),
            }),
            status => Err(status),
        }
    }

    fn try_completed_step(&self) -> Result<[bool; 2], Status> {
        let [mut event, mut terminate] = [2; 2];
        match self.fmi2CompletedIntegratorStep(fmi2True, &mut event, &mut terminate) {
            Status::Ok => Ok([event, terminate].map(truth)),
            status => Err(status),
        }
    }

    fn serialize_into(&self, state: *mut c_void, bytes: *mut u8, size: usize) -> Status {
        self.fmi2SerializeFMUstate(state, bytes.cast(), size)
    }

    fn deserialize(&self, bytes: *const u8, size: usize, state: *mut *mut c_void) -> Status {
        self.fmi2DeSerializeFMUstate(bytes.cast(), size, state)
    }
}

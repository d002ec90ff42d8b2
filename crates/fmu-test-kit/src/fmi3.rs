//! FMI 3.0: an instance as an importer uses it.

use crate::either::{methods, truth};
use crate::importer::{Log, importer, lock, remember};
use crate::{Arguments, Either, Hook, Message, Updated};
use fmi_abi::calls;
pub use fmi_abi::fmi3::Functions;
use fmi_abi::fmi3::types::*;
use fmu_export::Mode::{self, *};
use fmu_export::fmi3::{functions as functions_of, reference};
use fmu_export::{Exported, Interface, Standard};
use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr::{null, null_mut};

fmi_abi::fmi3_functions!(importer, fmi3FreeInstance;);

unsafe extern "C" fn log_message(
    environment: fmi3InstanceEnvironment,
    status: c_int,
    category: fmi3String,
    message: fmi3String,
) {
    // SAFETY: section 2.3.1 requires strings, and NULL or the log. FMI 3.0 passes no instance name.
    unsafe { remember(environment, null(), status, category, message) }
}

/// Calls the function that makes instances of the interface type.
fn make(functions: &Functions, arguments: &Arguments, log: &Log) -> fmi3Instance {
    let pointer = |text: Option<&CStr>| text.map_or(null(), CStr::as_ptr);
    let name = pointer(arguments.instance_name);
    let token = pointer(arguments.guid.as_deref());
    // FMI 3.0 needs a path, not a URI.
    let path = arguments.resource_location.map(|location| {
        let bytes = location.to_bytes_with_nul();
        CStr::from_bytes_with_nul(bytes.strip_prefix(b"file://").unwrap_or(bytes)).expect("its end is left")
    });
    let resources = pointer(path);
    let environment = match arguments.environment {
        true => (&raw const *log).cast_mut().cast(),
        false => null_mut(),
    };
    let callback = arguments.logger.then_some(log_message as fmi3LogMessageCallback);
    let (visible, logging_on) = (arguments.visible.into(), arguments.logging_on);
    let required = arguments.required_intermediate_variables;
    // SAFETY: each pointer is NULL or points to a live value.
    unsafe {
        match arguments.fmu_type {
            0 => (functions.fmi3InstantiateModelExchange)(
                name,
                token,
                resources,
                visible,
                logging_on,
                environment,
                callback,
            ),
            2 => (functions.fmi3InstantiateScheduledExecution)(
                name,
                token,
                resources,
                visible,
                logging_on,
                environment,
                callback,
                None,
                None,
                None,
            ),
            _ => (functions.fmi3InstantiateCoSimulation)(
                name,
                token,
                resources,
                visible,
                logging_on,
                arguments.event_mode_used,
                arguments.early_return_allowed,
                required.as_ptr(),
                required.len(),
                environment,
                callback,
                None,
            ),
        }
    }
}

/// Results of `fmi3DoStep`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "as in the standard, section 4.2.1")]
pub struct Stepped {
    pub event_handling_needed: bool,
    pub terminate: bool,
    pub early_return: bool,
    pub last_successful_time: f64,
}

/// Functions that exist only in FMI 3.0.
impl Importer {
    /// Performs a step.
    ///
    /// # Errors
    /// Returns the status if it is not OK.
    pub fn do_step(&self, point: f64, step_size: f64) -> Result<Stepped, Status> {
        let (mut event, mut terminate, mut early, mut time) = (2, 2, 2, f64::NAN);
        let status =
            self.fmi3DoStep(point, step_size, fmi3True, &mut event, &mut terminate, &mut early, &mut time);
        if status != Status::Ok {
            return Err(status);
        }
        let [event_handling_needed, terminate, early_return] =
            [event, terminate, early].map(|flag| truth(flag.into()));
        Ok(Stepped { event_handling_needed, terminate, early_return, last_successful_time: time })
    }
}

/// Returns the value references of variables with these indices, up to 16. Allocates nothing, because tests
/// of control loops count allocations.
fn references(indices: &[u32]) -> [u32; 16] {
    let mut references = [0; 16];
    references[..indices.len()].copy_from_slice(indices);
    references.map(reference)
}

impl Either for Importer {
    methods!(fmi3);

    fn standard() -> Standard {
        Standard::Fmi3
    }

    fn modes_of(interface: Interface) -> &'static [Mode] {
        match interface {
            Interface::CoSimulation => &[Instantiated, Initialization, Event, StepComplete, Terminated],
            Interface::ModelExchange => &[Instantiated, Initialization, Event, ContinuousTime, Terminated],
        }
    }

    fn enter_initialization_mode(&self, start_time: f64, stop_time: Option<f64>) -> Status {
        let (defined, stop_time) = (stop_time.is_some().into(), stop_time.unwrap_or(f64::NAN));
        self.fmi3EnterInitializationMode(fmi3False, f64::NAN, start_time, defined, stop_time)
    }

    fn try_get(&self, indices: &[u32], values: &mut [f64]) -> Status {
        if indices.len() <= 16 {
            let vr = references(indices);
            return self.fmi3GetFloat64(vr.as_ptr(), indices.len(), values.as_mut_ptr(), values.len());
        }
        let vr: Vec<_> = indices.iter().map(|index| reference(*index)).collect();
        self.fmi3GetFloat64(vr.as_ptr(), vr.len(), values.as_mut_ptr(), values.len())
    }

    fn try_set(&self, indices: &[u32], values: &[f64]) -> Status {
        let vr = references(indices);
        self.fmi3SetFloat64(vr.as_ptr(), indices.len(), values.as_ptr(), values.len())
    }

    fn try_step(&self, point: f64, step_size: f64) -> Status {
        self.do_step(point, step_size).err().unwrap_or(Status::Ok)
    }

    #[track_caller]
    fn step(&self, point: f64, step_size: f64) {
        let last_successful_time = point + step_size;
        let [event_handling_needed, terminate, early_return] = [false; 3];
        let whole = Stepped { event_handling_needed, terminate, early_return, last_successful_time };
        assert_eq!(self.do_step(point, step_size), Ok(whole), "log: {:#?}", self.take_log());
    }

    fn try_rate(&self, index: u32, order: i32, rate: &mut f64) -> Status {
        self.fmi3GetOutputDerivatives(&reference(index), 1, &order, rate, 1)
    }

    /// Also reads the adjoint derivatives of each unknown. By definition, their scalar product with the seed
    /// is the directional derivative; for one known, both are bit-identical.
    fn try_directional(&self, unknowns: &[u32], knowns: &[u32], seed: &[f64], results: &mut [f64]) -> Status {
        assert_eq!([seed.len(), results.len()], [knowns.len(), unknowns.len()]);
        let (unknown, known) = (references(unknowns), references(knowns));
        let (u, k, [us, ks]) = (unknown.as_ptr(), known.as_ptr(), [unknowns.len(), knowns.len()]);
        let status =
            self.fmi3GetDirectionalDerivative(u, us, k, ks, seed.as_ptr(), ks, results.as_mut_ptr(), us);
        for (unknown, forward) in unknown.iter().zip(results).filter(|_| status == Status::Ok) {
            let mut adjoint = [f64::NAN; 16];
            self.ok(self.fmi3GetAdjointDerivative(unknown, 1, k, ks, &1.0, 1, adjoint.as_mut_ptr(), ks));
            let terms = || adjoint.iter().zip(seed).map(|(adjoint, seed)| adjoint * seed);
            let (sum, scale) = (terms().sum::<f64>(), terms().map(f64::abs).sum::<f64>());
            assert!(ks != 1 || sum.to_bits() == forward.to_bits() || sum == 0.0, "{adjoint:?} {forward}");
            assert!((sum - *forward).abs() <= 1e-14 * scale, "{adjoint:?} {seed:?} {forward}");
        }
        status
    }

    fn try_update(&self) -> Result<Updated, Status> {
        let (mut flags, mut next) = ([2; 5], f64::NAN);
        let [again, terminate, nominals, states, defined] = &mut flags;
        match self.fmi3UpdateDiscreteStates(again, terminate, nominals, states, defined, &mut next) {
            Status::Ok => {
                let [again, terminate, nominals_changed, states_changed, defined] =
                    flags.map(|flag| truth(flag.into()));
                Ok(Updated {
                    again,
                    terminate,
                    nominals_changed,
                    states_changed,
                    next: defined.then_some(next),
                })
            }
            status => Err(status),
        }
    }

    fn try_completed_step(&self) -> Result<[bool; 2], Status> {
        let [mut event, mut terminate] = [2; 2];
        match self.fmi3CompletedIntegratorStep(fmi3True, &mut event, &mut terminate) {
            Status::Ok => Ok([event, terminate].map(|flag| truth(flag.into()))),
            status => Err(status),
        }
    }

    fn serialize_into(&self, state: *mut c_void, bytes: *mut u8, size: usize) -> Status {
        self.fmi3SerializeFMUState(state, bytes, size)
    }

    fn deserialize(&self, bytes: *const u8, size: usize, state: *mut *mut c_void) -> Status {
        self.fmi3DeserializeFMUState(bytes, size, state)
    }

    fn leave_event_mode(&self) {
        let has_events = self.fmi3EnterStepMode() == Status::Ok;
        if !has_events {
            self.take_log();
        }
    }
}

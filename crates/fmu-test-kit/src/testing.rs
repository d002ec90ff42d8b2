//! What tests of FMUs need: calls that must succeed, calls that must be refused.
//!
//! All methods panic where a promise is broken.

use crate::{Importer, Message};
use fmu_export::Category;
use fmu_export::fmi2::types::*;
use std::ffi::CStr;

/// Shorthands that assert, for the importers of all standards: answers, refusals, saved states.
macro_rules! shorthands {
    ($importer:ty, $prefix:literal: $get:ident $set:ident $free:ident $size:ident $serialize:ident $deserialize:ident) => {
        #[allow(clippy::missing_panics_doc, reason = "that is what they are for")]
        impl $importer {
            /// Asserts OK.
            #[track_caller]
            pub fn ok(&self, status: Status) {
                assert_eq!(status, Status::Ok, "log: {:#?}", self.take_log());
            }

            /// The promises about a refused call: an error, one clean message that names the function, and
            /// an instance that is as it was. Returns the message.
            #[track_caller]
            pub fn refused(&self, label: &str, call: impl FnOnce(&Self) -> Status) -> String {
                let before = self.serialized();
                self.take_log();
                let status = call(self);
                let log = self.take_log();
                assert_eq!(status, Status::Error, "{label} is not refused");
                let [message] = log.as_slice() else { panic!("{label}: one message expected, not {log:#?}") };
                assert_eq!(
                    (message.status, message.category.as_str()),
                    (Status::Error, "logStatusError"),
                    "{label}"
                );
                $crate::testing::assert_clean(message);
                assert!(message.text.starts_with($prefix), "{label}: which function? {}", message.text);
                assert_eq!(before, self.serialized(), "{label} changed the instance");
                self.take_log();
                message.text.clone()
            }

            /// The state as bytes; `None` if the FMU does not serialize.
            pub fn serialized(&self) -> Option<Vec<u8>> {
                let mut state = std::ptr::null_mut();
                if self.$get(&mut state) != Status::Ok {
                    return None;
                }
                let mut size = 0;
                let mut bytes = Vec::new();
                let mut status = self.$size(state, &mut size);
                if status == Status::Ok {
                    bytes.resize(size, 0);
                    status = self.$serialize(state, bytes.as_mut_ptr().cast(), size);
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
                let mut state = std::ptr::null_mut();
                self.ok(self.$deserialize(bytes.as_ptr().cast(), bytes.len(), &mut state));
                self.ok(self.$set(state));
                self.forget(state);
            }

            /// A new saved state.
            #[track_caller]
            pub fn save(&self) -> *mut std::ffi::c_void {
                let mut state = std::ptr::null_mut();
                self.ok(self.$get(&mut state));
                state
            }

            /// Frees a saved state.
            #[track_caller]
            pub fn forget(&self, mut state: *mut std::ffi::c_void) {
                self.ok(self.$free(&mut state));
                assert!(state.is_null(), "the handle is cleared");
            }
        }
    };
}
pub(crate) use shorthands;

shorthands! { Importer, "fmi2":
    fmi2GetFMUstate fmi2SetFMUstate fmi2FreeFMUstate
    fmi2SerializedFMUstateSize fmi2SerializeFMUstate fmi2DeSerializeFMUstate
}

/// Shorthands that assert.
#[allow(clippy::missing_panics_doc, reason = "that is what they are for")]
impl Importer {
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

    /// Real values.
    #[track_caller]
    pub fn get<const COUNT: usize>(&self, vr: [u32; COUNT]) -> [f64; COUNT] {
        let mut values = [f64::NAN; COUNT];
        self.ok(self.fmi2GetReal(vr.as_ptr(), COUNT, values.as_mut_ptr()));
        values
    }

    /// Sets Real values, or not.
    pub fn try_set(&self, vr: &[u32], values: &[f64]) -> Status {
        assert_eq!(vr.len(), values.len());
        self.fmi2SetReal(vr.as_ptr(), vr.len(), values.as_ptr())
    }

    /// Sets Real values.
    #[track_caller]
    pub fn set(&self, vr: &[u32], values: &[f64]) {
        self.ok(self.try_set(vr, values));
    }

    /// A step, or not.
    pub fn try_step(&self, point: f64, step_size: f64) -> Status {
        self.fmi2DoStep(point, step_size, fmi2True)
    }

    /// A step.
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

//! What tests of FMUs need, beside what importers of both standards have.

use super::Importer;
use crate::testing::shorthands;
use fmu_export::fmi3::{reference, types::*};

shorthands! { Importer, "fmi3":
    fmi3GetFMUState fmi3SetFMUState fmi3FreeFMUState
    fmi3SerializedFMUStateSize fmi3SerializeFMUState fmi3DeserializeFMUState
}

/// What `fmi3DoStep` says.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "as in the standard, section 4.2.1")]
pub struct Stepped {
    pub event_handling_needed: bool,
    pub terminate: bool,
    pub early_return: bool,
    pub last_successful_time: f64,
}

/// What `fmi3UpdateDiscreteStates` says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(missing_docs, reason = "as in the standard, section 2.3.5")]
pub struct Updated {
    pub again: bool,
    pub terminate: bool,
    pub nominals_changed: bool,
    pub states_changed: bool,
    pub next: Option<f64>,
}

/// The value references of variables at these places, up to 16; without an allocation, which tests of control loops
/// would count.
pub(crate) fn references(places: &[u32]) -> [u32; 16] {
    let mut references = [0; 16];
    references[..places.len()].copy_from_slice(places);
    references.map(reference)
}

/// Shorthands that assert. As those for FMI 2.0 they take variables by their places in the table.
#[allow(clippy::missing_panics_doc, reason = "that is what they are for")]
impl Importer {
    /// From instantiated to initialization mode.
    #[track_caller]
    pub fn enter_initialization(&self, start_time: f64, stop_time: Option<f64>) {
        let (defined, stop_time) = (stop_time.is_some().into(), stop_time.unwrap_or(f64::NAN));
        self.ok(self.fmi3EnterInitializationMode(fmi3False, f64::NAN, start_time, defined, stop_time));
    }

    /// From instantiated to the first communication point or to event mode.
    #[track_caller]
    pub fn initialize(&self, start_time: f64) {
        self.enter_initialization(start_time, None);
        self.ok(self.fmi3ExitInitializationMode());
    }

    /// Values of Float64.
    #[track_caller]
    pub fn get<const COUNT: usize>(&self, places: [u32; COUNT]) -> [f64; COUNT] {
        let vr = places.map(reference);
        let mut values = [f64::NAN; COUNT];
        self.ok(self.fmi3GetFloat64(vr.as_ptr(), COUNT, values.as_mut_ptr(), COUNT));
        values
    }

    /// Sets values of Float64, or not.
    pub fn try_set(&self, places: &[u32], values: &[f64]) -> Status {
        let vr = references(places);
        self.fmi3SetFloat64(vr.as_ptr(), places.len(), values.as_ptr(), values.len())
    }

    /// Sets values of Float64.
    #[track_caller]
    pub fn set(&self, places: &[u32], values: &[f64]) {
        self.ok(self.try_set(places, values));
    }

    /// A step, or not.
    ///
    /// # Errors
    /// What is answered instead of OK.
    pub fn try_step(&self, point: f64, step_size: f64) -> Result<Stepped, Status> {
        let (mut event, mut terminate, mut early, mut time) = (2, 2, 2, f64::NAN);
        let status =
            self.fmi3DoStep(point, step_size, fmi3True, &mut event, &mut terminate, &mut early, &mut time);
        if status != Status::Ok {
            return Err(status);
        }
        let [event_handling_needed, terminate, early_return] = [event, terminate, early].map(truth);
        Ok(Stepped { event_handling_needed, terminate, early_return, last_successful_time: time })
    }

    /// A step to its end.
    #[track_caller]
    pub fn step(&self, point: f64, step_size: f64) {
        let stepped = self.try_step(point, step_size);
        let whole = Stepped {
            event_handling_needed: false,
            terminate: false,
            early_return: false,
            last_successful_time: point + step_size,
        };
        assert_eq!(stepped, Ok(whole), "log: {:#?}", self.take_log());
    }

    /// One round of the event iteration.
    #[track_caller]
    pub fn update(&self) -> Updated {
        let (mut flags, mut next) = ([2; 5], f64::NAN);
        let [again, terminate, nominals, states, defined] = &mut flags;
        self.ok(self.fmi3UpdateDiscreteStates(again, terminate, nominals, states, defined, &mut next));
        let [again, terminate, nominals_changed, states_changed, defined] = flags.map(truth);
        Updated { again, terminate, nominals_changed, states_changed, next: defined.then_some(next) }
    }
}

#[track_caller]
fn truth(flag: fmi3Boolean) -> bool {
    assert!(flag <= 1, "{flag} is no truth value");
    flag == 1
}

//! Co-Simulation in either standard, for tests that run in both.

use crate::Importer;
use crate::fmi3::{self, references};
use fmu_export::fmi3::reference;
use fmu_export::fmi3::types::{fmi3False, fmi3True};
use fmu_export::{Exported, Interface};
use std::ffi::c_void;

/// An instance as an importer of FMI 2.0 or FMI 3.0 holds it. All calls must succeed; variables are named by their
/// places in the table.
#[allow(clippy::missing_panics_doc, reason = "that is what they are for")]
pub trait Either: Send {
    /// A new instance, initialized at time 0.
    fn initialized<M: Exported>() -> Self
    where
        Self: Sized,
    {
        Self::initialized_at::<M>(0.0)
    }

    /// A new instance, initialized at this time.
    fn initialized_at<M: Exported>(start_time: f64) -> Self
    where
        Self: Sized;

    /// Reads Reals.
    fn read(&self, vr: &[u32], values: &mut [f64]);

    /// Sets Reals.
    fn write(&self, vr: &[u32], values: &[f64]);

    /// Sets a Boolean.
    fn decide(&self, vr: u32, value: bool);

    /// A step to its end, which is the time of the FMU then, to the last bit.
    fn advance(&self, point: f64, step_size: f64);

    /// Sets the time derivatives of up to 8 inputs; FMI 3.0 has no function for it.
    fn write_rates(&self, _vr: &[u32], _values: &[f64]) {}

    /// Reads the time derivative of a variable.
    fn read_rate(&self, vr: u32) -> f64;

    /// Reads a partial derivative.
    fn read_partial(&self, unknown: u32, known: u32) -> f64;

    /// Saves the state, into one that is there already unless the handle is NULL.
    fn save_into(&self, state: &mut *mut c_void);

    /// Goes back to a saved state.
    fn go_back(&self, state: *mut c_void);

    /// Frees a saved state.
    fn free(&self, state: *mut c_void);

    /// The state as bytes.
    fn to_bytes(&self) -> Vec<u8>;
}

impl Either for Importer {
    fn initialized_at<M: Exported>(start_time: f64) -> Self {
        let fmu = Self::of::<M>(Interface::CoSimulation);
        fmu.initialize(start_time);
        fmu
    }

    fn read(&self, vr: &[u32], values: &mut [f64]) {
        assert_eq!(vr.len(), values.len());
        self.ok(self.fmi2GetReal(vr.as_ptr(), vr.len(), values.as_mut_ptr()));
    }

    fn write(&self, vr: &[u32], values: &[f64]) {
        self.set(vr, values);
    }

    fn decide(&self, vr: u32, value: bool) {
        self.ok(self.fmi2SetBoolean(&vr, 1, &value.into()));
    }

    fn advance(&self, point: f64, step_size: f64) {
        const LAST_SUCCESSFUL_TIME: i32 = 2;
        self.step(point, step_size);
        let mut time = f64::NAN;
        self.ok(self.fmi2GetRealStatus(LAST_SUCCESSFUL_TIME, &mut time));
        assert_eq!(time, point + step_size);
    }

    fn write_rates(&self, vr: &[u32], values: &[f64]) {
        let orders = [1; 8];
        assert!(vr.len() == values.len() && vr.len() <= orders.len());
        let (vr, count) = (vr.as_ptr(), vr.len());
        self.ok(self.fmi2SetRealInputDerivatives(vr, count, orders.as_ptr(), values.as_ptr()));
    }

    fn read_rate(&self, vr: u32) -> f64 {
        let [rate] = self.rates([vr]);
        rate
    }

    fn read_partial(&self, unknown: u32, known: u32) -> f64 {
        let mut partial = f64::NAN;
        self.ok(self.fmi2GetDirectionalDerivative(&unknown, 1, &known, 1, &1.0, &mut partial));
        partial
    }

    fn save_into(&self, state: &mut *mut c_void) {
        self.ok(self.fmi2GetFMUstate(state));
    }

    fn go_back(&self, state: *mut c_void) {
        self.ok(self.fmi2SetFMUstate(state));
    }

    fn free(&self, state: *mut c_void) {
        self.forget(state);
    }

    fn to_bytes(&self) -> Vec<u8> {
        self.bytes()
    }
}

impl Either for fmi3::Importer {
    fn initialized_at<M: Exported>(start_time: f64) -> Self {
        let fmu = Self::of::<M>(Interface::CoSimulation);
        fmu.initialize(start_time);
        fmu
    }

    fn read(&self, places: &[u32], values: &mut [f64]) {
        let vr = references(places);
        self.ok(self.fmi3GetFloat64(vr.as_ptr(), places.len(), values.as_mut_ptr(), values.len()));
    }

    fn write(&self, places: &[u32], values: &[f64]) {
        self.set(places, values);
    }

    fn decide(&self, place: u32, value: bool) {
        let vr = reference(place);
        self.ok(self.fmi3SetBoolean(&vr, 1, &if value { fmi3True } else { fmi3False }, 1));
    }

    fn advance(&self, point: f64, step_size: f64) {
        self.step(point, step_size);
    }

    fn read_rate(&self, place: u32) -> f64 {
        let mut rate = f64::NAN;
        self.ok(self.fmi3GetOutputDerivatives(&reference(place), 1, &1, &mut rate, 1));
        rate
    }

    /// Backward and forward: of one with respect to one it is the same number.
    fn read_partial(&self, unknown: u32, known: u32) -> f64 {
        let [unknown, known] = [unknown, known].map(reference);
        let (mut forward, mut adjoint) = (f64::NAN, f64::NAN);
        self.ok(self.fmi3GetDirectionalDerivative(&unknown, 1, &known, 1, &1.0, 1, &mut forward, 1));
        self.ok(self.fmi3GetAdjointDerivative(&unknown, 1, &known, 1, &1.0, 1, &mut adjoint, 1));
        assert_eq!(forward.to_bits(), adjoint.to_bits());
        forward
    }

    fn save_into(&self, state: &mut *mut c_void) {
        self.ok(self.fmi3GetFMUState(state));
    }

    fn go_back(&self, state: *mut c_void) {
        self.ok(self.fmi3SetFMUState(state));
    }

    fn free(&self, state: *mut c_void) {
        self.forget(state);
    }

    fn to_bytes(&self) -> Vec<u8> {
        self.bytes()
    }
}

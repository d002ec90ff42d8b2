//! Saved states, which are valid only in one FMI version.

use crate::models::{Palette, Ticker};
use fmu_export::Interface::*;
use fmu_export::Mode;
use fmu_test_kit::Either;
use fmu_test_kit::fmi3::Importer;
use std::ptr::null_mut;

#[test]
fn of_event_mode() {
    let (with, without) =
        (Importer::in_mode::<Ticker>(CoSimulation, Mode::Event), Importer::of::<Ticker>(CoSimulation));
    let (bytes, mut state) = (with.bytes(), null_mut());
    without.refused_with(&["event mode"], |fmu| {
        fmu.fmi3DeserializeFMUState(bytes.as_ptr(), bytes.len(), &mut state)
    });
}

/// Checks that a state with values of every type is rejected if any bytes are missing.
#[test]
fn cut_short() {
    let fmu = Importer::of::<Palette>(CoSimulation);
    let (bytes, handle) = (fmu.bytes(), fmu.save());
    (0..bytes.len()).for_each(|length| _ = fmu.refused_bytes(&bytes[..length]));
    let mut out = vec![0; bytes.len()];
    fmu.refused("a small buffer", |fmu| fmu.serialize_into(handle, out.as_mut_ptr(), bytes.len() - 1));
    fmu.forget(handle);
    fmu.refused("no state", |fmu| fmu.set_state(null_mut()));
}

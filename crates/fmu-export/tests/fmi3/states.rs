//! Saved states, which belong to a standard.

use crate::call_table::{in_mode, modes_of};
use crate::toys::{Oscillator, Palette, Ticker};
use fmu_export::Interface::*;
use fmu_export::Mode;
use fmu_export::fmi3::types::*;
use fmu_test_kit::fmi3::{Arguments, Importer};
use std::ptr::null_mut;

#[test]
fn every_mode() {
    for interface in [CoSimulation, ModelExchange] {
        for mode in modes_of(interface) {
            let bytes = in_mode::<Ticker>(interface, mode).bytes();
            let other = in_mode::<Ticker>(interface, Mode::Terminated);
            other.restore(&bytes);
            assert_eq!(other.bytes(), bytes, "{mode} of {interface}");
        }
    }
}

/// The state machines differ, so bytes of one standard are refused by the other: nothing is read from them.
#[test]
fn of_the_other_standard() {
    for interface in [CoSimulation, ModelExchange] {
        let (old, new) =
            (fmu_test_kit::Importer::of::<Oscillator>(interface), Importer::of::<Oscillator>(interface));
        old.initialize(0.0);
        new.initialize(0.0);
        let (old_bytes, new_bytes) = (old.bytes(), new.bytes());
        let (from, to) = (format!("{interface} of FMI 2.0"), format!("{interface} of FMI 3.0"));
        let to_new = format!("the state comes from {from}, this instance is {to}; states stay within");
        let to_old = format!("the state comes from {to}, this instance is {from}; states stay within");

        let mut state = null_mut();
        let text = new.refused("bytes of FMI 2.0", |fmu| {
            fmu.fmi3DeserializeFMUState(old_bytes.as_ptr(), old_bytes.len(), &mut state)
        });
        assert!(text.contains(&to_new), "{text}");
        let text = old.refused("bytes of FMI 3.0", |fmu| {
            fmu.fmi2DeSerializeFMUstate(new_bytes.as_ptr().cast(), new_bytes.len(), &mut state)
        });
        assert!(text.contains(&to_old), "{text}");
        assert!(state.is_null());
    }
}

#[test]
fn of_event_mode() {
    let (with, without) =
        (in_mode::<Ticker>(CoSimulation, Mode::Event), Importer::of::<Ticker>(CoSimulation));
    let (bytes, mut state) = (with.bytes(), null_mut());
    let text =
        without.refused("bytes", |fmu| fmu.fmi3DeserializeFMUState(bytes.as_ptr(), bytes.len(), &mut state));
    assert!(text.contains("event mode"), "{text}");
}

/// No byte can be changed unseen, and none be missing.
#[test]
fn damaged() {
    let fmu = Importer::with::<Palette>(&Arguments::of::<Palette>(CoSimulation));
    let bytes = fmu.bytes();
    let mut state = null_mut();
    for place in 0..bytes.len() {
        let mut other = bytes.clone();
        other[place] ^= 1;
        let read = |fmu: &Importer| fmu.fmi3DeserializeFMUState(other.as_ptr(), other.len(), &mut state);
        fmu.refused("another byte", read);
        fmu.refused("fewer", |fmu| fmu.fmi3DeserializeFMUState(bytes.as_ptr(), place, &mut state));
    }
    let mut size = 0;
    let handle = fmu.save();
    fmu.ok(fmu.fmi3SerializedFMUStateSize(handle, &mut size));
    let mut out = vec![0; size];
    fmu.refused("a small buffer", |fmu| fmu.fmi3SerializeFMUState(handle, out.as_mut_ptr(), size - 1));
    fmu.forget(handle);
    assert!(state.is_null());
    fmu.refused("no state", |fmu| fmu.fmi3SetFMUState(fmi3FMUState::from(null_mut())));
}

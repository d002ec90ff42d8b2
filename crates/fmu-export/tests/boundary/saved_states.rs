//! Saved states (section 2.1.8): their content, and rejected states.

use crate::INTERFACES;
use crate::models::{Counter, Grumbler, Oscillator, Talker, counter, grumbler, oscillator::Name, talker};
use crate::variables::{say, texts};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::Model;
use fmu_export::fmi2::types::Status;
use fmu_test_kit::checks::{DAMAGED, survivors};
use fmu_test_kit::serialized::*;
use fmu_test_kit::{Either, Importer};
use std::ptr::{null, null_mut, without_provenance_mut};

const FORCE: u32 = Name::force as u32;
/// Checks that memory other than variables is restored: the next count of the counter, the earlier texts of
/// the talker.
#[test]
fn memory_comes_back() {
    let fmu = Importer::of::<Counter>(CoSimulation);
    fmu.ok(fmu.fmi2SetBoolean(&(counter::Name::on as u32), 1, &1));
    fmu.initialize(0.0);
    fmu.step(0.0, 0.25);
    let other = Importer::of::<Counter>(CoSimulation);
    other.restore(&fmu.bytes());
    [&fmu, &other].iter().for_each(|fmu| fmu.step(0.25, 0.06));
    assert_eq!(fmu.bytes(), other.bytes());
    assert_eq!(other.get([counter::Name::sum as u32]), [3.0]);

    let fmu = Importer::in_mode::<Talker>(CoSimulation, StepComplete);
    for (i, text) in ["", "one", "", "and something longer: é"].iter().enumerate() {
        say(&fmu, talker::Name::heard, text);
        fmu.step(i as f64, 1.0);
        let other = Importer::of::<Talker>(CoSimulation);
        other.restore(&fmu.bytes());
        assert_eq!(other.bytes(), fmu.bytes());
        assert_eq!(texts(&other, [talker::Name::said]), texts(&fmu, [talker::Name::said]));
    }
}

/// Checks that a state from Initialization Mode can be restored while the simulation runs.
#[test]
fn back_to_the_initialization() {
    let fmu = Importer::in_mode::<Oscillator>(ModelExchange, Initialization);
    let state = fmu.save();
    for _ in 0..3 {
        fmu.ok(fmu.fmi2ExitInitializationMode());
        fmu.enter_continuous_time();
        fmu.ok(fmu.fmi2SetFMUstate(state));
    }
    fmu.forget(state);
}

#[test]
fn handles_are_reused() {
    let fmu = Importer::initialized_at::<Oscillator>(0.0);
    let mut state = fmu.save();
    let handle = state;
    let go = |from: i32| {
        let step = |i| {
            fmu.set(&[FORCE], &[f64::from(i).sin()]);
            fmu.step(f64::from(i), 1.0);
            fmu.bytes()
        };
        (from..from + 4).map(step).collect::<Vec<_>>()
    };
    go(0);
    fmu.ok(fmu.fmi2GetFMUstate(&mut state));
    assert_eq!(state, handle, "the memory is used again");
    let expected = go(4);
    fmu.ok(fmu.fmi2SetFMUstate(state));
    assert_eq!(go(4), expected, "with the later state");

    // De-serializing into the handle of a state replaces the state.
    let bytes = fmu.bytes();
    fmu.ok(fmu.deserialize(bytes.as_ptr(), bytes.len(), &mut state));
    assert_eq!(state, handle);
    let expected = go(8);
    fmu.ok(fmu.fmi2SetFMUstate(state));
    assert_eq!(go(8), expected);
    fmu.forget(state);
}

/// Checks that an instance frees its saved states (section 2.1.5). Handles of other instances, freed handles
/// and other addresses are rejected, not dereferenced.
#[test]
fn handles_that_are_none() {
    let [fmu, other] = [(); 2].map(|()| Importer::in_mode::<Talker>(CoSimulation, StepComplete));
    let (own, foreign, freed) = (fmu.save(), other.save(), fmu.save());
    fmu.forget(freed);
    let on_the_stack = (&raw const own).cast_mut().cast();
    let none = [foreign, freed, on_the_stack, without_provenance_mut(8), without_provenance_mut(usize::MAX)];
    let bytes = fmu.bytes();
    for wild in none {
        let mut handle = wild;
        let mut buffer = vec![0; bytes.len()];
        for message in [
            fmu.refused("get", |fmu| fmu.fmi2GetFMUstate(&mut handle)),
            fmu.refused("set", |fmu| fmu.fmi2SetFMUstate(handle)),
            fmu.refused("free", |fmu| fmu.fmi2FreeFMUstate(&mut handle)),
            fmu.refused("size", |fmu| fmu.fmi2SerializedFMUstateSize(handle, &mut 0)),
            fmu.refused("serialize", |fmu| {
                fmu.fmi2SerializeFMUstate(handle, buffer.as_mut_ptr().cast(), buffer.len())
            }),
            fmu.refused("de-serialize", |fmu| {
                fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut handle)
            }),
        ] {
            assert!(message.contains("no state of this instance"), "{message}");
            assert_eq!(handle, wild);
        }
    }
    other.ok(other.fmi2SetFMUstate(foreign));
    fmu.ok(fmu.fmi2SetFMUstate(own));
}

/// Checks that the model's memory may contain any number. A variable that is not finite could not be read
/// back, so it is not written.
#[test]
fn infinite_numbers() {
    let fmu = Importer::of::<Grumbler>(CoSimulation);
    fmu.set(&[grumbler::Name::last as u32], &[0.5]);
    fmu.initialize(0.0);
    let other = Importer::of::<Grumbler>(CoSimulation);
    other.restore(&fmu.bytes());
    other.step(0.0, 1e6);

    fmu.ok(fmu.fmi2SetInteger(&(grumbler::Name::trouble as u32), 1, &(grumbler::Trouble::Heat as i32)));
    fmu.step(0.0, 0.1);
    let (state, mut size) = (fmu.save(), 0);
    fmu.ok(fmu.fmi2SerializedFMUstateSize(state, &mut size));
    let mut buffer = vec![0; size];
    fmu.refused_with(&["warmer must be a finite number, it is inf"], |fmu| {
        fmu.fmi2SerializeFMUstate(state, buffer.as_mut_ptr().cast(), size)
    });
}

#[test]
fn null_handles_and_arrays() {
    for interface in INTERFACES {
        let fmu = Importer::of::<Oscillator>(interface);
        fmu.ok(fmu.fmi2FreeFMUstate(null_mut()));
        let mut state = null_mut();
        fmu.ok(fmu.fmi2FreeFMUstate(&mut state));
        let bytes = fmu.bytes();
        let mut size = 0;
        fmu.refused("get into NULL", |fmu| fmu.fmi2GetFMUstate(null_mut()));
        fmu.refused("set NULL", |fmu| fmu.fmi2SetFMUstate(null_mut()));
        fmu.refused("size of NULL", |fmu| fmu.fmi2SerializedFMUstateSize(null_mut(), &mut size));
        fmu.refused("serialize NULL", |fmu| {
            fmu.fmi2SerializeFMUstate(null_mut(), [0; 999].as_mut_ptr(), 999)
        });
        fmu.refused("de-serialize NULL", |fmu| fmu.fmi2DeSerializeFMUstate(null(), bytes.len(), &mut state));
        fmu.refused("de-serialize nothing", |fmu| fmu.fmi2DeSerializeFMUstate(null(), 0, &mut state));
        fmu.refused("de-serialize into NULL", |fmu| {
            fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), null_mut())
        });
        let saved = fmu.save();
        fmu.refused("size to NULL", |fmu| fmu.fmi2SerializedFMUstateSize(saved, null_mut()));
        fmu.refused("serialize into NULL", |fmu| fmu.fmi2SerializeFMUstate(saved, null_mut(), bytes.len()));
        fmu.forget(saved);
        assert!(state.is_null());
    }
}

#[test]
fn buffers_of_the_wrong_size() {
    let fmu = Importer::in_mode::<Talker>(CoSimulation, StepComplete);
    let (state, size) = (fmu.save(), fmu.bytes().len());
    for wrong in [0, 1, size - 1, size + 1] {
        let mut buffer = vec![0x55_u8; size + 1];
        let message = fmu
            .refused("wrong size", |fmu| fmu.fmi2SerializeFMUstate(state, buffer.as_mut_ptr().cast(), wrong));
        assert!(message.contains(&size.to_string()), "{message}");
        assert!(buffer.iter().all(|byte| *byte == 0x55), "nothing is written");
    }
    fmu.forget(state);
}

#[test]
fn states_of_the_other_interface_type() {
    let slave = Importer::in_mode::<Oscillator>(CoSimulation, Instantiated);
    let model = Importer::in_mode::<Oscillator>(ModelExchange, Instantiated);
    for (from, to) in [(&slave, &model), (&model, &slave)] {
        let message = to.refused_bytes(&from.bytes());
        assert!(message.contains("Co-Simulation") && message.contains("Model Exchange"), "{message}");
        assert!(message.contains("interface type"), "{message}");
    }
}

fn restores(fmu: &Importer, bytes: &[u8]) -> bool {
    let mut state = null_mut();
    let status = fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut state);
    if status == Status::Ok {
        fmu.ok(fmu.fmi2SetFMUstate(state));
        fmu.forget(state);
    }
    status == Status::Ok
}

/// Covers strings and vectors, too.
#[test]
fn no_changed_byte_goes_unseen() {
    fmu_test_kit::checks::no_changed_byte_goes_unseen::<Importer, Talker>();
}

#[test]
fn no_cut_and_no_extension_goes_unseen() {
    let fmu = Importer::in_mode::<Talker>(CoSimulation, StepComplete);
    let bytes = fmu.bytes();
    for length in 0..bytes.len() {
        fmu.refused_bytes(&bytes[..length]);
        if length > GUID_HASH.end + CHECKSUM {
            fmu.refused_bytes(&sealed(bytes[..length].to_vec()));
        }
    }
    for more in 1..20 {
        let longer = [bytes.as_slice(), &vec![0; more]].concat();
        fmu.refused_bytes(&longer);
        fmu.refused_bytes(&sealed(longer));
    }
}

#[test]
fn messages_say_where_a_state_comes_from() {
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, StepComplete);
    let bytes = fmu.bytes();
    assert_eq!(sealed(bytes.clone()), bytes, "the layout is as this test believes");
    assert_eq!(bytes[GUID_HASH], fnv1a(Oscillator::INFO.guid.as_bytes()));
    assert_eq!(time(&bytes), 0.0);

    let other_fmu = with(bytes.clone(), GUID_HASH, &fnv1a(b"{another-guid}"));
    assert!(fmu.refused_bytes(&other_fmu).contains("another FMU"));
    let other_fmu = Importer::in_mode::<Talker>(CoSimulation, StepComplete).bytes();
    assert!(fmu.refused_bytes(&other_fmu).contains("another FMU"));
    for version in [b"1", b"3", b"x"] {
        let other_version = with(bytes.clone(), VERSION..VERSION + 1, version);
        assert!(fmu.refused_bytes(&other_version).contains("version"));
    }
    let other_interface = with(bytes.clone(), INTERFACE..INTERFACE + 1, &[ModelExchange as u8]);
    assert!(fmu.refused_bytes(&other_interface).contains("interface type"));
    assert!(fmu.refused_bytes(b"something else").contains("no saved state"));
    let cut = &bytes[..bytes.len() - 30];
    assert!(fmu.refused_bytes(cut).contains("length"));
}

/// Checks invalid contents with a correct checksum.
#[test]
fn impossible_contents() {
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, StepComplete);
    let bytes = fmu.bytes();
    for mode in [Event, ContinuousTime, Fatal] {
        fmu.refused_bytes(&with_mode(bytes.clone(), mode));
    }
    for mode in [0, 3, -1, i64::MAX, 1 << 32 | 4] {
        fmu.refused_bytes(&with(bytes.clone(), MODE, &i64::to_le_bytes(mode)));
    }
    for truth in [2, u8::MAX] {
        fmu.refused_bytes(&with(bytes.clone(), ENDED..ENDED + 1, &[truth]));
    }
    for number in [f64::NAN, f64::INFINITY] {
        fmu.refused_bytes(&with(bytes.clone(), TIME, &number.to_le_bytes()));
    }
    // Force, position, velocity, mass, stiffness, springs, damping have 8 bytes each.
    let value = |place: usize| VALUES + 8 * place..VALUES + 8 * (place + 1);
    assert_eq!(bytes[value(4)], 50.0_f64.to_le_bytes());
    let message = fmu.refused_bytes(&with(bytes.clone(), value(3), &(-1.0_f64).to_le_bytes()));
    assert!(message.contains("mass"), "{message}");
    for springs in [0, 10, i64::MIN, 1 << 32 | 1] {
        fmu.refused_bytes(&with(bytes.clone(), value(5), &springs.to_le_bytes()));
    }
    let message = fmu.refused_bytes(&with(bytes.clone(), value(6), &20.0_f64.to_le_bytes()));
    assert!(message.contains("nothing oscillates"), "what update refuses: {message}");
    // The force may have any finite value and is restored exactly.
    assert!(restores(&fmu, &with(bytes, value(0), &f64::MAX.to_le_bytes())));
    assert_eq!(fmu.get([FORCE]), [f64::MAX]);
}

/// Checks impossible strings, enumeration items and lengths of vectors.
#[test]
fn absurd_lengths() {
    let fmu = Importer::in_mode::<Talker>(CoSimulation, StepComplete);
    say(&fmu, talker::Name::heard, "heard");
    let bytes = fmu.bytes();
    // Ranges of the length of the heard text, length of the greeting, mood, length of the vector of texts,
    // length of its first text.
    let heard = VALUES..VALUES + 8;
    let greeting = heard.end + 5..heard.end + 13;
    let mood = greeting.end + 5..greeting.end + 13;
    let said = mood.end + 3 * 8..mood.end + 4 * 8;
    let first_said = said.end..said.end + 8;
    for (at, value) in [(&heard, 5), (&greeting, 5), (&mood, 1), (&said, 1), (&first_said, 5)] {
        assert_eq!(bytes[at.clone()], u64::to_le_bytes(value), "the layout is as this test believes");
    }
    for at in [heard.clone(), greeting, mood, said, first_said] {
        for absurd in [0, 4, 6, 100, 1 << 20, (1 << 20) + 1, 1 << 32, 1 << 62, i64::MAX as u64, u64::MAX] {
            fmu.refused_bytes(&with(bytes.clone(), at.clone(), &absurd.to_le_bytes()));
        }
    }
    let no_text = with(bytes.clone(), heard.end..heard.end + 2, b"\xff\xfe");
    fmu.refused_bytes(&no_text);
    // C would read a NUL as the end of the string.
    assert!(restores(&fmu, &with(bytes, heard.end..heard.end + 2, b"a\0")));
    assert_eq!(texts(&fmu, [talker::Name::heard]), ["a ard"]);
}

/// Checks that no call is fatal after a damaged state that the FMU accepts.
#[test]
fn random_contents_break_nothing() {
    // Lengths of strings are kept, so that more than a few states are accepted.
    let accepted = [survivors::<Importer, Counter>(12), survivors::<Importer, Talker>(13)];
    assert!(accepted.iter().all(|accepted| *accepted > DAMAGED / 15), "only {accepted:?} were accepted");
}

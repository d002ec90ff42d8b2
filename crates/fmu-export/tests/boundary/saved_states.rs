//! Saved states (section 2.1.8 of FMI 2.0): what they contain, and which handles and bytes are rejected.

use crate::INTERFACES;
use crate::models::*;
use crate::variables::texts;
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::{BaseType, Exported, Status};
use fmu_test_kit::checks::{modes_of_model, random_contents_break_nothing};
use fmu_test_kit::serialized::*;
use fmu_test_kit::{Either, Importer, fmi3};
use std::ptr::{null_mut, without_provenance_mut};

const FORCE: u32 = oscillator::Name::force as u32;

/// Checks that saving with the handle of an earlier state replaces that state. The fault-injecting importer checks
/// the content of states.
#[test]
fn handles_are_reused() {
    let fmu = Importer::initialized_at::<Oscillator>(0.0);
    let mut state = fmu.save();
    let (handle, bytes) = (state, fmu.bytes());
    fmu.step(0.0, 1.0);
    fmu.ok(fmu.fmi2GetFMUstate(&mut state));
    assert_eq!(state, handle, "the handle must not change");
    fmu.ok(fmu.deserialize(bytes.as_ptr(), bytes.len(), &mut state));
    assert_eq!(state, handle);
    fmu.ok(fmu.fmi2SetFMUstate(state));
    assert_eq!(fmu.bytes(), bytes);
}

/// Checks that handles of other instances, freed handles and other addresses are rejected and not dereferenced. The two
/// states that remain are freed with their instances (section 2.1.5 of FMI 2.0).
#[test]
fn invalid_handles() {
    let [fmu, other] = [(); 2].map(|()| Importer::in_mode::<Talker>(CoSimulation, StepComplete));
    let (own, foreign, freed) = (fmu.save(), other.save(), fmu.save());
    fmu.forget(freed);
    let on_the_stack = (&raw const own).cast_mut().cast();
    let invalid =
        [foreign, freed, on_the_stack, without_provenance_mut(8), without_provenance_mut(usize::MAX)];
    let bytes = fmu.bytes();
    for invalid in invalid {
        let mut handle = invalid;
        let mut buffer = vec![0; bytes.len()];
        for message in [
            fmu.rejected("get", |fmu| fmu.fmi2GetFMUstate(&mut handle)),
            fmu.rejected("set", |fmu| fmu.fmi2SetFMUstate(handle)),
            fmu.rejected("free", |fmu| fmu.fmi2FreeFMUstate(&mut handle)),
            fmu.rejected("size", |fmu| fmu.fmi2SerializedFMUstateSize(handle, &mut 0)),
            fmu.rejected("serialize", |fmu| {
                fmu.fmi2SerializeFMUstate(handle, buffer.as_mut_ptr().cast(), buffer.len())
            }),
            fmu.rejected("de-serialize", |fmu| {
                fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut handle)
            }),
        ] {
            assert!(message.contains("unknown state handle"), "{message}");
            assert_eq!(handle, invalid);
        }
    }
    other.ok(other.fmi2SetFMUstate(foreign));
    fmu.ok(fmu.fmi2SetFMUstate(own));
}

/// Checks that the handle of a freed state stays invalid even if later states use the same memory.
#[test]
fn freed_handles_stay_invalid() {
    fn check<F: Either>() {
        let fmu = F::in_mode::<Oscillator>(CoSimulation, StepComplete);
        let mut freed = Vec::new();
        for _ in 0..20 {
            let state = fmu.save();
            assert!(!freed.contains(&state));
            fmu.forget(state);
            freed.push(state);
        }
        let _last = fmu.save();
        for state in freed {
            fmu.rejected_with(&["unknown state handle"], |fmu| fmu.set_state(state));
        }
    }
    check::<Importer>();
    check::<fmi3::Importer>();
}

/// Checks that freeing the oldest of many states takes about as many instructions as freeing the oldest of a few.
#[test]
fn states_are_freed_in_constant_time() {
    use fmu_test_kit::instructions;
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, StepComplete);
    let instructions_with = |count: usize| {
        let states: Vec<_> = (0..count).map(|_| fmu.save()).collect();
        let counted = instructions(&mut || fmu.forget(states[0]));
        states.into_iter().for_each(|state| fmu.forget(state));
        counted
    };
    if let [Some(few), Some(many)] = [10, 20_000].map(instructions_with) {
        assert!(many < few + few / 2, "{few} instructions, and {many} among 20,000");
    }
}

/// Checks that the `memory` fields of a model may contain infinity. A state with a variable that is not finite is not
/// serialized, because de-serializing it would be rejected.
#[test]
fn infinite_numbers() {
    // The time of the next count is infinity after the last count.
    let fmu = Importer::in_mode::<Counter>(ModelExchange, Instantiated);
    fmu.set(&[counter::Name::limit as u32], &[1.0]);
    fmu.initialize(0.0);
    assert_eq!(fmu.update().next, None);
    let other = Importer::in_mode::<Counter>(ModelExchange, Instantiated);
    other.restore(&fmu.bytes());
    assert_eq!(other.bytes(), fmu.bytes());
    assert_eq!(other.update().next, None);

    let fmu = Importer::initialized_at::<ClumsyOnHeap>(0.0);
    fmu.set(&[clumsy::ClumsyOnHeapName::u as u32], &[f64::MAX]);
    fmu.step(0.0, 1.0);
    let (state, mut size) = (fmu.save(), 0);
    fmu.ok(fmu.state_size(state, &mut size));
    let mut buffer = vec![0; size];
    fmu.rejected_with(&["x must be a finite number, it is inf"], |fmu| {
        fmu.serialize_into(state, buffer.as_mut_ptr(), size)
    });
}

/// Checks NULL handles; `call_table.rs` checks NULL pointers.
fn null_handles<F: Either>() {
    for interface in INTERFACES {
        let (fmu, mut size) = (F::in_mode::<Oscillator>(interface, Instantiated), 0);
        fmu.ok(fmu.free_state(null_mut()));
        fmu.ok(fmu.free_state(&mut null_mut()));
        fmu.rejected("set NULL", |fmu| fmu.set_state(null_mut()));
        fmu.rejected("size of NULL", |fmu| fmu.state_size(null_mut(), &mut size));
        fmu.rejected("serialize NULL", |fmu| fmu.serialize_into(null_mut(), [0; 999].as_mut_ptr(), 999));
        fmu.rejected_bytes(&[]);
    }
}

#[test]
fn buffers_of_the_wrong_size() {
    let fmu = Importer::in_mode::<Talker>(CoSimulation, StepComplete);
    let (state, size) = (fmu.save(), fmu.bytes().len());
    for wrong in [0, 1, size - 1, size + 1] {
        let mut buffer = vec![0x55_u8; size + 1];
        let message = fmu.rejected("wrong size", |fmu| {
            fmu.fmi2SerializeFMUstate(state, buffer.as_mut_ptr().cast(), wrong)
        });
        assert!(message.contains(&size.to_string()), "{message}");
        assert!(buffer.iter().all(|byte| *byte == 0x55), "nothing must be written");
    }
    fmu.forget(state);
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

/// Distance between the bytes that are changed, and between the lengths that are tried. Under Miri, which is slow, every
/// tenth is tried.
const STRIDE: usize = if cfg!(miri) { 10 } else { 1 };

/// Checks that any change of a byte is detected, and that the state of the handle then stays unchanged. Under Miri, only
/// one bit of a byte is changed.
fn every_changed_byte_is_detected<F: Either, M: Exported>() {
    let changes = || 1..=if cfg!(miri) { 1 } else { u8::MAX };
    for (interface, mode) in [(CoSimulation, StepComplete), (ModelExchange, ContinuousTime)] {
        let fmu = F::in_mode::<M>(interface, mode);
        let mut bytes = fmu.bytes();
        let (mut state, handle) = (fmu.save(), fmu.save());
        fmu.take_log();
        for i in (0..bytes.len()).step_by(STRIDE) {
            for change in changes() {
                bytes[i] ^= change;
                let status = fmu.deserialize(bytes.as_ptr(), bytes.len(), &mut state);
                assert_eq!(status, Status::Error, "byte {i} ^ {change:#x}");
                bytes[i] ^= change;
            }
        }
        assert_eq!(
            fmu.take_log().len(),
            changes().count() * bytes.len().div_ceil(STRIDE),
            "each change must be reported"
        );
        assert_eq!(fmu.bytes(), bytes);
        fmu.ok(fmu.set_state(state));
        assert_eq!(fmu.bytes(), bytes);
        [state, handle].iter().for_each(|state| fmu.forget(*state));
    }
}

fn every_other_length_is_detected<F: Either, M: Exported>() {
    let fmu = F::in_mode::<M>(CoSimulation, StepComplete);
    let bytes = fmu.bytes();
    for length in (0..bytes.len()).step_by(STRIDE) {
        fmu.rejected_bytes(&bytes[..length]);
        if length > GUID_HASH.end + CHECKSUM {
            fmu.rejected_bytes(&sealed(bytes[..length].to_vec()));
        }
    }
    for more in 1..20 {
        let longer = [bytes.as_slice(), &vec![0; more]].concat();
        fmu.rejected_bytes(&longer);
        fmu.rejected_bytes(&sealed(longer));
    }
}

/// Checks that an instance is equal to a new one after a reset (section 2.1.6 of FMI 2.0).
fn a_reset_instance_is_like_a_new_one<F: Either, M: Exported>() {
    for (interface, mode) in modes_of_model::<F, M>() {
        let fmu = F::in_mode::<M>(interface, Initialization);
        for (index, variable) in (0..).zip(M::TABLE) {
            match variable.base() {
                BaseType::Real => _ = fmu.try_set(&[index], &[0.75]),
                BaseType::String => _ = fmu.set_string(index, c"odd".as_ptr()),
                BaseType::Boolean => _ = fmu.set_boolean(index, 1),
                _ => _ = fmu.set_integer(index, 7),
            }
        }
        fmu.take_log();
        let fresh = F::in_mode::<M>(interface, Instantiated).bytes();
        fmu.restore(&with(with_mode(fmu.bytes(), mode), TIME, &5.0_f64.to_le_bytes()));
        assert_ne!(fmu.bytes(), fresh);
        fmu.ok(fmu.reset());
        assert_eq!(fmu.bytes(), fresh, "{} from {mode} of {interface}", M::INFO.name);
    }
}

/// Checks that a restored state restores the mode, the time and the stop time, even if the instance is in another mode.
fn every_mode_is_restored<F: Either, M: Exported>() {
    for (interface, mode) in modes_of_model::<F, M>() {
        let bytes = F::in_mode::<M>(interface, mode).bytes();
        for other in [Instantiated, Terminated] {
            let fmu = F::in_mode::<M>(interface, other);
            fmu.restore(&bytes);
            assert_eq!(fmu.bytes(), bytes, "{mode} of {interface}");
        }
    }
    let fmu = F::in_mode::<M>(CoSimulation, Instantiated);
    fmu.enter_initialization(2.0, Some(3.0));
    let bytes = fmu.bytes();
    fmu.ok(fmu.reset());
    fmu.restore(&bytes);
    fmu.ok(fmu.exit_initialization_mode());
    fmu.leave_event_mode();
    fmu.step(2.0, 0.5);
    fmu.rejected("past the stop time", |fmu| fmu.try_step(2.5, 0.6));
}

/// Checks that the bytes of a state are rejected in another FMI version or interface type, because the state machines
/// differ, and that a handle is valid only in its instance.
fn states_of_other_origins<F: Either, O: Either>([from, to]: [&str; 2]) {
    for (interface, of_other) in INTERFACES.into_iter().flat_map(|own| INTERFACES.map(|other| (own, other))) {
        let fmu = F::in_mode::<Oscillator>(interface, Initialization);
        let other = O::in_mode::<Oscillator>(of_other, Initialization);
        if F::standard() == O::standard() && interface == of_other {
            continue;
        }
        let message = fmu.rejected_bytes(&other.bytes());
        let own = format!("this instance is {interface} of {to}; states stay within");
        assert!(message.contains(&format!("the state comes from {of_other} of {from}, {own}")), "{message}");
        fmu.rejected_with(&["unknown state handle"], |fmu| fmu.set_state(other.save()));
    }
}

#[test]
fn in_both_versions() {
    fn check<F: Either>() {
        null_handles::<F>();
        every_changed_byte_is_detected::<F, Oscillator>();
        every_changed_byte_is_detected::<F, Talker>();
        every_other_length_is_detected::<F, Talker>();
        every_other_length_is_detected::<F, Palette>();
        a_reset_instance_is_like_a_new_one::<F, Oscillator>();
        a_reset_instance_is_like_a_new_one::<F, Talker>();
        every_mode_is_restored::<F, Oscillator>();
        random_contents_break_nothing::<F, Counter>();
        random_contents_break_nothing::<F, Talker>();
    }
    check::<Importer>();
    check::<fmi3::Importer>();
    states_of_other_origins::<Importer, Importer>(["FMI 2.0", "FMI 2.0"]);
    states_of_other_origins::<Importer, fmi3::Importer>(["FMI 3.0", "FMI 2.0"]);
    states_of_other_origins::<fmi3::Importer, Importer>(["FMI 2.0", "FMI 3.0"]);
}

#[test]
fn messages_say_where_a_state_comes_from() {
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, StepComplete);
    let bytes = fmu.bytes();
    assert_eq!(sealed(bytes.clone()), bytes, "the layout must be as this test assumes");
    assert_eq!(time(&bytes), 0.0);

    let other_fmu = with(bytes.clone(), GUID_HASH, &fnv1a(b"{another-guid}"));
    assert!(fmu.rejected_bytes(&other_fmu).contains("another FMU"));
    let other_fmu = Importer::in_mode::<Talker>(CoSimulation, StepComplete).bytes();
    assert!(fmu.rejected_bytes(&other_fmu).contains("another FMU"));
    for version in [b"1", b"3", b"x"] {
        let other_version = with(bytes.clone(), VERSION..VERSION + 1, version);
        assert!(fmu.rejected_bytes(&other_version).contains("version"));
    }
    assert!(fmu.rejected_bytes(b"something else").contains("not a saved state"));
    let cut = &bytes[..bytes.len() - 30];
    assert!(fmu.rejected_bytes(cut).contains("length"));
}

/// Checks that invalid values in the bytes are rejected even if the checksum is correct.
#[test]
fn impossible_contents() {
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, StepComplete);
    let bytes = fmu.bytes();
    for mode in [Event, ContinuousTime, Fatal] {
        fmu.rejected_bytes(&with_mode(bytes.clone(), mode));
    }
    for mode in [0, 3, -1, i64::MAX, 1 << 32 | 4] {
        fmu.rejected_bytes(&with(bytes.clone(), MODE, &i64::to_le_bytes(mode)));
    }
    for byte in [2, u8::MAX] {
        fmu.rejected_bytes(&with(bytes.clone(), ENDED..ENDED + 1, &[byte]));
    }
    for number in [f64::NAN, f64::INFINITY] {
        fmu.rejected_bytes(&with(bytes.clone(), TIME, &number.to_le_bytes()));
    }
    // Force, position, velocity, mass, stiffness, springs, damping have 8 bytes each.
    let value = |index: usize| VALUES + 8 * index..VALUES + 8 * (index + 1);
    assert_eq!(bytes[value(4)], 50.0_f64.to_le_bytes());
    let message = fmu.rejected_bytes(&with(bytes.clone(), value(3), &(-1.0_f64).to_le_bytes()));
    assert!(message.contains("mass"), "{message}");
    for springs in [0, 10, i64::MIN, 1 << 32 | 1] {
        fmu.rejected_bytes(&with(bytes.clone(), value(5), &springs.to_le_bytes()));
    }
    let message = fmu.rejected_bytes(&with(bytes.clone(), value(6), &20.0_f64.to_le_bytes()));
    assert!(message.contains("nothing oscillates"), "update must reject it: {message}");
    // The force may have any finite value and is restored exactly.
    assert!(restores(&fmu, &with(bytes, value(0), &f64::MAX.to_le_bytes())));
    assert_eq!(fmu.get([FORCE]), [f64::MAX]);
}

/// Checks that invalid strings and enumeration items are rejected. Unit tests of the layout check lengths.
#[test]
fn invalid_strings_and_items() {
    let fmu = Importer::in_mode::<Talker>(CoSimulation, StepComplete);
    fmu.write_string(talker::Name::heard as u32, "heard");
    let bytes = fmu.bytes();
    // The strings `heard` and `greeting` are a length of 8 bytes and 5 letters each. `mood` follows, an integer of 8 bytes.
    let heard = VALUES + 8..VALUES + 10;
    let mood = VALUES + 26..VALUES + 34;
    assert_eq!(bytes[mood.clone()], 1_i64.to_le_bytes(), "the layout must be as this test assumes");
    for item in [0, 3, 1 << 32 | 1, i64::MIN] {
        fmu.rejected_bytes(&with(bytes.clone(), mood.clone(), &item.to_le_bytes()));
    }
    fmu.rejected_bytes(&with(bytes.clone(), heard.clone(), b"\xff\xfe"));
    // A NUL is replaced, because C would read it as the end of the string.
    assert!(restores(&fmu, &with(bytes, heard, b"a\0")));
    assert_eq!(texts(&fmu, [talker::Name::heard]), ["a ard"]);
}

#[test]
fn states_of_event_mode() {
    let (with, without) = (
        fmi3::Importer::in_mode::<Counter>(CoSimulation, Event),
        fmi3::Importer::new::<Counter>(CoSimulation),
    );
    assert!(without.rejected_bytes(&with.bytes()).contains("Event Mode"));
}

//! Saved states (section 2.1.8): what they bring back, and what is refused.

use crate::modes::{INTERFACES, all_modes, enter_continuous_time, in_mode, modes_of_model};
use crate::random::Random;
use crate::toys::{Counter, Grumbler, Oscillator, Talker, counter, grumbler, oscillator::Name, talker};
use crate::variables::{say, texts};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::fmi2::types::Status;
use fmu_export::{Exported, Model};
use fmu_test_kit::Importer;
use fmu_test_kit::serialized::*;
use std::ops::Range;
use std::ptr::{null, null_mut, without_provenance_mut};

const FORCE: u32 = Name::force as u32;
/// The Real variables of the oscillator.
const REALS: [u32; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 10];

/// Every Real variable to the last bit.
fn observe(fmu: &Importer) -> [u64; 10] {
    fmu.get(REALS).map(f64::to_bits)
}

/// A Co-Simulation run with uneven steps, from any step to any other.
struct Run {
    /// Whether the slopes of the force are given.
    slopes: bool,
    points: Vec<f64>,
}

impl Run {
    const STEPS: usize = 24;

    fn new(slopes: bool) -> Self {
        let mut random = Random(7);
        let mut points = vec![0.25];
        for i in 0..Self::STEPS {
            points.push(points[i] + random.between(0.001, 0.03));
        }
        Self { slopes, points }
    }

    fn start(&self) -> Importer {
        let fmu = Importer::of::<Oscillator>(CoSimulation);
        fmu.set(&[Name::position as u32, Name::stiffness as u32], &[0.1, 55.0]);
        fmu.initialize(self.points[0]);
        fmu
    }

    fn set_inputs(&self, fmu: &Importer, i: usize) {
        let t = self.points[i];
        fmu.set(&[FORCE], &[(3.0 * t).sin()]);
        if self.slopes {
            fmu.set_rates([FORCE], [2.0 - t]);
        }
    }

    fn step(&self, fmu: &Importer, i: usize) {
        fmu.step(self.points[i], self.points[i + 1] - self.points[i]);
    }

    /// From step to step; what is seen on the way.
    fn go(&self, fmu: &Importer, steps: Range<usize>) -> Vec<[u64; 10]> {
        steps
            .map(|i| {
                self.set_inputs(fmu, i);
                self.step(fmu, i);
                observe(fmu)
            })
            .collect()
    }
}

#[test]
fn replay_is_bit_identical() {
    for slopes in [true, false] {
        let run = Run::new(slopes);
        for saved_at in [0, 1, 2, 3, 11] {
            let fmu = run.start();
            run.go(&fmu, 0..saved_at);
            let (state, bytes) = (fmu.save(), fmu.bytes());
            let expected = run.go(&fmu, saved_at..Run::STEPS);

            fmu.ok(fmu.fmi2SetFMUstate(state));
            assert_eq!(run.go(&fmu, saved_at..Run::STEPS), expected, "from {saved_at}");
            fmu.ok(fmu.fmi2SetFMUstate(state)); // "The FMUstate copy still exists."
            assert_eq!(fmu.bytes(), bytes);
            fmu.ok(fmu.fmi2Reset());
            fmu.restore(&bytes);
            assert_eq!(run.go(&fmu, saved_at..Run::STEPS), expected, "from {saved_at}, serialized");

            // Another instance, even one that was never initialized, takes the bytes.
            let other = Importer::of::<Oscillator>(CoSimulation);
            other.restore(&bytes);
            assert_eq!(run.go(&other, saved_at..Run::STEPS), expected, "from {saved_at}, elsewhere");
            fmu.forget(state);
        }
    }
}

/// Inputs and their derivatives that wait for the step belong to the state.
#[test]
fn state_between_inputs_and_step() {
    for slopes in [true, false] {
        let run = Run::new(slopes);
        let (fmu, other) = (run.start(), Importer::of::<Oscillator>(CoSimulation));
        run.go(&fmu, 0..5);
        run.set_inputs(&fmu, 5);
        other.restore(&fmu.bytes());
        assert_eq!(observe(&other), observe(&fmu));
        run.step(&fmu, 5);
        run.step(&other, 5);
        assert_eq!(observe(&other), observe(&fmu));
    }
}

/// Simulink steps back to operating points that it saved as bytes, in any order.
#[test]
fn stepping_back_in_any_order() {
    let run = Run::new(true);
    let fmu = run.start();
    let (mut saved, mut seen) = (Vec::new(), Vec::new());
    for i in 0..20 {
        saved.push(fmu.bytes());
        seen.extend(run.go(&fmu, i..i + 1));
    }
    for i in [15, 3, 19, 0, 8] {
        fmu.restore(&saved[i]);
        assert_eq!(run.go(&fmu, i..i + 1), seen[i..i + 1]);
    }
}

/// fmi2Reset leaves nothing of a run behind (section 2.1.6).
#[test]
fn reset_is_a_new_beginning() {
    for_every_toy!(check_reset());
}

fn check_reset<M: Exported>() {
    for (interface, mode) in modes_of_model::<M>() {
        let fmu = in_mode::<M>(interface, Initialization);
        for (vr, variable) in (0..).zip(M::TABLE) {
            match variable.base() {
                fmu_export::BaseType::Real => _ = fmu.try_set(&[vr], &[0.75]),
                fmu_export::BaseType::String => _ = fmu.fmi2SetString(&vr, 1, &c"odd".as_ptr()),
                fmu_export::BaseType::Boolean => _ = fmu.fmi2SetBoolean(&vr, 1, &1),
                _ => _ = fmu.fmi2SetInteger(&vr, 1, &7),
            }
        }
        fmu.take_log();
        let fresh = Importer::of::<M>(interface).bytes();
        fmu.restore(&with(with_mode(fmu.bytes(), mode), TIME, &5.0_f64.to_le_bytes()));
        assert_ne!(fmu.bytes(), fresh);
        fmu.ok(fmu.fmi2Reset());
        assert_eq!(fmu.bytes(), fresh, "{} from {mode} of {interface}", M::INFO.name);
    }
}

#[test]
fn replay_in_model_exchange() {
    let fmu = in_mode::<Oscillator>(ModelExchange, ContinuousTime);
    let go = || {
        let mut x = [0.0; 2];
        let mut seen = Vec::new();
        for i in 0..10 {
            let t = 0.1 * f64::from(i);
            fmu.ok(fmu.fmi2SetTime(t));
            fmu.set(&[FORCE], &[t.cos()]);
            fmu.ok(fmu.fmi2GetContinuousStates(x.as_mut_ptr(), 2));
            let mut rates = [0.0; 2];
            fmu.ok(fmu.fmi2GetDerivatives(rates.as_mut_ptr(), 2));
            x = std::array::from_fn(|i| x[i] + 0.001 * rates[i]);
            fmu.ok(fmu.fmi2SetContinuousStates(x.as_ptr(), 2));
            seen.push(observe(&fmu));
        }
        seen
    };
    go();
    let (state, bytes) = (fmu.save(), fmu.bytes());
    let expected = go();
    fmu.ok(fmu.fmi2SetFMUstate(state));
    assert_eq!(go(), expected);
    fmu.ok(fmu.fmi2Terminate());
    fmu.restore(&bytes); // The mode comes back too.
    assert_eq!(go(), expected);
    fmu.forget(state);
}

/// Memory besides variables: when the counter counts next, what the talker has said.
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

    let fmu = in_mode::<Talker>(CoSimulation, StepComplete);
    for (i, text) in ["", "one", "", "and something longer: é"].iter().enumerate() {
        say(&fmu, talker::Name::heard, text);
        fmu.step(i as f64, 1.0);
        let other = Importer::of::<Talker>(CoSimulation);
        other.restore(&fmu.bytes());
        assert_eq!(other.bytes(), fmu.bytes());
        assert_eq!(texts(&other, [talker::Name::said]), texts(&fmu, [talker::Name::said]));
    }
}

/// Every state brings its mode, its time and its stop time back, also from a mode to an earlier one.
#[test]
fn every_mode_comes_back() {
    for (interface, mode) in all_modes() {
        let bytes = in_mode::<Talker>(interface, mode).bytes();
        let fmu = Importer::of::<Talker>(interface);
        fmu.restore(&bytes);
        assert_eq!(fmu.bytes(), bytes, "{mode} of {interface}");
    }
    let fmu = Importer::of::<Oscillator>(CoSimulation);
    fmu.enter_initialization(2.0, Some(3.0));
    let bytes = fmu.bytes();
    fmu.ok(fmu.fmi2Reset());
    fmu.restore(&bytes);
    fmu.ok(fmu.fmi2ExitInitializationMode());
    fmu.step(2.0, 0.5);
    fmu.refused("past the stop time", |fmu| fmu.try_step(2.5, 0.6));
}

/// Between modes of one simulation, too: a state from the initialization can be set while running.
#[test]
fn back_to_the_initialization() {
    let fmu = in_mode::<Oscillator>(ModelExchange, Initialization);
    let state = fmu.save();
    for _ in 0..3 {
        fmu.ok(fmu.fmi2ExitInitializationMode());
        enter_continuous_time(&fmu);
        fmu.ok(fmu.fmi2SetFMUstate(state));
    }
    fmu.forget(state);
}

#[test]
fn handles_are_reused() {
    let run = Run::new(true);
    let fmu = run.start();
    let mut state = fmu.save();
    let handle = state;
    run.go(&fmu, 0..4);
    fmu.ok(fmu.fmi2GetFMUstate(&mut state));
    assert_eq!(state, handle, "the memory is used again");
    let expected = run.go(&fmu, 4..8);
    fmu.ok(fmu.fmi2SetFMUstate(state));
    assert_eq!(run.go(&fmu, 4..8), expected, "with the later state");

    // De-serializing into a handle that holds a state replaces it.
    let bytes = fmu.bytes();
    fmu.ok(fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut state));
    assert_eq!(state, handle);
    let expected = run.go(&fmu, 8..12);
    fmu.ok(fmu.fmi2SetFMUstate(state));
    assert_eq!(run.go(&fmu, 8..12), expected);
    fmu.forget(state);
}

/// What an instance has saved goes with it (section 2.1.5), and is its own: handles of others, freed ones and any other
/// address are told from its states, and not followed.
#[test]
fn handles_that_are_none() {
    let [fmu, other] = [(); 2].map(|()| in_mode::<Talker>(CoSimulation, StepComplete));
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

/// In the model's memory any number may have a meaning; a variable that is none could not be read, so it is not written.
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
    let message = fmu.refused("an infinite variable", |fmu| {
        fmu.fmi2SerializeFMUstate(state, buffer.as_mut_ptr().cast(), size)
    });
    assert!(message.contains("warmer must be a finite number, it is inf"), "{message}");
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
    let fmu = in_mode::<Talker>(CoSimulation, StepComplete);
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
    let slave = in_mode::<Oscillator>(CoSimulation, Instantiated);
    let model = in_mode::<Oscillator>(ModelExchange, Instantiated);
    for (from, to) in [(&slave, &model), (&model, &slave)] {
        let message = refused_bytes(to, &from.bytes());
        assert!(message.contains("Co-Simulation") && message.contains("Model Exchange"), "{message}");
        assert!(message.contains("interface type"), "{message}");
    }
}

/// De-serializing these bytes is refused, and a state that the handle holds stays; returns the message.
#[track_caller]
fn refused_bytes(fmu: &Importer, bytes: &[u8]) -> String {
    let mut state = null_mut();
    let message = fmu.refused("hostile bytes", |fmu| {
        fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut state)
    });
    assert!(state.is_null());
    assert!(message.starts_with("fmi2DeSerializeFMUstate: "), "{message}");
    message
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

#[test]
fn no_changed_byte_goes_unseen() {
    for (interface, mode) in [(CoSimulation, StepComplete), (ModelExchange, ContinuousTime)] {
        let fmu = in_mode::<Talker>(interface, mode);
        let mut bytes = fmu.bytes();
        let (mut state, handle) = (fmu.save(), fmu.save());
        fmu.take_log();
        for i in 0..bytes.len() {
            for change in 1..=u8::MAX {
                bytes[i] ^= change;
                let status = fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut state);
                assert_eq!(status, Status::Error, "byte {i} ^ {change:#x}");
                bytes[i] ^= change;
            }
        }
        assert_eq!(fmu.take_log().len(), 255 * bytes.len(), "each was reported");
        assert_eq!(fmu.bytes(), bytes);
        fmu.ok(fmu.fmi2SetFMUstate(state));
        assert_eq!(fmu.bytes(), bytes, "the state in the handle is what it was");
        fmu.forget(state);
        fmu.forget(handle);
    }
}

#[test]
fn no_cut_and_no_extension_goes_unseen() {
    let fmu = in_mode::<Talker>(CoSimulation, StepComplete);
    let bytes = fmu.bytes();
    for length in 0..bytes.len() {
        refused_bytes(&fmu, &bytes[..length]);
        if length > GUID_HASH.end + CHECKSUM {
            refused_bytes(&fmu, &sealed(bytes[..length].to_vec()));
        }
    }
    for more in 1..20 {
        let longer = [bytes.as_slice(), &vec![0; more]].concat();
        refused_bytes(&fmu, &longer);
        refused_bytes(&fmu, &sealed(longer));
    }
}

#[test]
fn messages_say_where_a_state_comes_from() {
    let fmu = in_mode::<Oscillator>(CoSimulation, StepComplete);
    let bytes = fmu.bytes();
    assert_eq!(sealed(bytes.clone()), bytes, "the layout is as this test believes");
    assert_eq!(bytes[GUID_HASH], fnv1a(Oscillator::INFO.guid.as_bytes()));
    assert_eq!(time(&bytes), 0.0);

    let other_fmu = with(bytes.clone(), GUID_HASH, &fnv1a(b"{another-guid}"));
    assert!(refused_bytes(&fmu, &other_fmu).contains("another FMU"));
    let other_fmu = in_mode::<Talker>(CoSimulation, StepComplete).bytes();
    assert!(refused_bytes(&fmu, &other_fmu).contains("another FMU"));
    for version in [b"1", b"3", b"x"] {
        let other_version = with(bytes.clone(), VERSION..VERSION + 1, version);
        assert!(refused_bytes(&fmu, &other_version).contains("version"));
    }
    let other_interface = with(bytes.clone(), INTERFACE..INTERFACE + 1, &[ModelExchange as u8]);
    assert!(refused_bytes(&fmu, &other_interface).contains("interface type"));
    assert!(refused_bytes(&fmu, b"something else").contains("no saved state"));
    let cut = &bytes[..bytes.len() - 30];
    assert!(refused_bytes(&fmu, cut).contains("length"));
}

/// A right checksum around wrong contents.
#[test]
fn impossible_contents() {
    let fmu = in_mode::<Oscillator>(CoSimulation, StepComplete);
    let bytes = fmu.bytes();
    for mode in [Event, ContinuousTime, Fatal] {
        refused_bytes(&fmu, &with_mode(bytes.clone(), mode));
    }
    for mode in [0, 3, -1, i64::MAX, 1 << 32 | 4] {
        refused_bytes(&fmu, &with(bytes.clone(), MODE, &i64::to_le_bytes(mode)));
    }
    for truth in [2, u8::MAX] {
        refused_bytes(&fmu, &with(bytes.clone(), ENDED..ENDED + 1, &[truth]));
    }
    for number in [f64::NAN, f64::INFINITY] {
        refused_bytes(&fmu, &with(bytes.clone(), TIME, &number.to_le_bytes()));
    }
    // Force, position, velocity, mass, stiffness, springs, damping of 8 bytes each.
    let value = |place: usize| VALUES + 8 * place..VALUES + 8 * (place + 1);
    assert_eq!(bytes[value(4)], 50.0_f64.to_le_bytes());
    let message = refused_bytes(&fmu, &with(bytes.clone(), value(3), &(-1.0_f64).to_le_bytes()));
    assert!(message.contains("mass"), "{message}");
    for springs in [0, 10, i64::MIN, 1 << 32 | 1] {
        refused_bytes(&fmu, &with(bytes.clone(), value(5), &springs.to_le_bytes()));
    }
    let message = refused_bytes(&fmu, &with(bytes.clone(), value(6), &20.0_f64.to_le_bytes()));
    assert!(message.contains("nothing oscillates"), "what update refuses: {message}");
    // The force may be what it likes, and is as it was written.
    assert!(restores(&fmu, &with(bytes, value(0), &f64::MAX.to_le_bytes())));
    assert_eq!(fmu.get([FORCE]), [f64::MAX]);
}

/// Texts, enumerations and vectors that claim to be what they cannot be.
#[test]
fn absurd_lengths() {
    let fmu = in_mode::<Talker>(CoSimulation, StepComplete);
    say(&fmu, talker::Name::heard, "heard");
    let bytes = fmu.bytes();
    // The lengths of what is heard and of the greeting, the mood, the vector of what was said and its first text.
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
            refused_bytes(&fmu, &with(bytes.clone(), at.clone(), &absurd.to_le_bytes()));
        }
    }
    let no_text = with(bytes.clone(), heard.end..heard.end + 2, b"\xff\xfe");
    refused_bytes(&fmu, &no_text);
    // A text with a zero byte has an end for C.
    assert!(restores(&fmu, &with(bytes, heard.end..heard.end + 2, b"a\0")));
    assert_eq!(texts(&fmu, [talker::Name::heard]), ["a ard"]);
}

/// Whatever passes for a state, the instance survives it: no call is fatal.
#[test]
fn random_contents_break_nothing() {
    // Texts keep their length, so that more than a few are accepted.
    let accepted = [survivors::<Oscillator>(11), survivors::<Counter>(12), survivors::<Talker>(13)];
    assert!(accepted.iter().all(|accepted| *accepted > 200), "only {accepted:?} were tried");
}

fn survivors<M: Exported>(seed: u64) -> usize {
    let fmu = in_mode::<M>(CoSimulation, StepComplete);
    let original = fmu.bytes();
    let mut random = Random(seed);
    let mut accepted = 0;
    for _ in 0..3_000 {
        let mut bytes = original.clone();
        for _ in 0..=random.bits() % 3 {
            // Odd numbers of every size, in the places where numbers begin and in others.
            let at = MODE.end + random.bits() as usize % (bytes.len() - MODE.end - 16);
            let word = random.bits() >> (random.bits() % 64);
            let width = if random.between(0.0, 1.0) < 0.5 { 4 } else { 8 };
            bytes[at..at + width].copy_from_slice(&word.to_le_bytes()[..width]);
        }
        let bytes = sealed(bytes);
        if restores(&fmu, &bytes) {
            accepted += 1;
            let mut time = 0.0;
            fmu.ok(fmu.fmi2GetRealStatus(2, &mut time));
            let all: Vec<u32> = (0..M::TABLE.len() as u32).collect();
            let mut statuses: Vec<_> = all.iter().map(|vr| fmu.fmi2GetReal(vr, 1, &mut 0.0)).collect();
            statuses.extend([
                fmu.try_step(time, 0.01),
                fmu.try_step(time + 0.01, 0.02),
                fmu.fmi2GetRealOutputDerivatives(&1, 1, &1, &mut 0.0),
            ]);
            assert!(!statuses.contains(&Status::Fatal), "{:?}\n{bytes:?}", fmu.take_log());
        }
        fmu.take_log();
    }
    fmu.restore(&original);
    fmu.step(0.0, 0.01);
    accepted
}

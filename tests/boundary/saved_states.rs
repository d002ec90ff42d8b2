//! Saved states (section 2.1.8): what they bring back, and what is refused.

use crate::exact::{Random, STATES};
use crate::modes::{INTERFACES, all_modes, enter_continuous_time, in_mode};
use crate::serialized::{GUID_HASH, INTERFACE, MODE, TIME, VERSION, fnv1a, sealed, with, with_mode};
use crate::support::{Fmu, Status};
use fmi2_export::Interface::{CoSimulation, ModelExchange};
use fmi2_export::call_table::Mode::*;
use prw_testbed::variables::{VARIABLES, vr};
use std::ops::Range;
use std::ptr::{null, null_mut};

/// Where the motor rates of a run come from.
#[derive(Clone, Copy, Debug)]
enum Rates {
    Samples,
    Omega,
    Derivatives,
}

/// Every Real variable to the last bit.
fn observe(fmu: &Fmu) -> Vec<u64> {
    let vr: Vec<u32> = (0..vr::M).collect();
    assert_eq!(VARIABLES[vr.len()].name(), "M", "all before are Real");
    let mut values = vec![0.0; vr.len()];
    fmu.ok(fmu.fmi2GetReal(vr.as_ptr(), vr.len(), values.as_mut_ptr()));
    values.into_iter().map(f64::to_bits).collect()
}

/// A Co-Simulation run with uneven steps, from any step to any other.
struct Run {
    rates: Rates,
    points: Vec<f64>,
}

impl Run {
    const STEPS: usize = 24;

    fn new(rates: Rates) -> Self {
        let mut random = Random(7);
        let mut points = vec![0.25];
        for i in 0..Self::STEPS {
            points.push(points[i] + random.between(0.001, 0.03));
        }
        Self { rates, points }
    }

    fn start(&self) -> Fmu {
        let fmu = Fmu::new(CoSimulation);
        fmu.ok(fmu.fmi2SetBoolean(&vr::use_omega, 1, &matches!(self.rates, Rates::Omega).into()));
        fmu.set(&[vr::theta5, vr::k2], &[0.1, 50.0]);
        fmu.initialize(self.points[0]);
        fmu
    }

    fn set_inputs(&self, fmu: &Fmu, i: usize) {
        let t = self.points[i];
        fmu.set(
            &[vr::theta1, vr::theta2, vr::omega1, vr::omega2],
            &[(3.0 * t).sin(), (5.0 * t).cos(), 3.0 * (3.0 * t).cos(), -5.0 * (5.0 * t).sin()],
        );
        if let Rates::Derivatives = self.rates {
            fmu.set_rates([vr::theta1, vr::theta2], [2.0 - t, 3.0 * t]);
        }
    }

    fn step(&self, fmu: &Fmu, i: usize) {
        fmu.step(self.points[i], self.points[i + 1] - self.points[i]);
    }

    /// From step to step; what is seen on the way.
    fn go(&self, fmu: &Fmu, steps: Range<usize>) -> Vec<Vec<u64>> {
        steps
            .map(|i| {
                self.set_inputs(fmu, i);
                self.step(fmu, i);
                observe(fmu)
            })
            .collect()
    }
}

const ALL_RATES: [Rates; 3] = [Rates::Samples, Rates::Omega, Rates::Derivatives];

#[test]
fn replay_is_bit_identical() {
    for rates in ALL_RATES {
        let run = Run::new(rates);
        for saved_at in [0, 1, 2, 3, 11] {
            let fmu = run.start();
            run.go(&fmu, 0..saved_at);
            let (state, bytes) = (fmu.save(), fmu.bytes());
            let expected = run.go(&fmu, saved_at..Run::STEPS);

            fmu.ok(fmu.fmi2SetFMUstate(state));
            assert_eq!(run.go(&fmu, saved_at..Run::STEPS), expected, "{rates:?} from {saved_at}");
            fmu.ok(fmu.fmi2SetFMUstate(state)); // "The FMUstate copy still exists."
            assert_eq!(fmu.bytes(), bytes);
            fmu.ok(fmu.fmi2Reset());
            fmu.restore(&bytes);
            assert_eq!(run.go(&fmu, saved_at..Run::STEPS), expected, "{rates:?} from {saved_at}, serialized");

            // Another instance, even one that was never initialized, takes the state.
            let other = Fmu::new(CoSimulation);
            other.ok(other.fmi2SetFMUstate(state));
            assert_eq!(
                run.go(&other, saved_at..Run::STEPS),
                expected,
                "{rates:?} from {saved_at}, elsewhere"
            );
            other.forget(state);
        }
    }
}

/// Inputs and their derivatives that wait for the step belong to the state.
#[test]
fn state_between_inputs_and_step() {
    for rates in ALL_RATES {
        let run = Run::new(rates);
        let (fmu, other) = (run.start(), Fmu::new(CoSimulation));
        run.go(&fmu, 0..5);
        run.set_inputs(&fmu, 5);
        other.restore(&fmu.bytes());
        assert_eq!(observe(&other), observe(&fmu), "{rates:?}");
        run.step(&fmu, 5);
        run.step(&other, 5);
        assert_eq!(observe(&other), observe(&fmu), "{rates:?}");
    }
}

/// fmi2Reset leaves nothing of a run behind (section 2.1.6).
#[test]
fn reset_is_a_new_beginning() {
    for (interface, mode) in all_modes() {
        let fmu = in_mode(interface, Initialization);
        fmu.set(&[vr::theta1, vr::theta3, vr::k1], &[0.1, 0.2, 99.0]);
        fmu.ok(fmu.fmi2SetBoolean(&vr::use_omega, 1, &1));
        fmu.restore(&with(with_mode(fmu.bytes(), mode), TIME, &5.0_f64.to_le_bytes()));
        fmu.ok(fmu.fmi2Reset());
        assert_eq!(fmu.bytes(), Fmu::new(interface).bytes(), "from {mode} of {interface}");
    }
}

#[test]
fn replay_in_model_exchange() {
    let fmu = in_mode(ModelExchange, ContinuousTime);
    let go = || {
        let mut x = [0.0; 6];
        let mut seen = Vec::new();
        for i in 0..10 {
            let t = 0.1 * f64::from(i);
            fmu.ok(fmu.fmi2SetTime(t));
            fmu.set(&[vr::theta1, vr::omega2], &[t.sin(), t.cos()]);
            fmu.ok(fmu.fmi2GetContinuousStates(x.as_mut_ptr(), 6));
            let mut rates = [0.0; 6];
            fmu.ok(fmu.fmi2GetDerivatives(rates.as_mut_ptr(), 6));
            x = std::array::from_fn(|i| x[i] + 0.001 * rates[i]);
            fmu.ok(fmu.fmi2SetContinuousStates(x.as_ptr(), 6));
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

/// Every state brings its mode, its time and its stop time back, also from a mode to an earlier one.
#[test]
fn every_mode_comes_back() {
    for (interface, mode) in all_modes() {
        let bytes = in_mode(interface, mode).bytes();
        let fmu = Fmu::new(interface);
        fmu.restore(&bytes);
        assert_eq!(fmu.bytes(), bytes, "{mode} of {interface}");
    }
    let fmu = Fmu::new(CoSimulation);
    fmu.enter_initialization(2.0, Some(3.0));
    let bytes = fmu.bytes();
    fmu.ok(fmu.fmi2Reset());
    fmu.restore(&bytes);
    fmu.ok(fmu.fmi2ExitInitializationMode());
    fmu.step(2.0, 0.5);
    fmu.refused("past the stop time", |fmu| fmu.try_step(2.5, 0.6));
}

#[test]
fn handles_are_reused() {
    let run = Run::new(Rates::Samples);
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

/// A saved state outlives the instance it came from and can be freed through another.
#[test]
fn states_outlive_instances() {
    let run = Run::new(Rates::Samples);
    let fmu = run.start();
    run.go(&fmu, 0..3);
    let (state, expected) = (fmu.save(), observe(&fmu));
    drop(fmu);
    let other = Fmu::new(CoSimulation);
    other.ok(other.fmi2SetFMUstate(state));
    assert_eq!(observe(&other), expected);
    other.forget(state);
}

#[test]
fn null_handles_and_arrays() {
    for interface in INTERFACES {
        let fmu = Fmu::new(interface);
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
    let fmu = in_mode(CoSimulation, StepComplete);
    let (state, size) = (fmu.save(), fmu.bytes().len());
    for wrong in [0, 1, size - 1, size + 1] {
        let mut buffer = vec![0x55; size + 1];
        let message = fmu
            .refused("wrong size", |fmu| fmu.fmi2SerializeFMUstate(state, buffer.as_mut_ptr().cast(), wrong));
        assert!(message.contains(&size.to_string()), "{message}");
        assert!(buffer.iter().all(|byte| *byte == 0x55), "nothing is written");
    }
    fmu.forget(state);
}

#[test]
fn states_of_the_other_interface_type() {
    let (slave, model) = (in_mode(CoSimulation, Instantiated), in_mode(ModelExchange, Instantiated));
    for (from, to) in [(&slave, &model), (&model, &slave)] {
        let (state, bytes) = (from.save(), from.bytes());
        let message = to.refused("set", |fmu| fmu.fmi2SetFMUstate(state));
        assert!(message.contains("Co-Simulation") && message.contains("Model Exchange"), "{message}");
        let message = refused_bytes(to, &bytes);
        assert!(message.contains("interface type"), "{message}");
        from.forget(state);
    }
}

/// De-serializing these bytes is refused, and a state that the handle holds stays; returns the message.
#[track_caller]
fn refused_bytes(fmu: &Fmu, bytes: &[u8]) -> String {
    let mut state = null_mut();
    let message = fmu.refused("hostile bytes", |fmu| {
        fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut state)
    });
    assert!(state.is_null());
    assert!(message.starts_with("fmi2DeSerializeFMUstate: "), "{message}");
    message
}

#[test]
fn no_changed_byte_goes_unseen() {
    for (interface, mode) in [(CoSimulation, StepComplete), (ModelExchange, ContinuousTime)] {
        let fmu = in_mode(interface, mode);
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
    let fmu = in_mode(CoSimulation, StepComplete);
    let bytes = fmu.bytes();
    for length in 0..bytes.len() {
        refused_bytes(&fmu, &bytes[..length]);
    }
    for more in 1..20 {
        refused_bytes(&fmu, &[bytes.as_slice(), &vec![0; more]].concat());
    }
}

#[test]
fn messages_say_where_a_state_comes_from() {
    let fmu = in_mode(CoSimulation, StepComplete);
    let bytes = fmu.bytes();
    assert_eq!(sealed(bytes.clone()), bytes, "the layout is as this test believes");
    assert_eq!(bytes[GUID_HASH], fnv1a(crate::GUID_TEXT.as_bytes()));
    assert_eq!(bytes[TIME], 0.0_f64.to_le_bytes());

    let other_fmu = with(bytes.clone(), GUID_HASH, &fnv1a(b"{another-guid}"));
    assert!(refused_bytes(&fmu, &other_fmu).contains("another FMU"));
    let other_version = with(bytes.clone(), VERSION..VERSION + 1, b"2");
    assert!(refused_bytes(&fmu, &other_version).contains("version"));
    let other_interface = with(bytes.clone(), INTERFACE..INTERFACE + 1, &[ModelExchange as u8]);
    assert!(refused_bytes(&fmu, &other_interface).contains("interface type"));
    assert!(refused_bytes(&fmu, b"something else").contains("no saved state"));
    let cut = &bytes[..bytes.len() - 30];
    assert!(refused_bytes(&fmu, cut).contains("length"));
}

/// A right checksum around wrong contents.
#[test]
fn impossible_contents() {
    let fmu = in_mode(CoSimulation, StepComplete);
    let bytes = fmu.bytes();
    for mode in [Event, ContinuousTime, Fatal] {
        refused_bytes(&fmu, &with_mode(bytes.clone(), mode));
    }
    for mode in [0, 3, -1, i32::MAX] {
        refused_bytes(&fmu, &with(bytes.clone(), MODE, &i32::to_le_bytes(mode)));
    }
    for number in [f64::NAN, f64::INFINITY] {
        refused_bytes(&fmu, &with(bytes.clone(), TIME, &number.to_le_bytes()));
    }
    // The first parameter, J2, after mode, time, start time, and the stop time that may be missing.
    let j2 = 46..54;
    assert_eq!(bytes[j2.clone()], prw_testbed::Parameters::BUILT_IN.J2.to_le_bytes());
    let message = refused_bytes(&fmu, &with(bytes.clone(), j2, &(-1.0_f64).to_le_bytes()));
    assert!(message.contains("J2"), "{message}");
}

/// The number of samples, after parameters and states: whatever it is, the next step is not fatal.
#[test]
fn impossible_number_of_samples() {
    let fmu = in_mode(CoSimulation, StepComplete);
    fmu.step(0.0, 0.125);
    fmu.step(0.125, 0.125);
    let bytes = fmu.bytes();
    assert_eq!(bytes[SAMPLES], 2_i32.to_le_bytes());
    for count in [-1, i32::MIN, 3, i32::MAX] {
        let bytes = with(bytes.clone(), SAMPLES, &count.to_le_bytes());
        let mut state = null_mut();
        if fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut state) == Status::Ok {
            fmu.ok(fmu.fmi2SetFMUstate(state));
            assert_ne!(fmu.try_step(0.25, 0.25), Status::Fatal, "{count}: {:?}", fmu.take_log());
            fmu.forget(state);
        }
    }
}

const SAMPLES: Range<usize> = 167..171;

/// Whatever passes for a state, the instance survives it: no call is fatal.
#[test]
fn random_contents_break_nothing() {
    let fmu = in_mode(CoSimulation, StepComplete);
    let original = fmu.bytes();
    let mut random = Random(11);
    let mut accepted = 0;
    for _ in 0..5_000 {
        let mut bytes = original.clone();
        for _ in 0..=random.bits() % 3 {
            // Odd numbers of every size, in the places where numbers begin and in others.
            let at = MODE.end + random.bits() as usize % (bytes.len() - MODE.end - 16);
            let word = random.bits() >> (random.bits() % 64);
            let width = if random.between(0.0, 1.0) < 0.5 { 4 } else { 8 };
            bytes[at..at + width].copy_from_slice(&word.to_le_bytes()[..width]);
        }
        let bytes = sealed(bytes);
        let mut state = null_mut();
        if fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut state) == Status::Ok {
            accepted += 1;
            fmu.ok(fmu.fmi2SetFMUstate(state));
            let (mut time, mut values) = (0.0, [0.0; 6]);
            fmu.ok(fmu.fmi2GetRealStatus(2, &mut time));
            for status in [
                fmu.fmi2GetReal(STATES.as_ptr(), 6, values.as_mut_ptr()),
                fmu.try_step(time, 0.01),
                fmu.try_step(time + 0.01, 0.02),
                fmu.fmi2GetRealOutputDerivatives(&vr::tau1, 1, &1, values.as_mut_ptr()),
            ] {
                assert_ne!(status, Status::Fatal, "{:?}\n{bytes:?}", fmu.take_log());
            }
            fmu.forget(state);
        }
        fmu.take_log();
    }
    assert!(accepted > 500, "only {accepted} were tried");
    fmu.restore(&original);
    fmu.step(0.0, 0.01);
}

/// Between modes of one simulation, too: a state from the initialization can be set while running.
#[test]
fn back_to_the_initialization() {
    let fmu = in_mode(ModelExchange, Initialization);
    let state = fmu.save();
    for _ in 0..3 {
        fmu.ok(fmu.fmi2ExitInitializationMode());
        enter_continuous_time(&fmu);
        fmu.ok(fmu.fmi2SetFMUstate(state));
    }
    fmu.forget(state);
}

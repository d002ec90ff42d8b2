//! Saved states (section 2.1.8): what they bring back, and what is refused.

use crate::exact::{Random, STATES, start_at};
use crate::modes::{all_modes, in_mode};
use crate::serialized::place_of;
use crate::{TABLE, new, vr};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::Status;
use fmu_test_kit::serialized::{MODE, TIME, sealed, with, with_mode};
use fmu_test_kit::{Importer as Fmu, fmi3};
use prw_testbed::TestbedFmu;
use prw_testbed::variables::Name;
use std::ops::Range;
use std::ptr::null_mut;

/// Where the motor rates of a run come from.
#[derive(Clone, Copy, Debug)]
enum Rates {
    Samples,
    Omega,
    Derivatives,
}

/// Every Real variable to the last bit.
fn observe(fmu: &Fmu) -> Vec<u64> {
    let vr: Vec<u32> = (0..vr(Name::M)).collect();
    assert_eq!(TABLE[vr.len()].name(), "M", "all before are Real");
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
        let fmu = new(CoSimulation);
        fmu.ok(fmu.fmi2SetBoolean(&vr(Name::use_omega), 1, &matches!(self.rates, Rates::Omega).into()));
        start_at(&fmu, [0.0, 0.0, 0.1, 0.0, 0.0, 0.0]);
        fmu.set(&[vr(Name::k2)], &[50.0]);
        fmu.initialize(self.points[0]);
        fmu
    }

    fn set_inputs(&self, fmu: &Fmu, i: usize) {
        let t = self.points[i];
        fmu.set(
            &[vr(Name::theta1), vr(Name::theta2), vr(Name::omega1), vr(Name::omega2)],
            &[(3.0 * t).sin(), (5.0 * t).cos(), 3.0 * (3.0 * t).cos(), -5.0 * (5.0 * t).sin()],
        );
        if let Rates::Derivatives = self.rates {
            fmu.set_rates([vr(Name::theta1), vr(Name::theta2)], [2.0 - t, 3.0 * t]);
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

            // Another instance, even one that was never initialized, takes the bytes.
            let other = new(CoSimulation);
            other.restore(&bytes);
            assert_eq!(
                run.go(&other, saved_at..Run::STEPS),
                expected,
                "{rates:?} from {saved_at}, elsewhere"
            );
            fmu.forget(state);
        }
    }
}

/// Inputs and their derivatives that wait for the step belong to the state.
#[test]
fn state_between_inputs_and_step() {
    for rates in ALL_RATES {
        let run = Run::new(rates);
        let (fmu, other) = (run.start(), new(CoSimulation));
        run.go(&fmu, 0..5);
        run.set_inputs(&fmu, 5);
        other.restore(&fmu.bytes());
        assert_eq!(observe(&other), observe(&fmu), "{rates:?}");
        run.step(&fmu, 5);
        run.step(&other, 5);
        assert_eq!(observe(&other), observe(&fmu), "{rates:?}");
    }
}

/// What was read before the state was saved is read again, whatever was calculated in between.
#[test]
fn values_come_back() {
    let run = Run::new(Rates::Samples);
    let fmu = run.start();
    run.go(&fmu, 0..3);
    let mut state = fmu.save();
    for i in 3..6 {
        run.go(&fmu, i..i + 1);
        let expected = observe(&fmu);
        fmu.ok(fmu.fmi2GetFMUstate(&mut state));
        run.go(&fmu, i + 1..i + 3);
        fmu.ok(fmu.fmi2SetFMUstate(state));
        assert_eq!(observe(&fmu), expected, "after step {i}");
    }
    fmu.forget(state);
}

/// fmi2Reset leaves nothing of a run behind (section 2.1.6).
#[test]
fn reset_is_a_new_beginning() {
    for (interface, mode) in all_modes() {
        let fmu = in_mode(interface, Initialization);
        fmu.set(&[vr(Name::theta1), vr(Name::k1)], &[0.1, 99.0]);
        start_at(&fmu, [0.2; 6]);
        fmu.ok(fmu.fmi2SetBoolean(&vr(Name::use_omega), 1, &1));
        fmu.restore(&with(with_mode(fmu.bytes(), mode), TIME, &5.0_f64.to_le_bytes()));
        fmu.ok(fmu.fmi2Reset());
        assert_eq!(fmu.bytes(), new(interface).bytes(), "from {mode} of {interface}");
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
            fmu.set(&[vr(Name::theta1), vr(Name::omega2)], &[t.sin(), t.cos()]);
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
        let fmu = new(interface);
        fmu.restore(&bytes);
        assert_eq!(fmu.bytes(), bytes, "{mode} of {interface}");
    }
    let fmu = new(CoSimulation);
    fmu.enter_initialization(2.0, Some(3.0));
    let bytes = fmu.bytes();
    fmu.ok(fmu.fmi2Reset());
    fmu.restore(&bytes);
    fmu.ok(fmu.fmi2ExitInitializationMode());
    fmu.step(2.0, 0.5);
    fmu.refused("past the stop time", |fmu| fmu.try_step(2.5, 0.6));
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

/// One library serves both standards; a state stays within its own.
#[test]
fn states_of_the_other_standard() {
    let (old, new) = (in_mode(CoSimulation, StepComplete), fmi3::Importer::of::<TestbedFmu>(CoSimulation));
    new.initialize(0.0);
    let message = refused_bytes(&old, &new.bytes());
    assert!(message.contains("comes from Co-Simulation of FMI 3.0"), "{message}");
    let (bytes, mut state) = (old.bytes(), null_mut());
    let message = new.refused("bytes of FMI 2.0", |fmu| {
        fmu.fmi3DeserializeFMUState(bytes.as_ptr(), bytes.len(), &mut state)
    });
    assert!(message.contains("comes from Co-Simulation of FMI 2.0"), "{message}");
    // A handle is its instance's alone.
    let message = old.refused("a handle of another instance", |fmu| fmu.fmi2SetFMUstate(new.save()));
    assert!(message.contains("no state of this instance"), "{message}");
}

/// A right checksum around parameters that make no testbed.
#[test]
fn impossible_parameters() {
    let fmu = in_mode(CoSimulation, StepComplete);
    let bytes = fmu.bytes();
    let j2 = place_of(vr(Name::J2));
    assert_eq!(bytes[j2.clone()], prw_testbed::Parameters::BUILT_IN.J2.to_le_bytes());
    let message = refused_bytes(&fmu, &with(bytes, j2, &(-1.0_f64).to_le_bytes()));
    assert!(message.contains("J2"), "{message}");
}

/// The number of samples comes first after the variables: what it cannot be is refused.
#[test]
fn impossible_number_of_samples() {
    let fmu = in_mode(CoSimulation, StepComplete);
    fmu.step(0.0, 0.125);
    fmu.step(0.125, 0.125);
    let (bytes, samples) = (fmu.bytes(), place_of(TABLE.len() as u32));
    assert_eq!(bytes[samples.clone()], 2_i64.to_le_bytes());
    for count in [-1, i64::from(i32::MIN), 3, i64::MAX] {
        refused_bytes(&fmu, &with(bytes.clone(), samples.clone(), &count.to_le_bytes()));
    }
    for step in [0.0, -0.125] {
        let last_step = samples.end..samples.end + 8;
        let message = refused_bytes(&fmu, &with(bytes.clone(), last_step, &f64::to_le_bytes(step)));
        assert!(message.contains("samples"), "{message}");
    }
}

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
                fmu.fmi2GetRealOutputDerivatives(&vr(Name::tau1), 1, &1, values.as_mut_ptr()),
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

//! Checks of saved states (section 2.1.8 of FMI 2.0, 2.2.7.4 of FMI 3.0), events and steps.

use super::*;
use crate::Random;
use crate::serialized::{MODE, TIME, sealed, time, with, with_mode};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::{BaseType, Status};
use std::ptr::null_mut;

/// Checks that a run repeats bit-identically from a saved state, also from its bytes and in another instance.
pub fn replay_is_bit_identical<F: Either, M: Exported>() {
    for run in Run::all() {
        for saved_at in [0, 1, 2, 3, 11] {
            let fmu: F = run.start::<F, M>();
            run.go::<M>(&fmu, 0..saved_at);
            let (state, bytes) = (fmu.save(), fmu.bytes());
            let expected = run.go::<M>(&fmu, saved_at..Run::STEPS);

            fmu.ok(fmu.set_state(state));
            assert_eq!(run.go::<M>(&fmu, saved_at..Run::STEPS), expected, "from {saved_at}");
            fmu.ok(fmu.set_state(state)); // "The FMUstate copy still exists."
            assert_eq!(fmu.bytes(), bytes);
            fmu.ok(fmu.reset());
            fmu.restore(&bytes);
            assert_eq!(run.go::<M>(&fmu, saved_at..Run::STEPS), expected, "from {saved_at}, serialized");

            // Another instance accepts the bytes, even if it was never initialized.
            let other = F::in_mode::<M>(CoSimulation, Instantiated);
            other.restore(&bytes);
            assert_eq!(run.go::<M>(&other, saved_at..Run::STEPS), expected, "from {saved_at}, elsewhere");
            fmu.forget(state);
        }
    }
}

/// Checks that a state includes inputs and their derivatives that have been set for the next step.
pub fn state_between_inputs_and_step<F: Either, M: Exported>() {
    for run in Run::all() {
        let (fmu, other) = (run.start::<F, M>(), F::in_mode::<M>(CoSimulation, Instantiated));
        run.go::<M>(&fmu, 0..5);
        run.set_inputs::<M>(&fmu, 5);
        other.restore(&fmu.bytes());
        assert_eq!(observe::<M>(&other), observe::<M>(&fmu));
        [&fmu, &other].iter().for_each(|fmu| run.step(*fmu, 5));
        assert_eq!(observe::<M>(&other), observe::<M>(&fmu));
    }
}

/// Restores serialized states in any order, as Simulink does with its operating points.
pub fn stepping_back_in_any_order<F: Either, M: Exported>() {
    let [run, ..] = Run::all();
    let fmu = run.start::<F, M>();
    let (mut saved, mut seen) = (Vec::new(), Vec::new());
    for i in 0..20 {
        saved.push(fmu.bytes());
        seen.extend(run.go::<M>(&fmu, i..i + 1));
    }
    for i in [15, 3, 19, 0, 8] {
        fmu.restore(&saved[i]);
        assert_eq!(run.go::<M>(&fmu, i..i + 1), seen[i..i + 1]);
    }
}

/// Checks that a restored state gives the values read before it was saved, after any calculations in between.
pub fn values_come_back<F: Either, M: Exported>() {
    let [_, run, _] = Run::all();
    let fmu = run.start::<F, M>();
    run.go::<M>(&fmu, 0..3);
    let mut state = fmu.save();
    for i in 3..6 {
        run.go::<M>(&fmu, i..i + 1);
        let expected = observe::<M>(&fmu);
        fmu.ok(fmu.get_state(&mut state));
        run.go::<M>(&fmu, i + 1..i + 3);
        fmu.ok(fmu.set_state(state));
        assert_eq!(observe::<M>(&fmu), expected, "after step {i}");
    }
    fmu.forget(state);
}

/// Checks that a reset restores all values (section 2.1.6 of FMI 2.0).
pub fn reset_is_a_new_beginning<F: Either, M: Exported>() {
    for (interface, mode) in modes_of_model::<F, M>() {
        let fmu = F::in_mode::<M>(interface, Initialization);
        for (place, variable) in (0..).zip(M::TABLE) {
            match variable.base() {
                BaseType::Real => _ = fmu.try_set(&[place], &[0.75]),
                BaseType::String => _ = fmu.set_text(place, c"odd".as_ptr()),
                BaseType::Boolean => _ = fmu.set_boolean(place, 1),
                _ => _ = fmu.set_integer(place, 7),
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

/// Checks that a run in Model Exchange repeats bit-identically from a saved state; the mode is restored, too.
pub fn replay_in_model_exchange<F: Either, M: Exported>() {
    let fmu = F::in_mode::<M>(ModelExchange, ContinuousTime);
    let mut x = vec![0.0; M::STATES.len()];
    let mut rates = x.clone();
    let mut go = || {
        let step = |i| {
            let t = 0.1 * f64::from(i);
            fmu.ok(fmu.set_time(t));
            fmu.set(&inputs::<M>(), &signals::<M>(1.0 + t));
            fmu.ok(fmu.get_states(x.as_mut_ptr(), x.len()));
            fmu.ok(fmu.get_derivatives(rates.as_mut_ptr(), x.len()));
            x.iter_mut().zip(&rates).for_each(|(x, rate)| *x += 0.001 * rate);
            fmu.ok(fmu.set_states(x.as_ptr(), x.len()));
            observe::<M>(&fmu)
        };
        (0..10).map(step).collect::<Vec<_>>()
    };
    go();
    let (state, bytes) = (fmu.save(), fmu.bytes());
    let expected = go();
    fmu.ok(fmu.set_state(state));
    assert_eq!(go(), expected);
    fmu.ok(fmu.terminate());
    fmu.restore(&bytes);
    assert_eq!(go(), expected);
    fmu.forget(state);
}

/// Checks that every state restores its mode, time and stop time, even an earlier mode.
pub fn every_mode_comes_back<F: Either, M: Exported>() {
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
    fmu.refused("past the stop time", |fmu| fmu.try_step(2.5, 0.6));
}

/// Checks that bytes of a state are rejected in the other FMI version, because the state machines differ.
/// Also checks that a handle is valid only in its instance.
pub fn states_of_the_other_standard<F: Either, M: Exported>() {
    fn other<F: Either, O: Either, M: Exported>([from, to]: [&str; 2]) {
        for interface in [CoSimulation, ModelExchange] {
            let (fmu, other) =
                (F::in_mode::<M>(interface, Initialization), O::in_mode::<M>(interface, Initialization));
            let expected = format!(
                "the state comes from {interface} of {from}, this instance is {interface} of {to}; states stay within"
            );
            let message = fmu.refused_bytes(&other.bytes());
            assert!(message.contains(&expected), "{message}");
            let message = fmu.refused("a handle of another instance", |fmu| fmu.set_state(other.save()));
            assert!(message.contains("no state of this instance"), "{message}");
        }
    }
    if F::functions()[0].starts_with("fmi2") {
        other::<F, crate::fmi3::Importer, M>(["FMI 3.0", "FMI 2.0"]);
    } else {
        other::<F, crate::Importer, M>(["FMI 2.0", "FMI 3.0"]);
    }
}

/// Checks that any changed byte is detected and the state of the handle stays unchanged. Miri, which is slow,
/// changes one bit of each byte.
pub fn no_changed_byte_goes_unseen<F: Either, M: Exported>() {
    let changes = || 1..=if cfg!(miri) { 1 } else { u8::MAX };
    for (interface, mode) in [(CoSimulation, StepComplete), (ModelExchange, ContinuousTime)] {
        let fmu = F::in_mode::<M>(interface, mode);
        let mut bytes = fmu.bytes();
        let (mut state, handle) = (fmu.save(), fmu.save());
        fmu.take_log();
        for i in 0..bytes.len() {
            for change in changes() {
                bytes[i] ^= change;
                let status = fmu.deserialize(bytes.as_ptr(), bytes.len(), &mut state);
                assert_eq!(status, Status::Error, "byte {i} ^ {change:#x}");
                bytes[i] ^= change;
            }
        }
        assert_eq!(fmu.take_log().len(), changes().count() * bytes.len(), "each was reported");
        assert_eq!(fmu.bytes(), bytes);
        fmu.ok(fmu.set_state(state));
        assert_eq!(fmu.bytes(), bytes);
        [state, handle].iter().for_each(|state| fmu.forget(*state));
    }
}

/// Checks that no call is fatal after a damaged state that the FMU accepts. Miri, which is slow, tries fewer.
pub fn random_contents_break_nothing<F: Either, M: Exported>() {
    let accepted = survivors::<F, M>(11);
    assert!(accepted > DAMAGED / 10, "only {accepted} of {DAMAGED} were accepted");
}

/// Number of damaged states that are tried.
pub const DAMAGED: usize = if cfg!(miri) { 60 } else { 3_000 };

/// Returns the number of damaged states that the FMU accepts.
pub fn survivors<F: Either, M: Exported>(seed: u64) -> usize {
    let fmu = F::in_mode::<M>(CoSimulation, StepComplete);
    let original = fmu.bytes();
    let (mut random, mut accepted) = (Random(seed), 0);
    for _ in 0..DAMAGED {
        let mut bytes = original.clone();
        for _ in 0..=random.bits() % 3 {
            // Writes numbers of any magnitude, aligned with values or not.
            let at = MODE.end + random.bits() as usize % (bytes.len() - MODE.end - 16);
            let word = random.bits() >> (random.bits() % 64);
            let width = if random.between(0.0, 1.0) < 0.5 { 4 } else { 8 };
            bytes[at..at + width].copy_from_slice(&word.to_le_bytes()[..width]);
        }
        let (bytes, mut state) = (sealed(bytes), null_mut());
        if fmu.deserialize(bytes.as_ptr(), bytes.len(), &mut state) == Status::Ok {
            accepted += 1;
            fmu.ok(fmu.set_state(state));
            fmu.forget(state);
            let time = time(&fmu.bytes());
            let all = places::<M>(is_real);
            let mut statuses: Vec<_> = all.iter().map(|place| fmu.try_get(&[*place], &mut [0.0])).collect();
            statuses.extend([fmu.try_step(time, 0.01), fmu.try_step(time + 0.01, 0.02)]);
            assert!(!statuses.contains(&Status::Fatal), "{:?}\n{bytes:?}", fmu.take_log());
        }
        fmu.take_log();
    }
    fmu.restore(&original);
    fmu.step(0.0, 0.01);
    accepted
}

/// Checks that events of the importer, in any number, change nothing.
pub fn events_of_the_importer<F: Either, M: Exported>() {
    let fmu = F::in_mode::<M>(ModelExchange, ContinuousTime);
    assert_eq!(fmu.completed_step(), [false; 2]);
    for _ in 0..3 {
        fmu.ok(fmu.enter_event_mode());
        fmu.ok(fmu.enter_event_mode());
        assert_eq!([fmu.update(), fmu.enter_continuous_time()], [crate::Updated::default(); 2]);
    }
}

/// Checks that a step of any size returns quickly, because importers may take very long steps.
pub fn steps_of_any_size<F: Either, M: Exported>() {
    for step_size in [1e-300, 1e-9, 1.0, 1e9, 1e100, 1e300, 0.5 * f64::MAX] {
        let (answer, answers) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let fmu = F::in_mode::<M>(CoSimulation, StepComplete);
            let inputs = inputs::<M>();
            fmu.set(&inputs, &vec![0.5; inputs.len()]);
            let _ = answer.send((fmu.try_step(0.0, step_size), observe::<M>(&fmu)));
        });
        let answer = answers.recv_timeout(std::time::Duration::from_secs(10));
        let (status, _) = answer.unwrap_or_else(|_| panic!("a step of {step_size:e} s takes for ever"));
        assert!(matches!(status, Status::Ok | Status::Error), "{step_size:e}: {status:?}");
    }
}

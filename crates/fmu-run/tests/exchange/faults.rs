//! Runs of faulty models: errors name the cause and the time, discarded states shorten the step, a run can be cancelled, and
//! messages reach a listener.

use crate::{VERSIONS, close, opened, run, tight};
use fmu_run::{Batch, Error, Integration, Solver, Start, Watch};

/// A run that fails before its first step, without a message, leaves the other runs of the batch as they are.
#[test]
fn only_one_run_fails() {
    for standard in VERSIONS {
        let batch = Batch { start: vec![("p", Start::Each(&[1.0, 2.0, 3.0]))], ..Batch::default() };
        let runs = run(&opened("picky", standard), &[0.0, 1.0], batch);
        let [(1, why)] = &*runs.errors else { panic!("{:?}", runs.errors) };
        assert!(why.contains("GetNominalsOfContinuousStates returned Error without a message"), "{why}");
        assert_eq!((runs.trajectories[0], runs.trajectories[4]), (1.0, 1.0));
        assert!(runs.trajectories[2].is_nan());
        close(runs.trajectories[5], (-1.0_f64).exp(), 1e-6);
    }
}

/// Runs a model and returns the error of the run.
fn why(model: &str, standard: fmu_run::Standard, solver: Solver) -> String {
    let runs = run(
        &opened(model, standard),
        &[0.0, 0.25, 3.0],
        Batch { integration: tight(solver), ..Batch::default() },
    );
    assert_eq!(runs.errors.len(), 1, "{model}");
    runs.errors[0].1.clone()
}

#[test]
fn errors_name_cause_and_time() {
    for standard in VERSIONS {
        for solver in [Solver::Auto, Solver::Dopri5, Solver::Bdf, Solver::Rk4] {
            let of = |model| why(model, standard, solver);
            let nan = of("nan");
            // A fixed step, here from 0.25 s to 3 s, cannot be shortened, so the error occurs in its middle.
            let time = if solver == Solver::Rk4 { 1.625 } else { 0.5 };
            let expected = format!("Model Exchange: the derivative of state 1 is NaN at t = {time}");
            let reached = |why: &str| why.strip_prefix("at ")?.split_once(" s: ")?.0.parse::<f64>().ok();
            assert!(nan.contains(&expected), "{nan}");
            // The message begins with the time that the run has reached.
            let [first, last] = if solver == Solver::Rk4 { [0.25, 0.25] } else { [0.499, 0.5] };
            assert!(reached(&nan).is_some_and(|time| (first..=last).contains(&time)), "{nan}");
            let failing = of("failing");
            // The solver may evaluate the FMU far beyond the reached time when it tries a step.
            let is_early = reached(&failing).is_some_and(|time| time < 0.5);
            assert!(is_early && failing.ends_with("the valve is stuck"), "{failing}");
            let endless = of("endless");
            assert!(endless.ends_with("the event does not end within 10000 iterations"), "{endless}");
            let announce = of("announce");
            assert!(
                announce.ends_with("the FMU announces events without end, the next one for t = 0.5 s: 1000 events from t = 0.5 s to t = 0.5 s"),
                "{announce}"
            );
            assert!(of("nowhere").ends_with("the time of the next event is NaN"));
            let relay = of("relay");
            assert!(
                relay.contains("event indicator 1 changes its sign again and again: 1000 events from t = 1"),
                "{relay}"
            );
        }
        let zeno = why("zeno", standard, Solver::Auto);
        assert!(
            zeno.contains("event indicator 1 changes its sign again and again: 1000 events from t = 2.55"),
            "{zeno}"
        );
    }
}

#[test]
fn a_discarded_state_shortens_the_step() {
    for standard in VERSIONS {
        for solver in [Solver::Auto, Solver::Dopri5, Solver::Bdf] {
            let runs = run(
                &opened("root", standard),
                &[0.0, 1.0, 1.9],
                Batch { integration: tight(solver), ..Batch::default() },
            );
            assert_eq!(runs.errors, []);
            close(runs.trajectories[2], 0.05 * 0.05, 1e-7);
        }
    }
}

/// Checks that a run can be cancelled. Otherwise the explicit method would need years for this stiff model.
#[test]
fn a_run_can_be_cancelled() {
    for standard in VERSIONS {
        let watch = Watch::pulsing(Watch::cancel);
        let batch = Batch {
            time: &[0.0, 1e12],
            start: vec![("p", Start::Same(1000.0))],
            outputs: vec!["y"],
            every: Some(1),
            integration: Integration { solver: Solver::Dopri5, ..Integration::default() },
            ..Batch::default()
        };
        assert_eq!(opened("vanderpol", standard).run(&batch, &watch).unwrap_err(), Error::Cancelled);
    }
}

#[test]
fn messages_reach_a_listener() {
    for standard in VERSIONS {
        let watch = Watch::listening();
        let batch = Batch {
            time: &[0.0, 1.0],
            start: vec![("p", Start::Each(&[1.0, 2.0]))],
            outputs: vec!["y"],
            every: Some(1),
            ..Batch::default()
        };
        opened("failing", standard).run(&batch, &watch).unwrap();
        let mut heard: Vec<_> =
            watch.take_messages().into_iter().map(|of| (of.index, of.message.text)).collect();
        heard.sort();
        let text = "the valve is stuck".to_owned();
        assert_eq!(heard, [(Some(0), text.clone()), (Some(1), text)]);
    }
}

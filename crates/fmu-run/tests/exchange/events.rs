//! Events at event indicators, at known times and after steps, and the end of the simulation.

use crate::{SOLVERS, VERSIONS, close, opened, run, tight, times};
use fmu_run::{Batch, Integration, Solver, Start, Trajectory, Watch};

/// Returns the times, s, of the first `count` hits of a ball that falls from 1 m.
fn hits(restitution: f64, count: usize) -> Vec<f64> {
    let mut time = (2.0 / 9.81_f64).sqrt();
    let mut flight = 2.0 * time;
    (0..count)
        .map(|_| {
            let now = time;
            flight *= restitution;
            time += flight;
            now
        })
        .collect()
}

/// Returns the height of the ball, m, at this time, s.
fn height(time: f64, restitution: f64) -> f64 {
    let all = hits(restitution, 20);
    let Some(last) = all.iter().rposition(|hit| *hit <= time) else { return 1.0 - 0.5 * 9.81 * time * time };
    let (speed, since) = (9.81 * all[0] * restitution.powi(last as i32 + 1), time - all[last]);
    speed * since - 0.5 * 9.81 * since * since
}

#[test]
fn a_ball_hits_the_ground_at_the_right_times() {
    for standard in VERSIONS {
        let fmu = opened("ball", standard);
        for solver in SOLVERS {
            for count in [1, 40] {
                let (time, factors) = (times(2.0, count), [0.7, 0.5]);
                let batch = Batch {
                    start: vec![("p", Start::Each(&factors))],
                    integration: Integration { solver, rtol: Some(1e-11), ..Integration::default() },
                    events: true,
                    ..Batch::default()
                };
                let end = if count == 1 { 1.2 } else { 2.0 };
                let time: Vec<_> = time.iter().map(|time| time * end / 2.0).collect();
                let runs = run(&fmu, &time, batch);
                assert_eq!(runs.errors.iter().filter(|(run, _)| *run == 0).count(), 0, "{:?}", runs.errors);
                let found: Vec<_> =
                    runs.events.iter().filter(|event| event.run == 0).map(|event| event.time).collect();
                let mut expected = hits(0.7, 20);
                expected.retain(|hit| *hit < end);
                // The height after a hit is slightly negative, so there may be a second event when the ball rises through 0.
                let mut merged: Vec<f64> = Vec::new();
                for time in found {
                    if merged.last().is_none_or(|last| time - last > 1e-6) {
                        merged.push(time);
                    }
                }
                assert_eq!(merged.len(), expected.len(), "{standard} {solver:?} {merged:?} {expected:?}");
                merged.iter().zip(&expected).for_each(|(found, expected)| close(*found, *expected, 1e-9));
                for (k, time) in time.iter().enumerate() {
                    close(runs.trajectories[k], height(*time, 0.7), 1e-7);
                }
            }
        }
    }
}

#[test]
fn events_at_known_times_are_exact() {
    for standard in VERSIONS {
        let fmu = opened("stair", standard);
        let time = [0.0, 0.5, 1.0, 2.5, 3.0, 9.75];
        let batch =
            Batch { time: &time, outputs: vec!["hits"], every: Some(1), events: true, ..Batch::default() };
        let runs = fmu.run(&batch, &Watch::default()).unwrap();
        assert_eq!(runs.trajectories, [0.0, 0.0, 1.0, 2.0, 3.0, 9.0], "values after the events");
        let events: Vec<_> =
            runs.events.iter().map(|event| (event.time, event.before[0], event.after[0])).collect();
        assert_eq!(events, (1..10).map(f64::from).map(|k| (k, k - 1.0, k)).collect::<Vec<_>>());
    }
}

#[test]
fn the_fmu_ends_the_run() {
    for standard in VERSIONS {
        let watch = Watch::default();
        let fmu = opened("stair", standard);
        let time = times(3.0, 12);
        let batch = Batch {
            time: &time,
            start: vec![("p", Start::Each(&[2.0, 3.0, 4.0]))],
            outputs: vec!["hits"],
            every: Some(1),
            ..Batch::default()
        };
        let runs = fmu.run(&batch, &watch).unwrap();
        assert_eq!(runs.errors, [(0, "ended by the FMU at t = 2 s".to_owned())]);
        assert_eq!(runs.notes, [(1, "ended by the FMU at t = 3 s".to_owned())]);
        assert_eq!(watch.ended(), [(0, 2.0, vec![2.0]), (1, 3.0, vec![3.0])]);
        assert_eq!((runs.trajectories[8], runs.trajectories[13 + 12]), (2.0, 3.0));
        assert!(runs.trajectories[9].is_nan());
        let watch = Watch::default();
        let runs = opened("ending", standard)
            .run(
                &Batch {
                    time: &[0.0, 1.0],
                    outputs: vec!["y"],
                    every: Some(1),
                    integration: tight(Solver::Auto),
                    ..Batch::default()
                },
                &watch,
            )
            .unwrap();
        assert!(runs.errors[0].1.starts_with("ended by the FMU at t = 0.693147180"), "{:?}", runs.errors);
        close(watch.ended()[0].1, std::f64::consts::LN_2, 1e-9);
    }
}

#[test]
fn an_event_after_a_step_may_choose_other_states() {
    for standard in VERSIONS {
        let fmu = opened("swap", standard);
        let time = times(2.0, 20);
        let batch = Batch { integration: tight(Solver::Auto), events: true, ..Batch::default() };
        let runs = run(&fmu, &time, batch);
        assert_eq!((runs.errors.len(), runs.events.len()), (0, 1));
        for (k, time) in time.iter().enumerate() {
            close(runs.trajectories[k], time.exp(), 1e-7);
        }
    }
}

/// An FMU that requests an event after each step is integrated with the same steps as an FMU that does not.
#[test]
fn events_after_each_step_do_not_shorten_the_steps() {
    let time = times(2.0, 4);
    for standard in VERSIONS {
        for (solver, rate) in
            SOLVERS.into_iter().chain([Solver::Rk4]).flat_map(|of| [(of, 1.0), (of, 1000.0)])
        {
            if solver == Solver::Rk4 && rate > 1.0 {
                continue;
            }
            let of = |model, events| {
                let batch = Batch {
                    start: vec![("p", Start::Same(rate))],
                    integration: Integration { max_step: Some(0.1), ..tight(solver) },
                    events,
                    ..Batch::default()
                };
                let runs = run(&opened(model, standard), &time, batch);
                assert_eq!(runs.errors, []);
                runs
            };
            let (steady, plain) = (of("steady", true), of("dahlquist", false));
            for ((found, same), time) in steady.trajectories.iter().zip(&plain.trajectories).zip(&time) {
                close(*found, (-rate * time).exp(), if solver == Solver::Rk4 { 1e-6 } else { 1e-7 });
                close(*found, *same, 1e-8);
            }
            assert!(steady.events.len() < 5000, "{} events", steady.events.len());
        }
    }
}

#[test]
fn derivatives_may_change_at_an_event_after_a_step() {
    let time = times(2.0, 20);
    for standard in VERSIONS {
        for solver in SOLVERS {
            let batch = Batch { integration: tight(solver), events: true, ..Batch::default() };
            let runs = run(&opened("turn", standard), &time, batch);
            assert_eq!((runs.errors.len(), runs.events.len()), (0, 1), "{solver:?}");
            let turn = runs.events[0].time;
            for (found, time) in runs.trajectories.iter().zip(&time) {
                close(*found, 1.0 + turn - (time - turn).abs(), 1e-8);
            }
        }
    }
}

#[test]
fn outputs_are_up_to_date_whether_the_fmu_calculates_them_with_the_derivatives_or_only_without() {
    let time = times(1.0, 500);
    for standard in VERSIONS {
        for (model, solver) in ["stale", "flagged"]
            .into_iter()
            .flat_map(|model| SOLVERS.into_iter().chain([Solver::Rk4]).map(move |solver| (model, solver)))
        {
            let batch = Batch { integration: tight(solver), ..Batch::default() };
            let runs = run(&opened(model, standard), &time, batch);
            runs.trajectories.iter().zip(&time).for_each(|(found, time)| close(*found, (-time).exp(), 1e-7));
        }
    }
}

/// An event that is announced for the time of the event before belongs to it: no value between them is shown.
#[test]
fn two_events_at_one_time() {
    for standard in VERSIONS {
        for time in [[0.0, 0.25, 0.5], [0.0, 0.5, 1.0]] {
            let batch = Batch {
                time: &time,
                outputs: vec!["hits"],
                every: Some(1),
                events: true,
                ..Batch::default()
            };
            let runs = opened("pair", standard).run(&batch, &Watch::default()).unwrap();
            assert_eq!(runs.trajectories, time.map(|time| if time < 0.5 { 0.0 } else { 2.0 }));
            let events: Vec<_> =
                runs.events.iter().map(|event| (event.time, event.before[0], event.after[0])).collect();
            assert_eq!(events, [(0.5, 0.0, 2.0)]);
        }
    }
}

#[test]
fn the_largest_step_also_holds_without_states() {
    for standard in VERSIONS {
        let integration = Integration { max_step: Some(0.03), ..Integration::default() };
        let batch = Batch {
            time: &[0.0, 1.0],
            outputs: vec!["hits"],
            every: Some(1),
            integration,
            events: true,
            ..Batch::default()
        };
        let runs = opened("wave", standard).run(&batch, &Watch::default()).unwrap();
        assert_eq!(runs.trajectories, [0.0, 10.0]);
        for (k, event) in runs.events.iter().enumerate() {
            close(event.time, 0.05 + 0.1 * k as f64, 1e-12);
        }
    }
}

#[test]
fn an_indicator_that_is_always_zero_is_not_an_event() {
    for standard in VERSIONS {
        let runs = run(&opened("zero", standard), &[0.0, 1.0], Batch { events: true, ..Batch::default() });
        assert_eq!((runs.errors.len(), runs.events.len()), (0, 0));
        close(runs.trajectories[1], (-1.0_f64).exp(), 1e-6);
    }
}

#[test]
fn discrete_inputs_change_at_events() {
    for standard in VERSIONS {
        let fmu = opened("lag", standard);
        let (times, values) = ([0.0, 0.3, 0.8], [0.0, 2.0, -1.0]);
        let batch = Batch {
            time: &[0.0, 0.25, 0.3, 0.5, 1.0],
            inputs: vec![("n", Trajectory::Sampled { times: &times, values: &values })],
            outputs: vec!["y", "n"],
            every: Some(1),
            integration: tight(Solver::Auto),
            events: true,
            ..Batch::default()
        };
        let runs = fmu.run(&batch, &Watch::default()).unwrap();
        assert_eq!(runs.errors, []);
        assert_eq!(runs.trajectories[5..], [0.0, 0.0, 2.0, 2.0, -1.0]);
        let at = |time: f64| -> f64 {
            let before = 2.0 * (1.0 - (-(time.min(0.8) - 0.3_f64)).exp());
            if time <= 0.8 { before } else { -1.0 + (before + 1.0) * (-(time - 0.8)).exp() }
        };
        [(3, 0.5), (4, 1.0)].iter().for_each(|&(k, time)| close(runs.trajectories[k], at(time), 1e-8));
        assert_eq!(runs.events.iter().map(|event| event.time).collect::<Vec<_>>(), [0.3, 0.8]);
    }
}

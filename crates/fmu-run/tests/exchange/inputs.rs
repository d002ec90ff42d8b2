//! Continuous inputs are functions of time.

use crate::{VERSIONS, close, opened, tight, times};
use fmu_run::{Batch, Integration, Solver, Start, Trajectory, Watch};

/// Returns the solution of x' = sin(w t) - x from x = 0.
fn answer(w: f64, t: f64) -> f64 {
    ((w * t).sin() - w * (w * t).cos() + w * (-t).exp()) / (1.0 + w * w)
}

/// Returns the largest error for an input with `count` intervals, which are lines, or cubics if `slopes`.
fn error(slopes: bool, count: usize, standard: fmu_run::Standard) -> f64 {
    const W: f64 = 5.0;
    let time = times(2.0, count);
    let u: Vec<_> = time.iter().map(|t| (W * t).sin()).collect();
    let du: Vec<_> = time.iter().map(|t| W * (W * t).cos()).collect();
    let batch = Batch {
        time: &time,
        inputs: vec![("u", Trajectory::Shared(&u))],
        input_derivatives: if slopes { vec![("u", Trajectory::Shared(&du))] } else { vec![] },
        outputs: vec!["y"],
        every: Some(1),
        integration: tight(Solver::Auto),
        ..Batch::default()
    };
    let runs = opened("lag", standard).run(&batch, &Watch::default()).unwrap();
    assert_eq!(runs.errors, []);
    runs.trajectories.iter().zip(&time).map(|(y, t)| (y - answer(W, *t)).abs()).fold(0.0, f64::max)
}

#[test]
fn results_converge_with_the_interpolation() {
    for standard in VERSIONS {
        let order =
            |slopes, count| (error(slopes, count, standard) / error(slopes, 2 * count, standard)).log2();
        let (lines, cubics) = (order(false, 100), order(true, 50));
        assert!((1.9..2.1).contains(&lines) && (3.8..4.2).contains(&cubics), "{lines} {cubics}");
        assert!(error(true, 800, standard) < 1e-9);
    }
}

/// x' = sin(t) - p x, which is stiff. The solver restarts at the beginning of each interval of the input.
#[test]
fn a_stiff_model_follows_a_moving_input() {
    const P: f64 = 1e5;
    let time = times(0.5, 500);
    let u: Vec<_> = time.iter().map(|t| t.sin()).collect();
    for standard in VERSIONS {
        for solver in [Solver::Auto, Solver::Bdf] {
            let batch = Batch {
                time: &time,
                inputs: vec![("u", Trajectory::Shared(&u))],
                start: vec![("p", Start::Same(P))],
                integration: Integration { solver, rtol: Some(1e-7), ..Integration::default() },
                outputs: vec!["y"],
                every: Some(1),
                ..Batch::default()
            };
            let runs = opened("lag", standard).run(&batch, &Watch::default()).unwrap();
            assert_eq!(runs.errors, []);
            for (y, t) in runs.trajectories.iter().zip(&time) {
                close(*y, (P * t.sin() - t.cos() + (-P * t).exp()) / (P * P + 1.0), 1e-9);
            }
        }
    }
}

#[test]
fn a_ramp_is_followed_exactly() {
    // u = t until 1 s; then u jumps to 3 and is constant.
    let (own, values) = ([0.0, 1.0, 1.0, 2.0], [0.0, 1.0, 3.0, 3.0]);
    for standard in VERSIONS {
        let batch = Batch {
            time: &[0.0, 0.7, 1.0, 2.0],
            inputs: vec![("u", Trajectory::Sampled { times: &own, values: &values })],
            outputs: vec!["y", "u", "rate"],
            every: Some(1),
            integration: tight(Solver::Auto),
            ..Batch::default()
        };
        let runs = opened("lag", standard).run(&batch, &Watch::default()).unwrap();
        let ramp = |t: f64| t - 1.0 + (-t).exp();
        close(runs.trajectories[1], ramp(0.7), 1e-9);
        close(runs.trajectories[2], ramp(1.0), 1e-9);
        close(runs.trajectories[3], 3.0 + (ramp(1.0) - 3.0) * (-1.0_f64).exp(), 1e-9);
        assert_eq!(runs.trajectories[4..8], [0.0, 0.7, 3.0, 3.0]);
        // The model description declares w as the derivative of u.
        assert_eq!(runs.trajectories[8..], [1.0, 1.0, 0.0, 0.0]);
    }
}

/// The value at the last time is the value after the event there, also if the times differ by a rounding error.
#[test]
fn an_input_jumps_at_the_end() {
    for standard in VERSIONS {
        for (end, jump) in [(1.0, 1.0), (0.3, 0.1 + 0.2), (0.3, 0.3 - f64::EPSILON / 8.0)] {
            let (own, values) = ([0.0, jump, jump], [0.0, 0.0, 1.0]);
            for name in ["u", "n"] {
                let batch = Batch {
                    time: &[0.0, 0.1, end],
                    inputs: vec![(name, Trajectory::Sampled { times: &own, values: &values })],
                    outputs: vec![name, "y"],
                    every: Some(1),
                    events: true,
                    ..Batch::default()
                };
                let runs = opened("lag", standard).run(&batch, &Watch::default()).unwrap();
                assert_eq!(runs.trajectories, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0], "{name} {jump}");
                let events: Vec<_> =
                    runs.events.iter().map(|of| (of.time, of.before[0], of.after[0])).collect();
                assert_eq!(events, [(end, 0.0, 1.0)]);
            }
        }
    }
}

#[test]
fn rates_of_other_inputs() {
    let (time, u, w) = ([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 5.0, 5.0], [7.0; 4]);
    for standard in VERSIONS {
        let fmu = opened("lag", standard);
        let rates = |inputs: Vec<(&'static str, Trajectory<'static>)>| {
            let mut all = vec![("u", Trajectory::Shared(&u))];
            all.extend(inputs);
            let batch =
                Batch { time: &time, inputs: all, outputs: vec!["rate"], every: Some(1), ..Batch::default() };
            fmu.run(&batch, &Watch::default()).unwrap().trajectories
        };
        assert_eq!(rates(vec![]), [1.0, 4.0, 0.0, 0.0]);
        assert_eq!(rates(vec![("w", Trajectory::RateOf("u"))]), [1.0, 4.0, 0.0, 0.0]);
        let given: &'static [f64; 4] = Box::leak(Box::new(w));
        assert_eq!(rates(vec![("w", Trajectory::Shared(given))]), [7.0; 4]);
    }
}

//! Runs that end early: the results that remain, and the messages.

use crate::built::misbehaving;
use crate::times;
use fmu_run::{Batch, Fmu, Measure, Runs, Standard, Start, Watch};
use std::time::{Duration, Instant};

/// How a run ends, from 0.5 s on: `BEHAVIOURS` of `integrator.c`.
#[derive(Clone, Copy)]
enum Behaviour {
    Good,
    SilentError,
    Pending,
    Fatal,
    Discard,
    NoStatus,
    NoReset,
    Warning,
    EndsBetween,
    EndsAtPoint,
    NoTerminate,
    NoStart,
    ErrorIfLogging,
    FatalIfLogging,
    SlowIfLogging,
    ReturnsEarly,
}
use Behaviour::*;

/// A behaviour, the number of times with results (of 11), the error, and the note; empty if there is none.
type Ending = (Behaviour, usize, &'static str, &'static str);

const IN_FMI2: &[Ending] = &[
    (Good, 11, "", ""),
    (SilentError, 6, "at 0.5 s: fmi2DoStep returned Error without a message", ""),
    (
        Pending,
        6,
        "at 0.5 s: fmi2GetStatus, after fmi2DoStep had returned Pending, returned Error without a message",
        "",
    ),
    (Fatal, 6, "at 0.5 s: fmi2DoStep returned Fatal without a message", ""),
    (Discard, 6, "at 0.5 s: fmi2DoStep: no more of this after half", ""),
    (NoStatus, 6, "at 0.5 s: fmi2DoStep returned Error without a message", ""),
    (NoReset, 11, "", ""),
    (Warning, 11, "", ""),
    (EndsBetween, 6, "ended by the FMU at t = 0.525 s: the tank is empty", ""),
    (EndsAtPoint, 7, "ended by the FMU at t = 0.6 s", ""),
    (NoTerminate, 11, "", "finished; then fmi2Terminate returned Error without a message"),
    (NoStart, 0, "fmi2ExitInitializationMode returned Error without a message", ""),
    (ErrorIfLogging, 6, "at 0.5 s: fmi2DoStep: the pump ran dry", ""),
    (FatalIfLogging, 6, "at 0.5 s: fmi2DoStep: the pump ran dry", ""),
];

const IN_FMI3: &[Ending] = &[
    (Good, 11, "", ""),
    (EndsBetween, 6, "ended by the FMU at t = 0.525 s: the tank is empty", ""),
    (EndsAtPoint, 7, "ended by the FMU at t = 0.6 s", ""),
    (ReturnsEarly, 6, "at 0.5 s: fmi3DoStep: the step ended early, at 0.525 s", ""),
    (NoTerminate, 11, "", "finished; then fmi3Terminate returned Fatal without a message"),
    (ErrorIfLogging, 6, "at 0.5 s: fmi3DoStep: the pump ran dry", ""),
];

/// Runs an FMU with each of these behaviours, and stores all values of the outputs.
fn run(fmu: &Fmu, time: &[f64], behaviours: &[Behaviour], outputs: &[&str]) -> Runs {
    let numbers: Vec<f64> = behaviours.iter().map(|behaviour| f64::from(*behaviour as u8)).collect();
    let batch = Batch {
        time,
        start: vec![("behaviour", Start::Each(&numbers))],
        outputs: outputs.to_vec(),
        every: Some(1),
        ..Batch::default()
    };
    fmu.system().run(&batch, &Watch::default()).unwrap()
}

fn assert_close(found: f64, expected: f64, of: &str) {
    assert!((found - expected).abs() < 1e-14 || found.is_nan() && expected.is_nan(), "{of}: {found}");
}

/// Each behaviour occurs in three successive runs, which threads run at the same time.
#[test]
fn each_ending_has_its_results_and_message() {
    let time = times();
    for (standard, endings) in [(Standard::Fmi2, IN_FMI2), (Standard::Fmi3, IN_FMI3)] {
        let fmu = misbehaving(standard, &[]);
        let of_runs: Vec<&Ending> = endings.iter().flat_map(|ending| [ending; 3]).collect();
        let numbers: Vec<f64> = of_runs.iter().map(|(behaviour, ..)| f64::from(*behaviour as u8)).collect();
        let stated = |text: fn(&Ending) -> &'static str| {
            let all = of_runs.iter().enumerate().map(|(run, ending)| (run, text(ending).to_owned()));
            all.filter(|(_, text)| !text.is_empty()).collect::<Vec<_>>()
        };
        let (errors, notes) = (stated(|ending| ending.2), stated(|ending| ending.3));
        for (every, read_before_set) in [(1, false), (1, true), (2, false), (2, true)] {
            let batch = Batch {
                time: &time,
                start: vec![("behaviour", Start::Each(&numbers))],
                outputs: vec!["y"],
                every: Some(every),
                measures: vec![Measure::End, Measure::Mean],
                threads: Some(4),
                read_before_set,
                ..Batch::default()
            };
            let runs = fmu.system().run(&batch, &Watch::default()).unwrap();
            assert_eq!((&runs.errors, &runs.notes), (&errors, &notes));
            let kept: Vec<usize> = (0..time.len()).step_by(every).collect();
            for (run, (_, count, error, _)) in of_runs.iter().enumerate() {
                let of = format!("run {run} in {standard}");
                let y = |at: usize| if at < *count { 4.0 + time[at] } else { f64::NAN };
                for (found, at) in runs.trajectories[run * kept.len()..].iter().zip(&kept) {
                    assert_close(*found, y(*at), &of);
                }
                // Statistics of a failed run are NaN; those of a run that the FMU ended cover the time until then.
                let expected = match error.is_empty() || error.starts_with("ended") {
                    true => [y(count - 1), 0.5 * (y(0) + y(count - 1))],
                    false => [f64::NAN; 2],
                };
                runs.measures[2 * run..]
                    .iter()
                    .zip(expected)
                    .for_each(|(found, expected)| assert_close(*found, expected, &of));
            }
        }
    }
}

#[test]
fn an_end_at_the_last_time_is_a_note() {
    let fmu = misbehaving(Standard::Fmi2, &[]);
    let time = &times()[..7];
    let runs = run(&fmu, time, &[EndsAtPoint], &["y"]);
    assert_eq!((runs.errors, runs.notes), (vec![], vec![(0, "ended by the FMU at t = 0.6 s".to_owned())]));
    runs.trajectories.iter().zip(time).for_each(|(y, time)| assert_close(*y, 4.0 + time, "y"));
}

#[test]
fn silent_runs_are_repeated_once_with_logging() {
    let (fmu, time) = (misbehaving(Standard::Fmi2, &[]), times());
    let largest = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let behaviours = [ErrorIfLogging, Good, SilentError, Discard, ErrorIfLogging];
    let runs = run(&fmu, &time, &behaviours, &["logged"]);
    assert_eq!(runs.errors.iter().map(|(run, _)| *run).collect::<Vec<_>>(), [0, 2, 3, 4]);
    assert_eq!(largest(&runs.trajectories), 0.0);
    // Three runs failed without a message. They were repeated with logging, one at a time, six steps each.
    for (name, count) in [("logged", 3.0 * 6.0), ("instances", 1.0)] {
        assert_eq!(largest(&run(&fmu, &time, &[Good], &[name]).trajectories), count);
    }
}

#[test]
fn an_fmu_that_is_slow_with_logging_is_not_repeated_to_the_end() {
    let time: Vec<f64> = (0..101).map(|k| 0.006 * f64::from(k)).collect();
    let begin = Instant::now();
    let runs = run(&misbehaving(Standard::Fmi2, &[]), &time, &[SlowIfLogging], &["y"]);
    // If all 76 steps were repeated, at 0.3 s each, this would take 23 s.
    assert!(begin.elapsed() < Duration::from_secs(10));
    assert!(runs.errors[0].1.ends_with("fmi2DoStep returned Error without a message"), "{:?}", runs.errors);
}

#[test]
fn an_fmu_that_cannot_be_instantiated_fails_all_runs() {
    for (guid, why) in [
        ("unknown", "the guid is of another FMU"),
        ("mute", "the instantiation of FaultyFmu returned NULL without a message"),
    ] {
        let (fmu, time) = (misbehaving(Standard::Fmi2, &[("misbehaving", guid)]), times());
        let batch = Batch {
            time: &time,
            start: vec![("slope", Start::Each(&[1.0, 2.0]))],
            outputs: vec!["y"],
            every: Some(1),
            measures: vec![Measure::Peak],
            ..Batch::default()
        };
        let runs = fmu.system().run(&batch, &Watch::default()).unwrap();
        assert_eq!(runs.errors, [0, 1].map(|run| (run, why.to_owned())));
        assert!(runs.trajectories.iter().chain(&runs.measures).all(|value| value.is_nan()));
    }
}

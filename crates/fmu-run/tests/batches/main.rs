//! Runs do not depend on earlier runs, on their order, or on the number of threads, even if a reset of the FMU is incomplete, unless the
//! caller requests that instances are reused.
#![allow(unsafe_code, reason = "FMUs are opened")]
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

mod built;

use built::Recorded;
use fmu_run::{Batch, Error, Measure, Runs, Start, Trajectory, Watch};
use fmu_test_kit::Random;

/// Manners of the FMU, which determine which values survive a reset, and whether the reset fails.
const MANNERS: [&str; 5] = ["good", "keeps_y", "keeps_bias", "derived", "no_reset"];
const MEASURES: [Measure; 7] = [
    Measure::Min,
    Measure::Max,
    Measure::Peak,
    Measure::TimeOfPeak,
    Measure::Mean,
    Measure::Rms,
    Measure::End,
];

/// Values that a run sets. `fails` is the index of the step that fails.
#[derive(Clone, Debug)]
struct Case {
    factor: f64,
    bias: f64,
    fails: Option<usize>,
    u: Vec<f64>,
}

/// Results of a run, expected or found: the bits of its outputs and statistics, and whether it fails.
#[derive(Debug, PartialEq)]
struct Expected {
    outputs: Vec<u64>,
    measures: Vec<u64>,
    fails: bool,
}

fn times(count: usize) -> Vec<f64> {
    (0..count).map(|k| 0.125 * k as f64).collect()
}

impl Case {
    /// Calculates the results in the same way as the C code of the FMU in a new instance.
    fn expected(&self, has_bias: bool) -> Expected {
        let time = times(self.u.len());
        let (gain, bias) = (self.factor, if has_bias { self.bias } else { 0.0 });
        let mut outputs = vec![0.0];
        for k in 1..time.len() {
            if self.fails == Some(k - 1) {
                break;
            }
            outputs.push(outputs[k - 1] + (time[k] - time[k - 1]) * (gain * self.u[k - 1] + bias));
        }
        let fails = outputs.len() < time.len();
        let measures = if fails { vec![f64::NAN; MEASURES.len()] } else { statistics(&time, &outputs) };
        outputs.resize(time.len(), f64::NAN);
        Expected { outputs: bits(&outputs), measures: bits(&measures), fails }
    }
}

/// Calculates the statistics from their definitions, in the order of [`MEASURES`].
fn statistics(time: &[f64], values: &[f64]) -> Vec<f64> {
    let count = values.len() as f64;
    let end = values[values.len() - 1];
    if values.iter().any(|value| value.is_nan()) {
        return [vec![f64::NAN; MEASURES.len() - 1], vec![end]].concat();
    }
    let peak = values.iter().fold(0.0, |peak: f64, value| peak.max(value.abs()));
    let first = values.iter().position(|value| value.abs() == peak).unwrap();
    // 0.0 and -0.0 are equal, so whichever occurs first is the result.
    let extreme = |is_beyond: fn(f64, f64) -> bool| {
        values.iter().fold(values[0], |found, value| if is_beyond(*value, found) { *value } else { found })
    };
    vec![
        extreme(|value, found| value < found),
        extreme(|value, found| value > found),
        peak,
        time[first],
        values.iter().fold(0.0, |sum, value| sum + value) / count,
        (values.iter().fold(0.0, |sum, value| sum + value * value) / count).sqrt(),
        end,
    ]
}

/// Returns the bits of numbers. All NaN have the same bits.
fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| if value.is_nan() { f64::NAN.to_bits() } else { value.to_bits() }).collect()
}

/// How cases are run.
#[derive(Clone, Copy, Default)]
struct How {
    threads: usize,
    has_bias: bool,
    reuse: bool,
}

/// Runs all cases as one batch. The bias is set only if `has_bias`.
fn run(of: &Recorded, cases: &[Case], how: How) -> Vec<Expected> {
    let time = times(cases[0].u.len());
    let each = |value: fn(&Case) -> f64| cases.iter().map(value).collect::<Vec<_>>();
    let (factor, bias) = (each(|case| case.factor), each(|case| case.bias));
    let fails = each(|case| case.fails.map_or(-1.0, |step| step as f64));
    let u: Vec<_> = cases.iter().flat_map(|case| case.u.iter().copied()).collect();
    let mut start = vec![("factor", Start::Each(&factor)), ("fails", Start::Each(&fails))];
    if how.has_bias {
        start.push(("bias", Start::Each(&bias)));
    }
    let batch = Batch {
        time: &time,
        inputs: vec![("u", Trajectory::EachRun(&u))],
        start,
        outputs: vec!["y"],
        every: Some(1),
        measures: MEASURES.to_vec(),
        threads: Some(how.threads.max(1)),
        reuse: how.reuse,
        ..Batch::default()
    };
    let runs = of.fmu().run(&batch, &Watch::default()).unwrap();
    found(&runs, time.len())
}

/// Returns the results of each run, for comparison with the expected ones.
fn found(runs: &Runs, times: usize) -> Vec<Expected> {
    let results = runs.trajectories.chunks(times).zip(runs.measures.chunks(MEASURES.len())).enumerate();
    let found = results.map(|(run, (outputs, measures))| Expected {
        outputs: bits(outputs),
        measures: bits(measures),
        fails: runs.errors.iter().any(|(failed, _)| *failed == run),
    });
    found.collect()
}

fn case(random: &mut Random, times: usize) -> Case {
    // Some values are frequent, so that successive runs often differ in only one parameter.
    let parameter = |random: &mut Random| match random.below(4) {
        0 => 0.0,
        1 => 1.0,
        2 => 2.5,
        _ => random.between(-3.0, 3.0),
    };
    let (factor, bias) = (parameter(random), parameter(random));
    let fails = random.chance(0.2).then(|| random.below(times));
    // A third of the inputs contain zeros and NaN.
    let is_special = random.chance(1.0 / 3.0);
    let u = (0..times).map(|_| match random.below(10) {
        0 if is_special => 0.0,
        1 if is_special => f64::NAN,
        _ => random.between(-4.0, 4.0),
    });
    Case { factor, bias, fails, u: u.collect() }
}

/// Successive batches have the same results as runs in new instances, even if some runs fail or have NaN: with any reset if instances are
/// not reused, and if they are, with a reset that is complete or fails.
#[test]
fn runs_are_independent() {
    for seed in 0..60 {
        let random = &mut Random(seed);
        let manner = MANNERS[random.below(MANNERS.len())];
        let is_reusable = matches!(manner, "good" | "no_reset");
        let mut recorded = Recorded::open(manner, "");
        for _ in 0..1 + random.below(11) {
            // A batch of cases with the same number of times.
            let times = 2 + random.below(7);
            let cases: Vec<_> = (0..1 + random.below(6)).map(|_| case(random, times)).collect();
            let (threads, has_bias) = (1 + random.below(3), random.chance(0.5));
            let how = How { threads, has_bias, reuse: is_reusable && random.chance(0.5) };
            let expected: Vec<_> = cases.iter().map(|case| case.expected(has_bias)).collect();
            assert_eq!(run(&recorded, &cases, how), expected, "{manner}, seed {seed}");
        }
        drop(recorded.fmu.take());
        let [made, reset, freed] = recorded.counts();
        assert_eq!(made, freed, "{manner}, seed {seed}");
        assert!(is_reusable || reset == 0, "{manner}, seed {seed}");
    }
}

fn single(factor: f64) -> Case {
    Case { factor, bias: 0.0, fails: None, u: vec![1.0, 2.0, 3.0] }
}

/// Instances are reset in a batch and from one batch to the next, but only if the caller requests it.
#[test]
fn instances_are_reused_on_request() {
    let reuse = How { reuse: true, ..How::default() };
    for (manner, how, expected) in [
        ("good", reuse, [1, 79, 0]),
        ("good", How::default(), [80, 0, 80]),
        // Each reset fails, so each run has a new instance.
        ("no_reset", reuse, [80, 79, 79]),
    ] {
        let recorded = Recorded::open(manner, "");
        for k in 0..40 {
            let cases = [single(f64::from(k)), single(f64::from(k) + 0.5)];
            let results: Vec<_> = cases.iter().map(|case| case.expected(false)).collect();
            assert_eq!(run(&recorded, &cases, how), results, "{manner}, batch {k}");
        }
        assert_eq!(recorded.counts(), expected, "{manner}");
        recorded.fmu().release();
        let [made, _, freed] = recorded.counts();
        assert_eq!(made, freed);
        // Runs are still possible after the release.
        assert_eq!(run(&recorded, &[single(3.0)], how), [single(3.0).expected(false)]);
    }
}

#[test]
fn instances_that_must_not_be_idle_are_freed() {
    let recorded = Recorded::open("good", "canBeInstantiatedOnlyOncePerProcess=\"true\"");
    for batch in 1..10 {
        run(&recorded, &[single(1.0), single(2.0)], How { reuse: true, ..How::default() });
        assert_eq!(recorded.counts(), [batch; 3]);
    }
}

#[test]
fn threads_run_an_fmu_at_the_same_time() {
    for (manner, reuse) in [("good", true), ("keeps_y", false), ("no_reset", true)] {
        let recorded = Recorded::open(manner, "");
        std::thread::scope(|scope| {
            for thread in 0..6 {
                let recorded = &recorded;
                scope.spawn(move || {
                    for k in 0..40 {
                        let cases: Vec<_> =
                            (0..1 + k % 3).map(|n| single(f64::from(100 * thread + k + n))).collect();
                        let expected: Vec<_> = cases.iter().map(|case| case.expected(false)).collect();
                        let how = How { threads: 2, has_bias: false, reuse };
                        assert_eq!(run(recorded, &cases, how), expected, "{manner}");
                    }
                });
            }
        });
    }
}

#[test]
fn a_pulse_cancels_runs() {
    let recorded = Recorded::open("good", "");
    // All steps together take much longer than the time between two pulses.
    let time: Vec<f64> = (0..20_000_000).map(f64::from).collect();
    for threads in [1, 2] {
        let factor = [1.0; 64];
        let batch = Batch {
            time: &time,
            start: vec![("factor", Start::Each(&factor))],
            outputs: vec!["y"],
            measures: vec![Measure::End],
            threads: Some(threads),
            ..Batch::default()
        };
        let watch = Watch::pulsing(Watch::cancel);
        assert_eq!(recorded.fmu().run(&batch, &watch).unwrap_err(), Error::Cancelled);
        assert!(watch.done() < factor.len());
    }
    // A cancelled run does not affect later runs.
    assert_eq!(run(&recorded, &[single(3.0)], How::default()), [single(3.0).expected(false)]);
}

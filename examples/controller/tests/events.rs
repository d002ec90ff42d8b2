//! The samples of the controller are events. The motion of the motors is bit-identical, regardless of whether the importer
//! or the FMU handles them.

use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::fmi3::types::{Status, fmi3Boolean, fmi3False, fmi3True};
use fmu_test_kit::fmi3::Stepped;
use fmu_test_kit::{Arguments, Either, Updated};
use prw_controller::Controller;
use prw_controller::variables::Name;

const INPUTS: [u32; 8] = [
    Name::pitch_ref as u32,
    Name::roll_ref as u32,
    Name::pitch as u32,
    Name::roll as u32,
    Name::pitch_rate as u32,
    Name::roll_rate as u32,
    Name::tau1 as u32,
    Name::tau2 as u32,
];
const OUTPUTS: [u32; 6] = [
    Name::theta1 as u32,
    Name::theta2 as u32,
    Name::omega1 as u32,
    Name::omega2 as u32,
    Name::pitch_correction as u32,
    Name::roll_correction as u32,
];
const KD: u32 = Name::Kd as u32;
const SAMPLE_TIME: u32 = Name::sample_time as u32;
// These times are powers of 2, so their sums are exact.
const START: f64 = 0.125;
const PERIOD: f64 = 1.0 / 128.0;
const SAMPLES: u32 = 200;

/// Returns the values of all inputs at this time.
fn inputs(time: f64) -> [f64; 8] {
    let wave = |amplitude: f64, frequency: f64| amplitude * (frequency * time).sin();
    [
        0.5 + wave(0.2, 3.0),
        wave(0.7, 2.0),
        wave(0.4, 2.9),
        wave(0.6, 1.9),
        wave(1.2, 3.1),
        wave(1.1, 2.1),
        wave(0.3, 7.0),
        wave(0.3, 5.0),
    ]
}

fn time_of(sample: u32) -> f64 {
    START + f64::from(sample) * PERIOD
}

fn bits(outputs: [f64; 6]) -> [u64; 6] {
    outputs.map(f64::to_bits)
}

/// Returns the outputs after each of `SAMPLES` steps of one sample period in FMI 2.0, where the FMU handles the samples
/// within its steps.
fn steps_of_fmi2() -> Vec<[f64; 6]> {
    let fmu = fmu_test_kit::Importer::new::<Controller>(CoSimulation);
    fmu.set(&[KD, SAMPLE_TIME], &[0.01, PERIOD]);
    fmu.initialize(START);
    let outputs = |sample| {
        let (time, next) = (time_of(sample), time_of(sample + 1));
        fmu.set(&INPUTS, &inputs(time));
        fmu.step(time, next - time);
        fmu.get(OUTPUTS)
    };
    let path: Vec<_> = (0..SAMPLES).map(outputs).collect();
    assert!(
        path.iter().any(|outputs| outputs[0].abs() > 0.3 && outputs[5] != 0.0),
        "no step has |theta1| > 0.3 and a roll correction: {path:?}"
    );
    path
}

fn with(event_mode_used: fmi3Boolean, early_return_allowed: fmi3Boolean) -> fmu_test_kit::fmi3::Importer {
    let arguments =
        Arguments { event_mode_used, early_return_allowed, ..Arguments::new::<Controller>(CoSimulation) };
    let fmu = fmu_test_kit::fmi3::Importer::make::<Controller>(&arguments).unwrap();
    fmu.set(&[KD, SAMPLE_TIME], &[0.01, PERIOD]);
    fmu.initialize(START);
    fmu
}

#[test]
fn without_event_mode() {
    let fmu = with(fmi3False, fmi3False);
    for (sample, expected) in (0..).zip(steps_of_fmi2()) {
        let (time, next) = (time_of(sample), time_of(sample + 1));
        fmu.set(&INPUTS, &inputs(time));
        fmu.step(time, next - time);
        assert_eq!(bits(fmu.get(OUTPUTS)), bits(expected), "at {next}");
    }
}

/// Checks steps of one sample period, at whose end there is an event, and longer steps, which end early at an event.
#[test]
fn in_event_mode() {
    for (early_return_allowed, samples_per_step) in [(fmi3False, 1), (fmi3True, 1), (fmi3True, 1000)] {
        let fmu = with(fmi3True, early_return_allowed);
        for (sample, expected) in (0..).zip(steps_of_fmi2()) {
            let (time, next) = (time_of(sample), time_of(sample + 1));
            fmu.set(&INPUTS, &inputs(time));
            assert_eq!(fmu.update().next, Some(next));
            fmu.ok(fmu.fmi3EnterStepMode());
            let stepped = Stepped {
                event_handling_needed: true,
                terminate: false,
                early_return: samples_per_step > 1,
                last_successful_time: next,
            };
            assert_eq!(fmu.do_step(time, time_of(sample + samples_per_step) - time), Ok(stepped));
            assert_eq!(bits(fmu.get(OUTPUTS)), bits(expected), "at {next}");
            fmu.ok(fmu.fmi3EnterEventMode());
        }
    }
}

/// Checks an importer that uses Event Mode but does not allow early return, so that the FMU handles the samples within a
/// step. They use the inputs at the start of the step, as for importers without Event Mode.
#[test]
fn in_event_mode_with_samples_within_a_step() {
    let (fmu, unaware) = (with(fmi3True, fmi3False), with(fmi3False, fmi3False));
    for point in 0..40 {
        let (time, next) = (time_of(5 * point), time_of(5 * (point + 1)));
        fmu.set(&INPUTS, &inputs(time));
        unaware.set(&INPUTS, &inputs(time));
        fmu.update();
        fmu.ok(fmu.fmi3EnterStepMode());
        assert!(fmu.do_step(time, next - time).unwrap().event_handling_needed);
        unaware.step(time, next - time);
        assert_eq!(bits(fmu.get(OUTPUTS)), bits(unaware.get(OUTPUTS)), "at {next}");
        fmu.ok(fmu.fmi3EnterEventMode());
    }
}

/// Checks that a step with too many samples changes nothing, and that a shorter step then succeeds.
#[test]
fn too_many_samples_within_a_step() {
    let fmu = with(fmi3True, fmi3False);
    fmu.set(&INPUTS, &inputs(START));
    fmu.update();
    fmu.ok(fmu.fmi3EnterStepMode());
    let before = (fmu.bytes(), bits(fmu.get(OUTPUTS)));
    assert_eq!(fmu.do_step(START, 1000.0), Err(Status::Discard));
    let log = fmu.take_log();
    assert!(log[0].message.contains("more than 10000 events; make shorter steps"), "{log:?}");
    assert_eq!((fmu.bytes(), bits(fmu.get(OUTPUTS))), before);
    assert!(fmu.do_step(START, 70.0).unwrap().event_handling_needed);
}

/// Checks that, if the importer does not handle an event at the end of a step, the next step handles it.
#[test]
fn an_event_that_the_importer_does_not_handle() {
    let (fmu, unaware) = (with(fmi3True, fmi3False), with(fmi3False, fmi3False));
    fmu.set(&INPUTS, &inputs(START));
    fmu.ok(fmu.fmi3EnterStepMode());
    for sample in 0..50 {
        let (time, next) = (time_of(sample), time_of(sample + 1));
        fmu.set(&INPUTS, &inputs(time));
        unaware.set(&INPUTS, &inputs(time));
        assert!(fmu.do_step(time, next - time).unwrap().event_handling_needed);
        unaware.step(time, next - time);
        assert_eq!(bits(fmu.get(OUTPUTS)), bits(unaware.get(OUTPUTS)), "at {next}");
    }
}

#[test]
fn in_model_exchange() {
    fn check<F: Either>() {
        let fmu = F::make::<Controller>(&Arguments::new::<Controller>(ModelExchange)).unwrap();
        fmu.set(&[KD, SAMPLE_TIME], &[0.01, PERIOD]);
        fmu.initialize(START);
        for (sample, expected) in (0..).zip(steps_of_fmi2()) {
            let (time, next) = (time_of(sample), time_of(sample + 1));
            fmu.set(&INPUTS, &inputs(time));
            assert_eq!(fmu.update(), Updated { next: Some(next), ..Updated::default() });
            fmu.ok(fmu.enter_continuous_time_mode());
            // A solver may evaluate a later time first and then an earlier one.
            for share in [0.5, 1.0, 0.25, 1.0] {
                fmu.ok(fmu.set_time(time + share * PERIOD));
                fmu.set(&INPUTS, &inputs(time + share * PERIOD));
                if share == 1.0 {
                    assert_eq!(bits(fmu.get(OUTPUTS)), bits(expected), "at {next}");
                }
            }
            fmu.ok(fmu.enter_event_mode());
        }
    }
    check::<fmu_test_kit::Importer>();
    check::<fmu_test_kit::fmi3::Importer>();
}

/// Checks that an event is rejected if too many samples are due, for example because the importer has ignored all time
/// events for 10^6 s.
#[test]
fn too_many_samples_in_an_event() {
    let fmu = fmu_test_kit::Importer::new::<Controller>(ModelExchange);
    fmu.initialize(0.0);
    fmu.ok(fmu.fmi2SetTime(1e6));
    fmu.rejected_with(&["sample_time"], |fmu| fmu.fmi2NewDiscreteStates(&mut Default::default()));
}

/// Compares partial derivatives with respect to time, which is a known in FMI 3.0, with differences. Between samples, the
/// motion of the motors is a function of time only.
#[test]
fn partial_derivatives_with_respect_to_time() {
    const WIDTH: f64 = 1.0 / 65_536.0;
    let fmu = fmu_test_kit::fmi3::Importer::new::<Controller>(ModelExchange);
    fmu.set(&[KD, SAMPLE_TIME], &[0.01, PERIOD]);
    fmu.initialize(START);
    let mut moves = [false; 6];
    for sample in 0..20 {
        let now = time_of(sample);
        fmu.ok(fmu.fmi3SetTime(now));
        fmu.set(&INPUTS, &inputs(now));
        fmu.update();
        fmu.ok(fmu.fmi3EnterContinuousTimeMode());
        let middle = now + 0.5 * PERIOD;
        let at = |time: f64| {
            fmu.ok(fmu.fmi3SetTime(time));
            fmu.get(OUTPUTS)
        };
        let (before, after) = (at(middle - WIDTH), at(middle + WIDTH));
        at(middle);
        for (index, unknown) in OUTPUTS.into_iter().enumerate() {
            let forward = fmu.partial(unknown, fmu_export::fmi3::independent::<Controller>().0);
            let difference = (after[index] - before[index]) / (2.0 * WIDTH);
            assert!(
                (forward - difference).abs() <= 1e-9 * (1.0 + difference.abs()),
                "{forward} {difference}"
            );
            moves[index] |= forward != 0.0;
        }
        fmu.ok(fmu.fmi3EnterEventMode());
    }
    assert_eq!(moves, [true, true, true, true, false, false], "corrections are constant");
}

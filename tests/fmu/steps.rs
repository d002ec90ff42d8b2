//! Steps at the edge of the range of numbers.

use crate::exact::start_at;
use crate::modes::in_mode;
use crate::vr;
use fmu_export::Interface::CoSimulation;
use fmu_export::Mode::*;
use fmu_export::Status;
use prw_testbed::variables::Name;

/// A step to infinity is refused, and everything stays usable.
#[test]
fn steps_out_of_the_range_of_numbers() {
    let fmu = in_mode(CoSimulation, StepComplete);
    start_at(&fmu, [0.0; 6]);
    fmu.set(&[vr(Name::theta1)], &[f64::MAX]);
    fmu.set_rates([vr(Name::theta1)], [f64::MAX]);
    let message = fmu.refused("a step to infinity", |fmu| fmu.try_step(0.0, 10.0));
    assert!(message.contains("range of numbers"), "{message}");
    let message = fmu.refused("an infinite torque", |fmu| fmu.fmi2GetReal(&vr(Name::tau1), 1, &mut 0.0));
    assert!(message.contains("tau1"), "{message}");
    fmu.set(&[vr(Name::theta1)], &[0.1]);
    fmu.set_rates([vr(Name::theta1)], [0.0]);
    fmu.step(0.0, 10.0);
}

/// The parabola through the samples may have an end in range and a rate there that is not: the next state
/// could not be saved.
#[test]
fn motors_out_of_the_range_of_numbers() {
    let fmu = in_mode(CoSimulation, StepComplete);
    let h = 1.0 / 1024.0;
    fmu.step(0.0, h);
    fmu.step(h, h);
    fmu.set(&[vr(Name::theta1)], &[1e302]);
    let message = fmu.refused("a motor of infinite rate", |fmu| fmu.try_step(2.0 * h, 10.0));
    assert!(message.contains("range of numbers"), "{message}");
    fmu.restore(&fmu.bytes());
    fmu.step(2.0 * h, h);
    fmu.restore(&fmu.bytes());
}

/// Masters that wait for long take long steps. However long, an answer comes at once.
#[test]
fn steps_of_any_size() {
    for step_size in [1e-300, 1e-9, 1.0, 1e9, 1e100, 1e300, 0.5 * f64::MAX] {
        let (answer, answers) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let fmu = in_mode(CoSimulation, StepComplete);
            fmu.set(&[vr(Name::theta1), vr(Name::theta2)], &[0.5, 0.5]);
            let _ = answer.send((fmu.try_step(0.0, step_size), fmu.get([vr(Name::pitch)])));
        });
        let (status, [pitch]) = answers
            .recv_timeout(std::time::Duration::from_secs(10))
            .unwrap_or_else(|_| panic!("a step of {step_size:e} s takes for ever"));
        assert!(matches!(status, Status::Ok | Status::Error), "{step_size:e}: {status:?}");
        if status == Status::Ok && step_size >= 10.0 {
            assert!((pitch - 0.5).abs() < 1e-12, "{step_size:e}: {pitch}");
        }
    }
}

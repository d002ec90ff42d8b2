//! Steps near the limits of the number range.

use crate::exact::start_at;
use crate::in_mode;
use crate::vr;
use fmu_export::Interface::CoSimulation;
use fmu_export::Mode::*;
use fmu_test_kit::Either;
use prw_testbed::variables::Name;

/// Checks that a step to infinity is rejected and the instance stays usable.
#[test]
fn steps_out_of_the_range_of_numbers() {
    let fmu = in_mode(CoSimulation, StepComplete);
    start_at(&fmu, [0.0; 6]);
    fmu.set(&[vr(Name::theta1)], &[f64::MAX]);
    fmu.set_rates([vr(Name::theta1)], [f64::MAX]);
    fmu.rejected_with(&["range of numbers"], |fmu| fmu.try_step(0.0, 10.0));
    fmu.rejected_with(&["tau1"], |fmu| fmu.fmi2GetReal(&vr(Name::tau1), 1, &mut 0.0));
    fmu.set(&[vr(Name::theta1)], &[0.1]);
    fmu.set_rates([vr(Name::theta1)], [0.0]);
    fmu.step(0.0, 10.0);
}

/// Checks that a step is rejected if the parabola's end is in range but its rate there is not, because the
/// next state could not be saved.
#[test]
fn motors_out_of_the_range_of_numbers() {
    let fmu = in_mode(CoSimulation, StepComplete);
    let h = 1.0 / 1024.0;
    fmu.step(0.0, h);
    fmu.step(h, h);
    fmu.set(&[vr(Name::theta1)], &[1e302]);
    fmu.rejected_with(&["range of numbers"], |fmu| fmu.try_step(2.0 * h, 10.0));
    fmu.restore(&fmu.bytes());
    fmu.step(2.0 * h, h);
    fmu.restore(&fmu.bytes());
}

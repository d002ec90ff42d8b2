//! Tests of the motion of the motors between communication points in Co-Simulation, through the functions of the FMU.

use crate::exact::{STATES, advanced, distance, jacobian, jumped, parameters, set_parameters, start_at};
use crate::{in_mode, new, vr};
use fmu_export::Interface::CoSimulation;
use fmu_export::Mode::*;
use fmu_test_kit::{Either, Importer as Fmu, Random};
use prw_testbed::variables::Name;
use prw_testbed::{BUILT_IN, Parameters};

const THETA: [u32; 2] = [vr(Name::theta1), vr(Name::theta2)];
const OMEGA: [u32; 2] = [vr(Name::omega1), vr(Name::omega2)];

fn slave(p: &Parameters, use_omega: bool) -> Fmu {
    let fmu = new(CoSimulation);
    set_parameters(&fmu, p);
    fmu.ok(fmu.fmi2SetBoolean(&vr(Name::use_omega), 1, &use_omega.into()));
    start_at(&fmu, [0.0; 6]);
    fmu.initialize(0.0);
    fmu
}

/// A reference for steps with known motor angles and rates: the exact solution, including the jump if the angles at the
/// start of a step differ from the angles at the end of the last step.
struct Follower<'a> {
    p: &'a Parameters,
    x: [f64; 6],
    expected_angles: Option<[f64; 2]>,
    time: f64,
}

impl<'a> Follower<'a> {
    fn new(p: &'a Parameters) -> Self {
        Self { p, x: [0.0; 6], expected_angles: None, time: 0.0 }
    }

    /// Makes a step of the FMU and asserts that its states equal the exact solution.
    #[track_caller]
    fn step(&mut self, fmu: &Fmu, theta: [f64; 2], rates: [f64; 2], h: f64) {
        fmu.step(self.time, h);
        let jump = self
            .expected_angles
            .map_or([0.0; 2], |expected| [theta[0] - expected[0], theta[1] - expected[1]]);
        let (x, angles) = advanced(self.p, jumped(self.p, self.x, jump), theta, rates, h);
        let found = fmu.get(STATES);
        assert!(
            distance(&found, &x) < 1e-11 * (1.0 + distance(&x, &[0.0; 6])),
            "{found:?}\n{x:?} at {}",
            self.time
        );
        (self.x, self.expected_angles, self.time) = (found, Some(angles), self.time + h);
    }
}

/// Checks that a derivative set with fmi2SetRealInputDerivatives takes precedence over omega and over the samples, but only
/// in the next step.
#[test]
fn set_derivatives_take_precedence() {
    for use_omega in [false, true] {
        let p = parameters(1);
        let fmu = slave(&p, use_omega);
        let mut follower = Follower::new(&p);
        let mut random = Random(2);
        for _ in 0..20 {
            let [theta, omega, rates] =
                [(); 3].map(|()| [random.between(-1.0, 1.0), random.between(-1.0, 1.0)]);
            fmu.set(&THETA, &theta);
            fmu.set(&OMEGA, &omega);
            fmu.set_input_derivatives(&THETA, &rates);
            assert_eq!(fmu.rates(THETA), rates);
            follower.step(&fmu, theta, rates, random.between(0.001, 0.05));
        }
        // If no new derivative is set, the rates again come from the source that `use_omega` selects.
        fmu.set(&THETA, &[0.1, 0.2]);
        fmu.set(&OMEGA, &[3.0, 4.0]);
        assert_eq!(fmu.rates(THETA) == [3.0, 4.0], use_omega);
    }
}

/// Checks that the order of setting omega, derivatives and `use_omega` has no effect on rates and torques, even before theta
/// is set again.
#[test]
fn the_order_of_setting_does_not_matter() {
    let p = parameters(7);
    let after_a_step = |use_omega: bool, calls: &[&dyn Fn(&Fmu)]| {
        let fmu = slave(&p, use_omega);
        fmu.set(&THETA, &[0.1, -0.2]);
        fmu.set(&OMEGA, &[1.0, 2.0]);
        fmu.step(0.0, 0.01);
        calls.iter().for_each(|call| call(&fmu));
        (fmu.rates(THETA), fmu.get([vr(Name::tau1), vr(Name::tau2)]))
    };
    let omega = |fmu: &Fmu| fmu.set(&OMEGA, &[5.0, -6.0]);
    let derivative = |fmu: &Fmu| fmu.set_input_derivatives(&THETA, &[3.0, 4.0]);
    let use_omega = |fmu: &Fmu| fmu.ok(fmu.fmi2SetBoolean(&vr(Name::use_omega), 1, &1));

    let one = after_a_step(true, &[&omega, &derivative]);
    assert_eq!(one.0, [3.0, 4.0], "a derivative must take precedence over omega");
    assert_eq!(one, after_a_step(true, &[&derivative, &omega]));

    let other = after_a_step(false, &[&omega, &use_omega]);
    assert_eq!(other.0, [5.0, -6.0], "omega must take effect immediately");
    assert_eq!(other, after_a_step(false, &[&use_omega, &omega]));
    assert_ne!(one.1, other.1);
}

/// Checks that the motors turn at the rates omega if `use_omega` is true. With omega = 0, the inputs are held exactly,
/// and the motors jump at each communication point.
#[test]
fn omega_is_the_slope() {
    let p = parameters(3);
    let fmu = slave(&p, true);
    let mut follower = Follower::new(&p);
    let mut random = Random(4);
    for i in 0..20 {
        let theta = [random.between(-1.0, 1.0), random.between(-1.0, 1.0)];
        let omega = if i < 10 { [0.0; 2] } else { [random.between(-9.0, 9.0), random.between(-9.0, 9.0)] };
        fmu.set(&[THETA, OMEGA].concat(), &[theta, omega].concat());
        follower.step(&fmu, theta, omega, random.between(0.001, 0.05));
    }
}

/// Returns the slope of the parabola through the last three samples at the newest one, by Lagrange's formula.
fn parabola_slope(t: [f64; 3], y: [f64; 3]) -> f64 {
    y[0] * (t[2] - t[1]) / ((t[0] - t[1]) * (t[0] - t[2]))
        + y[1] * (t[2] - t[0]) / ((t[1] - t[0]) * (t[1] - t[2]))
        + y[2] * (2.0 * t[2] - t[0] - t[1]) / ((t[2] - t[0]) * (t[2] - t[1]))
}

/// Checks the rates that are estimated from samples, in steps of different sizes: 0 at the first sample, the difference
/// quotient at the second, and from the third on the slope of the parabola through the last three samples. Torques and
/// steps must use this rate.
#[test]
fn samples_are_differentiated() {
    let p = parameters(5);
    let jacobian = jacobian(&p);
    let fmu = slave(&p, false);
    fmu.set(&OMEGA, &[77.0, 88.0]); // no effect, because use_omega is false
    let mut follower = Follower::new(&p);
    let mut random = Random(6);
    let (mut times, mut samples) = (vec![0.0_f64], Vec::<[f64; 2]>::new());
    for i in 0..30 {
        samples.push([random.between(-0.1, 0.1), (3.0 * times[i]).sin()]);
        fmu.set(&THETA, &samples[i]);
        let expected: [f64; 2] = std::array::from_fn(|motor| match i {
            0 => 0.0,
            1 => (samples[1][motor] - samples[0][motor]) / times[1],
            _ => parabola_slope(
                [times[i - 2], times[i - 1], times[i]],
                [2, 1, 0].map(|back| samples[i - back][motor]),
            ),
        });
        let found = fmu.rates(THETA);
        assert!(distance(&found, &expected) < 1e-10, "sample {i}: {found:?} instead of {expected:?}");
        let point = [&fmu.get(STATES)[..], &samples[i], &found].concat();
        for (torque, row) in fmu.get([vr(Name::tau1), vr(Name::tau2)]).into_iter().zip([6, 7]) {
            let terms: Vec<_> = (0..10).map(|column| jacobian[(row, column)] * point[column]).collect();
            let (expected, scale) =
                (terms.iter().sum::<f64>(), terms.iter().map(|term| term.abs()).sum::<f64>());
            assert!((torque - expected).abs() <= 1e-13 * scale, "sample {i}: {torque} instead of {expected}");
        }
        let h = random.between(0.002, 0.04);
        follower.step(&fmu, samples[i], found, h);
        times.push(times[i] + h);
    }
}

/// Checks that the motors come to rest at their angles if an importer sets these only once.
#[test]
fn inputs_that_are_not_set_stay() {
    let fmu = slave(&BUILT_IN, false);
    fmu.set(&THETA, &[0.3, 0.3]);
    for i in 0..300 {
        fmu.step(f64::from(i) * 0.01, 0.01);
    }
    assert!(distance(&fmu.get([vr(Name::theta3), vr(Name::pitch)]), &[0.3, 0.3]) < 1e-9);
}

/// Checks that derivatives of higher order, and derivatives of omega, are accepted but have no effect.
#[test]
fn higher_orders_are_harmless() {
    let [plain, rich] = [(); 2].map(|()| slave(&BUILT_IN, false));
    let outputs = |fmu: &Fmu| (fmu.get(STATES), fmu.get([vr(Name::tau1), vr(Name::tau2)]));
    let (of, orders) = ([THETA[0], THETA[1], OMEGA[0], THETA[0]], [2, 7, 1, i32::MAX]);
    for i in 0..20 {
        let t = f64::from(i) * 0.02;
        for fmu in [&plain, &rich] {
            fmu.set(&THETA, &[t.sin(), t.cos()]);
            if i % 4 < 2 {
                fmu.set_input_derivatives(&THETA, &[t.cos(), -t.sin()]);
            }
        }
        let values = [5.0, 6.0, 7.0, 8.0];
        rich.ok(rich.fmi2SetRealInputDerivatives(of.as_ptr(), 4, orders.as_ptr(), values.as_ptr()));
        plain.step(t, 0.02);
        rich.step(t, 0.02);
        assert_eq!(outputs(&plain), outputs(&rich), "step {i}");
    }
}

/// Checks that derivatives set in Initialization Mode apply to the first step.
#[test]
fn derivatives_of_the_initialization_are_used() {
    let [with, without] = [true, false].map(|given| {
        let fmu = in_mode(CoSimulation, Initialization);
        if given {
            fmu.set_input_derivatives(&THETA, &[2.0, 0.0]);
        }
        fmu.ok(fmu.fmi2ExitInitializationMode());
        fmu.step(0.0, 0.01);
        fmu.get([vr(Name::theta3)])
    });
    assert!(with[0] > 0.0 && without[0] == 0.0);
}

/// Checks that a step is rejected if the state would become infinite, and that the instance then works as before.
#[test]
fn steps_with_a_state_that_is_not_finite() {
    let fmu = in_mode(CoSimulation, StepComplete);
    start_at(&fmu, [0.0; 6]);
    fmu.set(&[vr(Name::theta1)], &[f64::MAX]);
    fmu.set_input_derivatives(&[vr(Name::theta1)], &[f64::MAX]);
    fmu.rejected_with(&["would overflow"], |fmu| fmu.try_step(0.0, 10.0));
    fmu.rejected_with(&["tau1"], |fmu| fmu.fmi2GetReal(&vr(Name::tau1), 1, &mut 0.0));
    fmu.set(&[vr(Name::theta1)], &[0.1]);
    fmu.set_input_derivatives(&[vr(Name::theta1)], &[0.0]);
    fmu.step(0.0, 10.0);
}

/// Checks that a step is rejected if the motor angle at its end is finite but the motor rate is not, because a saved state
/// with an infinite rate could not be restored.
#[test]
fn steps_with_a_motor_rate_that_is_not_finite() {
    let fmu = in_mode(CoSimulation, StepComplete);
    let h = 1.0 / 1024.0;
    fmu.step(0.0, h);
    fmu.step(h, h);
    fmu.set(&[vr(Name::theta1)], &[1e302]);
    fmu.rejected_with(&["would overflow"], |fmu| fmu.try_step(2.0 * h, 10.0));
    fmu.restore(&fmu.bytes());
    fmu.step(2.0 * h, h);
    fmu.restore(&fmu.bytes());
}

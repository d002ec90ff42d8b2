//! Tests of the motors: the exact step in Co-Simulation is compared with an integration in Model Exchange.

use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_test_kit::{Either, Importer};
use prw_motor::{Motors, Name};

const INPUTS: [u32; 4] = [Name::torque1 as u32, Name::torque2 as u32, Name::tau1 as u32, Name::tau2 as u32];
const OUTPUTS: [u32; 4] =
    [Name::theta1 as u32, Name::theta2 as u32, Name::omega1 as u32, Name::omega2 as u32];
const PARAMETERS: [u32; 2] = [Name::J1 as u32, Name::friction as u32];

/// The checks of the test kit that every FMU must pass.
mod every {
    fmu_test_kit::every_check!(prw_motor::Motors);
}

#[test]
fn undone_steps_leave_no_trace() {
    fmu_test_kit::history::Histories::default().check::<Motors>();
}

fn torques(t: f64) -> [f64; 4] {
    [0.4 - 2.0 * t, -0.3 + t, 0.1 + 0.5 * t, 0.2]
}

const SLOPES: [f64; 4] = [-2.0, 1.0, 0.5, 0.0];
const START: [f64; 4] = [0.5, -0.2, 3.0, -1.0];

/// Returns the angles and rates after one step of 0.1 s, during which the torques follow their slopes.
fn after_a_step(inertia: f64, friction: f64) -> [f64; 4] {
    let fmu = Importer::new::<Motors>(CoSimulation);
    fmu.set(&PARAMETERS, &[inertia, friction]);
    fmu.set(&OUTPUTS, &START);
    fmu.initialize(0.0);
    fmu.set(&INPUTS, &torques(0.0));
    fmu.set_input_derivatives(&INPUTS, &SLOPES);
    fmu.step(0.0, 0.1);
    fmu.get(OUTPUTS)
}

/// Returns the same values, calculated with 4,000 steps of the classical Runge-Kutta method.
fn integrated(inertia: f64, friction: f64) -> [f64; 4] {
    let fmu = Importer::new::<Motors>(ModelExchange);
    fmu.set(&PARAMETERS, &[inertia, friction]);
    fmu.set(&OUTPUTS, &START);
    fmu.initialize(0.0);
    fmu.update();
    fmu.ok(fmu.enter_continuous_time_mode());
    let slope = |t: f64, x: [f64; 4]| {
        fmu.ok(fmu.set_time(t));
        fmu.ok(fmu.set_states(x.as_ptr(), 4));
        fmu.set(&INPUTS, &torques(t));
        fmu.derivatives::<4>()
    };
    let add = |x: [f64; 4], h: f64, d: [f64; 4]| std::array::from_fn(|i| x[i] + h * d[i]);
    let (mut x, h) = (START, 0.1 / 4000.0);
    for k in 0..4000 {
        let t = f64::from(k) * h;
        let d1 = slope(t, x);
        let d2 = slope(t + 0.5 * h, add(x, 0.5 * h, d1));
        let d3 = slope(t + 0.5 * h, add(x, 0.5 * h, d2));
        let d4 = slope(t + h, add(x, h, d3));
        x = std::array::from_fn(|i| x[i] + h / 6.0 * (d1[i] + 2.0 * d2[i] + 2.0 * d3[i] + d4[i]));
    }
    x
}

/// Checks frictions from 0 to one with which a rate decays in a tenth of the step. Two of them are just below and above the
/// limit at which `decays` changes its formula.
#[test]
fn a_step_is_the_exact_solution() {
    for (inertia, friction) in
        [(2e-3, 0.0), (2e-3, 1e-6), (2e-3, 9.99e-3), (2e-3, 1.01e-2), (5e-3, 0.5), (0.1, 0.02)]
    {
        for (found, expected) in
            after_a_step(inertia, friction).into_iter().zip(integrated(inertia, friction))
        {
            assert!(
                (found - expected).abs() < 1e-11 * expected.abs().max(1.0),
                "{inertia} {friction}: {found} {expected}"
            );
        }
    }
}

/// Checks Newton's law with simple numbers: 2 N.m turn 0.5 kg.m2 by 8 rad in 2 s. If the wrist takes half of the torque, the
/// angle is half as large.
#[test]
fn the_torque_of_the_wrist_is_added() {
    for (tau, theta, omega) in [(0.0, 8.0, 8.0), (-1.0, 4.0, 4.0)] {
        let fmu = Importer::new::<Motors>(CoSimulation);
        fmu.set(&PARAMETERS, &[0.5, 0.0]);
        fmu.initialize(0.0);
        fmu.set(&INPUTS, &[2.0, -2.0, tau, -tau]);
        fmu.step(0.0, 2.0);
        assert_eq!(fmu.get(OUTPUTS), [theta, -theta, omega, -omega]);
    }
}

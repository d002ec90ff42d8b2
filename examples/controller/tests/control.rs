//! The control law with a rigid or blocked wrist, with sensors that have an offset or are stuck, and with random inputs.

use fmu_test_kit::Random;
use prw_controller::controller::{Controller, Inputs};
use prw_controller::motor::MotorSetpoint;
use prw_controller::parameters::Parameters;
use prw_controller::wrist::{Kinematics, PitchRoll};

fn controller(change: impl Fn(&mut Parameters)) -> Controller {
    let mut parameters = Parameters::DEFAULT;
    change(&mut parameters);
    Controller::new(parameters).unwrap()
}

fn radians(degrees: PitchRoll) -> PitchRoll {
    degrees.map(f64::to_radians)
}

/// Runs the controller for `duration` s in steps of 1 ms; `measure` calculates the inputs from the time and the motion of
/// the motors. Returns the motion after each step.
fn run(
    c: &mut Controller,
    duration: f64,
    measure: impl Fn(f64, [MotorSetpoint; 2]) -> Inputs,
) -> Vec<[MotorSetpoint; 2]> {
    let start = c.now;
    let mut motions = Vec::new();
    for k in 0..(duration * 1e3).round() as usize {
        let time = start + k as f64 * 1e-3;
        c.inputs = measure(time, c.motion());
        assert!(c.step(time, 1e-3));
        motions.push(c.motion());
    }
    motions
}

/// Returns a function that measures a wrist without flexible couplings.
fn rigid(reference: PitchRoll) -> impl Fn(f64, [MotorSetpoint; 2]) -> Inputs {
    let kinematics = Kinematics::new(4, 7);
    move |_, motors| Inputs {
        reference,
        angle: kinematics.wrist(motors.map(|motor| motor.angle)),
        rate: kinematics.wrist(motors.map(|motor| motor.rate)),
        torque: [0.0; 2],
    }
}

/// Checks that the integral removes the error of sensors with an offset of 2 degrees, which feed-forward cannot.
#[test]
fn the_integral_removes_a_constant_error() {
    let reference = radians([10.0, -20.0]);
    let offset = radians([2.0, -2.0]);
    let wrist = rigid(reference);
    let measured = |time, motors| {
        let mut inputs = wrist(time, motors);
        inputs.angle = std::array::from_fn(|axis| inputs.angle[axis] + offset[axis]);
        inputs
    };
    let mut c = controller(|_| ());
    let motions = run(&mut c, 6.0, measured);
    let angle = measured(0.0, *motions.last().unwrap()).angle;
    for axis in 0..2 {
        assert!((angle[axis] - reference[axis]).to_degrees().abs() < 1e-3, "{angle:?}");
    }
}

/// Checks that the correction stays within its limit and the motors stop if the measurements do not change.
#[test]
fn stuck_sensors_keep_motors_and_correction_bounded() {
    let reference = radians([30.0, 60.0]);
    let mut c = controller(|_| ());
    let motions = run(&mut c, 10.0, |_, _| Inputs { reference, ..Inputs::default() });
    let bound = Parameters::DEFAULT.max_correction;
    let goals = Kinematics::new(4, 7).motors(reference);
    for (motor, goal) in motions.last().unwrap().iter().zip(goals) {
        assert!(motor.rate.abs() < 1e-9 && (motor.angle - goal).abs() <= bound * (1.0 + 4.0 / 7.0) + 1e-9);
    }
    assert_eq!(c.correction.map(f64::abs), [bound; 2]);
}

/// Checks a blocked wrist, whose couplings (32 N.m/rad, as the controller assumes) are twisted by the whole motor angle. The
/// torque must never exceed the limit. After the wrist is released, the motors must not overshoot.
#[test]
fn motors_back_off_from_a_blocked_wrist() {
    let reference = radians([120.0, 0.0]);
    let p = Parameters::DEFAULT;
    let blocked = |_, motors: [MotorSetpoint; 2]| Inputs {
        reference,
        torque: motors.map(|motor| -p.stiffness * motor.angle),
        ..Inputs::default()
    };
    let mut c = controller(|_| ());
    let motions = run(&mut c, 3.0, blocked);
    for motor in motions.iter().flatten() {
        assert!(p.stiffness * motor.angle <= p.max_torque * (1.0 + 1e-9), "{motor:?}");
    }
    let [one, _] = motions.last().unwrap();
    assert!((p.stiffness * one.angle - p.max_torque).abs() < 1e-6, "{one:?}");
    // Anti-windup: the integral has paused while the motors moved, and while the torque limited their goals.
    assert_eq!(c.integral, [0.0; 2]);
    let motions = run(&mut c, 2.0, rigid(reference));
    for motor in motions.iter().flatten() {
        assert!(motor.angle <= reference[0] + 1e-9, "{motor:?}");
    }
}

/// Checks that the motors do not turn forward while the torque exceeds the limit, even if they did not cause the torque.
#[test]
fn torque_beyond_the_limit_reverses_the_motor() {
    let mut c = controller(|_| ());
    let pushed = |_, _| Inputs { reference: [1.0, 0.0], torque: [-12.0, -12.0], ..Inputs::default() };
    for motor in run(&mut c, 0.5, pushed).iter().flatten() {
        assert!(motor.rate <= 0.0);
    }
}

/// Checks that the communication points change neither the times of the samples nor their results, which are
/// bit-identical.
#[test]
fn samples_do_not_depend_on_the_communication_step() {
    let wrist =
        |time: f64| Inputs { reference: [if time < 0.0305 { 0.4 } else { -0.2 }, 0.3], ..Inputs::default() };
    let mut states = Vec::new();
    for steps in [vec![1e-3; 100], vec![0.5e-3; 200], vec![0.1e-3; 1000], [0.3e-3, 0.2e-3].repeat(200)] {
        let mut c = controller(|_| ());
        let mut time = 0.0_f64;
        for h in steps {
            // The inputs change only at samples, so that all runs sample equal values.
            c.inputs = wrist((time * 1e3 + 1e-6).floor() / 1e3);
            assert!(c.step(time, h));
            time += h;
        }
        let bits = c.motors.map(|m| [m.angle.to_bits(), m.rate.to_bits(), m.acceleration.to_bits()]);
        states.push((c.schedule.next, bits));
    }
    assert_eq!(states[0].0, 100.0);
    for state in &states[1..] {
        assert_eq!(*state, states[0]);
    }
}

/// Checks that samples within a long step use inputs that are extrapolated with their slopes.
#[test]
fn input_slopes_reach_the_samples_inside_a_step() {
    let ramp = |time: f64| 0.5 * time;
    let mut fine = controller(|p| p.Kd = 0.0);
    let mut coarse = fine.clone();
    run(&mut fine, 0.1, |time, _| Inputs { reference: [ramp(time), 0.0], ..Inputs::default() });
    for k in 0..10 {
        let time = 0.01 * f64::from(k);
        coarse.inputs.reference[0] = ramp(time);
        coarse.slopes.reference[0] = 0.5;
        assert!(coarse.step(time, 0.01));
        assert_eq!(coarse.slopes, Inputs::default());
    }
    assert!((fine.motion()[0].angle - coarse.motion()[0].angle).abs() < 1e-12);
}

#[test]
fn a_new_sample_time_applies_from_the_next_sample_on() {
    let mut c = controller(|_| ());
    assert!(c.step(0.0, 0.0025));
    c.parameters.sample_time = 0.01;
    c.parameters_changed().unwrap();
    assert!(c.step(0.0025, 0.0105));
    // Samples at 0, 1, 2, then 3 and 13 ms; the last one belongs to the next step.
    assert_eq!((c.sampled_at, c.schedule.next), (0.003, 1.0));
    assert!(c.step(0.013, 1e-4));
    assert_eq!(c.schedule.next, 2.0);
}

#[test]
fn invalid_parameters_are_rejected() {
    let with = |change: fn(&mut Parameters)| {
        let mut p = Parameters::DEFAULT;
        change(&mut p);
        p
    };
    for (text, parameters) in [
        ("sample_time must be between", with(|p| p.sample_time = 0.0)),
        ("max_rate must be between", with(|p| p.max_rate = -1.0)),
        ("max_acceleration must be between", with(|p| p.max_acceleration = f64::INFINITY)),
        ("stiffness must be between", with(|p| p.stiffness = f64::NAN)),
        ("Kp must be between 0", with(|p| p.Kp = -0.1)),
        ("Ki * sample_time must not exceed 1", with(|p| p.Ki = 1001.0)),
        ("N must be >= 1, it is 0", with(|p| p.N = 0)),
    ] {
        let message = Controller::new(parameters).unwrap_err().to_string();
        assert!(message.contains(text), "{message}");
    }
    let mut c = controller(|_| ());
    assert!(!c.step(0.0, 1e9), "a step with 1e12 samples");
    assert_eq!(c.schedule.next, 0.0);
}

/// Draws any finite number that an importer can set, including the largest ones.
fn any_input(random: &mut Random) -> f64 {
    match random.below(11) {
        0 => random.between(-1.0, 1.0) * 1e308,
        1 => f64::MAX,
        2 => -f64::MAX,
        _ => random.between(-3.0, 3.0),
    }
}

/// Checks for any inputs and steps that values are finite and within their limits, and that omega is the derivative of
/// theta.
#[test]
fn limits_hold_and_rates_are_derivatives() {
    for seed in 0..200 {
        let random = &mut Random(seed);
        let [step, rate] = [random.between(0.1e-3, 5e-3), random.between(0.1, 10.0)];
        let acceleration = random.between(1.0, 100.0);
        let mut c = controller(|p| (p.max_rate, p.max_acceleration) = (rate, acceleration));
        let mut time = 0.0;
        for _ in 0..1 + random.below(19) {
            let mut pair = || std::array::from_fn(|_| any_input(random));
            c.inputs = Inputs { reference: pair(), angle: pair(), rate: pair(), torque: pair() };
            for _ in 0..20 {
                let before = c.motion();
                assert!(c.step(time, step));
                time += step;
                for (old, new) in before.iter().zip(c.motion()) {
                    assert!(new.angle.is_finite(), "seed {seed}: {new:?}");
                    assert!(new.rate.abs() <= rate * (1.0 + 1e-9), "seed {seed}: {new:?}");
                    let limit = acceleration * step * (1.0 + 1e-9) + 1e-12;
                    assert!((new.rate - old.rate).abs() <= limit, "seed {seed}: {old:?} {new:?}");
                    // The mean of both rates gives the exact change of the angle if the step is within one sample period,
                    // and nearly the exact one otherwise.
                    let mean = 0.5 * (old.rate + new.rate) * step;
                    let limit = acceleration * step * step + 1e-9;
                    assert!((new.angle - old.angle - mean).abs() <= limit, "seed {seed}: {old:?} {new:?}");
                }
                assert!(c.correction.iter().all(|x| x.abs() <= 0.2), "seed {seed}: {:?}", c.correction);
            }
        }
    }
}

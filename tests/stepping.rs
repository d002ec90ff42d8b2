//! Compares the exact step with independent calculations: with eq. (11) instead of the decoupled equations, and with the
//! matrix exponential instead of the propagator.

#[path = "fmu/exponential.rs"]
mod exponential;

use exponential::exponential;
use fmu_test_kit::Random;
use nalgebra::SMatrix;
use prw_testbed::pair::PitchRoll;
use prw_testbed::propagator::{Propagator, StepMatrices};
use prw_testbed::state_space::state_space;
use prw_testbed::{BUILT_IN, Parameters, Testbed};

/// Calls `check` with 256 generators.
fn for_random_cases(mut check: impl FnMut(&mut Random)) {
    (0..256).for_each(|seed| check(&mut Random(seed)));
}

/// Returns random parameters: each measured one of Table 1, multiplied by a factor from 1/5 to 5.
fn parameters(random: &mut Random) -> Parameters {
    let near = BUILT_IN.varied(|| random.between(-1.6, 1.6));
    Parameters { M: 1 + random.below(8) as i32, N: 1 + random.below(14) as i32, ..near }
}

/// Returns random numbers between `-limit` and `limit`.
fn array<const N: usize>(random: &mut Random, limit: f64) -> [f64; N] {
    std::array::from_fn(|_| random.between(-limit, limit))
}

/// Sets the angles of both motors, and their rates as derivatives.
fn sample(testbed: &mut Testbed, theta: [f64; 2], rates: [f64; 2]) {
    for motor in 0..2 {
        testbed.motors.set_theta(motor, theta[motor]);
        testbed.motors.set_rate(motor, rates[motor]);
    }
}

/// Returns the state x after time h with constant motor rates omega, by the matrix exponential for `[x, theta, omega]`.
fn reference(p: &Parameters, x: [f64; 6], theta: [f64; 2], omega: [f64; 2], h: f64) -> [f64; 6] {
    let system = state_space(p);
    let mut generator = SMatrix::<f64, 10, 10>::zeros();
    generator.fixed_view_mut::<6, 6>(0, 0).copy_from(&system.A);
    generator.fixed_view_mut::<6, 4>(0, 6).copy_from(&system.B);
    generator[(6, 8)] = 1.0;
    generator[(7, 9)] = 1.0;
    let start = SMatrix::<f64, 10, 1>::from_iterator(x.into_iter().chain(theta).chain(omega));
    let end = exponential(generator * h) * start;
    std::array::from_fn(|i| end[i])
}

#[test]
fn decoupled_equations_are_those_of_eq_11() {
    for_random_cases(|random| {
        let p = parameters(random);
        let system = state_space(&p);
        let decoupled = *Testbed::new(p).unwrap().system();
        let (pitch, roll) = (decoupled.pitch, decoupled.roll);
        // In each 2 x 2 block of eq. (11), both diagonal entries are half the sum of the pitch and roll entries, and both
        // off-diagonal entries are half their difference.
        for row in 0..3 {
            for column in 0..3 {
                let expect = |sign: f64| 0.5 * (pitch.a[(row, column)] + sign * roll.a[(row, column)]);
                let scale = pitch.a[(row, column)].abs() + roll.a[(row, column)].abs() + 1.0;
                assert!((system.A[(2 * row, 2 * column)] - expect(1.0)).abs() < 1e-12 * scale);
                assert!((system.A[(2 * row, 2 * column + 1)] - expect(-1.0)).abs() < 1e-12 * scale);
            }
            for (column, (b_pitch, b_roll)) in
                [(pitch.b_angle, roll.b_angle), (pitch.b_rate, roll.b_rate)].into_iter().enumerate()
            {
                let expect = |sign: f64| 0.5 * (b_pitch[row] + sign * b_roll[row]);
                let scale = b_pitch[row].abs() + b_roll[row].abs() + 1.0;
                assert!((system.B[(2 * row, 2 * column)] - expect(1.0)).abs() < 1e-12 * scale);
                assert!((system.B[(2 * row, 2 * column + 1)] - expect(-1.0)).abs() < 1e-12 * scale);
            }
        }
    });
}

#[test]
fn steps_are_exact() {
    for_random_cases(|random| {
        let p = parameters(random);
        let x: [f64; 6] = array(random, 1.0);
        let (theta, omega) = (array(random, 1.0), array(random, 10.0));
        let h = 10f64.powf(random.between(-6.0, 0.3));
        let mut testbed = Testbed::new(p).unwrap();
        testbed.state = x;
        sample(&mut testbed, theta, omega);
        assert!(testbed.step(h));
        for (found, expected) in testbed.state.iter().zip(reference(&p, x, theta, omega, h)) {
            let scale = expected.abs().max(30.0); // velocities reach tens of rad/s
            assert!((found - expected).abs() < 1e-11 * scale, "{found} {expected}");
        }
    });
}

#[test]
fn two_steps_are_one() {
    for_random_cases(|random| {
        let (p, split) = (parameters(random), random.between(0.01, 0.99));
        let (h, omega) = (0.02, [3.0, -1.0]);
        let mut once = Testbed::new(p).unwrap();
        sample(&mut once, [0.0; 2], omega);
        let mut twice = once.clone();
        assert!(once.step(h) && twice.step(h * split));
        sample(&mut twice, omega.map(|w| w * h * split), omega);
        assert!(twice.step(h - h * split));
        for (a, b) in once.state.iter().zip(twice.state) {
            assert!((a - b).abs() < 1e-12 * (1.0 + a.abs()));
        }
    });
}

/// Checks that fast steps and general steps are bit-identical, even if rates are set as derivatives or come from omega.
#[test]
fn fast_steps_are_steps() {
    let mut fast = 0;
    for_random_cases(|random| {
        let mut testbed = Testbed::new(parameters(random)).unwrap();
        testbed.motors.use_omega = random.chance(0.5);
        testbed.motors.use_omega_changed();
        let mut other = testbed.clone();
        for _ in 0..4 + random.below(26) {
            let (theta, size) = (array::<2>(random, 1.0), random.below(8));
            let rates = [(); 2].map(|()| random.chance(0.2).then(|| random.between(-9.0, 9.0)));
            for testbed in [&mut testbed, &mut other] {
                for motor in 0..2 {
                    testbed.motors.set_theta(motor, theta[motor]);
                    testbed.motors.set_omega(motor, 0.5 - theta[motor]);
                    if let Some(rate) = rates[motor] {
                        testbed.motors.set_rate(motor, rate);
                    }
                }
            }
            let h = if size == 0 { 2e-3 } else { 1e-3 };
            if size == 1 {
                // A copy has no step matrices, so its next step cannot be fast.
                testbed = testbed.clone();
            }
            if testbed.step_fast(h).is_some() {
                fast += 1;
            } else {
                assert!(testbed.step(h));
            }
            assert!(other.step(h));
            assert_eq!(testbed.state.map(f64::to_bits), other.state.map(f64::to_bits));
            assert_eq!(testbed.motors, other.motors);
        }
    });
    assert!(fast > 500, "{fast}");
}

/// Checks that step matrices are computed once for each of up to 8 step sizes, even if states are saved and restored in
/// between, and that steps use the matrices of their size. The times are grids like `np.arange(n) * 1e-3`, whose
/// differences vary in their last digits.
#[test]
fn matrices_are_computed_once_for_each_size() {
    for_random_cases(|random| {
        let (p, dt) = (parameters(random), random.between(1e-5, 1e-2));
        let first = 1 + random.below(4999) as i32;
        let size = |k: i32| f64::from(k + 1) * dt - f64::from(k) * dt;
        let mut testbed = Testbed::new(p).unwrap();
        assert!(testbed.step(dt));
        // A changed parameter discards the matrices but keeps the memory allocated for the next ones.
        testbed.parameters.k1 *= 1.5;
        testbed.parameters_changed().unwrap();
        for mut testbed in [testbed.clone(), testbed] {
            let mut sizes: Vec<f64> = Vec::new();
            let before = testbed.computed_matrices();
            for k in first..first + 40 {
                // A fresh copy computes its matrices again, which is slow, so only every eighth step is compared with one.
                let mut fresh = (k % 8 == 0).then(|| testbed.clone());
                testbed.motors.set_theta(0, 0.01 * f64::from(k % 7));
                assert!(testbed.step(size(k)));
                if let Some(fresh) = &mut fresh {
                    fresh.motors.set_theta(0, 0.01 * f64::from(k % 7));
                    assert!(fresh.step(size(k)));
                    assert_eq!(testbed.state.map(f64::to_bits), fresh.state.map(f64::to_bits));
                }
                if !sizes.contains(&size(k)) {
                    sizes.push(size(k));
                }
                // Saves and restores the state.
                let saved = testbed.clone();
                testbed.copy_from(&saved);
            }
            if sizes.len() <= 8 {
                assert_eq!(testbed.computed_matrices() - before, sizes.len() as u64);
            }
        }
    });
}

/// Checks that the step matrices, in which pitch and roll are calculated together, equal the propagators of pitch and roll.
#[test]
fn pairs_of_propagators_are_propagators() {
    let mut compared = 0;
    for_random_cases(|random| {
        let (p, h) = (parameters(random), 10f64.powf(random.between(-6.0, -3.0)));
        let system = *Testbed::new(p).unwrap().system();
        let matrices = StepMatrices::new(&system, h);
        if matrices.remaining_velocity(PitchRoll::both(1.0)).is_some() {
            return;
        }
        compared += 1;
        let [pitch, roll] = [system.pitch, system.roll].map(|subsystem| Propagator::new(&subsystem, h));
        let zero = PitchRoll::both(0.0);
        for column in 0..3 {
            let mut unit = [zero; 3];
            unit[column] = PitchRoll::both(2.0);
            for (row, found) in matrices.increment(&unit, zero, zero).into_iter().enumerate() {
                assert_eq!(found.array(), [pitch.growth[(row, column)], roll.growth[(row, column)]]);
            }
        }
        for (row, found) in matrices.increment(&[zero; 3], PitchRoll::both(2.0), zero).into_iter().enumerate()
        {
            assert_eq!(found.array(), [pitch.ramp[row], roll.ramp[row]]);
        }
    });
    assert!(compared > 100, "{compared}");
}

#[test]
fn opposite_motors_leave_pitch_at_zero_and_equal_motors_roll() {
    for sign in [-1.0, 1.0] {
        let mut testbed = Testbed::new(BUILT_IN).unwrap();
        for i in 0..2000 {
            let t = f64::from(i) * 1e-3;
            let angle = (1.0 - (31.4 * t).cos()) / 31.4;
            sample(&mut testbed, [angle, sign * angle], [(31.4 * t).sin(), sign * (31.4 * t).sin()]);
            assert!(testbed.step(1e-3));
            let [.., theta5, theta6, _, _] = testbed.state;
            assert_eq!(theta5, sign * theta6);
        }
        assert!(testbed.state[2].abs() > 1e-3);
    }
}

/// Checks that stored step matrices are used only for their parameters and their step size.
#[test]
fn earlier_steps_do_not_matter() {
    let p = BUILT_IN;
    let other = Parameters { k1: 2.0 * p.k1, ..p };
    let step = |testbed: &mut Testbed, h: f64| {
        testbed.state = [0.1, -0.2, 0.15, 0.05, 1.0, -2.0];
        testbed.motors = Default::default();
        sample(testbed, [0.1, 0.3], [3.0, -1.0]);
        assert!(testbed.step(h));
        testbed.state
    };
    let fresh = |p: Parameters, h| step(&mut Testbed::new(p).unwrap(), h);
    // The list has more sizes than the cache can store, some of them nearly equal.
    let sizes = || (0..12).flat_map(|i| [1e-3 + 1e-10 * f64::from(i), 1e-3, 1e-3 * f64::from(i % 3 + 1)]);

    let mut testbed = Testbed::new(p).unwrap();
    for h in sizes() {
        assert_eq!(step(&mut testbed, h), fresh(p, h), "{h}");
    }
    let saved = testbed.clone();
    testbed.parameters = other;
    testbed.parameters_changed().unwrap();
    for h in sizes() {
        assert_eq!(step(&mut testbed, h), fresh(other, h), "{h} after the parameters have changed");
    }
    assert!(testbed.copy_from(&saved));
    for h in sizes() {
        assert_eq!(step(&mut testbed, h), fresh(p, h), "{h} after a saved testbed is restored");
    }
}

/// Checks a testbed without load damping whose sides turn with their motors. They must keep turning, accurate to the last
/// digits, for large ranges of stiffness, damping of the couplings at the motors, and step size.
#[test]
fn a_testbed_that_turns_keeps_turning() {
    let mut worst = 0.0_f64;
    for exponents in (0..4).flat_map(|k| (0..4).map(move |c| [k, c])) {
        let [k, c] = exponents.map(|exponent| 1e3_f64.powi(exponent));
        let built_in = BUILT_IN;
        let p = Parameters {
            k1: built_in.k1 * k,
            k2: built_in.k2 * k,
            c1: built_in.c1 * c * 1e-6,
            c3: 0.0,
            ..built_in
        };
        for h in [1e-4, 1e-3, 1e-2, 0.1, 1.0] {
            let omega = [3.0, -1.0];
            let mut testbed = Testbed::new(p).unwrap();
            testbed.state = [0.0, 0.0, 0.0, 0.0, omega[0], omega[1]];
            sample(&mut testbed, [0.0; 2], omega);
            assert!(testbed.step(h));
            for (motor, omega) in omega.into_iter().enumerate() {
                let [q_i, q_ii, v] = [0, 2, 4].map(|index| testbed.state[index + motor]);
                let error = [q_i / h, q_ii / h, v].map(|rate| ((rate - omega) / omega).abs());
                worst = error.into_iter().fold(worst, f64::max);
            }
        }
    }
    assert!(worst < 3e-15, "{worst:e}");
}

/// Checks that a velocity decays exponentially if there is almost no stiffness, and that even a small remainder is accurate
/// to the last digits.
#[test]
fn decayed_velocities_have_all_digits() {
    let built_in = BUILT_IN;
    let p = Parameters { k1: 1e-20, k2: 1e-20, c3: 1.0, ..built_in };
    let mut testbed = Testbed::new(p).unwrap();
    let rate = (testbed.system().side.damping + 0.5 * p.c3) / (p.J2 + 0.5 * p.H3);
    for fading in [0.1, 0.6, 0.8, 3.0, 10.0, 20.0] {
        testbed.state = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0];
        testbed.motors = Default::default();
        assert!(testbed.step(fading / rate));
        let left = testbed.state[4] / (-fading).exp();
        assert!((left - 1.0).abs() < 1e-14 * (1.0 + fading), "{fading}: {left}");
    }
}

#[test]
fn a_parameter_that_is_0_is_varied_too() {
    let built_in = Parameters { c1: 0.0, ..BUILT_IN };
    let varied = built_in.varied(|| 0.5);
    assert_eq!(varied.k1, built_in.k1 * 0.5_f64.exp());
    assert_eq!(varied.c1, built_in.c2.max(built_in.c3) * 0.5_f64.exp());
    assert_eq!((varied.M, varied.N), (built_in.M, built_in.N));
}

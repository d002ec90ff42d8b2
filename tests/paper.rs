//! Checks the model's eigenvalues and gains for the parameters of the paper, and the paper's equations against each other.
//! For each erratum, a test shows that the printed equation is wrong.

use nalgebra::{Complex, ComplexField as _, Matrix2, Matrix4, Matrix6, Vector4};
use prw_testbed::energies::{Angles, dissipation, kinetic_energy, potential_energy, sect};
use prw_testbed::state_space::{
    angle_transfer_matrix, damping_matrix, force, mass_matrix, state_space, stiffness_matrix, transfer_matrix,
};
use prw_testbed::testbed::Testbed;
use prw_testbed::{BUILT_IN as TABLE_1, Parameters};

const DEG_PER_RAD: f64 = 180.0 / std::f64::consts::PI;

fn sorted_eigenvalues(a: Matrix6<f64>) -> Vec<Complex<f64>> {
    let mut eigenvalues: Vec<_> = a.complex_eigenvalues().iter().copied().collect();
    eigenvalues.sort_by(|a, b| (a.re, a.im).partial_cmp(&(b.re, b.im)).unwrap());
    eigenvalues
}

/// Eigenvalues of A for Table 1, 1/s, to 8 decimals.
const EIGENVALUES: [(f64, f64); 6] = [
    (-174.87270665, 0.0),
    (-174.36733032, 0.0),
    (-18.94465405, -32.14568305),
    (-18.94465405, 32.14568305),
    (-9.68285129, -34.67786598),
    (-9.68285129, 34.67786598),
];

fn has_the_known_eigenvalues(p: &Parameters) -> bool {
    sorted_eigenvalues(state_space(p).A)
        .iter()
        .zip(EIGENVALUES)
        .all(|(found, (re, im))| (found - Complex::new(re, im)).abs() < 2e-8)
}

#[test]
fn eigenvalues_of_a() {
    assert!(has_the_known_eigenvalues(&TABLE_1));
}

#[test]
fn dc_gains() {
    let zero = Complex::new(0.0, 0.0);
    let h = angle_transfer_matrix(&TABLE_1, zero).unwrap();
    let g = transfer_matrix(&TABLE_1, zero).unwrap();
    for (row, expected) in [1.0, 0.0, 1.0, 0.0].into_iter().enumerate() {
        assert!((h[(row, 0)] - expected).abs() < 1e-12, "theta1 -> q[{row}] is {}", h[(row, 0)]);
    }
    assert!((g[(0, 0)] - 1.0).abs() < 1e-12 && g[(1, 0)].abs() < 1e-12);
}

/// Checks that eqs. (13) and (15) give equal gains from motor angles to shaft angles. In eq. (13), the motor rates are
/// separate inputs, which are s times the angles.
#[test]
fn transfer_matrices_agree() {
    for hertz in [0.1, 1.0, 5.0, 30.0, 500.0] {
        let s = Complex::new(0.0, 2.0 * std::f64::consts::PI * hertz);
        let h = angle_transfer_matrix(&TABLE_1, s).unwrap();
        let g = transfer_matrix(&TABLE_1, s).unwrap();
        for shaft in 0..2 {
            for motor in 0..2 {
                let from_g = g[(shaft, motor)] + s * g[(shaft, motor + 2)];
                assert!((h[(shaft, motor)] - from_g).abs() < 1e-12 * (1.0 + from_g.abs()));
            }
        }
    }
}

#[test]
fn erratum_theta7_is_pitch_and_theta8_is_roll() {
    // Sec. 4: if the motors move in opposite directions, the pitch rate is zero. With the printed definition, theta7 would
    // be roll.
    let (pitch, roll) = sect(&TABLE_1, 0.3, -0.3);
    assert_eq!(pitch, 0.0);
    assert!((roll - 7.0 / 4.0 * 0.3).abs() < 1e-15);
    // Eq. (4b): the inertia about the pitch axis is H3. With the printed, swapped inertias, H3 would belong
    // to roll.
    let rates = Angles { theta5: 1.0, theta6: 1.0, ..Angles::default() };
    assert!((kinetic_energy(&TABLE_1, &rates) - (TABLE_1.J2 + 0.5 * TABLE_1.H3)).abs() < 1e-15);
}

/// Returns the Hessian matrix of a quadratic form of theta1 to theta6, by central differences, which are exact for it.
fn hessian(form: impl Fn(&Angles) -> f64) -> Matrix6<f64> {
    let at = |i: usize, j: usize, si: f64, sj: f64| {
        let mut q = [0.0; 6];
        q[i] += si;
        q[j] += sj;
        let [theta1, theta2, theta3, theta4, theta5, theta6] = q;
        form(&Angles { theta1, theta2, theta3, theta4, theta5, theta6 })
    };
    Matrix6::from_fn(|i, j| {
        0.25 * (at(i, j, 1., 1.) - at(i, j, 1., -1.) - at(i, j, -1., 1.) + at(i, j, -1., -1.))
    })
}

/// Returns the block of the Hessian matrix for theta3 to theta6, whose motion eq. (8) describes.
fn free(hessian: &Matrix6<f64>) -> Matrix4<f64> {
    hessian.fixed_view::<4, 4>(2, 2).into_owned()
}

#[test]
fn erratum_last_term_of_eq_6_has_k2() {
    let printed = |q: &Angles| {
        let last = |k: f64| 0.5 * k * (q.theta4 - q.theta6) * (q.theta4 - q.theta6);
        potential_energy(&TABLE_1, q) - last(TABLE_1.k2) + last(TABLE_1.k1)
    };
    let k = stiffness_matrix(&TABLE_1);
    assert!((free(&hessian(printed)) - k).norm() > 0.1 * k.norm());
}

/// Checks M, Delta, K and f of eq. (8). By Lagrange's equation (2), the motors act on the testbed with the
/// negative mixed derivatives of the potential energy and of the dissipation.
#[test]
fn matrices_of_eq_8_follow_from_the_energies() {
    let mut exponent = 0.0;
    // Parameters that differ from Table 1, none of them 0.
    let varied = TABLE_1.varied(|| {
        exponent += 0.1;
        exponent
    });
    [TABLE_1, varied].iter().for_each(follow_from_the_energies);
}

fn follow_from_the_energies(p: &Parameters) {
    let kinetic = hessian(|rates| kinetic_energy(p, rates));
    let (damping, stiffness) = (hessian(|rates| dissipation(p, rates)), hessian(|q| potential_energy(p, q)));
    for (found, expected) in
        [(&kinetic, mass_matrix(p)), (&damping, damping_matrix(p)), (&stiffness, stiffness_matrix(p))]
    {
        assert!((free(found) - expected).norm() < 1e-12 * expected.norm());
    }
    for (motor, unit) in [[1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
        for (hessian, found) in [(&stiffness, force(p, unit, [0.0; 2])), (&damping, force(p, [0.0; 2], unit))]
        {
            let expected = -hessian.fixed_view::<4, 1>(2, motor);
            assert!((found - expected).norm() < 1e-12 * expected.norm());
        }
    }
}

#[test]
fn erratum_signs_of_a11_a12_a13() {
    let mut printed = state_space(&TABLE_1).A;
    let negated = -printed.fixed_rows::<2>(0).into_owned();
    printed.fixed_rows_mut::<2>(0).copy_from(&negated);
    let largest = |a| sorted_eigenvalues(a).last().unwrap().re;
    assert!(largest(state_space(&TABLE_1).A) < 0.0);
    assert!((largest(printed) - 183.0).abs() < 1.0, "{}", largest(printed));
}

#[test]
fn erratum_signs_of_d31_d32() {
    let p = &TABLE_1;
    let system = state_space(p);
    let (theta, omega) = ([0.3, -0.7], [1.1, 0.4]);
    let (q, v) = (Vector4::new(0.1, 0.2, -0.5, 0.6), Vector4::new(0.0, 0.0, 0.8, -0.9));
    // Computes q_I' from the first two rows of eq. (8), then evaluates eq. (10) directly.
    let rest = force(p, theta, omega) - stiffness_matrix(p) * q - damping_matrix(p) * v;
    let tau = |i: usize| {
        let q_rate = rest[i] / (p.c1 + p.c2);
        p.k1 * q[i] + p.c1 * q_rate - (p.k1 * theta[i] + p.c1 * omega[i])
    };
    let y = |d: &nalgebra::SMatrix<f64, 6, 4>| {
        let x = nalgebra::Vector6::new(q[0], q[1], q[2], q[3], v[2], v[3]);
        system.C * x + d * Vector4::new(theta[0], theta[1], omega[0], omega[1])
    };
    let mut printed = system.D;
    let first_term = Matrix2::identity() * (p.c1 / (p.c1 + p.c2));
    let correction = first_term * 2.0;
    for (columns, coefficient) in [(0, p.k1), (2, p.c1)] {
        let block = printed.fixed_view::<2, 2>(4, columns) - correction * coefficient;
        printed.fixed_view_mut::<2, 2>(4, columns).copy_from(&block);
    }
    for i in 0..2 {
        assert!((y(&system.D)[4 + i] - tau(i)).abs() < 1e-11);
        assert!((y(&printed)[4 + i] - tau(i)).abs() > 1.0);
    }
}

#[test]
fn erratum_table_1_is_per_degree() {
    let printed = Parameters { k1: 2.11, k2: 0.76, c1: 7.83e-3, c2: 8.35e-3, c3: 6.66e-3, ..TABLE_1 };
    assert!((TABLE_1.k1 - 2.11 * DEG_PER_RAD).abs() < 1e-12);
    assert!((TABLE_1.c3 - 6.66e-3 * DEG_PER_RAD).abs() < 1e-14);
    assert!(!has_the_known_eigenvalues(&printed));
}

/// Checks that the excitation is theta1' = sin(10 pi t). With the printed sin(10 pi), which is 0, the motors would be at
/// rest, unlike in Fig. 4.
#[test]
fn erratum_excitation_of_sec_4_depends_on_time() {
    let peak_roll = |rate: &dyn Fn(f64) -> f64| {
        let mut testbed = Testbed::new(TABLE_1).unwrap();
        testbed.motors.use_omega = true;
        let mut theta = 0.0;
        let mut peak = 0.0_f64;
        for k in 0..2000 {
            let omega = rate(1e-3 * f64::from(k));
            for (motor, sign) in [(0, 1.0), (1, -1.0)] {
                testbed.motors.set_theta(motor, sign * theta);
                testbed.motors.set_omega(motor, sign * omega);
            }
            assert!(testbed.step(1e-3));
            theta += 1e-3 * omega;
            peak = peak.max((testbed.state[2] - testbed.state[3]).abs());
        }
        peak
    };
    let meant = peak_roll(&|t| (10.0 * std::f64::consts::PI * t).sin());
    let printed = peak_roll(&|_| (10.0 * std::f64::consts::PI).sin());
    assert!(meant > 0.05 && printed < 1e-12, "{meant} {printed}");
}

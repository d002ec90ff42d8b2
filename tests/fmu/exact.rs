//! Reference for the FMU, calculated from eq. (11) in [`prw_testbed::state_space`]: values by matrix products, and motion by
//! the matrix exponential for the vector of states, motor angles and motor rates.

#![allow(non_snake_case, reason = "the paper's symbols")]

use crate::exponential::exponential;
use crate::{TABLE, vr};
use fmu_export::{BaseType, Causality, Variable};
use fmu_test_kit::{Either, Random};
use nalgebra::SMatrix;
use prw_testbed::TestbedFmu;
use prw_testbed::state_space::state_space;
use prw_testbed::variables::Name;
use prw_testbed::{BUILT_IN, Parameters};

pub const INPUTS: [u32; 4] = [vr(Name::theta1), vr(Name::theta2), vr(Name::omega1), vr(Name::omega2)];
pub const STATES: [u32; 6] = [
    vr(Name::theta3),
    vr(Name::theta4),
    vr(Name::theta5),
    vr(Name::theta6),
    vr(Name::omega5),
    vr(Name::omega6),
];
/// The parameters that are the start values of the states, in the order of [`STATES`].
pub const STARTS: [u32; 6] = [
    vr(Name::theta3_start),
    vr(Name::theta4_start),
    vr(Name::theta5_start),
    vr(Name::theta6_start),
    vr(Name::omega5_start),
    vr(Name::omega6_start),
];
/// The variables of eqs. (1), (9) and (11), in the order of the rows of [`jacobian`].
pub const LINEAR: [u32; 14] = [
    vr(Name::der_theta3),
    vr(Name::der_theta4),
    vr(Name::der_theta5),
    vr(Name::der_theta6),
    vr(Name::der_omega5),
    vr(Name::der_omega6),
    vr(Name::tau1),
    vr(Name::tau2),
    vr(Name::pitch),
    vr(Name::roll),
    vr(Name::pitch_rate),
    vr(Name::roll_rate),
    vr(Name::theta3),
    vr(Name::theta4),
];

/// Returns all variables that have partial derivatives after the initialization (section 2.1.9 of FMI 2.0): Real outputs and the
/// derivatives of the states.
pub fn unknowns() -> Vec<u32> {
    let is_one = |v: &Variable<TestbedFmu>| {
        v.base() == BaseType::Real && (v.causality() == Causality::Output || v.differentiates().is_some())
    };
    (0..).zip(TABLE).filter(|(_, variable)| is_one(variable)).map(|(vr, _)| vr).collect()
}

/// Returns the partial derivatives of [`LINEAR`] with respect to [`STATES`] and [`INPUTS`]: A and B, the
/// torque rows of C and D, eq. (1), and rows with a 1 for theta3 and theta4, which are states.
pub fn jacobian(p: &Parameters) -> SMatrix<f64, 14, 10> {
    let system = state_space(p);
    let mut jacobian = SMatrix::<f64, 14, 10>::zeros();
    jacobian.fixed_view_mut::<6, 6>(0, 0).copy_from(&system.A);
    jacobian.fixed_view_mut::<6, 4>(0, 6).copy_from(&system.B);
    jacobian.fixed_view_mut::<2, 6>(6, 0).copy_from(&system.C.fixed_rows::<2>(4));
    jacobian.fixed_view_mut::<2, 4>(6, 6).copy_from(&system.D.fixed_rows::<2>(4));
    let ratio = f64::from(p.N) / (2.0 * f64::from(p.M));
    for (row, first) in [(8, 2), (10, 4)] {
        jacobian.fixed_view_mut::<2, 2>(row, first).copy_from_slice(&[0.5, ratio, 0.5, -ratio]);
    }
    (jacobian[(12, 0)], jacobian[(13, 1)]) = (1.0, 1.0);
    jacobian
}

/// Returns the state and the motor angles after time h, while the motors turn at constant rates.
pub fn advanced(
    p: &Parameters,
    x: [f64; 6],
    theta: [f64; 2],
    rates: [f64; 2],
    h: f64,
) -> ([f64; 6], [f64; 2]) {
    let system = state_space(p);
    let mut generator = SMatrix::<f64, 10, 10>::zeros();
    generator.fixed_view_mut::<6, 6>(0, 0).copy_from(&system.A);
    generator.fixed_view_mut::<6, 4>(0, 6).copy_from(&system.B);
    (generator[(6, 8)], generator[(7, 9)]) = (1.0, 1.0);
    let start = SMatrix::<f64, 10, 1>::from_iterator(x.into_iter().chain(theta).chain(rates));
    let end = exponential(generator * h) * start;
    (std::array::from_fn(|i| end[i]), [end[6], end[7]])
}

/// Returns the state after a jump of the motor angles by `d`: x jumps by B2 d.
pub fn jumped(p: &Parameters, x: [f64; 6], d: [f64; 2]) -> [f64; 6] {
    let b = state_space(p).B;
    std::array::from_fn(|i| x[i] + b[(i, 2)] * d[0] + b[(i, 3)] * d[1])
}

/// Returns the largest absolute difference of two elements with the same index.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Makes the testbed start in this state instead of at rest.
#[track_caller]
pub fn start_at(fmu: &dyn Either, x: [f64; 6]) {
    fmu.ok(fmu.set_boolean(vr(Name::start_at_rest), 0));
    fmu.set(&STARTS, &x);
}

/// Sets all parameters of the equations. The Reals are set in one call, because the FMU checks them together.
pub fn set_parameters(fmu: &dyn Either, p: &Parameters) {
    let (mut reals, mut values) = (Vec::new(), Vec::new());
    for (name, value) in p.start_values() {
        let vr = TABLE.iter().position(|variable| variable.name() == name).unwrap();
        if TABLE[vr].base() == BaseType::Real {
            reals.push(vr as u32);
            values.push(value.parse().unwrap());
        } else {
            fmu.ok(fmu.set_integer(vr as u32, value.parse().unwrap()));
        }
    }
    fmu.set(&reals, &values);
}

/// Returns the value references of the Real parameters.
pub fn real_parameters() -> impl Iterator<Item = u32> {
    let is_one =
        |v: &Variable<TestbedFmu>| v.causality() == Causality::Parameter && v.base() == BaseType::Real;
    (0..).zip(TABLE).filter(move |(_, variable)| is_one(variable)).map(|(vr, _)| vr)
}

/// Returns random parameters, the same for the same seed. The Reals vary around Table 1.
pub fn parameters(seed: u64) -> Parameters {
    let mut random = Random(seed);
    let [M, N] = [8.0, 14.0].map(|end| random.between(1.0, end) as i32);
    let near = BUILT_IN.varied(|| random.between(-1.5, 1.5));
    Parameters { M, N, ..near }
}

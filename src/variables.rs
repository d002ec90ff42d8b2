//! The variables of the FMU: every name, unit, start value and range, written once.

use crate::parameters::Parameters;
use fmi2_export::units::{KG_M2, N_M, N_M_PER_RAD, N_M_S_PER_RAD, RAD, RAD_PER_S, RAD_PER_S2};
use fmi2_export::{Kind, RealType, Unit, Variable, variables};

const fn quantity(name: &'static str, unit: &'static Unit, nominal: f64) -> RealType {
    RealType { nominal: Some(nominal), ..RealType::new(name, unit) }
}

const ANGLE: RealType = quantity("Angle", &RAD, 1.0);
const ANGULAR_VELOCITY: RealType = quantity("AngularVelocity", &RAD_PER_S, 1.0);
const ANGULAR_ACCELERATION: RealType = quantity("AngularAcceleration", &RAD_PER_S2, 100.0);
const TORQUE: RealType = quantity("Torque", &N_M, 1.0);

/// The ranges include 0, which FMI cannot exclude; [`Parameters::check`] does where it must.
const fn parameter_type(name: &'static str, unit: &'static Unit, nominal: f64) -> RealType {
    RealType { min: Some(0.0), ..quantity(name, unit, nominal) }
}

const INERTIA: RealType = parameter_type("MomentOfInertia", &KG_M2, 0.01);
const STIFFNESS: RealType = parameter_type("RotationalSpringConstant", &N_M_PER_RAD, 100.0);
const DAMPING: RealType = parameter_type("RotationalDampingConstant", &N_M_S_PER_RAD, 1.0);

const START: Parameters = Parameters::BUILT_IN;

const fn inertia(start: f64) -> Variable {
    Variable::parameter(Kind::Real { of: &INERTIA, start })
}

const fn stiffness(start: f64) -> Variable {
    Variable::parameter(Kind::Real { of: &STIFFNESS, start })
}

const fn damping(start: f64) -> Variable {
    Variable::parameter(Kind::Real { of: &DAMPING, start })
}

const fn number(start: i32) -> Variable {
    Variable::parameter(Kind::Integer { min: 1, max: i32::MAX, start })
}

variables! {
    /// Angle of motor 1
    theta1 = Variable::input(&ANGLE, 0.0);
    /// Angle of motor 2
    theta2 = Variable::input(&ANGLE, 0.0);
    /// Angular velocity of motor 1; used in Co-Simulation only if use_omega is true
    omega1 = Variable::input(&ANGULAR_VELOCITY, 0.0).derivative_of(vr::theta1);
    /// Angular velocity of motor 2; used in Co-Simulation only if use_omega is true
    omega2 = Variable::input(&ANGULAR_VELOCITY, 0.0).derivative_of(vr::theta2);

    /// Torque measured by sensor 1 between motor 1 and the SECT, eq. (9a)
    tau1 = Variable::output(&TORQUE);
    /// Torque measured by sensor 2 between motor 2 and the SECT, eq. (9b)
    tau2 = Variable::output(&TORQUE);
    /// Pitch angle theta7 of the output shaft, mean of theta5 and theta6, eq. (1)
    pitch = Variable::output(&ANGLE);
    /// Roll angle theta8 of the output shaft, N/2M (theta5 - theta6), eq. (1)
    roll = Variable::output(&ANGLE);
    /// Pitch rate, the derivative of theta7
    pitch_rate = Variable::output(&ANGULAR_VELOCITY);
    /// Roll rate, the derivative of theta8
    roll_rate = Variable::output(&ANGULAR_VELOCITY);
    /// Angle of the shaft between couplings 1 and 2 (motor 1 side); state
    theta3 = Variable::output(&ANGLE).state(0.0);
    /// Angle of the shaft between couplings 3 and 4 (motor 2 side); state
    theta4 = Variable::output(&ANGLE).state(0.0);

    /// Angle of SECT input shaft 1; state
    theta5 = Variable::local(&ANGLE).state(0.0);
    /// Angle of SECT input shaft 2; state
    theta6 = Variable::local(&ANGLE).state(0.0);
    /// Angular velocity of SECT input shaft 1; state
    omega5 = Variable::local(&ANGULAR_VELOCITY).state(0.0);
    /// Angular velocity of SECT input shaft 2; state
    omega6 = Variable::local(&ANGULAR_VELOCITY).state(0.0);

    /// Derivative of theta3, eq. (11a)
    der_theta3 = Variable::local(&ANGULAR_VELOCITY).derivative_of(vr::theta3).named("der(theta3)");
    /// Derivative of theta4, eq. (11a)
    der_theta4 = Variable::local(&ANGULAR_VELOCITY).derivative_of(vr::theta4).named("der(theta4)");
    /// Derivative of theta5, equal to omega5
    der_theta5 = Variable::local(&ANGULAR_VELOCITY).derivative_of(vr::theta5).named("der(theta5)");
    /// Derivative of theta6, equal to omega6
    der_theta6 = Variable::local(&ANGULAR_VELOCITY).derivative_of(vr::theta6).named("der(theta6)");
    /// Derivative of omega5, eq. (11a)
    der_omega5 = Variable::local(&ANGULAR_ACCELERATION).derivative_of(vr::omega5).named("der(omega5)");
    /// Derivative of omega6, eq. (11a)
    der_omega6 = Variable::local(&ANGULAR_ACCELERATION).derivative_of(vr::omega6).named("der(omega6)");

    /// Moment of inertia of a roller-carrier with rollers and attached shafts; must be positive
    J2 = inertia(START.J2);
    /// Moment of inertia of the load about the roll axis; must be positive
    J3 = inertia(START.J3);
    /// Moment of inertia of the load about the pitch axis; must be positive
    H3 = inertia(START.H3);
    /// Torsional stiffness of couplings 1 and 3 (motor side); must be positive
    k1 = stiffness(START.k1);
    /// Torsional stiffness of couplings 2 and 4 (SECT side); must be positive
    k2 = stiffness(START.k2);
    /// Torsional damping of couplings 1 and 3 (motor side); c1 + c2 must be positive
    c1 = damping(START.c1);
    /// Torsional damping of couplings 2 and 4 (SECT side); c1 + c2 must be positive
    c2 = damping(START.c2);
    /// Damping of the load in pitch and in roll
    c3 = damping(START.c3);
    /// Number of lobes of the spherical cams
    M = number(START.M);
    /// Number of rollers on each side of the roller-carriers
    N = number(START.N);
    /// Co-Simulation: take the motor rates from omega1 and omega2 instead of differentiating theta1 and theta2
    use_omega = Variable::parameter(Kind::Boolean { start: false });
}

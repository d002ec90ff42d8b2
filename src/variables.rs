//! The variables of the FMU: name, unit, range, and the field or function that gives the value.

use crate::fmu::TestbedFmu;
use fmu_export::units::{KG_M2, N_M, N_M_PER_RAD, N_M_S_PER_RAD, RAD, RAD_PER_S, RAD_PER_S2};
use fmu_export::{BOOLEAN, Type, variables};

const ANGLE: Type = Type::real("Angle", &RAD).nominal(1.0);
const ANGULAR_VELOCITY: Type = Type::real("AngularVelocity", &RAD_PER_S).nominal(1.0);
const ANGULAR_ACCELERATION: Type = Type::real("AngularAcceleration", &RAD_PER_S2).nominal(100.0);
const TORQUE: Type = Type::real("Torque", &N_M).nominal(1.0);
/// Smallest positive value that is allowed. FMI ranges include their ends, so a range "> 0" needs a smallest value.
/// It is not smaller because C++ (`std::stod`) rejects numbers below about 2e-308, and because a value converted to
/// another unit must not underflow to 0.
const MORE_THAN_0: f64 = 1e-300;
const INERTIA: Type = Type::real("MomentOfInertia", &KG_M2).min(MORE_THAN_0).nominal(0.01);
const STIFFNESS: Type = Type::real("RotationalSpringConstant", &N_M_PER_RAD).min(MORE_THAN_0).nominal(100.0);
const DAMPING: Type = Type::real("RotationalDampingConstant", &N_M_S_PER_RAD).min(0.0).nominal(1.0);
const COUNT: Type = Type::integer("Integer_from_1").min_integer(1);

variables! {
    for TestbedFmu, memory in
        testbed.motors.times.count, testbed.motors.times.last_step, testbed.motors.times.step_before,
        testbed.motors.samples[0].is_new, testbed.motors.samples[1].is_new,
        testbed.motors.given_rate, testbed.motors.earlier, testbed.motors.segment_end,
        start.is_over;

    /// Angle of motor 1
    theta1 = input(&ANGLE) in testbed.motors.samples[0].theta then testbed.motors.samples[0].is_new;
    /// Angle of motor 2
    theta2 = input(&ANGLE) in testbed.motors.samples[1].theta then testbed.motors.samples[1].is_new;
    /// Angular velocity of motor 1; used in Co-Simulation only if use_omega is true
    omega1 = input(&ANGULAR_VELOCITY) in testbed.motors.omega[0] then |fmu| { fmu.testbed.motors.omega_changed(0) };
    /// Angular velocity of motor 2; used in Co-Simulation only if use_omega is true
    omega2 = input(&ANGULAR_VELOCITY) in testbed.motors.omega[1] then |fmu| { fmu.testbed.motors.omega_changed(1) };

    /// Torque measured by sensor 1 between motor 1 and the SECT, eq. (9a)
    tau1 = output(&TORQUE) from torques[0];
    /// Torque measured by sensor 2 between motor 2 and the SECT, eq. (9b)
    tau2 = output(&TORQUE) from torques[1];
    /// Pitch angle theta7 of the output shaft, mean of theta5 and theta6, eq. (1)
    pitch = output(&ANGLE) from angles[0];
    /// Roll angle theta8 of the output shaft, N/2M (theta5 - theta6), eq. (1)
    roll = output(&ANGLE) from angles[1];
    /// Pitch rate, the derivative of theta7
    pitch_rate = output(&ANGULAR_VELOCITY) from rates[0];
    /// Roll rate, the derivative of theta8
    roll_rate = output(&ANGULAR_VELOCITY) from rates[1];
    /// Angle of the shaft between couplings 1 and 2 (motor 1 side); state
    theta3 = output(&ANGLE).state().calculated().depends_on(&[start_at_rest, theta3_start, theta1])
        in testbed.state[0] then |fmu| { fmu.start.is_over = true };
    /// Angle of the shaft between couplings 3 and 4 (motor 2 side); state
    theta4 = output(&ANGLE).state().calculated().depends_on(&[start_at_rest, theta4_start, theta2])
        in testbed.state[1] then |fmu| { fmu.start.is_over = true };

    /// Angle of SECT input shaft 1; state
    theta5 = local(&ANGLE).state().calculated().depends_on(&[start_at_rest, theta5_start, theta1])
        in testbed.state[2] then |fmu| { fmu.start.is_over = true };
    /// Angle of SECT input shaft 2; state
    theta6 = local(&ANGLE).state().calculated().depends_on(&[start_at_rest, theta6_start, theta2])
        in testbed.state[3] then |fmu| { fmu.start.is_over = true };
    /// Angular velocity of SECT input shaft 1; state
    omega5 = local(&ANGULAR_VELOCITY).state().calculated().depends_on(&[start_at_rest, omega5_start])
        in testbed.state[4] then |fmu| { fmu.start.is_over = true };
    /// Angular velocity of SECT input shaft 2; state
    omega6 = local(&ANGULAR_VELOCITY).state().calculated().depends_on(&[start_at_rest, omega6_start])
        in testbed.state[5] then |fmu| { fmu.start.is_over = true };

    /// Derivative of theta3, eq. (11a)
    der_theta3 as "der(theta3)" = local(&ANGULAR_VELOCITY).derivative_of(theta3)
        by |fmu| fmu.now().shaft_rates(fmu.system())[0];
    /// Derivative of theta4, eq. (11a)
    der_theta4 as "der(theta4)" = local(&ANGULAR_VELOCITY).derivative_of(theta4)
        by |fmu| fmu.now().shaft_rates(fmu.system())[1];
    /// Derivative of theta5, equal to omega5
    der_theta5 as "der(theta5)" = local(&ANGULAR_VELOCITY).derivative_of(theta5) by |fmu| fmu.testbed.state[4];
    /// Derivative of theta6, equal to omega6
    der_theta6 as "der(theta6)" = local(&ANGULAR_VELOCITY).derivative_of(theta6) by |fmu| fmu.testbed.state[5];
    /// Derivative of omega5, eq. (11a)
    der_omega5 as "der(omega5)" = local(&ANGULAR_ACCELERATION).derivative_of(omega5)
        by |fmu| fmu.now().accelerations(fmu.system())[0];
    /// Derivative of omega6, eq. (11a)
    der_omega6 as "der(omega6)" = local(&ANGULAR_ACCELERATION).derivative_of(omega6)
        by |fmu| fmu.now().accelerations(fmu.system())[1];

    /// Moment of inertia of a roller-carrier with rollers and attached shafts; must be positive
    J2 = parameter(&INERTIA) in testbed.parameters.J2;
    /// Moment of inertia of the load about the roll axis; must be positive
    J3 = parameter(&INERTIA) in testbed.parameters.J3;
    /// Moment of inertia of the load about the pitch axis; must be positive
    H3 = parameter(&INERTIA) in testbed.parameters.H3;
    /// Torsional stiffness of couplings 1 and 3 (motor side); must be positive
    k1 = parameter(&STIFFNESS) in testbed.parameters.k1;
    /// Torsional stiffness of couplings 2 and 4 (SECT side); must be positive
    k2 = parameter(&STIFFNESS) in testbed.parameters.k2;
    /// Torsional damping of couplings 1 and 3 (motor side); c1 + c2 must be positive
    c1 = parameter(&DAMPING) in testbed.parameters.c1;
    /// Torsional damping of couplings 2 and 4 (SECT side); c1 + c2 must be positive
    c2 = parameter(&DAMPING) in testbed.parameters.c2;
    /// Damping of the load in pitch and in roll
    c3 = parameter(&DAMPING) in testbed.parameters.c3;
    /// Number of lobes of the spherical cams
    M = parameter(&COUNT) in testbed.parameters.M;
    /// Number of rollers on each side of the roller-carriers
    N = parameter(&COUNT) in testbed.parameters.N;
    // This Boolean precedes `use_omega`, because OpenModelica 1.27.0 passes the second Boolean of an array as false, and
    // false is the default of `use_omega` only.
    /// Start at rest at any initial motor angles (theta3 = theta5 = theta1, theta4 = theta6 = theta2, rates 0); if false, start at theta3_start ... omega6_start
    start_at_rest = parameter(&BOOLEAN) in start.at_rest;
    /// Co-Simulation: take the motor rates from omega1 and omega2 instead of differentiating theta1 and theta2
    use_omega = parameter(&BOOLEAN) in testbed.motors.use_omega then |fmu| { fmu.testbed.motors.use_omega_changed() };
    /// theta3 at the start; used only if start_at_rest is false
    theta3_start = parameter(&ANGLE) in start.state[0];
    /// theta4 at the start; used only if start_at_rest is false
    theta4_start = parameter(&ANGLE) in start.state[1];
    /// theta5 at the start; used only if start_at_rest is false
    theta5_start = parameter(&ANGLE) in start.state[2];
    /// theta6 at the start; used only if start_at_rest is false
    theta6_start = parameter(&ANGLE) in start.state[3];
    /// omega5 at the start; used only if start_at_rest is false
    omega5_start = parameter(&ANGULAR_VELOCITY) in start.state[4];
    /// omega6 at the start; used only if start_at_rest is false
    omega6_start = parameter(&ANGULAR_VELOCITY) in start.state[5];
}

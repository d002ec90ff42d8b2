//! The variables of the FMU: every name, unit, start value and range, written once.

use crate::parameters::{LARGEST, Parameters, SMALLEST};
use fmi2_export::{Kind, RealType, Unit, Variable, units, variables};

const ANGLE: RealType = RealType::new("Angle", &units::RAD);
const RATE: RealType = RealType::new("AngularVelocity", &units::RAD_PER_S);
const TORQUE: RealType = RealType::new("Torque", &units::N_M);

const fn positive(name: &'static str, unit: &'static Unit) -> RealType {
    RealType { min: Some(SMALLEST), max: Some(LARGEST), ..RealType::new(name, unit) }
}

const fn not_negative(name: &'static str, unit: &'static Unit) -> RealType {
    RealType { min: Some(0.0), max: Some(LARGEST), ..RealType::new(name, unit) }
}

const SAMPLE_TIME: RealType = positive("SampleTime", &units::S);
const RATE_LIMIT: RealType = positive("RateLimit", &units::RAD_PER_S);
const ACCELERATION_LIMIT: RealType = positive("AccelerationLimit", &units::RAD_PER_S2);
const TORQUE_LIMIT: RealType = positive("TorqueLimit", &units::N_M);
const STIFFNESS: RealType = positive("RotationalSpringConstant", &units::N_M_PER_RAD);
const GAIN: RealType = not_negative("Gain", &units::ONE);
const INTEGRAL_GAIN: RealType = not_negative("IntegralGain", &units::PER_S);
const RATE_GAIN: RealType = not_negative("RateGain", &units::S);
const ANGLE_LIMIT: RealType = not_negative("AngleLimit", &units::RAD);

const START: Parameters = Parameters::DEFAULT;

const fn parameter(of: &'static RealType, start: f64) -> Variable {
    Variable::parameter(Kind::Real { of, start })
}

const fn number(start: i32) -> Variable {
    Variable::parameter(Kind::Integer { min: 1, max: i32::MAX, start })
}

variables! {
    /// Pitch angle to go to
    pitch_ref = Variable::input(&ANGLE, 0.0);
    /// Roll angle to go to
    roll_ref = Variable::input(&ANGLE, 0.0);
    /// Measured pitch angle
    pitch = Variable::input(&ANGLE, 0.0);
    /// Measured roll angle
    roll = Variable::input(&ANGLE, 0.0);
    /// Measured pitch rate, for damping; may be left unconnected
    pitch_rate = Variable::input(&RATE, 0.0);
    /// Measured roll rate, for damping; may be left unconnected
    roll_rate = Variable::input(&RATE, 0.0);
    /// Measured torque of sensor 1, negative while the motor drives, for backing off; may be left unconnected
    tau1 = Variable::input(&TORQUE, 0.0);
    /// Measured torque of sensor 2, negative while the motor drives, for backing off; may be left unconnected
    tau2 = Variable::input(&TORQUE, 0.0);

    // Inputs and parameters act from the next sample on: at a communication point nothing depends on them.

    /// Angle of motor 1; its start value is where the motor stands when the simulation begins
    theta1 = Variable::output(&ANGLE).starting_at(0.0).depends_on(&[]);
    /// Angle of motor 2; its start value is where the motor stands when the simulation begins
    theta2 = Variable::output(&ANGLE).starting_at(0.0).depends_on(&[]);
    /// Angular velocity of motor 1
    omega1 = Variable::output(&RATE).derivative_of(vr::theta1).depends_on(&[]);
    /// Angular velocity of motor 2
    omega2 = Variable::output(&RATE).derivative_of(vr::theta2).depends_on(&[]);
    /// What the control adds to pitch_ref, as of the last sample
    pitch_correction = Variable::output(&ANGLE).depends_on(&[]);
    /// What the control adds to roll_ref, as of the last sample
    roll_correction = Variable::output(&ANGLE).depends_on(&[]);

    /// Time between samples, whatever the communication step size
    sample_time = parameter(&SAMPLE_TIME, START.sample_time);
    /// Highest rate of a motor
    max_rate = parameter(&RATE_LIMIT, START.max_rate);
    /// Highest acceleration of a motor
    max_acceleration = parameter(&ACCELERATION_LIMIT, START.max_acceleration);
    /// Torque at which a motor backs off
    max_torque = parameter(&TORQUE_LIMIT, START.max_torque);
    /// Stiffness between motor and wrist that backing off assumes: k1 k2 / (k1 + k2) of the testbed
    stiffness = parameter(&STIFFNESS, START.stiffness);
    /// Proportional gain
    Kp = parameter(&GAIN, START.Kp);
    /// Integral gain; Ki * sample_time must not exceed 1
    Ki = parameter(&INTEGRAL_GAIN, START.Ki);
    /// Gain of the measured rates, which damps vibration
    Kd = parameter(&RATE_GAIN, START.Kd);
    /// Largest correction of pitch and of roll
    max_correction = parameter(&ANGLE_LIMIT, START.max_correction);
    /// Number of lobes of the spherical cams
    M = number(START.M);
    /// Number of rollers on each side of the roller-carriers
    N = number(START.N);
}

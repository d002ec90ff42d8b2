//! The variables of the FMU: name, unit, range, and field.

use crate::controller::Controller;
use crate::parameters::{LARGEST, SMALLEST};
use fmu_export::{Index, Type, Unit, units, variables};

const ANGLE: Type = Type::real("Angle", &units::RAD);
const RATE: Type = Type::real("AngularVelocity", &units::RAD_PER_S);
const TORQUE: Type = Type::real("Torque", &units::N_M);

const fn positive(name: &'static str, unit: &'static Unit) -> Type {
    Type::real(name, unit).min(SMALLEST).max(LARGEST)
}

const fn not_negative(name: &'static str, unit: &'static Unit) -> Type {
    Type::real(name, unit).min(0.0).max(LARGEST)
}

const SAMPLE_TIME: Type = positive("SampleTime", &units::S);
const RATE_LIMIT: Type = positive("RateLimit", &units::RAD_PER_S);
const ACCELERATION_LIMIT: Type = positive("AccelerationLimit", &units::RAD_PER_S2);
const TORQUE_LIMIT: Type = positive("TorqueLimit", &units::N_M);
const STIFFNESS: Type = positive("RotationalSpringConstant", &units::N_M_PER_RAD);
const GAIN: Type = not_negative("Gain", &units::ONE);
const INTEGRAL_GAIN: Type = not_negative("IntegralGain", &units::PER_S);
const RATE_GAIN: Type = not_negative("RateGain", &units::S);
const ANGLE_LIMIT: Type = not_negative("AngleLimit", &units::RAD);
const COUNT: Type = Type::integer("Integer_from_1").min_integer(1);

variables! {
    for Controller, memory in slopes, motors, integral, damping, correction, on_goal, schedule, sampled_at;

    /// Pitch setpoint
    pitch_ref = input(&ANGLE) in inputs.reference[0];
    /// Roll setpoint
    roll_ref = input(&ANGLE) in inputs.reference[1];
    /// Measured pitch angle
    pitch = input(&ANGLE) in inputs.angle[0];
    /// Measured roll angle
    roll = input(&ANGLE) in inputs.angle[1];
    /// Measured pitch rate, for damping; may be left unconnected
    pitch_rate = input(&RATE) in inputs.rate[0];
    /// Measured roll rate, for damping; may be left unconnected
    roll_rate = input(&RATE) in inputs.rate[1];
    /// Measured torque of sensor 1, negative while the motor drives, for torque limiting; may be left unconnected
    tau1 = input(&TORQUE) in inputs.torque[0];
    /// Measured torque of sensor 2, negative while the motor drives, for torque limiting; may be left unconnected
    tau2 = input(&TORQUE) in inputs.torque[1];

    // Inputs and parameters take effect at the next sample, so the outputs at a communication point do not depend on them.

    /// Angle of motor 1; its start value is the initial angle
    theta1 = output(&ANGLE).exact().depends_on(&[Index::TIME]) in motors[0].angle by |c| c.motion()[0].angle;
    /// Angle of motor 2; its start value is the initial angle
    theta2 = output(&ANGLE).exact().depends_on(&[Index::TIME]) in motors[1].angle by |c| c.motion()[1].angle;
    /// Angular velocity of motor 1
    omega1 = output(&RATE).depends_on(&[Index::TIME]) by |c| c.motion()[0].rate;
    /// Angular velocity of motor 2
    omega2 = output(&RATE).depends_on(&[Index::TIME]) by |c| c.motion()[1].rate;
    /// Correction added to pitch_ref at the last sample
    pitch_correction = output(&ANGLE).discrete().depends_on(&[]) by |c| c.correction[0];
    /// Correction added to roll_ref at the last sample
    roll_correction = output(&ANGLE).discrete().depends_on(&[]) by |c| c.correction[1];

    /// Time between samples, independent of the communication step size
    sample_time = parameter(&SAMPLE_TIME) in parameters.sample_time;
    /// Highest rate of a motor
    max_rate = parameter(&RATE_LIMIT) in parameters.max_rate;
    /// Highest acceleration of a motor
    max_acceleration = parameter(&ACCELERATION_LIMIT) in parameters.max_acceleration;
    /// Torque limit of a motor
    max_torque = parameter(&TORQUE_LIMIT) in parameters.max_torque;
    /// Stiffness between motor and wrist that torque limiting assumes: k1 k2 / (k1 + k2) of the testbed
    stiffness = parameter(&STIFFNESS) in parameters.stiffness;
    /// Proportional gain
    Kp = parameter(&GAIN) in parameters.Kp;
    /// Integral gain; Ki * sample_time must not exceed 1
    Ki = parameter(&INTEGRAL_GAIN) in parameters.Ki;
    /// Gain of the measured rates, which damps vibration
    Kd = parameter(&RATE_GAIN) in parameters.Kd;
    /// Largest correction of pitch and of roll
    max_correction = parameter(&ANGLE_LIMIT) in parameters.max_correction;
    /// Number of lobes of the spherical cams
    M = parameter(&COUNT) in parameters.M;
    /// Number of rollers on each side of the roller-carriers
    N = parameter(&COUNT) in parameters.N;
}

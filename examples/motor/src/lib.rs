//! The two motors of the testbed as an FMU, for systems in which the motors are driven by torques.
//!
//! The inputs of the testbed are motor angles, and its outputs include the torques of the wrist on the motors. This FMU
//! calculates the angles from the torques: `J1 omega' = torque + tau - friction omega`. Its variables have the same names as
//! the variables of the testbed to which they are connected.

use fmu_export::*;

/// A value of motor 1 and of motor 2.
type Pair = [f64; 2];

/// Both motors: their inputs with slopes, states and parameters.
#[derive(Clone, Debug)]
pub struct Motors {
    /// Torques of the motors (`torque`) and of the wrist on the motors (`tau`), N.m.
    torque: Pair,
    tau: Pair,
    /// Slopes of these torques in the next step, N.m/s; 0 if the importer has not set them.
    torque_slope: Pair,
    tau_slope: Pair,
    theta: Pair,
    omega: Pair,
    inertia: f64,
    friction: f64,
}

const TORQUE: Type = Type::real("Torque", &units::N_M);
const ANGLE: Type = Type::real("Angle", &units::RAD);
const RATE: Type = Type::real("AngularVelocity", &units::RAD_PER_S);
const ACCELERATION: Type = Type::real("AngularAcceleration", &units::RAD_PER_S2).nominal(100.0);
const INERTIA: Type = Type::real("Inertia", &units::KG_M2).min(1e-6).max(1e6).nominal(1e-3);
const DAMPING: Type = Type::real("RotationalDampingConstant", &units::N_M_S_PER_RAD).min(0.0).max(1e6);

variables! { for Motors, memory in torque_slope, tau_slope;
    /// Torque of motor 1
    torque1 = input(&TORQUE) in torque[0];
    /// Torque of motor 2
    torque2 = input(&TORQUE) in torque[1];
    /// Torque of the wrist on motor 1, negative while the motor drives: tau1 of the testbed
    tau1 = input(&TORQUE) in tau[0];
    /// Torque of the wrist on motor 2: tau2 of the testbed
    tau2 = input(&TORQUE) in tau[1];
    /// Angle of motor 1
    theta1 = output(&ANGLE).state() in theta[0];
    /// Angle of motor 2
    theta2 = output(&ANGLE).state() in theta[1];
    /// Rate of motor 1
    omega1 = output(&RATE).state() in omega[0];
    /// Rate of motor 2
    omega2 = output(&RATE).state() in omega[1];
    /// Rate of theta1
    der_theta1 as "der(theta1)" = local(&RATE).derivative_of(theta1) by |motors| motors.omega[0];
    /// Rate of theta2
    der_theta2 as "der(theta2)" = local(&RATE).derivative_of(theta2) by |motors| motors.omega[1];
    /// Acceleration of motor 1
    der_omega1 as "der(omega1)" = local(&ACCELERATION).derivative_of(omega1) by |motors| motors.acceleration(0);
    /// Acceleration of motor 2
    der_omega2 as "der(omega2)" = local(&ACCELERATION).derivative_of(omega2) by |motors| motors.acceleration(1);
    /// Inertia of each motor, J1 of the paper, which gives no value; seen from the output of the gear
    J1 = parameter(&INERTIA) in inertia;
    /// Viscous friction of each motor; c1 of the testbed may contain it already
    friction = parameter(&DAMPING) in friction;
}

impl Motors {
    fn acceleration(&self, motor: usize) -> f64 {
        (self.torque[motor] + self.tau[motor] - self.friction * self.omega[motor]) / self.inertia
    }

    /// Returns the angle and the rate of a motor after `h` s; exact if the torques change linearly.
    fn after(&self, motor: usize, h: f64) -> Pair {
        let (theta, omega) = (self.theta[motor], self.omega[motor]);
        let acceleration = (self.torque[motor] + self.tau[motor]) / self.inertia;
        let jerk = (self.torque_slope[motor] + self.tau_slope[motor]) / self.inertia;
        let [decay, one, two, three] = decays(self.friction / self.inertia * h);
        [
            theta + h * (omega * one + h * (acceleration * two + h * jerk * three)),
            omega * decay + h * (acceleration * one + h * jerk * two),
        ]
    }
}

/// Returns the sums of (-z)^n / (n + k)! over all n from 0 on, for k = 0 to 3. The first sum is exp(-z); the others result
/// from repeated integration of exp(-z).
fn decays(z: f64) -> [f64; 4] {
    // If z is small, the differences below lose digits, but the series converges fast.
    if z < 0.5 {
        return std::array::from_fn(|k| {
            let first = [1.0, 1.0, 0.5, 1.0 / 6.0][k];
            (1..=16).rev().fold(1.0, |sum, n| 1.0 - sum * z / (n + k) as f64) * first
        });
    }
    let decay = (-z).exp();
    let one = -(-z).exp_m1() / z;
    let two = (1.0 - one) / z;
    [decay, one, two, (0.5 - two) / z]
}

impl Model for Motors {
    const INFO: Info = Info {
        description: "Motors of the pitch-roll wrist testbed, driven by torque",
        copyright: "Copyright (c) 2026 The pitch-roll wrist testbed authors",
        default_experiment: DefaultExperiment {
            stop_time: 1.0,
            step_size: 2.5e-4,
            ..DefaultExperiment::DEFAULT
        },
        smooth: true,
        ..info!("PitchRollWristMotors", "prw_motor")
    };

    fn new(_: &Setup) -> Result<Self, Error> {
        let zero = [0.0; 2];
        Ok(Self {
            torque: zero,
            tau: zero,
            torque_slope: zero,
            tau_slope: zero,
            theta: zero,
            omega: zero,
            inertia: 2e-3,
            friction: 0.0,
        })
    }
}

impl CoSimulation for Motors {
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        let after = [0, 1].map(|motor| self.after(motor, step.size));
        if !after.as_flattened().iter().all(|value| value.is_finite()) {
            return Err(Error::new("a motor turns so fast that its angle would not be finite"));
        }
        self.theta = after.map(|[theta, _]| theta);
        self.omega = after.map(|[_, omega]| omega);
        (self.torque_slope, self.tau_slope) = ([0.0; 2], [0.0; 2]);
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Motors {}

impl InputDerivatives for Motors {
    fn set_input_derivative(&mut self, of: Name, order: u32, value: f64) {
        match (of, order) {
            (Name::torque1, 1) => self.torque_slope[0] = value,
            (Name::torque2, 1) => self.torque_slope[1] = value,
            (Name::tau1, 1) => self.tau_slope[0] = value,
            (Name::tau2, 1) => self.tau_slope[1] = value,
            _ => {}
        }
    }
}

impl OutputDerivatives for Motors {
    fn output_derivative(&self, of: Name, order: u32) -> f64 {
        let slope = |motor: usize| self.torque_slope[motor] + self.tau_slope[motor];
        let jerk = |motor| (slope(motor) - self.friction * self.acceleration(motor)) / self.inertia;
        match (of, order) {
            (Name::torque1, 1) => self.torque_slope[0],
            (Name::torque2, 1) => self.torque_slope[1],
            (Name::tau1, 1) => self.tau_slope[0],
            (Name::tau2, 1) => self.tau_slope[1],
            (Name::theta1, 1) => self.omega[0],
            (Name::theta2, 1) => self.omega[1],
            (Name::omega1 | Name::der_theta1, 1) => self.acceleration(0),
            (Name::omega2 | Name::der_theta2, 1) => self.acceleration(1),
            (Name::der_omega1, 1) => jerk(0),
            (Name::der_omega2, 1) => jerk(1),
            _ => 0.0,
        }
    }
}

impl Partials for Motors {
    fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
        let of_acceleration = |motor: usize| match known {
            Name::torque1 | Name::tau1 if motor == 0 => 1.0 / self.inertia,
            Name::torque2 | Name::tau2 if motor == 1 => 1.0 / self.inertia,
            Name::omega1 if motor == 0 => -self.friction / self.inertia,
            Name::omega2 if motor == 1 => -self.friction / self.inertia,
            Name::J1 => -self.acceleration(motor) / self.inertia,
            Name::friction => -self.omega[motor] / self.inertia,
            _ => 0.0,
        };
        Some(match unknown {
            Name::der_theta1 => f64::from(u8::from(known == Name::omega1)),
            Name::der_theta2 => f64::from(u8::from(known == Name::omega2)),
            Name::der_omega1 => of_acceleration(0),
            Name::der_omega2 => of_acceleration(1),
            _ => f64::from(u8::from(unknown == known)),
        })
    }
}

export_fmu!(Motors: CoSimulation + ModelExchange + InputDerivatives + OutputDerivatives + Partials);

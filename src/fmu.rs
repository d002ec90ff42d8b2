//! The testbed as seen through FMI: which variable is what.

use crate::decoupled::{PitchRoll, sides, sum_difference};
use crate::motor::{Motion, Motor, RateSource};
use crate::parameters::{InvalidParameter, Parameters};
use crate::sensitivities::{self, Parameter};
use crate::testbed::{State, Testbed};
use crate::variables::{VARIABLES, vr};
use fmi2_export::{
    CoSimulation, DefaultExperiment, Interface, Model, ModelError, ModelExchange, ModelInfo, StateVisitor,
};

/// The testbed as FMI model.
#[derive(Debug)]
pub struct TestbedFmu {
    testbed: Testbed,
    interface: Interface,
}

impl Clone for TestbedFmu {
    fn clone(&self) -> Self {
        Self { testbed: self.testbed.clone(), interface: self.interface }
    }

    fn clone_from(&mut self, source: &Self) {
        self.testbed.clone_from(&source.testbed);
        self.interface = source.interface;
    }
}

/// What the linear equations read: the state x and input u of eq. (11), with the input's derivative.
struct Point {
    x: State,
    motors: [Motion; 2],
}

impl TestbedFmu {
    /// The motion of a motor now. Model Exchange takes theta and omega as they are set (u of eq. (11));
    /// Co-Simulation knows the motor by its samples.
    #[inline]
    fn motion(&self, motor: usize) -> Motion {
        match self.interface {
            Interface::CoSimulation => self.testbed.motion(motor),
            Interface::ModelExchange => {
                let Motor { theta, omega, .. } = self.testbed.motors[motor];
                Motion { angle: theta, rate: omega, acceleration: 0.0 }
            }
        }
    }

    fn now(&self) -> Point {
        Point { x: self.testbed.state, motors: [self.motion(0), self.motion(1)] }
    }

    /// States, and what follows from them alone.
    #[inline(always)]
    fn of_state(&self, variable: u32, x: &State) -> f64 {
        let [theta3, theta4, theta5, theta6, omega5, omega6] = *x;
        match variable {
            vr::pitch => 0.5 * (theta5 + theta6),
            vr::roll => self.testbed.system().roll_ratio * (theta5 - theta6),
            vr::pitch_rate => 0.5 * (omega5 + omega6),
            vr::roll_rate => self.testbed.system().roll_ratio * (omega5 - omega6),
            vr::theta3 => theta3,
            vr::theta4 => theta4,
            vr::theta5 => theta5,
            vr::theta6 => theta6,
            vr::omega5 | vr::der_theta5 => omega5,
            vr::omega6 | vr::der_theta6 => omega6,
            other => unreachable!("{other} does not follow from the states"),
        }
    }

    /// The sensor torque of side 0 or 1.
    #[inline]
    fn torque(&self, side: usize, x: &State, motion: Motion) -> f64 {
        self.testbed.system().side.torque(x[side], x[2 + side], x[4 + side], motion)
    }

    /// Every calculated variable, at any point. Linear in the point, so the same function serves for
    /// values, for partial derivatives (at unit points) and for time derivatives (at a point's rates).
    #[inline(never)]
    fn calculated(&self, variable: u32, point: &Point) -> f64 {
        let Point { x, motors } = point;
        let system = self.testbed.system();
        let torque = |side: usize| self.torque(side, x, motors[side]);
        let shaft_rate =
            |side: usize| system.side.shaft_rate(x[side], x[2 + side], x[4 + side], motors[side]);
        match variable {
            vr::tau1 => torque(0),
            vr::tau2 => torque(1),
            vr::der_theta3 => shaft_rate(0),
            vr::der_theta4 => shaft_rate(1),
            vr::der_omega5 | vr::der_omega6 => {
                // M_II v_II' = -gamma - (load damping), split into pitch and roll.
                let torque = sum_difference(torque(0), torque(1)) * 0.5;
                let rate = sum_difference(x[4], x[5]) * 0.5;
                let acceleration = PitchRoll::new(
                    (-torque.x - system.pitch.load_damping * rate.x) / system.pitch.inertia,
                    (-torque.y - system.roll.load_damping * rate.y) / system.roll.inertia,
                );
                sides(acceleration)[(variable - vr::der_omega5) as usize]
            }
            other => self.of_state(other, x),
        }
    }

    /// The time derivative of a point, by eq. (11a).
    fn rates(&self, point: &Point) -> Point {
        let state_derivatives =
            [vr::der_theta3, vr::der_theta4, vr::der_theta5, vr::der_theta6, vr::der_omega5, vr::der_omega6];
        Point {
            x: state_derivatives.map(|variable| self.calculated(variable, point)),
            motors: point.motors.map(|motor| Motion {
                angle: motor.rate,
                rate: motor.acceleration,
                acceleration: 0.0,
            }),
        }
    }

    /// The point with 1 at a state or input and 0 elsewhere.
    fn unit_point(known: u32) -> Option<Point> {
        let mut point = Point { x: [0.0; 6], motors: [Motion::default(); 2] };
        match known {
            vr::theta1 => point.motors[0].angle = 1.0,
            vr::theta2 => point.motors[1].angle = 1.0,
            vr::omega1 => point.motors[0].rate = 1.0,
            vr::omega2 => point.motors[1].rate = 1.0,
            vr::theta3..=vr::omega6 => point.x[(known - vr::theta3) as usize] = 1.0,
            _ => return None,
        }
        Some(point)
    }

    /// The derivative of a calculated variable with respect to a parameter, now.
    fn sensitivity(&self, unknown: u32, parameter: Parameter) -> f64 {
        let Point { x, motors } = &self.now();
        let testbed = &self.testbed;
        match unknown {
            vr::tau1 | vr::tau2 => {
                sensitivities::torque(testbed, x, motors, (unknown - vr::tau1) as usize, parameter)
            }
            vr::der_theta3 | vr::der_theta4 => {
                sensitivities::shaft_rate(testbed, x, motors, (unknown - vr::der_theta3) as usize, parameter)
            }
            vr::der_omega5 | vr::der_omega6 => {
                let now = [vr::der_omega5, vr::der_omega6].map(|variable| self.real(variable));
                sensitivities::accelerations(testbed, x, motors, now, parameter)
                    [(unknown - vr::der_omega5) as usize]
            }
            _state_or_rate => 0.0,
        }
    }

    fn parameter(&mut self, variable: u32) -> &mut f64 {
        let p = &mut self.testbed.parameters;
        match variable {
            vr::J2 => &mut p.J2,
            vr::J3 => &mut p.J3,
            vr::H3 => &mut p.H3,
            vr::k1 => &mut p.k1,
            vr::k2 => &mut p.k2,
            vr::c1 => &mut p.c1,
            vr::c2 => &mut p.c2,
            vr::c3 => &mut p.c3,
            other => unreachable!("{other} is no Real parameter"),
        }
    }
}

/// The Real parameter behind a value reference.
fn parameter(known: u32) -> Option<Parameter> {
    Some(match known {
        vr::J2 => Parameter::J2,
        vr::J3 => Parameter::J3,
        vr::H3 => Parameter::H3,
        vr::k1 => Parameter::K1,
        vr::k2 => Parameter::K2,
        vr::c1 => Parameter::C1,
        vr::c2 => Parameter::C2,
        vr::c3 => Parameter::C3,
        _ => return None,
    })
}

impl From<InvalidParameter> for ModelError {
    fn from(error: InvalidParameter) -> Self {
        Self::new(error.to_string())
    }
}

impl Model for TestbedFmu {
    const INFO: ModelInfo = ModelInfo {
        name: "PitchRollWristTestbed",
        identifier: "prw_testbed",
        guid: env!("FMU_GUID"),
        description: "Testbed of the McGill pitch-roll wrist: a spherical epicyclic cam train driven by two \
                      motors through flexible couplings",
        author: env!("CARGO_PKG_AUTHORS"),
        version: env!("CARGO_PKG_VERSION"),
        license: env!("CARGO_PKG_LICENSE"),
        copyright: "Copyright 2026 the pitch-roll wrist testbed authors",
        default_experiment: DefaultExperiment {
            start_time: 0.0,
            stop_time: 2.0,
            step_size: 1e-3,
            tolerance: 1e-6,
        },
        variables: VARIABLES,
        co_simulation: Some(CoSimulation {
            variable_step_size: true,
            interpolates_inputs: true,
            max_output_derivative_order: 1,
            directional_derivative: true,
            serializes_state: true,
        }),
        model_exchange: Some(ModelExchange { directional_derivative: true, serializes_state: true }),
        smooth: true,
    };

    fn new(interface: Interface) -> Self {
        let testbed = Testbed::new(Parameters::BUILT_IN).expect("the build has checked the parameters");
        Self { testbed, interface }
    }

    #[inline]
    fn real(&self, variable: u32) -> f64 {
        let Testbed { motors, parameters, state, .. } = &self.testbed;
        match variable {
            vr::theta1 => motors[0].theta,
            vr::theta2 => motors[1].theta,
            vr::omega1 => motors[0].omega,
            vr::omega2 => motors[1].omega,
            vr::J2 => parameters.J2,
            vr::J3 => parameters.J3,
            vr::H3 => parameters.H3,
            vr::k1 => parameters.k1,
            vr::k2 => parameters.k2,
            vr::c1 => parameters.c1,
            vr::c2 => parameters.c2,
            vr::c3 => parameters.c3,
            vr::tau1 => self.torque(0, state, self.motion(0)),
            vr::tau2 => self.torque(1, state, self.motion(1)),
            vr::pitch..=vr::omega6 => self.of_state(variable, state),
            calculated => self.calculated(calculated, &self.now()),
        }
    }

    #[inline]
    fn set_real(&mut self, variable: u32, value: f64) {
        match variable {
            vr::theta1 | vr::theta2 => {
                self.testbed.motors[(variable - vr::theta1) as usize].set_theta(value);
            }
            vr::omega1 | vr::omega2 => {
                let source = self.testbed.rate_source;
                self.testbed.motors[(variable - vr::omega1) as usize].set_omega(value, source);
            }
            vr::theta3..=vr::omega6 => self.testbed.state[(variable - vr::theta3) as usize] = value,
            parameter => *self.parameter(parameter) = value,
        }
    }

    fn integer(&self, variable: u32) -> i32 {
        let Parameters { M, N, .. } = self.testbed.parameters;
        if variable == vr::M { M } else { N }
    }

    fn set_integer(&mut self, variable: u32, value: i32) {
        let p = &mut self.testbed.parameters;
        *(if variable == vr::M { &mut p.M } else { &mut p.N }) = value;
    }

    fn boolean(&self, _use_omega: u32) -> bool {
        self.testbed.rate_source == RateSource::Omega
    }

    fn set_boolean(&mut self, _use_omega: u32, value: bool) {
        let source = if value { RateSource::Omega } else { RateSource::Samples };
        self.testbed.rate_source = source;
        self.testbed.motors.iter_mut().for_each(|motor| motor.source_changed(source));
    }

    fn parameters_changed(&mut self) -> Result<(), ModelError> {
        if !self.testbed.times.are_possible() {
            return Err(ModelError::new("the steps between the samples of a saved state must be > 0"));
        }
        Ok(self.testbed.parameters_changed()?)
    }

    fn initialize(&mut self, _start_time: f64) -> Result<(), ModelError> {
        self.testbed.forget_samples();
        Ok(())
    }

    #[inline]
    fn do_step(&mut self, _time: f64, step_size: f64) -> Result<(), ModelError> {
        if self.testbed.step(step_size) {
            return Ok(());
        }
        Err(ModelError::new("the state would leave the range of numbers; look for extreme inputs or states"))
    }

    /// Order 1 of theta is its slope over the next step. Higher orders, and derivatives of omega, are
    /// not needed: between communication points the motors move on straight lines.
    fn set_input_derivative(&mut self, variable: u32, order: u32, value: f64) {
        if let (vr::theta1 | vr::theta2, 1) = (variable, order) {
            self.testbed.motors[(variable - vr::theta1) as usize].set_rate(value);
        }
    }

    fn output_derivative(&self, variable: u32, order: u32) -> f64 {
        if order > 1 {
            return 0.0;
        }
        let point = self.now();
        match variable {
            vr::theta1 => point.motors[0].rate,
            vr::theta2 => point.motors[1].rate,
            vr::omega1 => point.motors[0].acceleration,
            vr::omega2 => point.motors[1].acceleration,
            vr::tau1..=vr::der_omega6 => self.calculated(variable, &self.rates(&point)),
            _parameter => 0.0,
        }
    }

    fn partial_derivative(&self, unknown: u32, known: u32) -> Option<f64> {
        match Self::unit_point(known) {
            Some(point) => Some(self.calculated(unknown, &point)),
            None => Some(self.sensitivity(unknown, parameter(known)?)),
        }
    }

    fn visit_state(&mut self, visitor: &mut impl StateVisitor) {
        let Testbed { parameters: p, rate_source, state, motors, times, .. } = &mut self.testbed;
        for value in [&mut p.J2, &mut p.J3, &mut p.H3, &mut p.k1, &mut p.k2, &mut p.c1, &mut p.c2, &mut p.c3]
        {
            visitor.real(value);
        }
        visitor.integer(&mut p.M);
        visitor.integer(&mut p.N);
        let mut use_omega = *rate_source == RateSource::Omega;
        visitor.boolean(&mut use_omega);
        *rate_source = if use_omega { RateSource::Omega } else { RateSource::Samples };
        for value in state {
            visitor.real(value);
        }
        visitor.integer(&mut times.count);
        times.count = times.count.clamp(0, 2);
        visitor.real(&mut times.last_step);
        visitor.real(&mut times.step_before);
        times.update_inverses();
        for motor in motors {
            visitor.real(&mut motor.theta);
            visitor.real(&mut motor.omega);
            visitor.optional_real(&mut motor.set_rate);
            visitor.boolean(&mut motor.is_sampled);
            let [previous, before] = &mut motor.earlier;
            let Motion { angle, rate, acceleration } = &mut motor.path_end;
            for value in [previous, before, angle, rate, acceleration] {
                visitor.real(value);
            }
        }
    }
}

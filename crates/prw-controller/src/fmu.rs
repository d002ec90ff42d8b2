//! The controller as seen through FMI: which variable is what.

use crate::controller::{Controller, Inputs};
use crate::parameters::{InvalidParameter, Parameters};
use crate::variables::{VARIABLES, vr};
use fmi2_export::{CoSimulation, DefaultExperiment, Interface, Model, ModelError, ModelInfo, StateVisitor};

/// The controller as FMI model.
#[derive(Clone, Debug)]
pub struct ControllerFmu {
    controller: Controller,
}

fn input(inputs: &mut Inputs, variable: u32) -> &mut f64 {
    match variable {
        vr::pitch_ref => &mut inputs.reference[0],
        vr::roll_ref => &mut inputs.reference[1],
        vr::pitch => &mut inputs.angle[0],
        vr::roll => &mut inputs.angle[1],
        vr::pitch_rate => &mut inputs.rate[0],
        vr::roll_rate => &mut inputs.rate[1],
        vr::tau1 => &mut inputs.torque[0],
        vr::tau2 => &mut inputs.torque[1],
        other => unreachable!("{other} is no input"),
    }
}

fn parameter(p: &mut Parameters, variable: u32) -> &mut f64 {
    match variable {
        vr::sample_time => &mut p.sample_time,
        vr::max_rate => &mut p.max_rate,
        vr::max_acceleration => &mut p.max_acceleration,
        vr::max_torque => &mut p.max_torque,
        vr::stiffness => &mut p.stiffness,
        vr::Kp => &mut p.Kp,
        vr::Ki => &mut p.Ki,
        vr::Kd => &mut p.Kd,
        vr::max_correction => &mut p.max_correction,
        other => unreachable!("{other} is no Real parameter"),
    }
}

impl From<InvalidParameter> for ModelError {
    fn from(error: InvalidParameter) -> Self {
        Self::new(error.to_string())
    }
}

impl Model for ControllerFmu {
    const INFO: ModelInfo = ModelInfo {
        description: "Sampled controller for the pitch-roll wrist testbed: moves its two motors so that the wrist \
                      takes a pitch and a roll angle. Co-Simulation only, because a sampled controller has no \
                      continuous states",
        author: env!("CARGO_PKG_AUTHORS"),
        version: env!("CARGO_PKG_VERSION"),
        license: env!("CARGO_PKG_LICENSE"),
        copyright: "Copyright (c) 2026 The pitch-roll wrist testbed authors",
        default_experiment: DefaultExperiment {
            start_time: 0.0,
            stop_time: 2.0,
            step_size: 1e-3,
            tolerance: 1e-6,
        },
        co_simulation: Some(CoSimulation {
            variable_step_size: true,
            interpolates_inputs: true,
            max_output_derivative_order: 1,
            directional_derivative: true,
            serializes_state: true,
        }),
        ..ModelInfo::new("PitchRollWristController", "prw_controller", env!("FMU_GUID"), VARIABLES)
    };

    fn new(_: Interface) -> Self {
        Self {
            controller: Controller::new(Parameters::DEFAULT).expect("the default parameters are in range"),
        }
    }

    fn real(&self, variable: u32) -> f64 {
        let c = &self.controller;
        match variable {
            vr::pitch_ref..=vr::tau2 => *input(&mut c.inputs.clone(), variable),
            vr::theta1 | vr::theta2 => c.motion()[(variable - vr::theta1) as usize].angle,
            vr::omega1 | vr::omega2 => c.motion()[(variable - vr::omega1) as usize].rate,
            vr::pitch_correction | vr::roll_correction => {
                c.correction[(variable - vr::pitch_correction) as usize]
            }
            other => *parameter(&mut c.parameters.clone(), other),
        }
    }

    fn set_real(&mut self, variable: u32, value: f64) {
        let c = &mut self.controller;
        match variable {
            vr::pitch_ref..=vr::tau2 => *input(&mut c.inputs, variable) = value,
            vr::theta1 | vr::theta2 => c.motors[(variable - vr::theta1) as usize].angle = value,
            other => *parameter(&mut c.parameters, other) = value,
        }
    }

    fn integer(&self, variable: u32) -> i32 {
        let Parameters { M, N, .. } = self.controller.parameters;
        if variable == vr::M { M } else { N }
    }

    fn set_integer(&mut self, variable: u32, value: i32) {
        let p = &mut self.controller.parameters;
        *(if variable == vr::M { &mut p.M } else { &mut p.N }) = value;
    }

    fn parameters_changed(&mut self) -> Result<(), ModelError> {
        Ok(self.controller.parameters_changed()?)
    }

    fn initialize(&mut self, start_time: f64) -> Result<(), ModelError> {
        self.controller.start(start_time);
        Ok(())
    }

    fn do_step(&mut self, time: f64, step_size: f64) -> Result<(), ModelError> {
        if self.controller.step(time, step_size) {
            return Ok(());
        }
        Err(ModelError::new(
            "the step holds billions of samples; take a smaller step or a longer sample_time",
        ))
    }

    fn set_input_derivative(&mut self, variable: u32, order: u32, value: f64) {
        if order == 1 {
            *input(&mut self.controller.slopes, variable) = value;
        }
    }

    fn output_derivative(&self, variable: u32, order: u32) -> f64 {
        let c = &self.controller;
        match (variable, order) {
            (vr::pitch_ref..=vr::tau2, 1) => *input(&mut c.slopes.clone(), variable),
            (vr::theta1 | vr::theta2, 1) => c.motion()[(variable - vr::theta1) as usize].rate,
            (vr::theta1 | vr::theta2, 2) => c.motors[(variable - vr::theta1) as usize].acceleration,
            (vr::omega1 | vr::omega2, 1) => c.motors[(variable - vr::omega1) as usize].acceleration,
            _ => 0.0,
        }
    }

    /// An input acts from the sample after it on, so at a communication point nothing depends on it.
    fn partial_derivative(&self, unknown: u32, known: u32) -> Option<f64> {
        let (vr::theta1..=vr::roll_correction, vr::pitch_ref..=vr::tau2) = (unknown, known) else {
            return None;
        };
        Some(0.0)
    }

    fn visit_state(&mut self, visitor: &mut impl StateVisitor) {
        let Controller {
            parameters,
            inputs,
            slopes,
            motors,
            integral,
            damping,
            correction,
            on_goal,
            schedule,
            sampled_at,
            now,
        } = &mut self.controller;
        for variable in vr::sample_time..=vr::max_correction {
            visitor.real(parameter(parameters, variable));
        }
        visitor.integer(&mut parameters.M);
        visitor.integer(&mut parameters.N);
        for variable in vr::pitch_ref..=vr::tau2 {
            visitor.real(input(inputs, variable));
            visitor.real(input(slopes, variable));
        }
        for motor in motors {
            for value in [&mut motor.angle, &mut motor.rate, &mut motor.acceleration] {
                visitor.real(value);
            }
        }
        for value in integral.iter_mut().chain(damping).chain(correction) {
            visitor.real(value);
        }
        visitor.boolean(on_goal);
        for value in [&mut schedule.epoch, &mut schedule.period, &mut schedule.next, sampled_at, now] {
            visitor.real(value);
        }
    }
}

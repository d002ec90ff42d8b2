//! What the FMU of the testbed offers.

use crate::fmu::TestbedFmu;
use crate::instant::Instant;
use crate::motor::{Inputs, Motions};
use crate::pair::Pair;
use crate::parameters::{InvalidParameter, Parameters};
use crate::start::Start;
use crate::testbed::{State, Testbed};
use crate::variables::Name;
use fmu_export::{
    CoSimulation, DefaultExperiment, Error, Experiment, Info, InputDerivatives, Model, ModelExchange,
    OutputDerivatives, Partials, Saved, Setup, StateVisitor, Step, Stepped, Variables, info, saved,
};

impl Saved for Pair {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        self[0].visit(visitor);
        self[1].visit(visitor);
    }
}

saved!(for Motions { angle, rate, acceleration });

impl From<InvalidParameter> for Error {
    fn from(error: InvalidParameter) -> Self {
        Self::new(error.to_string())
    }
}

impl Model for TestbedFmu {
    const INFO: Info = Info {
        description: "Testbed of the McGill pitch-roll wrist: a spherical epicyclic cam train driven by two \
                      motors through flexible couplings",
        copyright: "Copyright 2026 the pitch-roll wrist testbed authors",
        default_experiment: DefaultExperiment {
            start_time: 0.0,
            stop_time: 2.0,
            step_size: 1e-3,
            tolerance: 1e-6,
        },
        smooth: true,
        ..info!("PitchRollWristTestbed", "prw_testbed")
    };

    fn new(setup: &Setup) -> Result<Self, Error> {
        let testbed = Testbed::new(Parameters::BUILT_IN)?;
        let (interface, start) = (setup.interface, Start::default());
        Ok(Self { testbed, interface, start, torques: [0.0; 2], angles: [0.0; 2], rates: [0.0; 2] })
    }

    fn update(&mut self) -> Result<(), Error> {
        Ok(self.testbed.parameters_changed()?)
    }

    fn restored(&mut self) -> Result<(), Error> {
        let motors = &mut self.testbed.motors;
        if !motors.times.are_possible() {
            return Err(Error::new(
                "the samples of a saved state must be 0 to 2, the steps between them > 0",
            ));
        }
        motors.times.update();
        motors.rates_changed();
        Ok(())
    }

    /// Until the testbed has started, its state follows the motors, or what is given.
    fn calculate_start(&mut self) {
        if !self.start.is_over {
            self.testbed.state = self.start.from(self.testbed.motors.theta());
        }
    }

    fn initialize(&mut self, _: &Experiment) -> Result<(), Error> {
        self.testbed.motors.forget_samples();
        Ok(())
    }

    fn calculate(&mut self, _time: f64) {
        self.calculate_with(self.motions(&self.testbed.motors));
    }
}

impl CoSimulation for TestbedFmu {
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        if !self.testbed.step(step.size) {
            return Err(Error::new(
                "the state would leave the range of numbers; look for extreme inputs or states",
            ));
        }
        self.start.is_over = true;
        self.calculate_with(self.testbed.motors.path_end);
        Ok(Stepped::Calculated)
    }

    #[inline(always)]
    fn step_at_once(&mut self, size: f64) -> bool {
        if !self.testbed.step_at_once(size) {
            return false;
        }
        self.calculate_with(self.testbed.motors.path_end);
        true
    }
}

impl ModelExchange for TestbedFmu {
    fn continuous_time_entered(&mut self) {
        self.start.is_over = true;
    }
}

impl InputDerivatives for TestbedFmu {
    /// Order 1 of theta is its slope over the next step. Higher orders, and derivatives of omega, are
    /// not needed: between communication points the motors move on straight lines.
    fn set_input_derivative(&mut self, of: Name, order: u32, value: f64) {
        match (of, order) {
            (Name::theta1, 1) => self.testbed.motors.set_rate(0, value),
            (Name::theta2, 1) => self.testbed.motors.set_rate(1, value),
            _ => {}
        }
    }
}

impl OutputDerivatives for TestbedFmu {
    fn output_derivative(&self, of: Name, _: u32) -> f64 {
        self.at(of, &self.now().rates(self.system()))
    }
}

/// The derivatives of the values that a getter returns, while initializing and later. In Co-Simulation the rates that
/// are estimated from the angles react to an angle, and until the start is over the states react to it too. Else these
/// are A, B, C and D of eq. (11).
impl Partials for TestbedFmu {
    fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
        Some(match self.reaction(known) {
            Some(reaction) => self.at(unknown, &reaction),
            None => self.change(unknown, &self.unit_change(known)),
        })
    }
}

impl TestbedFmu {
    /// The change of the instant when an input, a state, or a parameter that a state starts from is set to a value
    /// that is larger by 1. `None` for the parameters of the equations.
    fn reaction(&self, known: Name) -> Option<Instant> {
        let (mut inputs, mut x) = ([Inputs::default(); 2], State::default());
        let mut start = Start { state: State::default(), ..self.start };
        *match known {
            Name::theta1 => &mut inputs[0].theta,
            Name::theta2 => &mut inputs[1].theta,
            Name::omega1 => &mut inputs[0].omega,
            Name::omega2 => &mut inputs[1].omega,
            Name::theta3 => &mut x[0],
            Name::theta4 => &mut x[1],
            Name::theta5 => &mut x[2],
            Name::theta6 => &mut x[3],
            Name::omega5 => &mut x[4],
            Name::omega6 => &mut x[5],
            Name::theta3_start => &mut start.state[0],
            Name::theta4_start => &mut start.state[1],
            Name::theta5_start => &mut start.state[2],
            Name::theta6_start => &mut start.state[3],
            Name::omega5_start => &mut start.state[4],
            Name::omega6_start => &mut start.state[5],
            _ => return None,
        } = 1.0;
        let motors = self.testbed.motors.reaction(inputs);
        if !start.is_over {
            let followed = start.from(motors.theta());
            x = std::array::from_fn(|i| x[i] + followed[i]);
        }
        Some(Instant { x, motors: self.motions(&motors) })
    }

    /// What a variable would be at an instant. All but parameters are linear in it.
    fn at(&self, variable: Name, instant: &Instant) -> f64 {
        let Instant { x, motors } = instant;
        let system = self.system();
        match variable {
            Name::theta1 => motors.angle[0],
            Name::theta2 => motors.angle[1],
            Name::omega1 => motors.rate[0],
            Name::omega2 => motors.rate[1],
            Name::tau1 => instant.torques(system)[0],
            Name::tau2 => instant.torques(system)[1],
            Name::pitch => instant.pitch(system),
            Name::roll => instant.roll(system),
            Name::pitch_rate => instant.pitch_rate(system),
            Name::roll_rate => instant.roll_rate(system),
            Name::theta3 => x[0],
            Name::theta4 => x[1],
            Name::theta5 => x[2],
            Name::theta6 => x[3],
            Name::omega5 | Name::der_theta5 => x[4],
            Name::omega6 | Name::der_theta6 => x[5],
            Name::der_theta3 => instant.shaft_rates(system)[0],
            Name::der_theta4 => instant.shaft_rates(system)[1],
            Name::der_omega5 => instant.accelerations(system)[0],
            Name::der_omega6 => instant.accelerations(system)[1],
            _parameter => f64::NAN,
        }
    }

    /// By how much a variable changes with the parameters.
    fn change(&self, variable: Name, parameters: &Parameters) -> f64 {
        let (now, system) = (self.now(), self.system());
        match variable {
            Name::tau1 => now.change_of_torques(system, parameters)[0],
            Name::tau2 => now.change_of_torques(system, parameters)[1],
            Name::der_theta3 => now.change_of_shaft_rates(system, parameters)[0],
            Name::der_theta4 => now.change_of_shaft_rates(system, parameters)[1],
            Name::der_omega5 => now.change_of_accelerations(system, parameters)[0],
            Name::der_omega6 => now.change_of_accelerations(system, parameters)[1],
            _state_or_rate => 0.0,
        }
    }

    /// The direction in which one parameter changes by 1: the table knows where it lives.
    fn unit_change(&self, parameter: Name) -> Parameters {
        let mut unit = self.clone();
        unit.testbed.parameters = Parameters::ZERO;
        Self::TABLE[parameter as usize].set(&mut unit, &1.0.into());
        unit.testbed.parameters
    }
}

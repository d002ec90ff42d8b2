//! Capabilities of the controller FMU.

use crate::controller::{Controller, Inputs, Schedule};
use crate::motor::MotorSetpoint;
use crate::parameters::Parameters;
use crate::variables::Name;
use fmu_export::{
    CoSimulation, DefaultExperiment, Error, Event, Events, Experiment, Info, InputDerivatives, Model,
    ModelExchange, OutputDerivatives, Partials, Setup, Step, Stepped, Variables, info, saved,
};

saved!(for Inputs { reference, angle, rate, torque });
saved!(for MotorSetpoint { angle, rate, acceleration });
saved!(for Schedule { epoch, period, next });

impl Model for Controller {
    const INFO: Info = Info {
        description: "Sampled controller for the pitch-roll wrist testbed: moves its two motors so that the wrist \
                      reaches given pitch and roll angles",
        copyright: "Copyright (c) 2026 The pitch-roll wrist testbed authors",
        default_experiment: DefaultExperiment {
            start_time: 0.0,
            stop_time: 2.0,
            step_size: 1e-3,
            tolerance: 1e-6,
        },
        ..info!("PitchRollWristController", "prw_controller")
    };

    fn new(_: &Setup) -> Result<Self, Error> {
        Self::new(Parameters::DEFAULT)
    }

    fn update(&mut self) -> Result<(), Error> {
        self.parameters_changed()
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Error> {
        self.start(experiment.start_time);
        Ok(())
    }

    fn calculate(&mut self, time: f64) {
        self.now = time;
    }
}

impl CoSimulation for Controller {
    /// Each sample is an event for importers that handle events. Otherwise `step` takes the samples, and a sample at the end
    /// of a step is taken in the next step, with the inputs of the next step.
    const EVENTS: Events = Events::StopIfHandled;
    const ATOMIC_STEP: bool = true;

    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        if step.stop_at_events
            && let Some(time) = self.sample_within(step.time, step.size)
        {
            return Ok(Stepped::Event(time));
        }
        if self.step(step.time, step.size) {
            return Ok(Stepped::Done);
        }
        Err(Error::new(
            "the step contains so many samples that it would take more than a second; take a smaller step or a longer \
             sample_time",
        ))
    }
}

/// The controller has no continuous states, because the motion of the motors is known between samples. The samples are
/// time events.
impl ModelExchange for Controller {
    fn event(&mut self, time: f64) -> Result<Event, Error> {
        if self.take_samples(time) {
            return Ok(Event { next: Some(self.next_sample()), ..Event::default() });
        }
        Err(Error::new(
            "so many samples are due that they would take more than a second; handle the time events when they are due \
             or take a longer sample_time",
        ))
    }
}

impl InputDerivatives for Controller {
    /// Sets a slope with the setter of the input in the variable table. For this, `inputs` and `slopes`, which have the same
    /// type, are exchanged.
    fn set_input_derivative(&mut self, of: Name, order: u32, value: f64) {
        if order == 1 {
            std::mem::swap(&mut self.inputs, &mut self.slopes);
            Self::TABLE[Self::index(of)].set(self, &value.into());
            std::mem::swap(&mut self.inputs, &mut self.slopes);
        }
    }
}

impl OutputDerivatives for Controller {
    fn output_derivative(&self, of: Name, order: u32) -> f64 {
        let slopes = &self.slopes;
        match (of, order) {
            (Name::pitch_ref, 1) => slopes.reference[0],
            (Name::roll_ref, 1) => slopes.reference[1],
            (Name::pitch, 1) => slopes.angle[0],
            (Name::roll, 1) => slopes.angle[1],
            (Name::pitch_rate, 1) => slopes.rate[0],
            (Name::roll_rate, 1) => slopes.rate[1],
            (Name::tau1, 1) => slopes.torque[0],
            (Name::tau2, 1) => slopes.torque[1],
            (_, 1) => self.partial_by_time(of).unwrap_or_default(),
            _ => 0.0,
        }
    }
}

impl Partials for Controller {
    /// Outputs do not depend on inputs and parameters, because these take effect at the next sample. Motor angles depend
    /// only on their own start values.
    fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
        Some(f64::from(u8::from(unknown == known)))
    }

    fn partial_by_time(&self, unknown: Name) -> Option<f64> {
        let [motor1, motor2] = self.motion();
        Some(match unknown {
            Name::theta1 => motor1.rate,
            Name::theta2 => motor2.rate,
            Name::omega1 => motor1.acceleration,
            Name::omega2 => motor2.acceleration,
            _ => 0.0,
        })
    }
}

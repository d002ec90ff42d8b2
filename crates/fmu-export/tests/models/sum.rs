//! A model that does as little as possible: Co-Simulation, and nothing else.

use fmu_export::*;

/// Sums up its input.
#[derive(Clone)]
pub struct Sum {
    u: f64,
    y: f64,
    gain: f64,
}

const SMALL: Type = Type::real("Small", &units::ONE).min(0.0).max(10.0);

variables! { for Sum;
    /// What comes in
    u = input(&SMALL) in u;
    /// What goes out: the sum of all that came in
    y = output(&SMALL).exact() in y;
    /// Factor
    gain = parameter(&SMALL) in gain;
}

impl Model for Sum {
    const INFO: Info = Info { guid: "{sum}", ..info!("Sum", "sum") };

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self { u: 0.0, y: 0.0, gain: 1.0 })
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Error> {
        if experiment.start_time < 0.0 {
            return Err(Error::new("this model knows no time before 0"));
        }
        Ok(())
    }
}

impl CoSimulation for Sum {
    const VARIABLE_STEP_SIZE: bool = false;

    fn step(&mut self, _: Step) -> Result<Stepped, Error> {
        let sum = self.y + self.gain * self.u;
        if !(-10.0..=10.0).contains(&sum) {
            return Err(Error::new("the sum would be more than 10"));
        }
        self.y = sum;
        Ok(Stepped::Done)
    }
}

offer!(Sum: CoSimulation);

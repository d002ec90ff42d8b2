//! A first-order lag as an FMU: the smallest complete model, to copy and to grow.

use fmi2_export::*;

const NUMBER: RealType = RealType::new("Number", &units::ONE);

variables! {
    /// Input
    u = Variable::input(&NUMBER, 0.0);
    /// Output, follows the input
    x = Variable::output(&NUMBER).state(0.0);
    /// Its rate
    der_x = Variable::local(&NUMBER).derivative_of(vr::x).named("der(x)");
}

/// x' = u - x.
#[derive(Clone, Default)]
pub struct Lag {
    u: f64,
    x: f64,
}

impl Model for Lag {
    const INFO: ModelInfo = ModelInfo {
        description: "First-order lag with time constant 1 s",
        co_simulation: Some(CoSimulation { variable_step_size: true, ..CoSimulation::PLAIN }),
        model_exchange: Some(ModelExchange::PLAIN),
        ..ModelInfo::new("Lag", "lag", guid!(), VARIABLES)
    };

    fn new(_: Interface) -> Self {
        Self::default()
    }

    fn real(&self, variable: u32) -> f64 {
        match variable {
            vr::u => self.u,
            vr::x => self.x,
            _ => self.u - self.x,
        }
    }

    fn set_real(&mut self, variable: u32, value: f64) {
        *(if variable == vr::u { &mut self.u } else { &mut self.x }) = value;
    }

    fn do_step(&mut self, _time: f64, step_size: f64) -> Result<(), ModelError> {
        self.x += (self.u - self.x) * (1.0 - (-step_size).exp());
        Ok(())
    }
}

export_fmi2!(Lag);

//! The smallest complete model of an FMU, to be extended.

use fmu_export::*;

variables! {
    /// x' = u - x.
    pub struct Lag;

    /// Input
    u: f64 = input(&NUMBER);
    /// Output, follows the input
    x: f64 = output(&NUMBER).state();
    /// Its rate
    der_x as "der(x)" = local(&NUMBER).derivative_of(x) by |lag| lag.u - lag.x;
}

impl Model for Lag {
    const INFO: Info = Info {
        description: "x follows u with the time constant 1 s",
        // There are no branches or limits, so the build finds dependencies by changing one variable at a time.
        smooth: true,
        ..info!("Lag", "lag")
    };
}

impl CoSimulation for Lag {
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        self.x += (self.u - self.x) * (1.0 - (-step.size).exp());
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Lag {}

export_fmu!(Lag: CoSimulation + ModelExchange);

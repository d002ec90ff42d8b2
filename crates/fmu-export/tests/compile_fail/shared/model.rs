// A complete model for Co-Simulation with one variable.
include!("fields.rs");

variables! { for Plant;
    /// In
    u = input(&NUMBER) in u;
}

impl Model for Plant {
    const INFO: Info = info!("Plant", "plant");

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self { u: 0.0, x: 0.0, n: 0, list: [0.0; 8] })
    }
}

impl CoSimulation for Plant {
    fn step(&mut self, _: Step) -> Result<Stepped, Error> {
        Ok(Stepped::Done)
    }
}

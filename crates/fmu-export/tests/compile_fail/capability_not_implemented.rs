//! A capability that is named is implemented.
include!("toy/fields.rs");

variables! { for Toy;
    /// In
    u = input(&NUMBER) in u;
}

impl Model for Toy {
    const INFO: Info = info!("Toy", "toy");

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self { u: 0.0, x: 0.0, n: 0, list: [0.0; 8] })
    }
}

offer!(Toy: CoSimulation);

//! A model whose steps end early, and one way or the other the simulation.

use fmu_export::*;

/// Warms up under a load. A step that crosses 100 degrees ends there, for the importer to know when that was; at 200 it
/// melts, and the simulation ends.
#[derive(Clone)]
pub struct Fuse {
    load: f64,
    temperature: f64,
}

variables! { for Fuse;
    /// Degrees per second
    load = input(&NUMBER) in load;
    /// Degrees
    temperature = output(&NUMBER).exact() in temperature;
}

const HOT: f64 = 100.0;
const MELTED: f64 = 200.0;

impl Model for Fuse {
    const INFO: Info = Info { guid: "{fuse}", ..info!("Fuse", "fuse") };

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self { load: 10.0, temperature: 20.0 })
    }
}

impl CoSimulation for Fuse {
    const ENDS_EARLY: bool = true;

    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        let (start, end) = (self.temperature, self.temperature + self.load * step.size);
        if !end.is_finite() {
            return Err(Error::new("nothing gets as hot as that"));
        }
        let time_of = |temperature: f64| step.time + (temperature - start).max(0.0) / self.load;
        // A step to just there, up to rounding, is not early.
        if start < HOT - 1e-6 && end > HOT + 1e-6 {
            self.temperature = HOT;
            return Ok(Stepped::Early(time_of(HOT)));
        }
        if end >= MELTED {
            self.temperature = start.max(MELTED);
            return Ok(Stepped::Terminate(time_of(MELTED)));
        }
        self.temperature = end;
        Ok(Stepped::Done)
    }
}

offer!(Fuse: CoSimulation);

//! A model in which some steps end early, and one step ends the simulation.

use fmu_export::*;

const HOT: f64 = 100.0;
const MELTED: f64 = 200.0;

variables! {
    /// Warms up under a load. A step that would exceed 100 degrees ends early at 100, so that the importer learns the time. At
    /// 200 degrees the fuse melts, and the simulation ends.
    pub struct Fuse;
    /// Degrees per second
    load: f64 = input(&NUMBER).start(10.0);
    /// Degrees
    temperature: f64 = output(&NUMBER).exact().start(20.0);
}

impl Model for Fuse {
    const INFO: Info = info!("Fuse", "fuse");
}

impl CoSimulation for Fuse {
    const ENDS_EARLY: bool = true;

    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        let (start, end) = (self.temperature, self.temperature + self.load * step.size);
        if !end.is_finite() {
            return Err(Error::new("the temperature would not be finite"));
        }
        let time_of = |temperature: f64| step.time + (temperature - start).max(0.0) / self.load;
        // A step that ends at 100 degrees, within rounding error, is not early.
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

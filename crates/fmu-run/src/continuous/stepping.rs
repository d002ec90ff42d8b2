//! Processes each completed step of the solver: locates events in it, reads outputs and notifies the FMU.

use super::model::Model;
use super::simulation::{Arrival, Hooks, Simulation};
use fmi_abi::client::Rejection;
use ivp::dense::StepInterpolant;
use ivp::solout::{ControlFlag, SolOut};

/// Fractions of the first step after an event at which event indicators are also evaluated, because an indicator may quickly change
/// its sign back.
const PROBES: [f64; 4] = [1e-6, 1e-3, 0.1, 0.5];

/// Observes the steps of the solver.
pub(super) struct Stepping<'s, 'a, 'm, H> {
    simulation: &'s mut Simulation<'a>,
    model: &'s Model<'m>,
    hooks: &'s mut H,
    stop: f64,
    pub arrival: Option<Arrival>,
    pub failure: Option<Rejection>,
    /// Whether the derivatives have changed at an event after which the solver continues.
    has_kink: bool,
}

/// Time, states and event indicators.
#[derive(Clone, Debug, Default)]
struct Point {
    time: f64,
    x: Vec<f64>,
    z: Vec<f64>,
}

/// Returns the number of equal steps into which an interval of this length is divided, so that none exceeds the largest step.
pub(super) fn equal_steps(length: f64, largest: Option<f64>) -> u64 {
    largest.map_or(1.0, |largest| (length / largest - 1e-9).ceil().max(1.0)) as u64
}

impl<'s, 'a, 'm, H: Hooks> Stepping<'s, 'a, 'm, H> {
    pub fn of(simulation: &'s mut Simulation<'a>, model: &'s Model<'m>, hooks: &'s mut H, stop: f64) -> Self {
        Self { simulation, model, hooks, stop, arrival: None, failure: None, has_kink: false }
    }

    /// Processes the interval in equal steps that are not longer than the largest step, for an FMU without states.
    pub fn without_states(mut self) -> Result<Arrival, Rejection> {
        let (begin, stop) = (self.simulation.time, self.stop);
        let steps = equal_steps(stop - begin, self.simulation.settings.max_step);
        for number in 1..=steps {
            let end =
                if number == steps { stop } else { begin + (stop - begin) * number as f64 / steps as f64 };
            self.step([self.simulation.time, end], &[], &|_, _| ())?;
            if let Some(arrival) = self.arrival {
                return Ok(arrival);
            }
        }
        Ok(Arrival::Stop)
    }

    /// Processes a step: locates an event in it, reads outputs at the communication points and notifies the FMU. `at` writes the
    /// states at a time within the step.
    fn step(
        &mut self,
        [begin, end]: [f64; 2],
        x: &[f64],
        at: &dyn Fn(f64, &mut [f64]),
    ) -> Result<(), Rejection> {
        let mut end = Point { time: end, x: x.to_vec(), z: Vec::new() };
        let mut indicator = None;
        if !self.simulation.z.is_empty() {
            (end, indicator) = self.first_event(begin, end, at)?;
        }
        let mut between = vec![0.0; x.len()];
        while self.simulation.times[self.simulation.next] < end.time.min(self.stop) {
            let time = self.simulation.times[self.simulation.next];
            at(time, &mut between);
            self.hooks.record(self.model.parts().observe(time, &between)?, self.simulation.next)?;
            self.simulation.next += 1;
        }
        let mut parts = self.model.parts();
        let mut requested = [false; 2];
        if self.simulation.settings.reports_steps {
            requested = parts.complete_step(end.time, &end.x)?;
        }
        parts.accepted();
        drop(parts);
        let simulation = &mut *self.simulation;
        (simulation.taken, simulation.time, simulation.is_fresh) = (end.time - begin, end.time, false);
        simulation.x.copy_from_slice(&end.x);
        if !simulation.z.is_empty() {
            simulation.z.copy_from_slice(&end.z);
        }
        self.arrival = match requested {
            _ if !self.hooks.proceed(simulation.time) => Some(Arrival::Cancel),
            [_, true] => Some(Arrival::Terminate),
            // A step that ends at `stop` may end at other events, too, which are handled together.
            [true, _] if indicator.is_none() && simulation.time < self.stop => {
                let mut smooth = true;
                let arrival = simulation.step_event(self.model, self.hooks, &mut smooth)?;
                self.has_kink = !smooth;
                arrival
            }
            [true, _] => Some(Arrival::Event(indicator)),
            _ => indicator.map(|indicator| Arrival::Event(Some(indicator))),
        };
        Ok(())
    }

    /// Returns the first point at which an event indicator has changed its sign, and the index of the indicator. If none has,
    /// returns the end of the step.
    fn first_event(
        &mut self,
        begin: f64,
        end: Point,
        at: &dyn Fn(f64, &mut [f64]),
    ) -> Result<(Point, Option<usize>), Rejection> {
        let simulation = &*self.simulation;
        let probes =
            PROBES.iter().filter(|_| simulation.is_fresh).map(|part| begin + part * (end.time - begin));
        let points = simulation.times[simulation.next..].iter().copied().take_while(|time| *time < end.time);
        let mut between: Vec<_> =
            probes.chain(points).filter(|time| *time > begin && *time < end.time).collect();
        between.sort_unstable_by(f64::total_cmp);
        let mut before = Point { time: begin, x: simulation.x.clone(), z: simulation.z.clone() };
        for time in between.into_iter().chain([end.time]) {
            let after = if time == end.time {
                let mut after = end.clone();
                after.z.resize(simulation.z.len(), 0.0);
                self.model.parts().indicators(time, &after.x, &mut after.z)?;
                after
            } else {
                self.point(time, at)?
            };
            if simulation.changed(&after.z).next().is_some() {
                let found = self.locate(before, after, at)?;
                let indicator = simulation.changed(&found.z).next();
                return Ok((found, indicator));
            }
            before = after;
        }
        Ok((before, None))
    }

    /// Evaluates states and event indicators at a time within the step.
    fn point(&self, time: f64, at: &dyn Fn(f64, &mut [f64])) -> Result<Point, Rejection> {
        let mut point =
            Point { time, x: vec![0.0; self.simulation.x.len()], z: vec![0.0; self.simulation.z.len()] };
        at(time, &mut point.x);
        self.model.parts().indicators(time, &point.x, &mut point.z)?;
        Ok(point)
    }

    /// Narrows the interval in which an event indicator first changes its sign, and returns the end of the interval, where the sign
    /// has changed. Uses the Illinois method, with a bisection in every fourth iteration.
    fn locate(
        &self,
        mut before: Point,
        mut after: Point,
        at: &dyn Fn(f64, &mut [f64]),
    ) -> Result<Point, Rejection> {
        const MOST: usize = 200;
        let mut weights = [1.0, 1.0];
        for iteration in 0..MOST {
            let (a, b) = (before.time, after.time);
            let middle = a + 0.5 * (b - a);
            if b - a <= 2.0 * f64::EPSILON * a.abs().max(b.abs()) || middle <= a || middle >= b {
                break;
            }
            let zeros = self.simulation.changed(&after.z).map(|index| {
                let (low, high) = (weights[0] * before.z[index], weights[1] * after.z[index]);
                a + (b - a) * low / (low - high)
            });
            let zero = zeros.fold(f64::INFINITY, f64::min);
            let time = if iteration % 4 != 3 && zero > a && zero < b { zero } else { middle };
            let point = self.point(time, at)?;
            if self.simulation.changed(&point.z).next().is_some() {
                (after, weights) = (point, [0.5 * weights[0], 1.0]);
            } else {
                (before, weights) = (point, [1.0, 0.5 * weights[1]]);
            }
        }
        Ok(after)
    }
}

impl<H: Hooks> SolOut for Stepping<'_, '_, '_, H> {
    fn solout(
        &mut self,
        begin: f64,
        end: &mut f64,
        x: &mut [f64],
        interpolant: Option<&StepInterpolant<'_>>,
    ) -> ControlFlag {
        if *end <= self.simulation.time {
            // The solver also calls this function before the first step.
            return ControlFlag::Continue;
        }
        if self.model.parts().has_failed() {
            return ControlFlag::Interrupt;
        }
        let at = |time: f64, x: &mut [f64]| {
            if let Some(interpolant) = interpolant {
                interpolant.interpolate(time, x);
            }
        };
        self.failure = self.step([begin, *end], x, &at).err();
        match (&self.failure, self.arrival) {
            (None, None) if std::mem::take(&mut self.has_kink) => ControlFlag::ModifiedSolution,
            (None, None) => ControlFlag::Continue,
            _ => ControlFlag::Interrupt,
        }
    }
}

//! A run in Model Exchange: steps of the solver, events between them, outputs at the communication points.

use super::inputs::Break;
use super::model::Model;
use super::{Integration, Solver};
use crate::running::Running;
use fmi_client::Rejection;
use ivp::dense::StepInterpolant;
use ivp::methods::{BDF, DOP853, DOPRI5, IntegrationResult, RK4, Tolerance};
use ivp::solout::{ControlFlag, SolOut};
use ivp::status::Status;

/// What the caller does during a run.
pub(crate) trait Hooks {
    /// Reads outputs at the communication point with this index.
    fn record(&mut self, running: &mut Running, index: usize) -> Result<(), Rejection>;

    /// Returns whether the run goes on; called after each step.
    fn proceed(&mut self, time: f64) -> bool;

    /// Observes the outputs before (`false`) and after (`true`) an event.
    fn event(&mut self, running: &mut Running, time: f64, is_after: bool) -> Result<(), Rejection>;

    /// Returns whether an input that is set only at events changes at this communication point, and is not a number.
    fn changes(&self, index: usize) -> bool;

    /// Sets these inputs, in Event Mode.
    fn set_exact(&mut self, running: &mut Running, index: usize) -> Result<(), Rejection>;
}

/// Position of a run.
pub(crate) struct March<'a> {
    /// Communication points, s.
    times: &'a [f64],
    /// Index of the next one whose outputs are not read.
    pub next: usize,
    time: f64,
    x: Vec<f64>,
    /// Event indicators, and whether they were above 0 after the last event or step.
    z: Vec<f64>,
    above: Vec<bool>,
    /// Time of the next event that the FMU has announced, s.
    event: Option<f64>,
    /// Sizes of the next step, if it is known, and of the last, s.
    step: Option<f64>,
    taken: f64,
    settings: Settings,
    chatter: Chatter,
    /// Whether no step was taken since the last event.
    is_fresh: bool,
}

#[derive(Clone, Copy, Debug)]
struct Settings {
    solver: Solver,
    rtol: f64,
    atol: f64,
    max_step: Option<f64>,
    /// Whether the FMU has to know of completed steps.
    reports_steps: bool,
}

/// Detects events that follow each other without progress.
#[derive(Debug, Default)]
struct Chatter {
    since: f64,
    count: usize,
}

/// Number of events in such a part of the times of the run after which the model is said to chatter.
const MOST_EVENTS: usize = 1000;
const SHORT: f64 = 1e-9;

/// Parts of the first step after an event at which event indicators are evaluated, too: one may return to the side from which it came.
const PROBES: [f64; 4] = [1e-6, 1e-3, 0.1, 0.5];

/// End of a smooth interval.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Arrival {
    /// At the requested time.
    Stop,
    /// At an event: by this event indicator, or by the FMU after a step.
    Event(Option<usize>),
    /// The FMU ended the simulation.
    Terminate,
    /// The caller ended the run.
    Cancel,
}

impl<'a> March<'a> {
    pub fn new(
        times: &'a [f64],
        [states, indicators]: [usize; 2],
        integration: &Integration,
        rtol: f64,
        reports_steps: bool,
    ) -> Self {
        let Integration { solver, atol, max_step, .. } = *integration;
        Self {
            times,
            next: 0,
            time: times[0],
            x: vec![0.0; states],
            z: vec![0.0; indicators],
            above: vec![false; indicators],
            event: None,
            step: None,
            taken: 0.0,
            settings: Settings { solver, rtol, atol: atol.unwrap_or(0.01 * rtol), max_step, reports_steps },
            chatter: Chatter { since: times[0], count: 0 },
            is_fresh: true,
        }
    }

    /// Performs the run after Initialization Mode. Returns early if the caller cancels it.
    pub fn run(&mut self, model: &Model, hooks: &mut impl Hooks) -> Result<(), Rejection> {
        self.update(model, true)?;
        loop {
            let is_end = self.next + 1 >= self.times.len();
            if self.times[self.next] <= self.time {
                let mut parts = model.parts();
                parts.set(self.time, &self.x)?;
                hooks.record(parts.running, self.next)?;
                self.next += 1;
                if is_end {
                    return Ok(());
                }
            }
            let stop = self.stop(model);
            let arrival = self.integrate(model, hooks, stop)?;
            match arrival {
                Arrival::Cancel => return Ok(()),
                Arrival::Terminate => return self.end(model),
                Arrival::Stop | Arrival::Event(_) => self.arrive(model, hooks, arrival)?,
            }
        }
    }

    /// Returns the last communication point, s.
    fn last(&self) -> f64 {
        self.times[self.times.len() - 1]
    }

    /// Returns the size of the times of the run, s, to which rounding is relative.
    fn scale(&self) -> f64 {
        let (first, last) = (self.times[0], self.last());
        (last - first).max(first.abs()).max(last.abs())
    }

    /// Returns the time at which the next smooth interval ends at the latest.
    fn stop(&self, model: &Model) -> f64 {
        let mut stop = self.last().min(model.parts().until()).min(self.event.unwrap_or(f64::INFINITY));
        // Without states, no step shows an event before; a fixed step ends at the communication points.
        if self.x.is_empty() || self.settings.solver == Solver::Rk4 {
            stop = stop.min(self.times[self.next]);
        }
        stop.max(self.time)
    }

    /// Handles what happens at the end of a smooth interval.
    fn arrive(&mut self, model: &Model, hooks: &mut impl Hooks, arrival: Arrival) -> Result<(), Rejection> {
        let is_point = self.times[self.next] <= self.time;
        let is_end = is_point && self.next + 1 == self.times.len();
        let is_timed = self.event.is_some_and(|time| time <= self.time);
        let exact = is_point && hooks.changes(self.next);
        let is_sure = is_timed || exact || matches!(arrival, Arrival::Event(_));
        if is_sure || model.parts().until() <= self.time {
            let mut parts = model.parts();
            parts.set(self.time, &self.x)?;
            hooks.event(parts.running, self.time, false)?;
        }
        let passed = model.parts().pass(self.time, is_end);
        if !is_sure && passed != Break::Jump {
            return Ok(());
        }
        self.chatter(arrival)?;
        {
            let mut parts = model.parts();
            parts.running.sole().enter_event_mode()?;
            parts.set_inputs(self.time)?;
            if exact {
                hooks.set_exact(parts.running, self.next)?;
            }
        }
        self.update(model, false)?;
        let mut parts = model.parts();
        parts.set(self.time, &self.x)?;
        hooks.event(parts.running, self.time, true)
    }

    /// Iterates an event in Event Mode, enters Continuous-Time Mode and reads what has changed.
    fn update(&mut self, model: &Model, is_first: bool) -> Result<(), Rejection> {
        let mut parts = model.parts();
        let event = parts.running.sole().event()?;
        if event.terminate {
            drop(parts);
            return self.end(model);
        }
        parts.running.sole().enter_continuous_time_mode()?;
        if event.states_changed || is_first {
            parts.states(&mut self.x)?;
        }
        if event.nominals_changed || is_first {
            parts.read_nominals()?;
        }
        self.event = event.next;
        self.is_fresh = true;
        if !self.z.is_empty() {
            parts.indicators(self.time, &self.x, &mut self.z)?;
            self.above.iter_mut().zip(&self.z).for_each(|(above, z)| *above = *z > 0.0);
        }
        Ok(())
    }

    /// Returns the error for a requested end.
    fn end(&self, model: &Model) -> Result<(), Rejection> {
        Err(model
            .parts()
            .running
            .sole()
            .rejection("Model Exchange", fmi_abi::Status::Discard, Vec::new())
            .at_end(self.time))
    }

    /// Counts events, and fails if there are too many in a short time.
    fn chatter(&mut self, arrival: Arrival) -> Result<(), Rejection> {
        let short = SHORT * self.scale();
        let Chatter { since, count } = &mut self.chatter;
        if self.time - *since > short {
            (*since, *count) = (self.time, 0);
        }
        *count += 1;
        if *count < MOST_EVENTS {
            return Ok(());
        }
        let what = match arrival {
            Arrival::Event(Some(index)) => {
                format!("event indicator {} changes its sign again and again", index + 1)
            }
            Arrival::Event(None) => "the FMU requests an event after each step".to_owned(),
            _ => format!(
                "the FMU announces events without end, the next one for t = {:?} s",
                self.event.unwrap_or(self.time)
            ),
        };
        let text = format!("{what}: {MOST_EVENTS} events from t = {since} s to t = {} s", self.time);
        Err(Rejection::without_fmu("Model Exchange", &text))
    }

    /// Integrates to this time, or to an event before it.
    fn integrate(&mut self, model: &Model, hooks: &mut impl Hooks, stop: f64) -> Result<Arrival, Rejection> {
        /// Part of the time that rounding may have changed.
        const ROUNDING: f64 = 1e-14;
        /// Smallest first step after an event, as a part of the times of the run.
        const SMALL: f64 = 1e-13;
        loop {
            let near = ROUNDING * self.scale();
            if stop - self.time <= near {
                self.time = stop;
                return Ok(Arrival::Stop);
            }
            if self.x.is_empty() {
                return Stepping::of(self, model, hooks, stop).without_states();
            }
            model.parts().check_derivatives(self.time, &self.x)?;
            let begin = (self.time, self.step);
            let result = self.solve(model, hooks, stop);
            if let Some(rejection) = model.parts().take_fault() {
                return Err(rejection);
            }
            let (arrival, result) = result?;
            let reached = stop - self.time <= near;
            if reached && arrival.is_none_or(|of| of == Arrival::Stop) {
                // The last step was cut short at the end; the next interval may begin with a full one.
                let cut = result.steps.total <= 1;
                self.step = Some(begin.1.filter(|_| cut).map_or(result.h, |step| step.max(result.h)));
                self.time = stop;
                return Ok(Arrival::Stop);
            }
            // The estimate of the solver is far too small if a state is almost 0, as it often is at an event.
            let small = Some((0.01 * self.taken).max(SMALL * self.scale()));
            if let Some(arrival) = arrival {
                self.step = small;
                return Ok(arrival);
            }
            match result.status {
                Status::ProbablyStiff if self.settings.solver == Solver::Auto => {
                    (self.settings.solver, self.step) = (Solver::Bdf, None);
                }
                Status::ProbablyStiff | Status::NeedLargerNMax if self.time > begin.0 => self.step = None,
                Status::StepSizeTooSmall if result.steps.total == 0 && self.step.is_none() => {
                    self.step = small
                }
                status => {
                    let miss = model.parts().take_miss();
                    return Err(miss.unwrap_or_else(|| stuck(status, self.time)));
                }
            }
        }
    }

    /// Calls the solver.
    fn solve(
        &mut self,
        model: &Model,
        hooks: &mut impl Hooks,
        stop: f64,
    ) -> Result<(Option<Arrival>, IntegrationResult), Rejection> {
        /// Steps for which the solver is called at most.
        const STEPS: usize = 100_000;
        /// Every step shows whether the model is stiff.
        const STIFF: usize = 1;
        let Settings { solver, rtol, atol, max_step, .. } = self.settings;
        let (time, x) = (self.time, self.x.clone());
        let relative = Tolerance::Scalar(rtol);
        let absolute: Vec<_> = model.parts().nominals.iter().map(|nominal| atol * nominal).collect();
        let (absolute, first_step) = (Tolerance::Vector(absolute), self.step.filter(|step| *step > 0.0));
        let dense_output = !self.z.is_empty() || self.times[self.next] < stop;
        let mut stepping = Stepping::of(self, model, hooks, stop);
        let observer = Some(&mut stepping);
        let result = match solver {
            Solver::Auto | Solver::Dop853 => {
                let stiff_test = if solver == Solver::Auto { STIFF } else { usize::MAX };
                DOP853 {
                    max_step,
                    first_step,
                    max_steps: STEPS,
                    stiff_test,
                    dense_output,
                    ..DOP853::default()
                }
                .solve(model, time, &x, stop, relative, absolute, observer)
            }
            Solver::Dopri5 => DOPRI5 {
                max_step,
                first_step,
                max_steps: STEPS,
                stiff_test: usize::MAX,
                dense_output,
                ..DOPRI5::default()
            }
            .solve(model, time, &x, stop, relative, absolute, observer),
            Solver::Bdf => BDF { max_step, first_step, max_steps: STEPS, ..BDF::default() }
                .solve(model, time, &x, stop, relative, absolute, observer),
            Solver::Rk4 => {
                let steps = max_step.map_or(1.0, |step| ((stop - time) / step - 1e-9).ceil().max(1.0));
                RK4 { max_steps: usize::MAX, dense_output }.solve(
                    model,
                    time,
                    &x,
                    stop,
                    (stop - time) / steps,
                    observer,
                )
            }
        };
        let Stepping { arrival, failure, .. } = stepping;
        match (failure, result) {
            (Some(rejection), _) => Err(rejection),
            (None, Ok(result)) => Ok((arrival, result)),
            (None, Err(error)) => Err(Rejection::without_fmu("Model Exchange", &error.to_string())),
        }
    }
}

fn stuck(status: Status, time: f64) -> Rejection {
    let why = match status {
        Status::StepSizeTooSmall => {
            "the solver finds no step that is short enough; the model may have a singularity"
        }
        _ => "the solver does not converge",
    };
    Rejection::without_fmu("Model Exchange", &format!("{why} at t = {time} s"))
}

/// Observes the steps of the solver.
struct Stepping<'s, 'a, 'm, H> {
    march: &'s mut March<'a>,
    model: &'s Model<'m>,
    hooks: &'s mut H,
    stop: f64,
    arrival: Option<Arrival>,
    failure: Option<Rejection>,
}

/// Time, states and event indicators.
#[derive(Clone, Debug, Default)]
struct Point {
    time: f64,
    x: Vec<f64>,
    z: Vec<f64>,
}

impl<'s, 'a, 'm, H: Hooks> Stepping<'s, 'a, 'm, H> {
    fn of(march: &'s mut March<'a>, model: &'s Model<'m>, hooks: &'s mut H, stop: f64) -> Self {
        Self { march, model, hooks, stop, arrival: None, failure: None }
    }

    /// Goes to the end of the interval, if the FMU has no states.
    fn without_states(mut self) -> Result<Arrival, Rejection> {
        let (begin, stop) = (self.march.time, self.stop);
        self.step([begin, stop], &[], &|_, _| ())?;
        Ok(self.arrival.unwrap_or(Arrival::Stop))
    }

    /// Completes a step: locates an event in it, reads outputs at the communication points and reports the step to the FMU.
    fn step(
        &mut self,
        [begin, end]: [f64; 2],
        x: &[f64],
        at: &dyn Fn(f64, &mut [f64]),
    ) -> Result<(), Rejection> {
        let mut end = Point { time: end, x: x.to_vec(), z: Vec::new() };
        let mut indicator = None;
        if !self.march.z.is_empty() {
            (end, indicator) = self.first_event(begin, end, at)?;
        }
        let mut between = vec![0.0; x.len()];
        while self.march.times[self.march.next] < end.time.min(self.stop) {
            let time = self.march.times[self.march.next];
            at(time, &mut between);
            let mut parts = self.model.parts();
            parts.set(time, &between)?;
            self.hooks.record(parts.running, self.march.next)?;
            self.march.next += 1;
        }
        let mut parts = self.model.parts();
        let mut wanted = [false; 2];
        if self.march.settings.reports_steps {
            parts.set(end.time, &end.x)?;
            wanted = parts.running.sole().completed_integrator_step()?;
        }
        parts.accepted();
        let march = &mut *self.march;
        (march.taken, march.time, march.is_fresh) = (end.time - begin, end.time, false);
        march.x.copy_from_slice(&end.x);
        if !march.z.is_empty() {
            march.z.copy_from_slice(&end.z);
        }
        self.arrival = match wanted {
            _ if !self.hooks.proceed(march.time) => Some(Arrival::Cancel),
            [_, true] => Some(Arrival::Terminate),
            [true, _] => Some(Arrival::Event(indicator)),
            _ => indicator.map(|indicator| Arrival::Event(Some(indicator))),
        };
        Ok(())
    }

    /// Returns the first point after an event indicator has changed its sign, and the indicator; else the end of the step.
    fn first_event(
        &mut self,
        begin: f64,
        end: Point,
        at: &dyn Fn(f64, &mut [f64]),
    ) -> Result<(Point, Option<usize>), Rejection> {
        let march = &*self.march;
        let probes = PROBES.iter().filter(|_| march.is_fresh).map(|part| begin + part * (end.time - begin));
        let points = march.times[march.next..].iter().copied().take_while(|time| *time < end.time);
        let mut between: Vec<_> =
            probes.chain(points).filter(|time| *time > begin && *time < end.time).collect();
        between.sort_unstable_by(f64::total_cmp);
        let mut before = Point { time: begin, x: march.x.clone(), z: march.z.clone() };
        for time in between.into_iter().chain([end.time]) {
            let after = if time == end.time {
                let mut after = end.clone();
                after.z.resize(march.z.len(), 0.0);
                self.model.parts().indicators(time, &after.x, &mut after.z)?;
                after
            } else {
                self.point(time, at)?
            };
            if march.changed(&after.z).next().is_some() {
                let found = self.locate(before, after, at)?;
                let indicator = march.changed(&found.z).next();
                return Ok((found, indicator));
            }
            before = after;
        }
        Ok((before, None))
    }

    fn point(&self, time: f64, at: &dyn Fn(f64, &mut [f64])) -> Result<Point, Rejection> {
        let mut point = Point { time, x: vec![0.0; self.march.x.len()], z: vec![0.0; self.march.z.len()] };
        at(time, &mut point.x);
        self.model.parts().indicators(time, &point.x, &mut point.z)?;
        Ok(point)
    }

    /// Narrows the interval in which the first event indicator changes its sign, and returns its end, where the sign has changed.
    /// The Illinois method, with a bisection now and then.
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
            let zeros = self.march.changed(&after.z).map(|index| {
                let (low, high) = (weights[0] * before.z[index], weights[1] * after.z[index]);
                a + (b - a) * low / (low - high)
            });
            let zero = zeros.fold(f64::INFINITY, f64::min);
            let time = if iteration % 4 != 3 && zero > a && zero < b { zero } else { middle };
            let point = self.point(time, at)?;
            if self.march.changed(&point.z).next().is_some() {
                (after, weights) = (point, [0.5 * weights[0], 1.0]);
            } else {
                (before, weights) = (point, [1.0, 0.5 * weights[1]]);
            }
        }
        Ok(after)
    }
}

impl March<'_> {
    /// Returns the event indicators that are on another side of 0 than after the last event.
    fn changed(&self, z: &[f64]) -> impl Iterator<Item = usize> {
        self.above
            .iter()
            .zip(z)
            .enumerate()
            .filter(|(_, (above, z))| **above != (**z > 0.0))
            .map(|(index, _)| index)
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
        if *end <= self.march.time {
            // The call before the first step.
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
            (None, None) => ControlFlag::Continue,
            _ => ControlFlag::Interrupt,
        }
    }
}

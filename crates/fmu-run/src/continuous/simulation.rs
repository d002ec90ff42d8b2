//! A run in Model Exchange: integrates the smooth intervals, handles the events between them, and reads outputs at the communication
//! points.

use super::chatter::{Chatter, MOST_EVENTS};
use super::inputs::Break;
use super::model::Model;
use super::{Integration, Solver};
use crate::system_instance::SystemInstance;
use fmi_abi::client::{Event, Rejection};
use fmi_abi::shown_number;

/// Functions of the caller that are called during a run.
pub(crate) trait Hooks {
    /// Reads outputs at the communication point with this index.
    fn record(&mut self, instance: &mut SystemInstance, index: usize) -> Result<(), Rejection>;

    /// Returns whether the run continues; called after each step.
    fn proceed(&mut self, time: f64) -> bool;

    /// Called before an event (`is_after` is false) and after it, so that the caller can read outputs. At a break of an input that
    /// is not an event, it is only called with `is_after` false.
    fn event(&mut self, instance: &mut SystemInstance, time: f64, is_after: bool) -> Result<(), Rejection>;

    /// Called in an event after the FMU has updated its discrete states, before the states are read. `x` are the states before, and
    /// `reported` is whether the FMU reports that they have changed.
    fn updated(&mut self, instance: &mut SystemInstance, x: &[f64], reported: bool) -> Result<(), Rejection>;

    /// Updates the discrete states in Event Mode at this time, s, until the event is complete.
    fn update(&mut self, instance: &mut SystemInstance, _time: f64) -> Result<Event, Rejection> {
        instance.sole().event()
    }

    /// Returns whether a string, bytes or a 64-bit integer among the inputs changes at this communication point.
    fn changes(&self, index: usize) -> bool;

    /// Sets the inputs that are strings, bytes or 64-bit integers to their values at this communication point, in Event Mode.
    fn set_exact(&mut self, instance: &mut SystemInstance, index: usize) -> Result<(), Rejection>;
}

/// State of a run.
pub(crate) struct Simulation<'a> {
    /// Communication points, s.
    pub(super) times: &'a [f64],
    /// Index of the first communication point whose outputs have not been read.
    pub next: usize,
    /// Time that has been reached, s.
    pub time: f64,
    /// Continuous states.
    pub(super) x: Vec<f64>,
    /// Event indicators.
    pub(super) z: Vec<f64>,
    /// Whether each event indicator was above 0 after the last event or step.
    pub(super) above: Vec<bool>,
    /// Time of the next event that the FMU has announced, s.
    event: Option<f64>,
    /// Suggested size of the next step, s; `None` lets the solver choose.
    pub(super) step: Option<f64>,
    /// Size of the last step, s.
    pub(super) taken: f64,
    /// Suggested size of the next step, s, if the FMU continues smoothly after the event that it requested after the last step.
    pub(super) smooth: Option<f64>,
    pub(super) settings: Settings,
    chatter: Chatter,
    /// Whether no step has been performed since the last event.
    pub(super) is_fresh: bool,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Settings {
    pub solver: Solver,
    pub rtol: f64,
    pub atol: f64,
    pub max_step: Option<f64>,
    /// Whether the FMU must be notified of completed integrator steps.
    pub reports_steps: bool,
}

/// Reason why a smooth interval ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Arrival {
    /// The requested time was reached.
    Stop,
    /// An event occurred: at this event indicator, or because the FMU requested it after a step.
    Event(Option<usize>),
    /// An event that the FMU requested after a step has been handled, but the solver must start again.
    Handled,
    /// The FMU ended the simulation.
    Terminate,
    /// The caller ended the run.
    Cancel,
}

impl<'a> Simulation<'a> {
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
            smooth: None,
            settings: Settings { solver, rtol, atol: atol.unwrap_or(0.01 * rtol), max_step, reports_steps },
            chatter: Chatter::since(times[0]),
            is_fresh: true,
        }
    }

    /// Performs the run, from the end of Initialization Mode. Returns early if the caller cancels it.
    pub fn run(&mut self, model: &Model, hooks: &mut impl Hooks) -> Result<(), Rejection> {
        self.update(model, hooks, true)?;
        loop {
            let is_end = self.next + 1 >= self.times.len();
            if self.times[self.next] <= self.time {
                hooks.record(model.parts().observe(self.time, &self.x)?, self.next)?;
                self.next += 1;
                if is_end {
                    return Ok(());
                }
            }
            let stop = self.stop(model);
            let arrival = self.integrate(model, hooks, stop)?;
            match arrival {
                Arrival::Cancel => return Ok(()),
                Arrival::Terminate => return Err(self.ended(model)),
                Arrival::Handled => {}
                Arrival::Stop | Arrival::Event(_) => self.arrive(model, hooks, arrival)?,
            }
        }
    }

    /// Returns the last communication point, s.
    fn last(&self) -> f64 {
        self.times[self.times.len() - 1]
    }

    /// Returns the magnitude of the times of the run, s, to which rounding errors are relative.
    pub(super) fn scale(&self) -> f64 {
        let (first, last) = (self.times[0], self.last());
        (last - first).max(first.abs()).max(last.abs())
    }

    /// Returns the latest time, s, at which the next smooth interval may end.
    fn stop(&self, model: &Model) -> f64 {
        let mut stop = self.last().min(model.parts().until()).min(self.event.unwrap_or(f64::INFINITY));
        // Without states, each interval is processed as one step, so it must not exceed a communication point. Fixed steps end at
        // communication points, too.
        if self.x.is_empty() || self.settings.solver == Solver::Rk4 {
            stop = stop.min(self.times[self.next]);
        }
        stop.max(self.time)
    }

    /// Passes breaks of inputs at the end of a smooth interval, and handles an event if there is one.
    fn arrive(&mut self, model: &Model, hooks: &mut impl Hooks, arrival: Arrival) -> Result<(), Rejection> {
        let is_point = self.times[self.next] <= self.time;
        let is_end = is_point && self.next + 1 == self.times.len();
        let is_timed = self.event.is_some_and(|time| time <= self.time);
        let exact = is_point && hooks.changes(self.next);
        let is_sure = is_timed || exact || matches!(arrival, Arrival::Event(_));
        if is_sure || model.parts().until() <= self.time {
            hooks.event(model.parts().observe(self.time, &self.x)?, self.time, false)?;
        }
        let passed = model.parts().pass(self.time, is_end);
        if !is_sure && passed != Break::Jump {
            return Ok(());
        }
        let changes = self.handle(model, hooks, arrival, exact)?;
        if arrival == Arrival::Event(None) && !(changes || is_timed || exact || passed == Break::Jump) {
            self.step = self.smooth;
        }
        Ok(())
    }

    /// Handles an event that the FMU has requested after a step, before the solver continues. If the event changes neither states nor
    /// nominal values, the solver need not start again, and the result is `None`. This matters for FMUs that request an event after each
    /// step (section 3.2.2 of FMI 2.0 allows it). `smooth` tells whether the derivatives are the same as before, too.
    pub(super) fn step_event(
        &mut self,
        model: &Model,
        hooks: &mut impl Hooks,
        smooth: &mut bool,
    ) -> Result<Option<Arrival>, Rejection> {
        let [mut before, mut after] = [vec![0.0; self.x.len()], vec![0.0; self.x.len()]];
        hooks.event(model.parts().observe(self.time, &self.x)?, self.time, false)?;
        model.parts().derivatives(self.time, &self.x, &mut before)?;
        let (next, z) = (self.event, self.z.clone());
        let changes = self.handle(model, hooks, Arrival::Event(None), false)?;
        if changes || self.event != next {
            return Ok(Some(Arrival::Handled));
        }
        model.parts().derivatives(self.time, &self.x, &mut after)?;
        *smooth = before == after;
        self.is_fresh = !*smooth || z != self.z;
        Ok(None)
    }

    /// Handles an event. Returns whether states or their nominal values have changed.
    fn handle(
        &mut self,
        model: &Model,
        hooks: &mut impl Hooks,
        arrival: Arrival,
        exact: bool,
    ) -> Result<bool, Rejection> {
        let scale = self.scale();
        if let Some(since) = self.chatter.count(self.time, scale) {
            return Err(self.chattering(arrival, since));
        }
        {
            let mut parts = model.parts();
            parts.instance.sole().enter_event_mode()?;
            parts.set_inputs(self.time)?;
            if exact {
                hooks.set_exact(parts.instance, self.next)?;
            }
        }
        let changes = self.update(model, hooks, false)?;
        hooks.event(model.parts().observe(self.time, &self.x)?, self.time, true)?;
        Ok(changes)
    }

    /// Handles an event in Event Mode, and the further events that the FMU announces for the same time, because values between them
    /// belong to no time. Returns whether states or their nominal values have changed.
    fn update(&mut self, model: &Model, hooks: &mut impl Hooks, is_first: bool) -> Result<bool, Rejection> {
        let mut changes = self.update_once(model, hooks, is_first)?;
        while self.event.is_some_and(|next| next <= self.time) {
            let scale = self.scale();
            if let Some(since) = self.chatter.count(self.time, scale) {
                return Err(self.chattering(Arrival::Stop, since));
            }
            model.parts().instance.sole().enter_event_mode()?;
            changes |= self.update_once(model, hooks, false)?;
        }
        Ok(changes)
    }

    /// Updates the discrete states in Event Mode until the event is complete, enters Continuous-Time Mode and reads the values that
    /// have changed. Returns whether states or their nominal values have changed.
    fn update_once(
        &mut self,
        model: &Model,
        hooks: &mut impl Hooks,
        is_first: bool,
    ) -> Result<bool, Rejection> {
        let mut parts = model.parts();
        let event = hooks.update(parts.instance, self.time)?;
        if event.terminate {
            drop(parts);
            return Err(self.ended(model));
        }
        if !is_first {
            hooks.updated(parts.instance, &self.x, event.states_changed)?;
        }
        parts.instance.sole().enter_continuous_time_mode()?;
        if event.states_changed || is_first {
            parts.states(&mut self.x)?;
        }
        if event.nominals_changed || is_first {
            parts.read_nominals()?;
        }
        if event.next.is_some_and(f64::is_nan) {
            return Err(Rejection::without_fmu("Model Exchange", "the time of the next event is NaN"));
        }
        self.event = event.next;
        self.is_fresh = true;
        if !self.z.is_empty() {
            parts.indicators(self.time, &self.x, &mut self.z)?;
            self.above.iter_mut().zip(&self.z).for_each(|(above, z)| *above = *z > 0.0);
        }
        Ok(event.states_changed || event.nominals_changed)
    }

    /// Returns the error for an end of the simulation that the FMU requests.
    fn ended(&self, model: &Model) -> Rejection {
        let mut parts = model.parts();
        let rejection =
            parts.instance.sole().rejection("Model Exchange", fmi_abi::Status::Discard, Vec::new());
        rejection.at_end(self.time)
    }

    /// Returns the error for too many events since this time, s.
    fn chattering(&self, arrival: Arrival, since: f64) -> Rejection {
        let cause = match arrival {
            Arrival::Event(Some(index)) => {
                format!("event indicator {} changes its sign again and again", index + 1)
            }
            Arrival::Event(None) => "the FMU requests an event after each step".to_owned(),
            _ => format!(
                "the FMU announces events without end, the next one for t = {} s",
                shown_number(self.event.unwrap_or(self.time))
            ),
        };
        let [since, now] = [since, self.time].map(shown_number);
        let text = format!("{cause}: {MOST_EVENTS} events from t = {since} s to t = {now} s");
        Rejection::without_fmu("Model Exchange", &text)
    }

    /// Returns the event indicators that have changed their sign since the last event or step.
    pub(super) fn changed(&self, z: &[f64]) -> impl Iterator<Item = usize> {
        self.above
            .iter()
            .zip(z)
            .enumerate()
            .filter(|(_, (above, z))| **above != (**z > 0.0))
            .map(|(index, _)| index)
    }
}

//! The work of a thread of a batch, which performs one run after the other.

use super::Occurrence;
use super::input_rows::InputRows;
use super::measure::Measured;
use super::plan::Plan;
use super::pulse::Pulse;
use super::watch::Watch;
use crate::error::lock;
use crate::instance::Experiment;
use crate::messages::{Feed, Logging};
use crate::system::System;
use crate::system_instance::SystemInstance;
use fmi_abi::client::Rejection;
use fmi_abi::{Value, shown_number};
use std::sync::Arc;
use std::time;

/// Failure of a run before the last time.
pub(super) struct Failure {
    /// Index of the time of the failure; `None` if the initialization failed.
    pub at: Option<usize>,
    pub text: String,
    /// Whether the FMU has logged no message.
    pub is_silent: bool,
}

/// Index of a run, and its values that `f64` cannot represent: for each stored time that it reached, the values of all such outputs.
pub(super) type Exact = (usize, Vec<Value>);

/// Instance and buffers of a thread.
pub(super) struct Worker<'a> {
    pub system: &'a System,
    pub plan: &'a Plan<'a>,
    pub watch: &'a Watch,
    /// Deadline, if failed runs are repeated with logging on.
    deadline: Option<time::Instant>,
    /// Collector of all messages, if the caller requests them, and the index of this thread's instance.
    pub feed: Option<(Arc<Feed>, usize)>,
    /// Whether this is the thread of the caller, which calls the pulse.
    is_caller: bool,
    pulse: Pulse,
    /// The instance of the previous run, if instances are reused.
    used: Option<SystemInstance>,
    pub inputs: InputRows<'a>,
    derivatives: InputRows<'a>,
    /// Index of the current run.
    number: usize,
    /// Values of the current run that `f64` cannot represent.
    exact_of_run: Vec<Value>,
    /// The same for finished runs.
    pub exact: Vec<Exact>,
    /// Events in Model Exchange.
    pub events: Vec<Occurrence>,
    /// Orders of the input derivatives, which are all 1.
    orders: Vec<i32>,
    /// Numeric outputs at the current time.
    pub row: Vec<f64>,
    /// Number of communication points that the run has reached.
    pub reached: usize,
    measured: Measured,
}

/// Position in the trajectories of a run.
pub(super) struct Kept {
    /// Length of a trajectory.
    length: usize,
    /// Index of the next stored value.
    index: usize,
    /// Number of communication points until then.
    wait: usize,
}

impl Kept {
    pub fn of(plan: &Plan) -> Self {
        Self { length: plan.stored_times(), index: 0, wait: 0 }
    }
}

/// Index of the last communication point before a run stopped, and the time that it reached, s (`None` if the initialization failed);
/// and the error.
pub(super) type Stopped = (Option<(usize, f64)>, Rejection);

impl<'a> Worker<'a> {
    pub fn new(
        system: &'a System,
        plan: &'a Plan<'a>,
        watch: &'a Watch,
        number: usize,
        deadline: Option<time::Instant>,
    ) -> Self {
        Self {
            system,
            plan,
            watch,
            deadline,
            feed: None,
            is_caller: number == 0,
            pulse: Pulse::default(),
            used: None,
            inputs: InputRows::new(&plan.inputs),
            derivatives: InputRows::new(&plan.derivatives),
            number: 0,
            exact_of_run: Vec::new(),
            exact: Vec::new(),
            events: Vec::new(),
            orders: vec![1; plan.derivatives.values.len()],
            row: vec![0.0; plan.outputs.len()],
            reached: 0,
            measured: Measured::new(plan.measures, plan.outputs.len()),
        }
    }

    fn logging(&self) -> Logging {
        Logging { on: self.deadline.is_some() || self.feed.is_some(), feed: self.feed.clone() }
    }

    /// Returns whether a run may reset the instance of an earlier one. With logging on, it may not, so that the messages of each run are
    /// complete. An instance with event mode is not kept, because later runs may be without.
    fn may_reuse(&self) -> bool {
        self.plan.reuse && !self.logging().on && self.plan.events.is_none()
    }

    /// Takes an instance that an earlier batch has kept, if there is one.
    pub fn begin(&mut self) {
        if self.may_reuse() {
            let kept = self.system.pool().take(self.plan.interface);
            self.used = kept.map(|components| SystemInstance::of(self.system, components));
        }
    }

    /// Keeps the instance for a later batch, if the system permits idle instances.
    pub fn finish(self) {
        if let Some(used) = self.used
            && self.system.may_be_idle(self.plan.interface)
        {
            self.system.pool().put(self.plan.interface, used.into_components());
        }
    }

    /// Performs a run over these times. If the run reaches the last time, the result may be a note about its end.
    pub fn run(
        &mut self,
        run: usize,
        times: &[f64],
        trajectories: &mut [f64],
        measures: &mut [f64],
    ) -> Result<Option<String>, Failure> {
        let plan = self.plan;
        self.report_time(run, plan.time[0]);
        let mode = (plan.interface, plan.events.is_some());
        let instance = SystemInstance::renewed(self.used.take(), self.system, mode, &self.logging());
        let mut instance = instance.map_err(|(text, is_silent)| Failure { at: None, text, is_silent })?;
        instance.forget_log();
        self.inputs.begin(&plan.inputs, run);
        self.derivatives.begin(&plan.derivatives, run);
        (self.reached, self.number) = (0, run);
        self.exact_of_run.clear();
        self.measured.begin();
        let stopped: Option<Stopped> = match (&plan.model_exchange, &plan.events) {
            (None, None) => self.follow(times, &mut instance, run, trajectories).err(),
            (None, Some(events)) => self.follow_events(events, times, &mut instance, run, trajectories).err(),
            (Some(model_exchange), _) => {
                self.integrate(model_exchange, times, &mut instance, run, trajectories).err()
            }
        };
        if !self.is_repeated() && !plan.exact_outputs.is_empty() {
            self.exact.push((run, std::mem::take(&mut self.exact_of_run)));
        }
        if !self.is_repeated() {
            let reached = stopped.as_ref().map_or(times.last().copied(), |(at, _)| at.map(|(_, time)| time));
            self.report_time(run, reached.unwrap_or(plan.time[0]));
            let ended = stopped.as_ref().and_then(|(_, rejection)| rejection.ended());
            lock(&self.watch.ended).extend(ended.map(|time| (run, time, self.row.clone())));
        }
        let filled = plan.every.map_or(0, |every| self.reached.div_ceil(every));
        for trajectory in trajectories.chunks_mut(plan.stored_times().max(1)) {
            trajectory[filled..].fill(f64::NAN);
        }
        let rejected = stopped.as_ref().is_some_and(|(_, rejection)| rejection.ended().is_none());
        for (output, row) in measures.chunks_mut(plan.measures.len().max(1)).enumerate() {
            for (value, measure) in row.iter_mut().zip(plan.measures) {
                *value = if rejected { f64::NAN } else { self.measured.measure(*measure, output) };
            }
        }
        let is_complete = stopped.is_none() && self.reached == plan.time.len();
        let terminated = if rejected { Ok(()) } else { instance.terminate() };
        if is_complete && terminated.is_ok() && self.may_reuse() {
            self.used = Some(instance);
        }
        let Some((at, rejection)) = stopped else {
            return Ok(terminated.err().map(|rejection| format!("finished; then {rejection}")));
        };
        if !rejected && self.reached == plan.time.len() {
            return Ok(Some(rejection.to_string()));
        }
        let text = match at {
            Some((_, time)) if rejected => format!("at {} s: {rejection}", shown_number(time)),
            _ => rejection.to_string(),
        };
        Err(Failure { at: at.map(|(index, _)| index), text, is_silent: rejection.is_silent() })
    }

    /// Returns whether the run is repeated with logging on, so that only its message is used.
    pub fn is_repeated(&self) -> bool {
        self.deadline.is_some()
    }

    /// Records the index and the time of the run for the messages of the FMU.
    #[inline(always)]
    pub fn report_time(&self, run: usize, time: f64) {
        if let Some((feed, instance)) = &self.feed {
            feed.at(*instance, run, time);
        }
    }

    /// Runs an instance in Co-Simulation from the start values to the last time, unless the caller cancels the run or the deadline
    /// passes.
    fn follow(
        &mut self,
        times: &[f64],
        instance: &mut SystemInstance,
        run: usize,
        trajectories: &mut [f64],
    ) -> Result<(), Stopped> {
        let plan = self.plan;
        self.start(instance, run).map_err(|rejection| (None, rejection))?;
        instance.forget_log();
        let mut kept = Kept::of(plan);
        let mut ended: Option<Rejection> = None;
        for (k, &time) in times.iter().enumerate() {
            let at = |rejection| (Some((k, time)), rejection);
            if !self.proceeds() {
                return Ok(());
            }
            self.report_time(run, time);
            if self.is_repeated() {
                // Drops messages about earlier steps, so that they do not become the reason of a later error.
                instance.forget_log();
            }
            if !plan.read_before_set && ended.is_none() {
                self.set_inputs(instance, k).map_err(at)?;
            }
            if let Err(rejection) = self.record(instance, &mut kept, time, trajectories) {
                return Err(at(ended.unwrap_or(rejection)));
            }
            self.reached = k + 1;
            if let Some(ended) = ended {
                return Err(at(ended));
            }
            if plan.read_before_set {
                self.set_inputs(instance, k).map_err(at)?;
            }
            if let Some(next) = times.get(k + 1) {
                // An FMU that needs steps of equal size may compare them, and the differences between times have rounding errors.
                let size = plan.step.unwrap_or(next - time);
                if let Err(rejection) = instance.step(time, size) {
                    let Some(end) = rejection.ended() else { return Err(at(rejection)) };
                    // Now outputs can be read, but inputs can no longer be set (section 4.2.4 of FMI 2.0).
                    if instance.get(&plan.outputs, &mut self.row).is_err() {
                        self.row.fill(f64::NAN);
                    }
                    if next - end > 1e-9 * size {
                        return Err(at(rejection));
                    }
                    ended = Some(rejection);
                }
            }
        }
        Ok(())
    }

    /// Calls the pulse if it is due. Returns whether the run continues.
    #[inline(always)]
    pub fn proceeds(&mut self) -> bool {
        if self.is_caller && self.pulse.is_due() {
            self.watch.pulse();
        }
        !self.watch.is_cancelled() && self.deadline.is_none_or(|deadline| time::Instant::now() <= deadline)
    }

    /// Reads the outputs at a communication point. Stores them in the trajectories if it is one of the stored times, and adds them to the
    /// statistics.
    #[inline(always)]
    pub fn record(
        &mut self,
        instance: &mut SystemInstance,
        kept: &mut Kept,
        time: f64,
        trajectories: &mut [f64],
    ) -> Result<(), Rejection> {
        let (plan, measures) = (self.plan, !self.plan.measures.is_empty());
        let is_kept = kept.wait == 0 && kept.index < kept.length;
        if is_kept || measures {
            instance.get(&plan.outputs, &mut self.row)?;
        }
        if is_kept {
            // Avoids `chunks`, which would calculate the number of chunks each time.
            for (output, value) in self.row.iter().enumerate() {
                trajectories[output * kept.length + kept.index] = *value;
            }
            for target in &plan.exact_outputs {
                self.exact_of_run.push(instance.get_value(*target)?);
            }
            (kept.index, kept.wait) = (kept.index + 1, plan.every.unwrap_or(1));
        }
        kept.wait = kept.wait.saturating_sub(1);
        if measures {
            self.measured.add(time, &self.row);
        }
        Ok(())
    }

    pub fn experiment(&self) -> Experiment {
        let (start_time, stop_time) = (self.plan.time[0], self.plan.time.last().copied());
        Experiment { start_time, stop_time, tolerance: self.plan.tolerance }
    }

    /// Sets start values, enters Initialization Mode, sets the first values of the inputs, and leaves Initialization Mode.
    fn start(&mut self, instance: &mut SystemInstance, run: usize) -> Result<(), Rejection> {
        let plan = self.plan;
        instance.begin(self.experiment(), &plan.start, run)?;
        self.set_values(instance, 0)?;
        instance.exit_initialization_mode()
    }

    #[inline(always)]
    fn set_inputs(&mut self, instance: &mut SystemInstance, time: usize) -> Result<(), Rejection> {
        self.set_values(instance, time)?;
        if self.derivatives.is_empty() {
            return Ok(());
        }
        let references = self.plan.derivatives.variables.references().unwrap_or_default();
        instance.sole().set_input_derivatives(references, &self.orders, self.derivatives.at(time))
    }

    #[inline(always)]
    pub fn set_values(&mut self, instance: &mut SystemInstance, time: usize) -> Result<(), Rejection> {
        for input in &self.plan.exact_inputs {
            input.set(instance, self.number, time)?;
        }
        if self.inputs.is_empty() {
            return Ok(());
        }
        instance.set(&self.plan.inputs.variables, self.inputs.at(time))
    }
}

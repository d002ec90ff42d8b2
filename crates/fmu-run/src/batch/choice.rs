//! Chooses the instance for a run: a new one, or the reset instance of an earlier run.

use super::reuse::{Choice, Origin, Used};
use super::worker::{Failure, Worker};
use crate::pool::{Change, Given, Idle};
use crate::system_instance::SystemInstance;
use fmi_abi::Interface;
use std::time::{Duration, Instant};

impl Worker<'_> {
    /// Takes an instance that an earlier batch has kept, if there is one.
    pub fn begin(&mut self) {
        if !self.may_reuse() {
            return;
        }
        if let Some(Idle { components, given, took }) = self.system.pool().take() {
            let instance = SystemInstance::of(self.system, components);
            self.reuse.used = Some(Used { instance, origin: Origin::Earlier(given), took });
        }
    }

    /// Keeps the instance for a later batch, if the system permits idle instances.
    pub fn finish(mut self) {
        let Some(Used { instance, origin, took }) = self.reuse.used.take() else { return };
        if !self.system.may_be_idle(Interface::CoSimulation) {
            return;
        }
        let given = self.given_in(origin);
        self.system.pool().put(Idle { components: instance.into_components(), given, took });
    }

    /// Keeps the instance of a complete run for the next run. `took` is the duration of the run; `None` means that instances are not
    /// kept.
    pub fn keep(&mut self, instance: SystemInstance, run: usize, took: Option<Duration>) {
        if self.may_reuse()
            && let Some(took) = took
        {
            self.reuse.used = Some(Used { instance, origin: Origin::Run(run), took });
        }
    }

    /// Chooses the instance for a run.
    pub fn choose(&mut self, run: usize) -> Choice {
        let Some(Used { instance, origin, took }) = self.reuse.used.take() else { return Choice::New };
        let is_of_this_batch = matches!(origin, Origin::Run(_));
        if !(self.reuse.is_trusted && is_of_this_batch) {
            let changes = self.given_in(origin).changes(&self.given(run));
            let trust = self.system.pool().trust();
            let all = self.plan.start.targets().map(Change::Value).chain([Change::Steps, Change::Inputs]);
            self.reuse.is_trusted = trust.proves(all);
            if !trust.proves(changes.iter().copied()) {
                let is_due = trust.is_check_due(took);
                return if is_due { Choice::Check(instance, changes) } else { Choice::New };
            }
        }
        if let Some(instance) = instance.reset() {
            return Choice::Reset(instance);
        }
        self.system.pool().trust().distrust();
        Choice::New
    }

    /// Performs a run twice, in a reset instance and then in a new one, and returns the result of the new one. If both results are
    /// bit-identical and the run is complete, this counts as a proof that the FMU can be reset after these changes. If they differ,
    /// the FMU is not reset any more.
    pub fn check(
        &mut self,
        (instance, changes): (SystemInstance, Vec<Change>),
        run: usize,
        times: &[f64],
        trajectories: &mut [f64],
        measures: &mut [f64],
    ) -> Result<Option<String>, Failure> {
        let begin = Instant::now();
        let [mut kept, mut measured] = [&trajectories, &measures].map(|values| vec![0.0; values.len()]);
        (self.reuse.is_check, self.reuse.compares, self.reuse.seen) = (true, true, None);
        let reset = instance.reset();
        let again = reset.map(|instance| self.perform(instance, run, times, &mut kept, &mut measured));
        let (seen, exact) = (self.reuse.seen.take(), self.take_exact());
        self.reuse.is_check = false;
        // Frees the instance first, because some FMUs permit only one.
        self.reuse.used = None;
        let took = begin.elapsed();
        let result = self.run_new(run, times, trajectories, measures);
        self.reuse.compares = false;
        if self.watch.is_cancelled() {
            return result;
        }
        let same = |one: &[f64], other: &[f64]| {
            one.iter().map(|x| x.to_bits()).eq(other.iter().map(|x| x.to_bits()))
        };
        let is_same = again.as_ref() == Some(&result)
            && seen == self.reuse.seen
            && self.has_exact(run, &exact)
            && same(&kept, trajectories)
            && same(&measured, measures);
        let mut trust = self.system.pool().trust();
        trust.checked(took);
        match (is_same, &self.reuse.used) {
            (false, _) => trust.distrust(),
            (true, Some(_)) => trust.prove(changes),
            // The final values could not be read and compared, or the run did not end normally.
            (true, None) if result.is_ok() => trust.distrust(),
            // An incomplete run proves nothing.
            (true, None) => {}
        }
        result
    }

    /// Creates an instance. The error contains the reason, and whether the FMU logged no message.
    pub fn create(&mut self) -> Result<SystemInstance, (String, bool)> {
        let begin = Instant::now();
        let instance = SystemInstance::new(self.system, self.plan.interface, &self.logging())?;
        if self.may_reuse() {
            self.system.pool().trust().created(begin.elapsed());
        }
        Ok(instance)
    }

    /// Returns whether runs may share an instance. With logging on, they may not, so that the messages of each run are complete. In
    /// Model Exchange they may not either, because resets are checked only in Co-Simulation.
    fn may_reuse(&self) -> bool {
        !self.is_logging() && self.plan.interface == Interface::CoSimulation
    }

    /// Returns the values that the earlier run set.
    fn given_in(&self, origin: Origin) -> Given {
        match origin {
            Origin::Earlier(given) => given,
            Origin::Run(run) => self.given(run),
        }
    }

    /// Returns the values that a run sets.
    fn given(&self, run: usize) -> Given {
        let plan = self.plan;
        let times = [plan.time.first(), plan.time.last()].map(|time| time.map_or(0, |time| time.to_bits()));
        Given {
            experiment: (times, plan.tolerance),
            numbers: plan.start.numbers(run).map(|(target, value)| (target, value.to_bits())).collect(),
            values: plan.start.values(run).map(|(target, value)| (target, value.clone())).collect(),
            inputs: (plan.set_in_steps.clone(), plan.hash_of_inputs(run)),
        }
    }
}

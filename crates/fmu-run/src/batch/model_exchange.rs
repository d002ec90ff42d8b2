//! Runs in Model Exchange.

use super::Occurrence;
use super::event_plan::EventPlan;
use super::model_exchange_plan::ModelExchangePlan;
use super::worker::{Kept, Stopped, Worker};
use crate::clocks::Ticking;
use crate::continuous::{Hooks, Model, Simulation, Solver};
use crate::system_instance::SystemInstance;
use fmi_abi::client::{Continuous, Event, Rejection};

impl<'a> Worker<'a> {
    /// Runs an instance in Model Exchange from the start values to the last time. `follow` is its counterpart in Co-Simulation.
    pub fn integrate(
        &mut self,
        model_exchange: &'a ModelExchangePlan<'a>,
        times: &[f64],
        instance: &mut SystemInstance,
        run: usize,
        trajectories: &mut [f64],
    ) -> Result<(), Stopped> {
        let plan = self.plan;
        let before = |rejection| (None, rejection);
        instance.begin(self.experiment(), &plan.start, run).map_err(before)?;
        for input in &plan.exact_inputs {
            input.set(instance, run, 0).map_err(before)?;
        }
        let ModelExchangePlan { description, moving, held, integration, rtol, reports_steps, .. } =
            model_exchange;
        let inputs = model_exchange.signals(run, plan.time);
        let retries = integration.solver != Solver::Rk4;
        let model = Model::new(instance, description, inputs, [moving, held], retries);
        model.parts().begin(times[0]).map_err(before)?;
        let of_clocks = |events: &'a EventPlan<'a>| {
            Ticking::new(&events.clocks, events.inputs(run, plan.time), plan.time)
        };
        let mut ticking = plan.events.as_deref().map(of_clocks);
        if let Some(ticking) = &mut ticking {
            ticking.begin(model.parts().instance).map_err(before)?;
        }
        model.parts().instance.exit_initialization_mode().map_err(before)?;
        model.parts().instance.forget_log();
        let sizes = [description.states, description.event_indicators];
        let mut simulation = Simulation::new(times, sizes, integration, *rtol, *reports_steps);
        let mut kept = Kept::of(plan);
        let mut observed = Observed { worker: self, times, trajectories, kept: &mut kept, run, event: None };
        let result = match &mut ticking {
            None => simulation.run(&model, &mut observed),
            Some(ticking) => simulation.run(&model, &mut Ticked { observed, ticking, has_begun: false }),
        };
        result.map_err(|rejection| {
            if let Some(end) = rejection.ended() {
                ticking.iter().for_each(|ticking| ticking.show(end, &mut self.row));
                self.end(model.parts().instance, times, (simulation.next, end), &mut kept, trajectories);
            }
            (simulation.next.checked_sub(1).map(|index| (index, simulation.time)), rejection)
        })
    }

    /// Reads the outputs at the end of a run that the FMU has ended. They belong to the results if the end is at a communication
    /// point.
    pub(super) fn end(
        &mut self,
        instance: &mut SystemInstance,
        times: &[f64],
        (next, end): (usize, f64),
        kept: &mut Kept,
        trajectories: &mut [f64],
    ) {
        let is_point = times.get(next).is_some_and(|time| *time <= end);
        let read = match is_point {
            true => self.record(instance, kept, end, trajectories),
            false => instance.get(&self.plan.outputs, &mut self.row),
        };
        match read {
            Ok(()) if is_point => self.reached = next + 1,
            Ok(()) => {}
            Err(_) => self.row.fill(f64::NAN),
        }
    }
}

/// Functions for the simulation loop: they store outputs and events, set exact inputs, and tell whether the run continues.
struct Observed<'w, 'a> {
    worker: &'w mut Worker<'a>,
    times: &'w [f64],
    trajectories: &'w mut [f64],
    kept: &'w mut Kept,
    run: usize,
    /// The current event, without the outputs after it.
    event: Option<Occurrence>,
}

impl Observed<'_, '_> {
    fn keeps_events(&self) -> bool {
        self.worker.plan.model_exchange.as_ref().is_some_and(|of| of.keeps_events)
            && !self.worker.is_repeated()
    }
}

impl Hooks for Observed<'_, '_> {
    fn record(&mut self, instance: &mut SystemInstance, index: usize) -> Result<(), Rejection> {
        let Self { worker, times, trajectories, kept, run, .. } = self;
        worker.report_time(*run, times[index]);
        worker.record(instance, kept, times[index], trajectories)?;
        worker.reached = index + 1;
        Ok(())
    }

    fn proceed(&mut self, time: f64) -> bool {
        self.worker.report_time(self.run, time);
        self.worker.proceeds()
    }

    fn event(&mut self, instance: &mut SystemInstance, time: f64, is_after: bool) -> Result<(), Rejection> {
        if !self.keeps_events() {
            return Ok(());
        }
        let outputs = &self.worker.plan.outputs;
        // Clocked outputs have been written to the worker's row.
        let mut row = self.worker.row.clone();
        instance.get(outputs, &mut row)?;
        if !is_after {
            self.event = Some(Occurrence { run: self.run, time, before: row, ..Occurrence::default() });
        } else if let Some(event) = self.event.take() {
            self.worker.events.push(Occurrence { after: row, ..event });
        }
        Ok(())
    }

    fn updated(&mut self, instance: &mut SystemInstance, x: &[f64], reported: bool) -> Result<(), Rejection> {
        let Some(event) = &mut self.event else { return Ok(()) };
        event.states_changed |= reported;
        let mut after = vec![0.0; x.len()];
        if !x.is_empty() {
            instance.sole().get_continuous(Continuous::States, &mut after)?;
        }
        let changed = (0..x.len()).filter(|state| after[*state] != x[*state]);
        event.states.extend(changed);
        Ok(())
    }

    fn changes(&self, index: usize) -> bool {
        self.worker.plan.exact_inputs.iter().any(|input| input.changes(self.run, index))
    }

    fn set_exact(&mut self, instance: &mut SystemInstance, index: usize) -> Result<(), Rejection> {
        self.worker.plan.exact_inputs.iter().try_for_each(|input| input.set(instance, self.run, index))
    }
}

/// A run in Model Exchange with clocks, which tick whenever the discrete states are updated.
struct Ticked<'t, 'w, 'a> {
    observed: Observed<'w, 'a>,
    ticking: &'t mut Ticking<'a>,
    /// Whether the initial event has begun.
    has_begun: bool,
}

impl Hooks for Ticked<'_, '_, '_> {
    fn record(&mut self, instance: &mut SystemInstance, index: usize) -> Result<(), Rejection> {
        self.ticking.show(self.observed.times[index], &mut self.observed.worker.row);
        self.observed.record(instance, index)
    }

    fn proceed(&mut self, time: f64) -> bool {
        self.observed.proceed(time)
    }

    fn event(&mut self, instance: &mut SystemInstance, time: f64, is_after: bool) -> Result<(), Rejection> {
        self.ticking.show(time, &mut self.observed.worker.row);
        self.observed.event(instance, time, is_after)
    }

    fn updated(&mut self, instance: &mut SystemInstance, x: &[f64], reported: bool) -> Result<(), Rejection> {
        self.observed.updated(instance, x, reported)
    }

    /// The initial event is only among the results if a clock ticks in it.
    fn update(&mut self, instance: &mut SystemInstance, time: f64) -> Result<Event, Rejection> {
        let is_initial = !std::mem::replace(&mut self.has_begun, true);
        let is_kept = is_initial && self.ticking.is_due(time);
        if is_kept {
            self.event(instance, time, false)?;
        }
        let event = self.ticking.update(instance, time)?;
        if let Some(occurrence) = &mut self.observed.event {
            occurrence.clocks.extend(self.ticking.names());
        }
        if is_kept {
            self.event(instance, time, true)?;
        }
        Ok(event)
    }

    fn changes(&self, index: usize) -> bool {
        self.observed.changes(index)
    }

    fn set_exact(&mut self, instance: &mut SystemInstance, index: usize) -> Result<(), Rejection> {
        self.observed.set_exact(instance, index)
    }
}

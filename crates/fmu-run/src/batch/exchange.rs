//! Runs in Model Exchange.

use super::Occurrence;
use super::integrated::Integrated;
use super::worker::{Kept, Stopped, Worker};
use crate::continuous::{Hooks, March, Model, Solver};
use crate::running::Running;
use fmi_client::Rejection;

impl<'a> Worker<'a> {
    /// Runs an instance in Model Exchange from the start values to the last time. `follow` is its counterpart in Co-Simulation.
    pub fn integrate(
        &mut self,
        integrated: &'a Integrated<'a>,
        times: &[f64],
        instance: &mut Running,
        run: usize,
        trajectories: &mut [f64],
    ) -> Result<(), Stopped> {
        let plan = self.plan;
        let before = |rejection| (None, rejection);
        instance.begin(self.experiment(), &plan.start, run).map_err(before)?;
        for input in &plan.exact_inputs {
            input.set(instance, run, 0).map_err(before)?;
        }
        let Integrated { description, moving, held, integration, rtol, reports_steps, .. } = integrated;
        let inputs = integrated.signals(run, plan.time);
        let retries = integration.solver != Solver::Rk4;
        let model = Model::new(instance, description, inputs, [moving, held], retries);
        model.parts().begin(times[0]).map_err(before)?;
        model.parts().running.exit_initialization_mode().map_err(before)?;
        model.parts().running.forget_log();
        let sizes = [description.states, description.event_indicators];
        let mut march = March::new(times, sizes, integration, *rtol, *reports_steps);
        let mut kept = Kept::default();
        let mut observed = Observed { worker: self, times, trajectories, kept: &mut kept, run, before: None };
        let result = march.run(&model, &mut observed);
        result.map_err(|rejection| {
            if let Some(end) = rejection.ended() {
                self.end(model.parts().running, times, (march.next, end), &mut kept, trajectories);
            }
            (march.next.checked_sub(1), rejection)
        })
    }

    /// Reads the outputs at the end of a run that the FMU has ended. They belong to the results if the end is at a communication
    /// point.
    fn end(
        &mut self,
        running: &mut Running,
        times: &[f64],
        (next, end): (usize, f64),
        kept: &mut Kept,
        trajectories: &mut [f64],
    ) {
        let is_point = times.get(next).is_some_and(|time| *time <= end);
        let read = match is_point {
            true => self.record(running, kept, end, trajectories),
            false => running.get(&self.plan.outputs, &mut self.row),
        };
        match read {
            Ok(()) if is_point => self.reached = next + 1,
            Ok(()) => {}
            Err(_) => self.row.fill(f64::NAN),
        }
    }
}

/// Functions for the simulation loop: they read outputs into the results of a run.
struct Observed<'w, 'a> {
    worker: &'w mut Worker<'a>,
    times: &'w [f64],
    trajectories: &'w mut [f64],
    kept: &'w mut Kept,
    run: usize,
    /// Outputs before an event.
    before: Option<Vec<f64>>,
}

impl Hooks for Observed<'_, '_> {
    fn record(&mut self, running: &mut Running, index: usize) -> Result<(), Rejection> {
        let Self { worker, times, trajectories, kept, run, .. } = self;
        worker.report_time(*run, times[index]);
        worker.record(running, kept, times[index], trajectories)?;
        worker.reached = index + 1;
        Ok(())
    }

    fn proceed(&mut self, time: f64) -> bool {
        self.worker.report_time(self.run, time);
        self.worker.proceeds()
    }

    fn event(&mut self, running: &mut Running, time: f64, is_after: bool) -> Result<(), Rejection> {
        let plan = self.worker.plan;
        if plan.integrated.as_ref().is_none_or(|of| !of.keeps_events) || self.worker.is_repeated() {
            return Ok(());
        }
        let mut row = vec![0.0; plan.outputs.len()];
        running.get(&plan.outputs, &mut row)?;
        if !is_after {
            self.before = Some(row);
        } else if let Some(before) = self.before.take() {
            self.worker.events.push(Occurrence { run: self.run, time, before, after: row });
        }
        Ok(())
    }

    fn changes(&self, index: usize) -> bool {
        self.worker.plan.exact_inputs.iter().any(|input| input.changes(self.run, index))
    }

    fn set_exact(&mut self, running: &mut Running, index: usize) -> Result<(), Rejection> {
        self.worker.plan.exact_inputs.iter().try_for_each(|input| input.set(running, self.run, index))
    }
}

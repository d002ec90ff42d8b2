//! Runs in Co-Simulation with event mode (section 4.2.1 of FMI 3.0).

use super::Occurrence;
use super::event_plan::EventPlan;
use super::input_rows::InputRows;
use super::worker::{Kept, Stopped, Worker};
use crate::clocks::Ticking;
use crate::continuous::{Chatter, MOST_EVENTS};
use crate::system_instance::SystemInstance;
use fmi_abi::client::Rejection;
use fmi_abi::{Status, shown_number};

/// State of a run in Co-Simulation with event mode.
struct Progress<'a> {
    ticking: Ticking<'a>,
    plan: &'a EventPlan<'a>,
    held: InputRows<'a>,
    /// Values of the inputs that are not continuous, as they were set last.
    set: Vec<f64>,
    /// Time that has been reached, s.
    time: f64,
    /// Time of the next event, s.
    next: Option<f64>,
    chatter: Chatter,
    run: usize,
    /// The current event, without the outputs after it.
    event: Option<Occurrence>,
}

impl<'a> Worker<'a> {
    /// Runs an instance in Co-Simulation with event mode, from the start values to the last time. Steps end at events, and inputs that are
    /// not continuous change in Event Mode.
    pub fn follow_events(
        &mut self,
        plan: &'a EventPlan<'a>,
        times: &[f64],
        instance: &mut SystemInstance,
        run: usize,
        trajectories: &mut [f64],
    ) -> Result<(), Stopped> {
        let points = self.plan.time;
        let mut progress = Progress {
            ticking: Ticking::new(&plan.clocks, plan.inputs(run, points), points),
            plan,
            held: InputRows::new(&plan.held),
            set: Vec::new(),
            time: points[0],
            next: None,
            chatter: Chatter::since(points[0]),
            run,
            event: None,
        };
        progress.held.begin(&plan.held, run);
        self.start_events(instance, &mut progress).map_err(|rejection| (None, rejection))?;
        let mut kept = Kept::of(self.plan);
        for (k, &time) in times.iter().enumerate() {
            if !self.proceeds() {
                return Ok(());
            }
            self.report_time(run, time);
            if self.is_repeated() {
                instance.forget_log();
            }
            let stopped = |rejection| (Some((k, time)), rejection);
            self.arrive(instance, &mut progress, k).map_err(stopped)?;
            progress.ticking.show(time, &mut self.row);
            self.record(instance, &mut kept, time, trajectories).map_err(stopped)?;
            self.reached = k + 1;
            let Some(target) = times.get(k + 1) else { break };
            self.advance(instance, &mut progress, [time, *target]).map_err(|rejection| {
                if let Some(end) = rejection.ended() {
                    let end = progress.ticking.near_point(end);
                    progress.ticking.show(end, &mut self.row);
                    self.end(instance, times, (k + 1, end), &mut kept, trajectories);
                }
                stopped(rejection)
            })?;
        }
        Ok(())
    }

    /// Sets start values and the first values of the inputs, and handles the initial event.
    fn start_events(
        &mut self,
        instance: &mut SystemInstance,
        progress: &mut Progress<'a>,
    ) -> Result<(), Rejection> {
        instance.begin(self.experiment(), &self.plan.start, progress.run)?;
        self.set_all(instance, progress, 0)?;
        progress.ticking.begin(instance)?;
        instance.exit_initialization_mode()?;
        instance.forget_log();
        // Otherwise the initial event is not among the results.
        if progress.ticking.is_due(progress.time) {
            self.note_event(instance, progress)?;
        }
        self.in_event_mode(instance, progress)
    }

    /// Sets the inputs at a communication point, and handles the events there.
    fn arrive(
        &mut self,
        instance: &mut SystemInstance,
        progress: &mut Progress<'a>,
        index: usize,
    ) -> Result<(), Rejection> {
        if index == 0 {
            return self.handle_due(instance, progress);
        }
        let changes = *progress.held.at(index) != *progress.set
            || self.plan.exact_inputs.iter().any(|input| input.changes(progress.run, index));
        if changes || progress.is_due() {
            self.enter_event_mode(instance, progress)?;
            self.set_all(instance, progress, index)?;
            self.in_event_mode(instance, progress)?;
        } else if !self.plan.inputs.variables.is_empty() {
            instance.set(&self.plan.inputs.variables, self.inputs.at(index))?;
        }
        self.handle_due(instance, progress)
    }

    /// Sets all inputs to their values at a communication point.
    fn set_all(
        &mut self,
        instance: &mut SystemInstance,
        progress: &mut Progress<'a>,
        index: usize,
    ) -> Result<(), Rejection> {
        self.set_values(instance, index)?;
        progress.set.clear();
        progress.set.extend_from_slice(progress.held.at(index));
        match progress.set.is_empty() {
            true => Ok(()),
            false => instance.set(&progress.plan.held.variables, &progress.set),
        }
    }

    /// Performs steps from one communication point to the next, and handles the events before it.
    fn advance(
        &mut self,
        instance: &mut SystemInstance,
        progress: &mut Progress<'a>,
        [point, target]: [f64; 2],
    ) -> Result<(), Rejection> {
        while progress.time < target {
            let (begin, stop) = (progress.time, progress.next.map_or(target, |next| next.min(target)));
            let size = match self.plan.step {
                Some(size) if [begin, stop] == [point, target] => size,
                Some(_) if stop < target => return Err(progress.uneven(stop)),
                _ => stop - begin,
            };
            let stepped = instance.sole().step_to_event(begin, size)?;
            // Only an FMU that returns early has not reached the end of the step, because others may return it with a rounding error.
            progress.time = if stepped.early { progress.ticking.near_point(stepped.time) } else { stop };
            if !(begin..=stop).contains(&progress.time) {
                return Err(
                    progress.error(&format!("the FMU returned early, at {} s", shown_number(stepped.time)))
                );
            }
            if stepped.event {
                progress.next = Some(progress.time);
            }
            if progress.time == begin {
                progress.count()?;
            }
            if progress.time < target {
                self.handle_due(instance, progress)?;
            }
            if !self.proceeds() {
                return Ok(());
            }
        }
        Ok(())
    }

    /// Handles the events that are due, each of which may announce another one for the same time.
    fn handle_due(
        &mut self,
        instance: &mut SystemInstance,
        progress: &mut Progress<'a>,
    ) -> Result<(), Rejection> {
        while progress.is_due() {
            self.enter_event_mode(instance, progress)?;
            self.in_event_mode(instance, progress)?;
        }
        Ok(())
    }

    fn enter_event_mode(
        &mut self,
        instance: &mut SystemInstance,
        progress: &mut Progress<'a>,
    ) -> Result<(), Rejection> {
        progress.count()?;
        self.note_event(instance, progress)?;
        instance.sole().enter_event_mode()
    }

    /// Begins an event that is among the results, with the outputs before it.
    fn note_event(
        &mut self,
        instance: &mut SystemInstance,
        progress: &mut Progress<'a>,
    ) -> Result<(), Rejection> {
        if progress.plan.keeps_events && !self.is_repeated() {
            let before = self.outputs_at(instance, progress)?;
            let event =
                Occurrence { run: progress.run, time: progress.time, before, ..Occurrence::default() };
            progress.event = Some(event);
        }
        Ok(())
    }

    /// Completes an event, and enters Step Mode.
    fn in_event_mode(
        &mut self,
        instance: &mut SystemInstance,
        progress: &mut Progress<'a>,
    ) -> Result<(), Rejection> {
        let event = progress.ticking.update(instance, progress.time)?;
        if event.terminate {
            let rejection = instance.sole().rejection("Co-Simulation", Status::Discard, Vec::new());
            return Err(rejection.at_end(progress.time));
        }
        if event.next.is_some_and(f64::is_nan) {
            return Err(progress.error("the time of the next event is NaN"));
        }
        progress.next = event.next.map(|next| progress.ticking.near_point(next));
        instance.sole().enter_step_mode()?;
        if let Some(event) = progress.event.take() {
            let (after, clocks) = (self.outputs_at(instance, progress)?, progress.ticking.names().collect());
            self.events.push(Occurrence { after, clocks, ..event });
        }
        Ok(())
    }

    /// Reads the outputs at the time that has been reached.
    fn outputs_at(
        &mut self,
        instance: &mut SystemInstance,
        progress: &Progress<'a>,
    ) -> Result<Vec<f64>, Rejection> {
        let mut row = vec![0.0; self.plan.outputs.len()];
        progress.ticking.show(progress.time, &mut row);
        instance.get(&self.plan.outputs, &mut row)?;
        Ok(row)
    }
}

impl Progress<'_> {
    fn is_due(&self) -> bool {
        self.next.is_some_and(|next| next <= self.time)
    }

    /// Counts an event, or a step that does not advance. Fails if there are too many.
    fn count(&mut self) -> Result<(), Rejection> {
        let points = self.ticking.points();
        let (first, last) = (points[0], points[points.len() - 1]);
        match self.chatter.count(self.time, (last - first).max(first.abs()).max(last.abs())) {
            None => Ok(()),
            Some(since) => {
                let [since, now] = [since, self.time].map(shown_number);
                Err(self.error(&format!(
                    "events without end: {MOST_EVENTS} events from t = {since} s to t = {now} s"
                )))
            }
        }
    }

    /// Returns the error for an event before the end of a step, of which all must be equal.
    fn uneven(&self, event: f64) -> Rejection {
        self.error(&format!(
            "the next event is at t = {} s, between two communication points, but the FMU needs steps of equal size \
            (canHandleVariableCommunicationStepSize is not true); add communication points with equal distances, one of which is this time",
            shown_number(event)
        ))
    }

    fn error(&self, why: &str) -> Rejection {
        Rejection::without_fmu("Co-Simulation", why)
    }
}

//! Integrates smooth intervals with the solver.

use super::Solver;
use super::model::Model;
use super::simulation::{Arrival, Hooks, Settings, Simulation};
use super::stepping::{Stepping, equal_steps};
use fmi_abi::client::Rejection;
use fmi_abi::shown_number;
use ivp::methods::{BDF, DOP853, DOPRI5, IntegrationResult, RK4, Tolerance};
use ivp::status::Status;

impl Simulation<'_> {
    /// Integrates to the time `stop`, s, or to an event before it.
    pub(super) fn integrate(
        &mut self,
        model: &Model,
        hooks: &mut impl Hooks,
        stop: f64,
    ) -> Result<Arrival, Rejection> {
        /// Rounding error of times, relative to the magnitude of the times of the run.
        const ROUNDING: f64 = 1e-14;
        /// Smallest first step after an event, relative to the magnitude of the times of the run.
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
            // If the interval had only one step, this step may have been shortened to end at `stop`, so the next interval may begin
            // with the size that was suggested before.
            let cut = result.steps.total <= 1;
            let uncut = begin.1.filter(|_| cut).map_or(result.h, |step| step.max(result.h));
            if reached && arrival.is_none_or(|of| of == Arrival::Stop) {
                self.step = Some(uncut);
                self.time = stop;
                return Ok(Arrival::Stop);
            }
            // At an event a state is often almost 0, and the solver's own estimate of the first step is then far too small.
            let small = Some((0.01 * self.taken).max(SMALL * self.scale()));
            if let Some(arrival) = arrival {
                (self.step, self.smooth) = (small, Some(uncut).filter(|step| *step > 0.0));
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

    /// Calls the solver once. Returns why the interval ended, if it did, and the result of the solver.
    fn solve(
        &mut self,
        model: &Model,
        hooks: &mut impl Hooks,
        stop: f64,
    ) -> Result<(Option<Arrival>, IntegrationResult), Rejection> {
        /// Maximum number of steps in one call of the solver.
        const STEPS: usize = 100_000;
        /// Number of steps between two tests for stiffness.
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
                let steps = equal_steps(stop - time, max_step);
                RK4 { max_steps: usize::MAX, dense_output }.solve(
                    model,
                    time,
                    &x,
                    stop,
                    (stop - time) / steps as f64,
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
    Rejection::without_fmu("Model Exchange", &format!("{why} at t = {} s", shown_number(time)))
}

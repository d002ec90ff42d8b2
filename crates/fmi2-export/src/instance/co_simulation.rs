//! Co-Simulation (section 4.2).

use super::Instance;
use crate::logger::Sink;
use crate::model::Model;
use crate::refusal::{Outcome, Refusal, refuse_with};
use crate::types::{Status, StatusKind};

impl<M: Model, S: Sink> Instance<M, S> {
    #[inline]
    pub fn do_step(&mut self, point: f64, step_size: f64) -> Outcome {
        let end = point + step_size;
        if !(point.is_finite() && step_size > 0.0 && end.is_finite()) {
            return refuse_with(move || {
                format!(
                    "the communication point must be finite and the step size finite and > 0, they are {point} and {step_size}"
                )
            });
        }
        if end <= point {
            return refuse_with(move || {
                format!("the step size {step_size} vanishes beside the communication point {point}")
            });
        }
        let rounding = rounding(point, step_size);
        if (point - self.state.time).abs() > rounding {
            return refuse_with(move || {
                format!(
                    "the communication point is {point}, but the last step ended at {}; go on from there or set a saved state",
                    self.state.time
                )
            });
        }
        if let Some(stop_time) = self.state.stop_time
            && end > stop_time + rounding + STOP_TIME_ROUNDING * (stop_time - self.state.start_time)
        {
            return refuse_with(move || {
                format!("the step would end at {end}, after the stop time {stop_time}")
            });
        }
        self.state.model.do_step(point, step_size)?;
        self.state.time = end;
        Ok(())
    }

    /// `fmi2GetStatus`: only asynchronous steps have one.
    pub fn no_status(&self, kind: StatusKind) -> Outcome {
        let message = match kind {
            StatusKind::DoStepStatus | StatusKind::PendingStatus => {
                "no step is pending: fmi2DoStep works synchronously"
            }
            StatusKind::LastSuccessfulTime => "fmi2LastSuccessfulTime is a Real: ask fmi2GetRealStatus",
            StatusKind::Terminated => "fmi2Terminated is a Boolean: ask fmi2GetBooleanStatus",
        };
        Err(Box::new(Refusal { status: Status::Discard, message: message.to_owned() }))
    }

    pub fn last_successful_time(&self) -> f64 {
        self.state.time
    }
}

/// How far the last step may end after the stop time, of the whole simulated time: masters that count in
/// nanoseconds round a step of 1/60 s up, every time.
const STOP_TIME_ROUNDING: f64 = 1e-7;

/// How far a communication point may be off: masters count in nanoseconds, add up step sizes or
/// multiply them, and lose the last digits each in their own way.
#[inline]
fn rounding(point: f64, step_size: f64) -> f64 {
    (0.01 * step_size).min(1e-9) + 8.0 * f64::EPSILON * point.abs()
}

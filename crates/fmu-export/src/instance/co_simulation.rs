//! Co-Simulation (section 4.2).

use super::refusal::discard;
use super::{Instance, Outcome, refuse, refuse_with};
use crate::capabilities::{Step, Stepped};
use crate::export::Exported;
use crate::mode::Mode;

impl<M: Exported> Instance<M> {
    #[inline]
    pub fn do_step(&mut self, point: f64, step_size: f64) -> Outcome {
        let end = point + step_size;
        // False for what is no number, too.
        if !(point > f64::NEG_INFINITY && end > point && end < f64::INFINITY) {
            return refuse_step(point, step_size);
        }
        let rounding = rounding(point, step_size);
        if (point - self.state.time).abs() > rounding {
            let time = self.state.time;
            return refuse_with(move || {
                format!(
                    "the communication point is {point}, but the last step ended at {time}; go on from there or set a saved state"
                )
            });
        }
        if let Some(stop_time) = self.state.experiment.stop_time
            && end
                > stop_time + rounding + STOP_TIME_ROUNDING * (stop_time - self.state.experiment.start_time)
        {
            return refuse_with(move || {
                format!("the step would end at {end}, after the stop time {stop_time}")
            });
        }
        match self.state.model.exported_step(Step { time: point, size: step_size })? {
            Stepped::Done => {
                self.state.time = end;
                self.state.stale = true;
                Ok(())
            }
            early => self.ended_early(early, point, end),
        }
    }

    #[cold]
    fn ended_early(&mut self, stepped: Stepped, point: f64, end: f64) -> Outcome {
        let (time, terminate) = match stepped {
            Stepped::Done => (end, false),
            Stepped::Early(time) => (time, false),
            Stepped::Terminate(time) => (time, true),
        };
        self.state.time = if time >= point && time <= end { time } else { end };
        self.state.stale = true;
        self.state.ended = terminate;
        self.enter(Mode::StepFailed);
        let time = self.state.time;
        discard(if terminate {
            format!("the model ends the simulation at {time}")
        } else {
            format!("the step to {end} ended early, at {time}; set a saved state or terminate")
        })
    }

    pub fn last_successful_time(&self) -> f64 {
        self.state.time
    }

    /// Whether the model wants the simulation to end.
    pub fn has_ended(&self) -> bool {
        self.state.ended
    }
}

#[cold]
#[inline(never)]
fn refuse_step(point: f64, step_size: f64) -> Outcome {
    if point.is_finite() && step_size > 0.0 && step_size.is_finite() && (point + step_size).is_finite() {
        return refuse(format!("the step size {step_size} vanishes beside the communication point {point}"));
    }
    refuse(format!(
        "the communication point must be finite and the step size finite and > 0, they are {point} and {step_size}"
    ))
}

/// A question that only asynchronous steps answer, or that another function does.
#[cold]
pub(crate) fn no_status(message: &str) -> Outcome {
    discard(message)
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

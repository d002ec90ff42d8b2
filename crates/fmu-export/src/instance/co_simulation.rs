//! Co-Simulation (section 4.2 of both FMI versions).

use super::{Importer, Instance, Outcome, Rejection, discard, reject, reject_with};
use crate::capabilities::{Event, Events, Step, Stepped};
use crate::export::Exported;
use crate::model::Error;
use fmi_abi::Mode;
use fmi_abi::Standard;
use fmi_abi::Status;

/// Result of a step in FMI 3.0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reached {
    /// Whether the importer must handle an event before the next step.
    pub event: bool,
    pub terminate: bool,
    pub early: bool,
    pub time: f64,
}

/// Maximum number of events per step, and of iterations per event. A model that needs more is taken to be in an
/// endless loop.
pub(super) const MOST_EVENTS: u32 = 10_000;

/// Advice in the message about too many events.
pub(super) const CHATTER: &str = "make shorter steps, or give the events hysteresis if the model chatters";

impl<M: Exported> Instance<M> {
    /// Whether steps may end early. It is a constant, so that models whose steps never end early have no overhead.
    pub(super) const ENDS_EARLY: bool = match M::CO_SIMULATION {
        Some(offer) => offer.ends_early,
        None => false,
    };

    /// Whether a failed step leaves the model unchanged. It is a constant, so that models with such steps have no
    /// overhead.
    const IS_ATOMIC: bool = match M::CO_SIMULATION {
        Some(offer) => offer.atomic_step,
        None => true,
    };

    /// Returns whether a step may fail after it has changed the model, so that it has to be undone. The model itself
    /// may fail, or an event that this crate handles within the step. In FMI 3.0, a step may also end early for an
    /// importer that does not accept this.
    pub(super) fn needs_undo(importer: Importer) -> bool {
        let handles_events = M::CO_SIMULATION.is_some_and(|offer| offer.events == Events::Stop);
        !Self::IS_ATOMIC
            || match importer.standard {
                Standard::Fmi2 => handles_events,
                Standard::Fmi3 => Self::ENDS_EARLY && !(importer.event_mode && importer.early_return),
            }
    }

    /// Performs a step of an importer of FMI 2.0 (section 4.2.2 of FMI 2.0).
    #[inline]
    pub fn do_step(&mut self, point: f64, step_size: f64) -> Outcome {
        match self.step(point, step_size)? {
            Stepped::Done | Stepped::Calculated => Ok(()),
            early => self.ended_early(early, point + step_size),
        }
    }

    /// Performs a step of an importer of FMI 3.0 (section 4.2.1 of FMI 3.0). If it returns another status than OK, it
    /// has changed nothing.
    #[inline]
    pub fn do_step_to(&mut self, point: f64, step_size: f64) -> Outcome<Reached> {
        let stepped = self.step(point, step_size)?;
        let (time, end) = (self.state.time, point + step_size);
        let early = time < end;
        match stepped {
            Stepped::Early(_) if early && !self.importer.early_return => {
                let why = "the model stops there, but earlyReturnAllowed is false";
                return self.go_back(discard(format!("the step to {end} ends early, at {time}: {why}")));
            }
            Stepped::Terminate(_) => {
                self.state.ended = true;
                self.logger.log(Status::Ok, format!("the model ends the simulation at {time}"));
            }
            _ => {}
        }
        Ok(Reached {
            event: matches!(stepped, Stepped::Event(_)),
            terminate: matches!(stepped, Stepped::Terminate(_)),
            early: early && self.importer.early_return,
            time,
        })
    }

    /// Restores the state at the start of a failed step and returns `why`: an error, or a discard if a shorter step may
    /// help. Section 4.2.1 of FMI 3.0 requires that a discarded step leaves the state as it was before the step, and
    /// FMI 2.0 does not specify the state (section 2.1.3). This crate applies the same rule to both versions, and also
    /// to errors.
    #[cold]
    fn go_back<T>(&mut self, why: Outcome<T>) -> Outcome<T> {
        self.listen();
        if let Some([before]) = self.rollback.as_deref() {
            self.state.undo(before);
        }
        why
    }

    /// Performs a step with the model's `step_fast`, if the step begins where the last one ended and needs no further
    /// checks. Returns false, and changes nothing, if the step must take the general path.
    #[inline(always)]
    pub fn step_fast(&mut self, point: f64, step_size: f64) -> bool {
        let end = point + step_size;
        let done = self.is_usual(point, end) && self.state.model.exported_step_fast(step_size);
        self.finish_usual(done, end)
    }

    /// Does the same with the model's `step_any_size`; see [`step_fast`](Self::step_fast).
    #[inline(always)]
    pub fn step_any_size(&mut self, point: f64, step_size: f64) -> bool {
        let end = point + step_size;
        let done = self.is_usual(point, end) && self.state.model.exported_step_any_size(step_size);
        self.finish_usual(done, end)
    }

    /// Returns whether a step begins where the last one ended and needs no further checks.
    #[inline(always)]
    fn is_usual(&self, point: f64, end: f64) -> bool {
        !Self::ENDS_EARLY
            && self.state.started
            && point == self.state.time
            && end > point
            && end <= self.state.experiment.stop_time.unwrap_or(f64::MAX)
    }

    #[inline(always)]
    fn finish_usual(&mut self, done: bool, end: f64) -> bool {
        if done {
            self.state.stale = false;
            self.state.time = end;
        }
        done
    }

    pub(super) fn step(&mut self, point: f64, step_size: f64) -> Outcome<Stepped> {
        let end = point + step_size;
        // These conditions are also false for NaN, so it is rejected.
        if !(point > f64::NEG_INFINITY && (end > point || step_size == 0.0) && end < f64::INFINITY) {
            return reject_step(point, step_size);
        }
        let rounding = rounding(point, step_size);
        if (point - self.state.time).abs() > rounding {
            let time = self.state.time;
            return reject_with(move || {
                format!(
                    "the communication point is {point}, but the last step ended at {time}: continue from there, or restore a saved state"
                )
            });
        }
        if let Some(stop_time) = self.state.experiment.stop_time
            && end
                > stop_time + rounding + STOP_TIME_ROUNDING * (stop_time - self.state.experiment.start_time)
        {
            return reject_with(move || {
                format!("the step would end at {end}, after the stop time {stop_time}")
            });
        }
        if Self::ENDS_EARLY {
            // The model has requested the end of the simulation, but the importer has not received the request or
            // ignores it.
            if self.state.ended {
                self.state.time = point;
                return Ok(Stepped::Terminate(point));
            }
        }
        if step_size == 0.0 {
            return Ok(self.stay(point));
        }
        if (Self::ENDS_EARLY || !Self::IS_ATOMIC)
            && let Some([before]) = self.rollback.as_deref_mut()
        {
            before.back_up(&self.state);
        }
        let stepped = match self.exported_step(point, step_size) {
            Ok(stepped) => stepped,
            Err(error) => return self.go_back(Err(error.into())),
        };
        self.state.stale = stepped != Stepped::Calculated;
        self.state.started = true;
        if let Stepped::Done | Stepped::Calculated = stepped {
            self.state.time = end;
            return Ok(stepped);
        }
        self.through_events(stepped, point, end)
    }

    /// Accepts a step of size 0, which some importers make before the first step, although the size must be above 0. The
    /// model is not called, so it does not notice the step.
    #[cold]
    fn stay(&mut self, point: f64) -> Stepped {
        self.state.time = point;
        self.logger.log(Status::Ok, format!("a step of size 0 at {point} changes nothing"));
        Stepped::Done
    }

    #[inline]
    fn exported_step(&mut self, time: f64, size: f64) -> Result<Stepped, Error> {
        let stops = M::CO_SIMULATION.is_some_and(|offer| offer.events == Events::Stop);
        let stop_at_events = stops || self.importer.event_mode;
        self.state.model.exported_step(Step { time, size, stop_at_events })
    }

    /// Completes a step that stopped before its end or at an event. Handles the events that the importer does not
    /// handle itself, and performs the rest of the step after each of them.
    #[cold]
    fn through_events(&mut self, mut stepped: Stepped, point: f64, end: f64) -> Outcome<Stepped> {
        self.state.time = point;
        let mut events = 0;
        loop {
            let (Stepped::Early(time) | Stepped::Terminate(time) | Stepped::Event(time)) = stepped else {
                self.state.time = end;
                return Ok(stepped);
            };
            self.state.time = if time >= self.state.time && time <= end { time } else { end };
            self.state.stale = true;
            let time = self.state.time;
            let Stepped::Event(_) = stepped else { return Ok(stepped) };
            if self.importer.event_mode && (time == end || self.importer.early_return) {
                return Ok(stepped);
            }
            let handled = if events < MOST_EVENTS {
                self.handle_event()
            } else {
                discard(format!("it has more than {MOST_EVENTS} events; {CHATTER}"))
            };
            events += 1;
            let next = handled.and_then(|_| match () {
                () if self.state.ended => Ok(Stepped::Terminate(time)),
                () if time == end => Ok(Stepped::Done),
                () => Ok(self.exported_step(time, end - time)?),
            });
            stepped = match next {
                Ok(stepped) => stepped,
                Err(rejection) => return self.fail_step(time, *rejection),
            };
            self.state.stale = true;
        }
    }

    /// Ends a step that failed at `time`, after its first part. The step is undone, unless it failed because of too
    /// many events in FMI 2.0: then it ends early at `time`.
    fn fail_step(&mut self, time: f64, mut why: Rejection) -> Outcome<Stepped> {
        why.message = format!("the step cannot go on at {time}: {}", why.message);
        if self.standard() == Standard::Fmi2 && why.status == Status::Discard {
            self.logger.log(Status::Warning, why.message);
            return Ok(Stepped::Early(time));
        }
        self.go_back(Err(Box::new(why)))
    }

    /// Performs the event iteration for an importer that does not handle events, and returns the last result.
    pub fn handle_event(&mut self) -> Outcome<Event> {
        let time = self.state.time;
        let (event, ended) = self.try_change(|model| {
            let mut ended = false;
            for _ in 0..MOST_EVENTS {
                model.calculate(time);
                let event = model.exported_event(time)?;
                ended |= event.terminate;
                if !event.again {
                    return Ok((event, ended));
                }
            }
            reject(format!("the event at {time} does not come to an end in {MOST_EVENTS} rounds"))
        })?;
        self.state.ended |= ended;
        Ok(event)
    }

    #[cold]
    fn ended_early(&mut self, stepped: Stepped, end: f64) -> Outcome {
        let time = self.state.time;
        self.enter(Mode::StepFailed);
        if let Stepped::Terminate(_) = stepped {
            self.state.ended = true;
            return discard(format!("the model ends the simulation at {time}"));
        }
        discard(format!("the step to {end} ended early, at {time}; set a saved state or terminate"))
    }

    pub fn enter_step_mode(&mut self) {
        self.enter(Mode::StepComplete);
    }

    #[inline]
    pub fn last_successful_time(&self) -> f64 {
        self.state.time
    }

    /// Returns whether the model has requested the end of the simulation.
    pub fn has_ended(&self) -> bool {
        self.state.ended
    }
}

#[cold]
#[inline(never)]
fn reject_step<T>(point: f64, step_size: f64) -> Outcome<T> {
    if point.is_finite() && step_size > 0.0 && step_size.is_finite() && (point + step_size).is_finite() {
        return reject(format!(
            "the step size {step_size} is too small to change the communication point {point}"
        ));
    }
    reject(format!(
        "the communication point must be finite and the step size finite and > 0, they are {point} and {step_size}"
    ))
}

/// Tolerance by which the last step may end after the stop time, relative to the simulated time. It exists because
/// importers that count in nanoseconds round the size of each step, for example of 1/60 s, so their steps can add up to
/// more than the stop time.
const STOP_TIME_ROUNDING: f64 = 1e-7;

/// Returns the tolerance for a communication point. Importers count in nanoseconds, add up step sizes or multiply
/// them, and each way has different rounding errors.
#[inline]
fn rounding(point: f64, step_size: f64) -> f64 {
    (0.01 * step_size).min(1e-9) + 8.0 * f64::EPSILON * point.abs()
}

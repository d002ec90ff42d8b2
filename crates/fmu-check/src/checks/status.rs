//! Checks `fmi2GetStatus` and the similar functions by which an importer requests the status of Co-Simulation (section 4.2.3 of FMI 2.0.5).
//! Values that these functions return with OK must be right. An FMU may reject a request.

use crate::call_sequence::{Arg, Kind, Run, Values};
use crate::checker::Checker;
use crate::finding::status_name;
use crate::worker::FILL;
use crate::writer::{Trajectory, Writer};

/// Values of `fmi2StatusKind`.
const DO_STEP: i64 = 0;
const PENDING: i64 = 1;
const LAST_TIME: i64 = 2;
const TERMINATED: i64 = 3;

/// Step, and the calls that request the status after it.
struct StepStatus {
    /// Time at which the step begins.
    begin: f64,
    /// Time at which the step ends.
    end: f64,
    /// Number of the step.
    step: u32,
    /// Number of the request for `fmi2LastSuccessfulTime`.
    time: u32,
    /// Number of the request for `fmi2Terminated`.
    terminated: u32,
    /// Number of the request for `fmi2DoStepStatus`.
    done: u32,
    /// Numbers of requests for an integer and a string, for which it is only checked that a value was written.
    others: [u32; 2],
}

/// Writes a request for a value of `fmi2StatusKind`.
fn request(writer: &mut Writer, function: &str, kind: i64, of: Kind) -> u32 {
    writer.call(0, function, vec![Arg::Integer(kind), Arg::Out(of, 1)])
}

/// Writes all requests after a step.
fn request_all(writer: &mut Writer, begin: f64, size: f64, step: u32) -> StepStatus {
    StepStatus {
        begin,
        end: begin + size,
        step,
        time: request(writer, "GetRealStatus", LAST_TIME, Kind::F64),
        terminated: request(writer, "GetBooleanStatus", TERMINATED, Kind::I32),
        done: request(writer, "GetStatus", DO_STEP, Kind::I32),
        others: [
            request(writer, "GetIntegerStatus", LAST_TIME, Kind::I32),
            request(writer, "GetStringStatus", PENDING, Kind::Pointer),
        ],
    }
}

/// Returns the number that a request returned with OK.
fn number_if_ok(run: &Run, id: u32) -> Option<f64> {
    run.written(id).filter(|_| run.status(id) == Some(0))?.numbers().first().copied()
}

/// Checks the status after every step, and after one step more, in which the model may end its simulation.
pub fn status(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let Some(last) = trajectory.points.last().filter(|_| !checker.fmi3()) else { return Ok(()) };
    let mut writer = checker.writer(trajectory);
    writer.begin(0);
    let mut all = Vec::new();
    for point in &trajectory.points {
        if let Some(step) = writer.point(0, point).last() {
            all.push(request_all(&mut writer, point.time, point.size, *step));
        }
    }
    let step = writer.step(0, trajectory.end, last.size);
    all.push(request_all(&mut writer, trajectory.end, last.size, step));
    checker.check("results.status", writer.sequence, move |run| {
        let unwritten = all.iter().find_map(|one| unwritten(run, one));
        unwritten
            .or_else(|| all.iter().enumerate().find_map(|(index, one)| wrong(run, one, &all[index + 1..])))
    })
}

/// Describes a request that returned OK but wrote no value.
fn unwritten(run: &Run, step_status: &StepStatus) -> Option<String> {
    let functions = ["fmi2GetRealStatus", "fmi2GetBooleanStatus", "fmi2GetStatus", "fmi2GetIntegerStatus"];
    let ids = [step_status.time, step_status.terminated, step_status.done, step_status.others[0]];
    let numbers = functions.into_iter().zip(ids).find_map(|(name, id)| {
        let Values::Numbers(kind, bits) = run.written(id).filter(|_| run.status(id) == Some(0))? else {
            return None;
        };
        let untouched = u64::from_ne_bytes([FILL; 8]) >> (64 - 8 * kind.size());
        (bits.first() == Some(&untouched)).then_some(name)
    });
    let string = || {
        let id = step_status.others[1];
        let written = run.written(id).filter(|_| run.status(id) == Some(0))?;
        (*written == Values::Strings(vec![None])).then_some("fmi2GetStringStatus")
    };
    Some(format!("{} returns OK and no value", numbers.or_else(string)?))
}

/// Describes a wrong status after a step that returned OK or Discard.
fn wrong(run: &Run, step_status: &StepStatus, later: &[StepStatus]) -> Option<String> {
    let status = run.status(step_status.step)?;
    let StepStatus { begin, end, .. } = *step_status;
    // The time may be rounded, and the steps of a solver may not end exactly at the end of the communication step.
    let tolerance = 1e-2 * (end - begin) + 1e-9 * end.abs();
    if let Some(time) = number_if_ok(run, step_status.time) {
        let is_wrong = match status {
            0 => (time - end).abs() > tolerance,
            2 => !(begin - tolerance..=end + tolerance).contains(&time),
            _ => false,
        };
        let name = status_name(status);
        let of_step = format!("a step from {begin:?} to {end:?} that returned {name}");
        if is_wrong {
            return Some(format!("fmi2LastSuccessfulTime is {time:?} after {of_step}"));
        }
    }
    if status != 0 {
        return None;
    }
    let done = number_if_ok(run, step_status.done).filter(|done| *done != 0.0);
    if let Some(done) = done {
        let name = status_name(done as i32);
        return Some(format!("fmi2DoStepStatus is {name} after a step that returned OK"));
    }
    let terminated = number_if_ok(run, step_status.terminated)?;
    if terminated != 0.0 && terminated != 1.0 {
        return Some(format!("fmi2Terminated is {terminated}, which is not a Boolean"));
    }
    // After a model has ended its simulation, steps must not succeed.
    let continues = later.iter().any(|later| run.status(later.step) == Some(0));
    (terminated == 1.0 && continues)
        .then(|| format!("fmi2Terminated is true after the step to {end:?}, and the next steps succeed"))
}

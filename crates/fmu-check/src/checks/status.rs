//! Checks the status that Co-Simulation of FMI 2.0 returns on request (section 4.2.3): values that are returned with OK are right. A
//! status that the FMU does not have is rejected, which is not a finding.

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

/// Requests for the status after a step.
struct Asked {
    /// Times at which the step begins and ends.
    begin: f64,
    end: f64,
    /// Number of the step.
    step: u32,
    time: u32,
    terminated: u32,
    done: u32,
    /// Further requests, of which only the values that were not written are evaluated.
    others: [u32; 2],
}

fn ask(writer: &mut Writer, function: &str, kind: i64, of: Kind) -> u32 {
    writer.call(0, function, vec![Arg::Integer(kind), Arg::Out(of, 1)])
}

fn ask_all(writer: &mut Writer, begin: f64, size: f64, step: u32) -> Asked {
    Asked {
        begin,
        end: begin + size,
        step,
        time: ask(writer, "GetRealStatus", LAST_TIME, Kind::F64),
        terminated: ask(writer, "GetBooleanStatus", TERMINATED, Kind::I32),
        done: ask(writer, "GetStatus", DO_STEP, Kind::I32),
        others: [
            ask(writer, "GetIntegerStatus", LAST_TIME, Kind::I32),
            ask(writer, "GetStringStatus", PENDING, Kind::Pointer),
        ],
    }
}

/// Returns the number that a request returned with OK.
fn answer(run: &Run, id: u32) -> Option<f64> {
    run.written(id).filter(|_| run.status(id) == Some(0))?.numbers().first().copied()
}

/// Checks the status after every step, and after one more, by which a model may end its simulation.
pub fn status(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let Some(last) = trajectory.points.last().filter(|_| !checker.fmi3()) else { return Ok(()) };
    let mut writer = checker.writer(trajectory);
    writer.begin(0);
    let mut asked = Vec::new();
    for point in &trajectory.points {
        if let Some(step) = writer.point(0, point).last() {
            asked.push(ask_all(&mut writer, point.time, point.size, *step));
        }
    }
    let step = writer.step(0, trajectory.end, last.size);
    asked.push(ask_all(&mut writer, trajectory.end, last.size, step));
    checker.check("results.status", writer.sequence, move |run| {
        let unwritten = asked.iter().find_map(|asked| unwritten(run, asked));
        unwritten.or_else(|| {
            asked.iter().enumerate().find_map(|(index, one)| wrong(run, one, &asked[index + 1..]))
        })
    })
}

/// Describes a request that returned OK and has not written its value.
fn unwritten(run: &Run, asked: &Asked) -> Option<String> {
    let functions = ["fmi2GetRealStatus", "fmi2GetBooleanStatus", "fmi2GetStatus", "fmi2GetIntegerStatus"];
    let ids = [asked.time, asked.terminated, asked.done, asked.others[0]];
    let numbers = functions.into_iter().zip(ids).find_map(|(name, id)| {
        let Values::Numbers(kind, bits) = run.written(id).filter(|_| run.status(id) == Some(0))? else {
            return None;
        };
        let untouched = u64::from_ne_bytes([FILL; 8]) >> (64 - 8 * kind.size());
        (bits.first() == Some(&untouched)).then_some(name)
    });
    let text = || {
        let id = asked.others[1];
        let written = run.written(id).filter(|_| run.status(id) == Some(0))?;
        (*written == Values::Strings(vec![None])).then_some("fmi2GetStringStatus")
    };
    Some(format!("{} returns OK and no value", numbers.or_else(text)?))
}

/// Describes a wrong status after a step that returned OK or Discard.
fn wrong(run: &Run, asked: &Asked, later: &[Asked]) -> Option<String> {
    let status = run.status(asked.step)?;
    let Asked { begin, end, .. } = *asked;
    // Rounding, and steps of a solver that do not end exactly where the communication step does.
    let near = 1e-2 * (end - begin) + 1e-9 * end.abs();
    if let Some(time) = answer(run, asked.time) {
        let is_wrong = match status {
            0 => (time - end).abs() > near,
            2 => !(begin - near..=end + near).contains(&time),
            _ => false,
        };
        let how = status_name(status);
        let of_step = format!("a step from {begin:?} to {end:?} that returned {how}");
        if is_wrong {
            return Some(format!("fmi2LastSuccessfulTime is {time:?} after {of_step}"));
        }
    }
    if status != 0 {
        return None;
    }
    let done = answer(run, asked.done).filter(|done| *done != 0.0);
    if let Some(done) = done {
        let name = status_name(done as i32);
        return Some(format!("fmi2DoStepStatus is {name} after a step that returned OK"));
    }
    let terminated = answer(run, asked.terminated)?;
    if terminated != 0.0 && terminated != 1.0 {
        return Some(format!("fmi2Terminated is {terminated}, which is not a Boolean"));
    }
    // A model that ends its simulation does not continue it.
    let continues = later.iter().any(|later| run.status(later.step) == Some(0));
    (terminated == 1.0 && continues)
        .then(|| format!("fmi2Terminated is true after the step to {end:?}, and the next steps succeed"))
}

//! Proves findings: shortens the call sequence of a finding, and runs a program in C that reproduces it.

use super::Checker;
use crate::call_sequence::{CallSequence, End, Setting};
use crate::finding::{Finding, Proof};
use crate::reproduce::confirm::Proving;
use crate::run::Stop;
use crate::shrink::shrink;
use crate::worker::interrupted;
use std::path::Path;
use std::time::Instant;

/// For each topic, the functions whose calls are not removed from a call sequence that compares simulations. If only one of two
/// compared simulations lacked such a call, the results would differ for that reason.
const PINNED: &[(&str, &[&str])] = &[
    ("states", STATES),
    ("reset", STATES),
    ("derivatives", &["SetReal", "SetFloat64", "SetContinuousStates"]),
    ("results", STEPS),
    ("life_cycle", STEPS),
    ("dynamics", DYNAMICS),
];
#[rustfmt::skip]
const DYNAMICS: &[&str] = &[
    "SetTime", "DoStep", "CompletedIntegratorStep", "SetContinuousStates", "SetReal", "SetFloat64", "SetFloat32", "EnterEventMode",
    "EnterInitializationMode",
];
#[rustfmt::skip]
const STATES: &[&str] = &[
    "Reset", "GetFMUState", "SetFMUState", "FreeFMUState", "SerializedFMUStateSize", "SerializeFMUState",
    "DeserializeFMUState", "EnterInitializationMode",
];
const STEPS: &[&str] = &["SetTime", "DoStep", "CompletedIntegratorStep"];

/// Findings whose criterion does not compare simulations, so each call may be removed without the corresponding calls of other
/// simulations.
#[rustfmt::skip]
const REMOVED_SEPARATELY: [&str; 5] = [
    "life_cycle.rejected", "life_cycle.states-changed", "results.early-return", "results.early-unreported", "start_values.inputs",
];

/// Returns an observation without its numbers, to compare observations of one finding.
fn outline(observed: &str) -> String {
    let names = observed.split(|letter: char| !(letter.is_alphabetic() || letter == '_'));
    names.filter(|name| name.len() > 1 && !["NaN", "inf"].contains(name)).collect::<Vec<_>>().join(" ")
}

impl Checker {
    /// Returns the parameters with which a finding is reproduced. For a crash or an access beyond an array, arrays always end at
    /// a guard page.
    fn reproducing_setting(&self, finding: &Finding) -> Setting {
        let ends = ["read-beyond", "written-beyond", "crash"].iter().any(|end| finding.name.ends_with(end));
        Setting { soft: self.setting.soft && !ends, ..self.setting.clone() }
    }

    /// Shortens the call sequence of a finding, writes the program that reproduces the finding, and runs the program. A finding
    /// that its program does not show becomes a note. Ends at the instant `until`.
    pub fn prove(&self, finding: &mut Finding, scratch: &Path, shortens: bool, until: Instant) {
        if finding.criterion.is_none() {
            return;
        }
        let begin = Instant::now();
        let (sequence, observed) = (finding.sequence.clone(), finding.observed.clone());
        if shortens {
            self.shorten(finding, begin + until.saturating_duration_since(begin) / 2);
        }
        let mut proof = self.proof(finding, scratch, until);
        // The program may need a call that was removed, so it is also tried with the original call sequence.
        if matches!(proof, Proof::NotShown(_)) && finding.sequence.len() < sequence.len() {
            finding.steps.1 = sequence.len();
            (finding.sequence, finding.observed) = (sequence, observed);
            proof = self.proof(finding, scratch, until);
        }
        finding.judge(proof);
    }

    /// Writes the program of a finding, and returns the result of its runs.
    fn proof(&self, finding: &mut Finding, scratch: &Path, until: Instant) -> Proof {
        let over =
            |_| Proof::NotRun(if interrupted() { Stop::Interrupted } else { Stop::TimeOver }.to_string());
        match self.reproduce(finding, until) {
            Ok(true) => {}
            Ok(false) => return Proof::NotShown("a repetition of its calls does not show it".to_owned()),
            Err(error) => return over(error),
        }
        let directory = self.setting.resources.parent().unwrap_or(scratch);
        let (memory, limit) = (self.setting.memory, self.limit);
        let proving =
            Proving { workers: &self.workers, fmu: directory, scratch, memory, limit, deadline: until };
        proving.prove(finding)
    }

    /// Repeats the calls of a finding, at most three times. If a repetition shows the finding, writes its program and returns
    /// true. The limit is ten times as long as in the check, because the machine may be busy; for a hang, it is not extended in
    /// this way.
    fn reproduce(&self, finding: &mut Finding, until: Instant) -> anyhow::Result<bool> {
        let Some(criterion) = finding.criterion.clone() else { return Ok(false) };
        let patience = if finding.name.ends_with("hang") { 1.0 } else { 10.0 };
        let limit = patience * (self.limit + 3.0 * self.setting.repetitions);
        for _ in 0..3 {
            let remaining = until.saturating_duration_since(Instant::now()).as_secs_f64();
            if remaining <= 0.0 {
                return Err(Stop::TimeOver.into());
            }
            let run = self.workers.execute(
                &self.reproducing_setting(finding),
                &finding.sequence,
                limit.min(remaining),
            )?;
            let found = criterion(&run).is_some() || finding.name == "package.symbols";
            if matches!(run.end, End::Hang(seconds) if seconds < limit && !finding.name.ends_with("hang")) {
                return Err(Stop::TimeOver.into());
            }
            if found {
                crate::reproduce::program(finding, &run, &self.setting, &self.description);
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Removes calls that the finding does not need, until the instant `until` or the maximum number of attempts.
    fn shorten(&self, finding: &mut Finding, until: Instant) {
        finding.steps = (finding.sequence.len(), finding.sequence.len());
        let Some(criterion) = finding.criterion.clone() else { return };
        let setting = self.reproducing_setting(finding);
        let hangs = finding.name.ends_with("hang");
        let limit = if hangs { self.limit.min(1.5) } else { self.limit };
        let mut remaining = match finding.topic() {
            _ if hangs => 12,
            "resources" => 15,
            _ => 400,
        };
        let removes_separately = REMOVED_SEPARATELY.contains(&finding.name.as_str());
        let ends = ["crash", "hang", "exit"].iter().any(|end| finding.name.ends_with(end));
        let pinned =
            PINNED.iter().find(|(topic, _)| *topic == finding.topic() && !ends && !removes_separately);
        let pinned = pinned.map_or(&[][..], |(_, calls)| calls);
        // A shorter sequence is accepted only if its observation differs in nothing but numbers.
        let (same, mut observed) = (outline(&finding.observed), finding.observed.clone());
        let mut reproduces = |tried: &CallSequence| {
            let remaining = until.saturating_duration_since(Instant::now()).as_secs_f64();
            let run = self.workers.execute(&setting, tried, limit.min(remaining)).ok();
            let now = run.and_then(|run| criterion(&run)).filter(|now| outline(now) == same);
            now.is_some_and(|now| {
                observed = now;
                true
            })
        };
        let mut short = shrink(&self.description, &finding.sequence, pinned, !removes_separately, |tried| {
            remaining -= 1;
            remaining >= 0 && Instant::now() < until && !interrupted() && reproduces(tried)
        });
        // If a repetition does not reproduce the finding, the finding does not occur in every run, so its sequence is not
        // shortened.
        if short.len() < finding.sequence.len() && !reproduces(&short) {
            (short, observed) = (finding.sequence.clone(), finding.observed.clone());
        }
        finding.observed = observed;
        finding.steps.1 = short.len();
        finding.sequence = short;
    }
}

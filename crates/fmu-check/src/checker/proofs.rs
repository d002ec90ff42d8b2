//! Proves findings: shortens the call sequence of a finding, and executes it twice, each time in new processes.

use super::Checker;
use crate::call_sequence::{Action, CallSequence, End, Run, Setting};
use crate::evidence::Evidence;
use crate::finding::{Finding, Proof};
use crate::reproduce;
use crate::run::{Manner, Stop};
use crate::shrink::shrink;
use crate::worker::interrupted;
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
        let now = finding.name == "package.symbols";
        Setting { soft: self.setting.soft && !ends, now, ..self.setting.clone() }
    }

    /// Repeats the calls of a finding. A finding that they do not show again becomes a note. Ends at the instant `until`.
    pub fn prove(&self, finding: &mut Finding, until: Instant) {
        if finding.criterion.is_some() {
            finding.length = (finding.sequence.len(), finding.sequence.len());
            let proof = self.proof(finding, until);
            finding.judge(proof);
        }
    }

    /// Shortens the call sequence of a proven finding, if the shorter one shows it, too. Ends at the instant `until`.
    pub fn shorten(&self, finding: &mut Finding, until: Instant) {
        if finding.proof != Proof::Shown {
            return;
        }
        let (begin, mut shorter) = (Instant::now(), finding.clone());
        self.search_shorter(&mut shorter, begin + until.saturating_duration_since(begin) / 2);
        if shorter.sequence.len() < finding.sequence.len() && self.proof(&mut shorter, until) == Proof::Shown
        {
            *finding = shorter;
        }
    }

    /// Repeats the calls of a finding twice, adds them to the finding, and returns whether both repetitions show it.
    fn proof(&self, finding: &mut Finding, until: Instant) -> Proof {
        let proof = self.show_twice(finding, until);
        proof.unwrap_or_else(|error| match error.downcast::<Stop>() {
            Ok(Stop::TimeOver) if interrupted() => Proof::NotRun(Stop::Interrupted.to_string()),
            Ok(stop) => Proof::NotRun(stop.to_string()),
            Err(error) => Proof::NotRun(error.to_string()),
        })
    }

    /// Both repetitions must break the rule again, by equal results or by others. The results that are equal are the evidence, which
    /// is all that a later replay has.
    fn show_twice(&self, finding: &mut Finding, until: Instant) -> anyhow::Result<Proof> {
        let Some(criterion) = finding.criterion.clone() else { return Ok(Proof::Files) };
        let limit = self.reproducing_limit(finding);
        let setting = self.reproducing_setting(finding);
        // The calls are also reported if there is no time to repeat them.
        reproduce::write(finding, Evidence::Unknown, &setting, limit, &self.description);
        let first = self.repetition(finding, until, Manner::Usual, |run| criterion(run).is_some())?;
        let Some(first) = first else {
            return Ok(Proof::NotShown("a repetition of its calls does not show it".to_owned()));
        };
        let second = self.repetition(finding, until, Manner::Again, |run| criterion(run).is_some())?;
        let mut evidence = reproduce::evidence(finding, &first, until);
        if let Some(second) = &second {
            evidence.loosen(second);
        }
        let is_shown = second.is_some_and(|second| {
            evidence == Evidence::Unknown || evidence.shows(&first, Some(&second), &finding.sequence)
        });
        reproduce::write(finding, evidence, &setting, limit, &self.description);
        Ok(match is_shown {
            true => Proof::Shown,
            false => Proof::NotShown("a second repetition of its calls does not show it".to_owned()),
        })
    }

    /// Returns the maximum duration of a process that reproduces a finding. It is ten times as long as in the check, because the
    /// machine may be busy; for a hang, it is not extended in this way.
    fn reproducing_limit(&self, finding: &Finding) -> f64 {
        let patience = if finding.name.ends_with("hang") { 1.0 } else { 10.0 };
        patience * (self.limit + 3.0 * self.setting.repetitions)
    }

    /// Executes the calls of a finding, and returns the run if it shows the finding. Calls on several threads are executed at most
    /// three times, because their results may be different each time.
    fn repetition(
        &self,
        finding: &Finding,
        until: Instant,
        manner: Manner,
        shows: impl Fn(&Run) -> bool,
    ) -> anyhow::Result<Option<Run>> {
        let limit = self.reproducing_limit(finding);
        let threads = finding.sequence.iter().any(|numbered| matches!(numbered.action, Action::Parallel(_)));
        for _ in 0..if threads { 3 } else { 1 } {
            let remaining = until.saturating_duration_since(Instant::now()).as_secs_f64();
            if remaining <= 0.0 {
                return Err(Stop::TimeOver.into());
            }
            let setting = self.reproducing_setting(finding);
            let run = self.workers.execute_as(manner, &setting, &finding.sequence, limit.min(remaining))?;
            if matches!(run.end, End::Hang(seconds) if seconds < limit && !finding.name.ends_with("hang")) {
                return Err(Stop::TimeOver.into());
            }
            if shows(&run) {
                return Ok(Some(run));
            }
        }
        Ok(None)
    }

    /// Removes calls that the finding does not need, until the instant `until` or the maximum number of attempts.
    fn search_shorter(&self, finding: &mut Finding, until: Instant) {
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
            (remaining >= 0 && Instant::now() < until && !interrupted()).then(|| reproduces(tried))
        });
        // If a repetition does not reproduce the finding, the finding does not occur in every run, so its sequence is not
        // shortened.
        if short.len() < finding.sequence.len() && !reproduces(&short) {
            (short, observed) = (finding.sequence.clone(), finding.observed.clone());
        }
        finding.observed = observed;
        finding.length.1 = short.len();
        finding.sequence = short;
    }
}

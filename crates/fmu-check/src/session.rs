//! A check from the FMU to the report: simulates the model, executes the checks, and repeats the calls of their findings.

use crate::activity::{Activity, Progress};
use crate::baseline::Baseline;
use crate::call_sequence::Run;
use crate::checker::{Checker, Unchecked};
use crate::finding::{Finding, Proof, first_failure};
use crate::opening::opened;
use crate::options::{INTERFACES, Options};
use crate::report::Report;
use crate::rules::TOPICS;
use crate::run::Stop;
use crate::schedule::{execute_checks, prove, stop};
use crate::trajectory::{NoTrajectory, find_trajectory};
use crate::worker;
use crate::writer::Trajectory;
use fmi_abi::Interface;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

/// Findings that are reported even if `--only` excludes their topic, because any call may reveal them or because they prevent
/// other checks. The same holds for the topics `arrays` and `logs`.
#[rustfmt::skip]
const ALWAYS: [&str; 7] = [
    "functions.status", "package.unloadable", "package.symbols",
    "life_cycle.simulation", "life_cycle.crash", "life_cycle.exit", "life_cycle.hang",
];

/// Checks an FMU, and shows the progress on the standard error.
///
/// Returns when the time is over, or when the user interrupts the check, even if a check is still evaluating results: its thread then
/// ends with the process.
///
/// # Errors
/// Fails if the file is not an FMU of FMI 2.0 or 3.0, if the baseline cannot be read, or if a report or a temporary file cannot
/// be written.
pub fn check(path: &Path, options: &Options, progress: Progress) -> anyhow::Result<Report> {
    let begin = Instant::now();
    let activity = Activity::begin(progress, path);
    let baseline = options.baseline.as_deref().map(Baseline::read).transpose()?.unwrap_or_default();
    let (scratch, mut checker) = opened(path, options, begin)?;
    activity.set("simulates the model");
    simulate(&mut checker)?;
    let session = Arc::new(Session {
        path: path.to_owned(),
        options: options.clone(),
        baseline,
        begin,
        checker,
        findings: OnceLock::new(),
    });
    let work = std::thread::spawn({
        let session = Arc::clone(&session);
        move || session.work(&activity)
    });
    while !work.is_finished() {
        if session.is_over() {
            session.checker.close();
            // The processes of the FMU use the directory. The first of them removes it when this process ends.
            std::mem::forget(scratch);
            return Ok(session.final_report());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    match work.join() {
        Ok(result) => result?,
        Err(panic) => std::panic::resume_unwind(panic),
    }
    let report = session.final_report();
    // The checker is dropped before the directory is removed, because its processes use the directory until they end.
    drop(session);
    Ok(report)
}

/// Time after the end of a check or an interrupt in which the checks should have ended by themselves.
const GRACE: Duration = Duration::from_millis(500);

/// A check, with everything that its report needs.
struct Session {
    path: PathBuf,
    options: Options,
    baseline: Baseline,
    begin: Instant,
    checker: Checker,
    /// Findings whose calls are being repeated; empty before that.
    findings: OnceLock<Vec<Mutex<Finding>>>,
}

impl Session {
    /// Executes the checks, and repeats the calls of their findings.
    fn work(&self, progress: &Activity) -> anyhow::Result<()> {
        let Self { options, checker, .. } = self;
        // The report is written after every check, so that earlier findings are not lost if this process is killed.
        let write_report = || match &options.out {
            Some(directory) => {
                self.report(self.wanted_findings(), "the check had not ended").write(directory)
            }
            None => Ok(()),
        };
        execute_checks(checker, progress, &|name| options.wants(name), &write_report)?;
        let findings =
            self.findings.get_or_init(|| self.wanted_findings().into_iter().map(Mutex::new).collect());
        prove(checker, findings, options, progress);
        Ok(())
    }

    /// Returns whether the checks have not ended in time, or not soon after an interrupt.
    fn is_over(&self) -> bool {
        let now = Instant::now();
        now > self.checker.end + GRACE || worker::interrupted_at().is_some_and(|at| now > at + GRACE)
    }

    /// Returns the report at the end.
    fn final_report(&self) -> Report {
        let findings = match self.findings.get() {
            None => self.wanted_findings(),
            // The finding whose calls are being repeated is taken as it was before.
            Some(slots) => {
                let all = self.wanted_findings().into_iter();
                let of = |(slot, before): (&Mutex<Finding>, Finding)| {
                    slot.try_lock().map_or(before, |finding| finding.clone())
                };
                slots.iter().zip(all).map(of).collect()
            }
        };
        let stop = if worker::interrupted() { Stop::Interrupted } else { Stop::TimeOver };
        self.report(findings, &stop.to_string())
    }

    /// Returns the findings so far that the options ask for, the most severe first.
    fn wanted_findings(&self) -> Vec<Finding> {
        let mut findings = self.checker.findings();
        let is_wanted_finding = |finding: &Finding| {
            self.options.wants(&finding.name)
                || ["arrays", "logs"].contains(&finding.topic())
                || ALWAYS.contains(&finding.name.as_str())
        };
        findings.retain(|finding| self.options.only.is_empty() || is_wanted_finding(finding));
        sort(&mut findings);
        findings
    }

    /// Returns the report. A finding whose calls have not been repeated is a note in it, for this reason.
    fn report(&self, mut findings: Vec<Finding>, why: &str) -> Report {
        let is_open = |finding: &&mut Finding| finding.criterion.is_some() && finding.proof == Proof::Files;
        for finding in findings.iter_mut().filter(is_open) {
            finding.judge(Proof::NotRun(why.to_owned()));
        }
        sort(&mut findings);
        let mut report = Report::new(&self.path, &self.checker, findings);
        report.seconds = self.begin.elapsed().as_secs_f64();
        let why = if self.options.only.is_empty() { "left out (--quick)" } else { "left out (--only)" };
        let unwanted = TOPICS.iter().filter(|topic| !self.options.wants(topic));
        report.unreached.extend(unwanted.map(|topic| Unchecked {
            name: (*topic).to_owned(),
            why: why.to_owned(),
            allowed: true,
        }));
        report.evaluate(&self.options, &self.baseline);
        report
    }
}

fn sort(findings: &mut [Finding]) {
    findings.sort_by(|one, other| other.severity.cmp(&one.severity).then_with(|| one.name.cmp(&other.name)));
}

/// Finds a successful simulation for each interface type that has a library, and records the interface types for which none
/// succeeds as not checked.
fn simulate(checker: &mut Checker) -> anyhow::Result<()> {
    for (index, interface) in [Interface::CoSimulation, Interface::ModelExchange].into_iter().enumerate() {
        if checker.setting.libraries[index].is_none() {
            continue;
        }
        match simulation(checker, interface) {
            Ok(trajectory) => checker.trajectories.push(trajectory),
            Err(error) if error.is::<NoTrajectory>() => {
                checker.unchecked(INTERFACES[index], format!("no simulation succeeds: {error}"));
            }
            Err(error) if error.is::<Stop>() || worker::interrupted() => {
                checker.unchecked(INTERFACES[index], stop(&error));
            }
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Returns a successful simulation. If there is none, records a finding and returns the error [`NoTrajectory`], unless a
/// simulation succeeds with accessible memory after each array.
fn simulation(checker: &mut Checker, interface: Interface) -> anyhow::Result<Trajectory> {
    let trajectory = find_trajectory(checker, interface);
    let Some(NoTrajectory(_, sequence)) = trajectory.as_ref().err().and_then(|error| error.downcast_ref())
    else {
        return trajectory;
    };
    let copy = sequence.clone();
    let criterion = move |run: &Run| first_failure(&copy, run, 1);
    checker.check("life_cycle.simulation", sequence.clone(), criterion)?;
    // An FMU that accesses memory beyond arrays may succeed if that memory is accessible.
    if ["arrays.read-beyond", "arrays.written-beyond"].iter().any(|name| checker.has(name)) {
        checker.setting.soft = true;
        return find_trajectory(checker, interface);
    }
    trajectory
}

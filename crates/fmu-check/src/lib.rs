#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! A check writes a call sequence (`writer`, `call_sequence`), which a separate process executes (`run`, `worker`), and evaluates
//! the results. The call sequence of a finding is shortened (`shrink`) so that the standard still allows it (`legal`), executed
//! twice, and written to the report with the results that show the finding (`reproduce`, `evidence`), from which `replay` executes
//! it again. All `unsafe` code is in `worker`, which loads and calls the library of the FMU in processes that may crash.
//!
//! Each module uses only modules before it: `call_sequence`, `worker`, `evidence`, `finding`, `rules`, `schema`,
//! `description`, `values`, `legal`, `writer`, `shrink`, `run`, `reproduce`, `always`, `options`, `checker`, `trajectory`, `checks`,
//! `activity`, `schedule`, `baseline`, `report`, `replay`.

mod activity;
mod always;
mod baseline;
mod call_sequence;
mod checker;
mod checks;
mod description;
mod evidence;
mod finding;
mod legal;
mod options;
mod replay;
mod report;
mod reproduce;
mod rules;
mod run;
mod schedule;
mod schema;
mod shrink;
mod trajectory;
mod values;
#[allow(unsafe_code, reason = "the library of the FMU is loaded and called here")]
mod worker;
mod writer;

pub use activity::Progress;
pub use checker::Unchecked;
pub use finding::{Finding, Proof, Severity};
pub use options::{FailOn, Options};
pub use replay::{ReplayOptions, replay};
pub use report::Report;
pub use worker::run_worker_if_requested;

use activity::Activity;
use anyhow::Context as _;
use checker::Checker;
use description::Description;
use fmi_abi::Interface;
use options::INTERFACES;
use run::Stop;
use schedule::{execute_checks, prove, stop};
use std::io::{IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};
use trajectory::{NoTrajectory, find_trajectory};

/// Topics that are not part of a quick check.
const LONG: [&str; 2] = ["malformed", "resources"];

/// Checks an FMU, prints the findings and writes the reports; with `--explain`, only prints a rule. Returns the exit status: 1 if
/// a finding fails the check; otherwise 2 if the FMU, or an interface or topic that must be checked, was not checked, or if a
/// file cannot be read or written; otherwise 0. After an interrupt it is 130.
///
/// The program must call [`run_worker_if_requested`] first in `main`, because the check starts the same program again to execute
/// call sequences.
pub fn command(fmu: &Path, options: &Options) -> ExitCode {
    if let Some(rule) = &options.explain {
        return match rules::explain(rule) {
            Some(text) => {
                // A closed pipe is not an error.
                let _ = std::io::stdout().write_all(text.as_bytes());
                ExitCode::SUCCESS
            }
            None => {
                eprintln!("error: no rule is called {rule}; --explain all prints all");
                ExitCode::from(2)
            }
        };
    }
    let shows = !options.json && std::io::stderr().is_terminal();
    let progress = if shows { Progress::Line } else { Progress::None };
    worker::listen_for_interrupts();
    match check(fmu, options, progress).and_then(|report| {
        let text = match options.json {
            true => format!("{}\n", report.json()?),
            false => report.terminal(std::io::stdout().is_terminal()),
        };
        // A closed pipe is not an error.
        let written = std::io::stdout().write_all(text.as_bytes());
        written.or_else(|error| match error.kind() {
            std::io::ErrorKind::BrokenPipe => Ok(()),
            _ => Err(error).context("the report cannot be written to the standard output"),
        })?;
        if let Some(directory) = &options.out {
            report.write(directory).with_context(|| format!("{}: cannot be written", directory.display()))?;
        }
        Ok(report)
    }) {
        Ok(report) if !worker::interrupted() => ExitCode::from(report.status),
        result => {
            let error = result.err().unwrap_or_else(|| Stop::Interrupted.into());
            eprintln!("error: {}", fmi_abi::one_line(&format!("{error:#}")));
            ExitCode::from(if worker::interrupted() { 130 } else { 2 })
        }
    }
}

/// Findings that are reported even if `--only` excludes their topic, because any call may reveal them or because they prevent
/// other checks. The same holds for the topics `arrays` and `logs`.
#[rustfmt::skip]
const ALWAYS: [&str; 6] = [
    "functions.status", "package.unloadable", "package.symbols",
    "life_cycle.simulation", "life_cycle.crash", "life_cycle.hang",
];

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
    let baseline = options.baseline.as_deref().map(baseline::Baseline::read).transpose()?.unwrap_or_default();
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

/// Unpacks an FMU. Returns the temporary directory with its files, and a checker that has recorded the findings in these files
/// and the interface types that cannot be checked.
fn opened(
    path: &Path,
    options: &Options,
    begin: Instant,
) -> anyhow::Result<(fmi_abi::files::Scratch, Checker)> {
    let scratch = fmi_abi::files::Scratch::new("fmu-check-")?;
    let workers = run::Workers::new(scratch.path().to_owned())?;
    let directory = &scratch.path().join("fmu");
    let zip_observations = checks::package::unpack(path, directory, options.unpacked << 20)?;
    let file = directory.join("modelDescription.xml");
    if !file.exists() {
        anyhow::bail!("{}: there is no modelDescription.xml in it; it is not an FMU", path.display());
    }
    let text = fmi_abi::files::read(&file, fmi_abi::files::MAX_XML)
        .map_err(|why| anyhow::anyhow!("{}: modelDescription.xml {why}", path.display()))?;
    let encoding = encoding(&text);
    // A file that is not UTF-8 is a finding. It is decoded as Latin-1, so that the other checks can continue.
    let text = match std::str::from_utf8(&text) {
        Ok(text) => text.to_owned(),
        Err(_) => text.iter().map(|byte| char::from(*byte)).collect(),
    };
    let text = text.trim_start_matches('\u{feff}');
    let description = Description::parse(text).map_err(|why| anyhow::anyhow!("{}: {why}", path.display()))?;
    let wanted = |topic: &str| is_wanted(options, topic);
    let mut observations = Vec::new();
    if wanted("package") {
        observations.extend(zip_observations);
        observations.extend(checks::package::look(directory, &description));
    }
    if wanted("description") {
        observations.extend(encoding);
        observations.extend(description.wrong.iter().cloned());
        observations.extend(schema::violation(description.standard, &description.version, text));
    }
    let (setting, without) = setting(options, directory, &description);
    let checker = Checker::new(description, setting, workers, options, begin);
    observations.into_iter().for_each(|(name, observed)| checker.add(checker.broken(name, observed)));
    without.into_iter().for_each(|(name, why)| checker.unchecked(name, why));
    Ok((scratch, checker))
}

/// Returns whether the options include a topic or a rule.
fn is_wanted(options: &Options, name: &str) -> bool {
    let topic = finding::topic_of(name);
    match options.only.is_empty() {
        true => !options.quick || !LONG.contains(&topic),
        false => options.only.iter().any(|only| only == topic || only == name),
    }
}

/// Time after the end of a check or an interrupt in which the checks should have ended by themselves.
const GRACE: Duration = Duration::from_millis(500);

/// A check, with everything that its report needs.
struct Session {
    path: PathBuf,
    options: Options,
    baseline: baseline::Baseline,
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
            Some(directory) => self.report(self.wanted_findings()).write(directory),
            None => Ok(()),
        };
        execute_checks(checker, progress, &|name| is_wanted(options, name), &write_report)?;
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

    /// Returns the report. A finding whose calls have not been repeated is a note in it.
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
        let judged = findings.into_iter().map(|mut finding| {
            if finding.criterion.is_some() && finding.proof == Proof::Files {
                let stop = if worker::interrupted() { Stop::Interrupted } else { Stop::TimeOver };
                finding.judge(Proof::NotRun(stop.to_string()));
            }
            finding
        });
        self.report(judged.collect())
    }

    /// Returns the findings so far that the options ask for, the most severe first.
    fn wanted_findings(&self) -> Vec<Finding> {
        let mut findings = self.checker.findings();
        let is_wanted_finding = |finding: &Finding| {
            is_wanted(&self.options, &finding.name)
                || ["arrays", "logs"].contains(&finding.topic())
                || ALWAYS.contains(&finding.name.as_str())
        };
        findings.retain(|finding| self.options.only.is_empty() || is_wanted_finding(finding));
        sort(&mut findings);
        findings
    }

    fn report(&self, mut findings: Vec<Finding>) -> Report {
        sort(&mut findings);
        let mut report = Report::new(&self.path, &self.checker, findings);
        report.seconds = self.begin.elapsed().as_secs_f64();
        let why = if self.options.only.is_empty() { "left out (--quick)" } else { "left out (--only)" };
        let unwanted = rules::TOPICS.iter().filter(|topic| !is_wanted(&self.options, topic));
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

/// Returns an observation if the XML declaration of a model description names an encoding other than UTF-8, or if the description
/// is not valid UTF-8.
fn encoding(text: &[u8]) -> Option<rules::Observation> {
    let declaration = text.split(|byte| *byte == b'>').next().unwrap_or_default();
    let declaration = String::from_utf8_lossy(declaration);
    let declared =
        declaration.split_once("encoding=").and_then(|(_, rest)| rest.get(1..)?.split(['"', '\'']).next());
    let why = match declared {
        Some(name) if !name.eq_ignore_ascii_case("utf-8") => {
            format!("the encoding of modelDescription.xml is {name}")
        }
        _ if std::str::from_utf8(text).is_err() => {
            "modelDescription.xml has bytes that are not UTF-8".to_owned()
        }
        _ => return None,
    };
    Some(("description.encoding", why))
}

/// Returns a successful simulation. If there is none, records a finding and returns the error [`NoTrajectory`], unless a
/// simulation succeeds with accessible memory after each array.
fn simulation(checker: &mut Checker, interface: Interface) -> anyhow::Result<writer::Trajectory> {
    let trajectory = find_trajectory(checker, interface);
    let Some(NoTrajectory(_, sequence)) = trajectory.as_ref().err().and_then(|error| error.downcast_ref())
    else {
        return trajectory;
    };
    let copy = sequence.clone();
    let criterion = move |run: &call_sequence::Run| finding::first_failure(&copy, run, 1);
    checker.check("life_cycle.simulation", sequence.clone(), criterion)?;
    // An FMU that accesses memory beyond arrays may succeed if that memory is accessible.
    if ["arrays.read-beyond", "arrays.written-beyond"].iter().any(|name| checker.has(name)) {
        checker.setting.soft = true;
        return find_trajectory(checker, interface);
    }
    trajectory
}

/// Returns the parameters that all call sequences share, and the interface types that cannot be checked, each with the reason.
fn setting(
    options: &Options,
    directory: &Path,
    description: &Description,
) -> (call_sequence::Setting, Vec<(&'static str, String)>) {
    let mut libraries = [None, None];
    let mut without = Vec::new();
    if description.scheduled_execution {
        without.push((INTERFACES[2], "fmu-check has no checks for Scheduled Execution".to_owned()));
    }
    for (index, offer) in [&description.co_simulation, &description.model_exchange].into_iter().enumerate() {
        let Some(offer) = offer else { continue };
        if offer.can(&["needsExecutionTool"]) && !options.execution_tool {
            let why = "it starts another program (needsExecutionTool); to check it, give --execution-tool";
            without.push((INTERFACES[index], why.to_owned()));
            continue;
        }
        match checks::package::library(directory, description.standard, offer) {
            Ok(library) => libraries[index] = Some(library),
            Err(why) => without.push((INTERFACES[index], why)),
        }
    }
    let setting = call_sequence::Setting {
        fmi3: description.standard == fmi_abi::Standard::Fmi3,
        libraries,
        resources: directory.join("resources"),
        memory: options.memory << 20,
        soft: false,
        now: false,
        repetitions: options.repeat,
    };
    (setting, without)
}

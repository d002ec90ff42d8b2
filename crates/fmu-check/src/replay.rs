//! Executes the calls of a finding in a report again.

use crate::call_sequence::{
    Action, Arg, CallSequence, End, Numbered, Setting, action_name, all_actions, unfold,
};
use crate::checker::Checker;
use crate::evidence::{Evidence, Replay};
use crate::opening::opened;
use crate::options::{INTERFACES, Options};
use crate::report::SCHEMA;
use crate::reproduce::{Printed, expectation};
use crate::run::{Manner, Stop};
use crate::worker;
use anyhow::{Context as _, bail, ensure};
use clap::builder::RangedU64ValueParser;
use fmi_abi::calls::signatures;
use fmi_abi::{Standard, one_line};
use std::collections::HashSet;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Options of a replay.
#[derive(Clone, Debug, clap::Args)]
pub struct ReplayOptions {
    /// The file report.json of a check.
    pub report: PathBuf,
    /// Number of the finding in the report, from 1 on, or its name.
    pub finding: String,
    /// Calls this FMU instead of the one that the report names, for example after its fault was fixed.
    #[arg(long, value_name = "FILE")]
    pub fmu: Option<PathBuf>,
    /// Executes the calls this many times.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = RangedU64ValueParser::<usize>::new().range(1..))]
    pub times: usize,
    /// Maximum duration of an execution of the calls in seconds. The report may state a shorter one.
    #[arg(long, default_value_t = 150.0, value_parser = crate::options::seconds)]
    pub limit: f64,
    /// Megabytes of memory that the FMU may use. The report may state fewer.
    #[arg(long, default_value_t = 8192)]
    pub memory: u64,
    /// Waits before the last call, so that you can attach a debugger and step into the FMU.
    #[arg(long = "break")]
    pub wait: bool,
}

/// Parts of a report that a replay needs.
#[derive(serde::Deserialize)]
struct Report {
    schema: u32,
    fmu: PathBuf,
    token: String,
    findings: Vec<Finding>,
}

#[derive(serde::Deserialize)]
struct Finding {
    name: String,
    observed: String,
    replay: Option<Replay>,
}

/// Executes the calls of a finding again, and prints them with their results. Returns the exit status: 1 if the finding shows, 0
/// if it does not, and 2 if the calls cannot be executed. After an interrupt it is 130.
///
/// The program must call [`run_worker_if_requested`](crate::run_worker_if_requested) first in `main`.
pub fn replay(options: &ReplayOptions) -> ExitCode {
    worker::listen_for_interrupts();
    match show(options) {
        Ok(shows) if !worker::interrupted() => ExitCode::from(u8::from(shows)),
        result => {
            let error = result.err().unwrap_or_else(|| Stop::Interrupted.into());
            eprintln!("error: {}", one_line(&format!("{error:#}")));
            ExitCode::from(if worker::interrupted() { 130 } else { 2 })
        }
    }
}

/// Returns whether one of the repetitions shows the finding.
fn show(options: &ReplayOptions) -> anyhow::Result<bool> {
    let report = read(&options.report)?;
    let (number, finding) = find(&report, &options.finding)?;
    let Some(replay) = &finding.replay else {
        bail!(
            "the finding {} has no calls, because it concerns the files of the FMU or because the check was interrupted",
            finding.name
        )
    };
    let path = options.fmu.as_ref().unwrap_or(&report.fmu);
    // Someone else may have written the report, so it cannot exceed the limits of the user.
    let memory = options.memory.min(replay.memory >> 20);
    let unpacking = Options { execution_tool: true, memory, ..Options::default() };
    // The checker is dropped before the directory is removed, because its processes use the directory until they end.
    let (_scratch, checker) = opened(path, &unpacking, Instant::now())
        .context("the FMU cannot be called; --fmu names another file")?;
    let description = &checker.description;
    check_calls(&replay.sequence, description.standard)?;
    let folded = with_token(&replay.sequence, &report.token, &description.token);
    let sequence = unfold(&folded);
    check_libraries(&sequence, &checker)?;
    check_numbers(replay, &sequence)?;
    let Replay { soft, now, ref evidence, .. } = *replay;
    let (limit, repetitions) = (options.limit.min(replay.limit), options.limit.min(replay.repetitions));
    let setting = Setting { soft, now, repetitions, ..checker.setting.clone() };
    let threads = sequence.iter().any(|numbered| matches!(numbered.action, Action::Parallel(_)));
    let attempts = if threads { options.times.max(MOST_ATTEMPTS) } else { options.times };
    let last = last(&sequence, evidence).filter(|_| options.wait);
    let manner = last.map_or(Manner::Usual, Manner::Debugged);
    print(&format!("Finding {number} of {}: {}", options.report.display(), finding.name));
    print(&format!("Observed: {}", finding.observed));
    let mut shown = 0;
    for time in 1..=attempts {
        let run = checker.workers.execute_as(manner, &setting, &sequence, limit)?;
        let again = || checker.workers.execute_as(Manner::Again, &setting, &sequence, limit);
        let other = if evidence.varies() { Some(again()?) } else { None };
        let shows = evidence.shows(&run, other.as_ref(), &sequence);
        // Calls that are cut off do not show whether the fault is still there.
        if !shows && let End::Hang(_) = run.end {
            bail!("the calls have not ended in {limit} s; allow more with --limit");
        }
        shown += usize::from(shows);
        if time == 1 {
            print(&format!("Calls of {}:", path.display()));
            let printed = Printed { description, run: Some(&run) };
            printed.lines(&folded).iter().for_each(|line| print(line));
            print("The finding shows if all of this holds:");
            expectation(evidence, &sequence, Some(&run))
                .iter()
                .for_each(|line| print(&format!("      {line}")));
        }
        if attempts > 1 {
            print(&format!("Repetition {time}: {}", if shows { "shown" } else { "not shown" }));
        }
        if shows && time >= options.times {
            break;
        }
    }
    if *evidence == Evidence::Unknown {
        bail!(
            "the report does not contain the results that show the finding, because no repetition has shown it"
        );
    }
    match attempts {
        _ if shown > 0 => print("The finding shows."),
        1 => print("The finding does not show."),
        _ => print(&format!("The finding does not show in {attempts} repetitions.")),
    }
    Ok(shown > 0)
}

/// Prints a line without control characters.
fn print(text: &str) {
    // A closed pipe is not an error.
    let _ = writeln!(std::io::stdout(), "{}", one_line(text));
}

fn read(path: &Path) -> anyhow::Result<Report> {
    let text = std::fs::read(path).with_context(|| format!("{}", path.display()))?;
    let report: Report = serde_json::from_slice(&text)
        .with_context(|| format!("{}: is not a report.json of this version of fmu-check", path.display()))?;
    if report.schema != SCHEMA {
        bail!(
            "{}: its schema is {}, but this version of fmu-check reads {SCHEMA}",
            path.display(),
            report.schema
        );
    }
    Ok(report)
}

/// Returns a finding with its number.
fn find<'r>(report: &'r Report, wanted: &str) -> anyhow::Result<(usize, &'r Finding)> {
    let numbers = 1..=report.findings.len();
    let is_wanted =
        |(number, finding): &(usize, &Finding)| finding.name == wanted || number.to_string() == wanted;
    let found: Vec<_> = numbers.zip(&report.findings).filter(is_wanted).collect();
    ensure!(found.len() < 2, "the report has {} findings {wanted}; give the number of one", found.len());
    found.into_iter().next().with_context(|| {
        let names: Vec<&str> = report.findings.iter().map(|finding| finding.name.as_str()).collect();
        format!("the report has no finding {wanted}; its findings are {}", names.join(", "))
    })
}

/// Returns the calls with the guid or instantiation token of the FMU that is called, because a new build of an FMU has another one.
fn with_token(sequence: &[Numbered], reported: &str, token: &str) -> CallSequence {
    let mut sequence = sequence.to_vec();
    for numbered in &mut sequence {
        match &mut numbered.action {
            Action::Make(_, make) if make.token == reported => token.clone_into(&mut make.token),
            Action::Repeat(_, actions) | Action::Copies(_, _, actions) => {
                *actions = with_token(actions, reported, token)
            }
            Action::Parallel(sequences) => {
                sequences.iter_mut().for_each(|actions| *actions = with_token(actions, reported, token));
            }
            _ => {}
        }
    }
    sequence
}

/// Checks that each function is one of the FMI version and gets the number of its arguments, that the directory of the FMU stays in the
/// temporary directory, and that copies, arrays and threads are not too many, because someone else may have written the report.
fn check_calls(sequence: &[Numbered], standard: Standard) -> anyhow::Result<()> {
    if memory_of(sequence) > MOST_MEMORY {
        bail!("the calls of the finding need more than {} MB with all copies and results", MOST_MEMORY >> 20);
    }
    let find = |function: &str| signatures(standard).iter().find(|signature| signature.rule.name == function);
    for numbered in all_actions(sequence) {
        let is_valid = match &numbered.action {
            Action::Call { function, args, .. } => {
                find(function).is_some_and(|signature| signature.arguments.len() == args.len())
            }
            Action::Parallel(sequences) => sequences.len() <= MOST_THREADS,
            Action::Version(name) => VERSIONS.contains(&name.as_str()),
            Action::Elsewhere(name) => {
                !name.is_empty() && !name.contains(['/', '\\']) && name != "." && name != ".."
            }
            _ => true,
        };
        if !is_valid {
            bail!("call {} of the report is not a call of {standard}", numbered.id);
        }
    }
    Ok(())
}

/// Checks that the FMU has a library for each interface type that is instantiated.
fn check_libraries(sequence: &CallSequence, checker: &Checker) -> anyhow::Result<()> {
    for (index, name) in INTERFACES.into_iter().take(2).enumerate() {
        let makes =
            |action: &Action| matches!(action, Action::Make(_, make) if make.co_simulation == (index == 0));
        let is_used = all_actions(sequence).iter().any(|numbered| makes(&numbered.action));
        if is_used && checker.setting.libraries[index].is_none() {
            let unchecked = checker.all_unchecked().into_iter().find(|unchecked| unchecked.name == name);
            let why = unchecked.map_or("the FMU does not offer it".to_owned(), |unchecked| unchecked.why);
            bail!("{name} cannot be called: {why}");
        }
    }
    Ok(())
}

/// Checks that the calls have time, and that those whose results show the finding are among them. Otherwise it could never show.
fn check_numbers(replay: &Replay, sequence: &CallSequence) -> anyhow::Result<()> {
    for (name, seconds) in [("limit", replay.limit), ("repetitions", replay.repetitions)] {
        ensure!(seconds > 0.0, "the report is damaged: {name} is {seconds} s");
    }
    if let Evidence::Same(expected, pairs) = &replay.evidence {
        let known: HashSet<u32> = all_actions(sequence).iter().map(|numbered| numbered.id).collect();
        let mut needed = expected.iter().map(|call| call.id).chain(pairs.iter().flatten().copied());
        if let Some(id) = needed.find(|id| !known.contains(id)) {
            bail!("the report is damaged: the finding needs call {id}, which does not exist");
        }
    }
    Ok(())
}

/// Returns the number of bytes that the actions need, with all copies and results.
fn memory_of(sequence: &[Numbered]) -> usize {
    let sum = |all: &mut dyn Iterator<Item = usize>| all.fold(0, usize::saturating_add);
    let of_arg = |arg: &Arg| match arg {
        Arg::In(_, words) => WORD * words.len(),
        Arg::Strings(texts) => texts.iter().map(|text| WORD + text.as_ref().map_or(0, Vec::len)).sum(),
        Arg::Blobs(blobs) => blobs.iter().map(|blob| WORD + blob.len()).sum(),
        Arg::Out(_, count) => count.saturating_mul(WORD),
        _ => WORD,
    };
    let of_action = |numbered: &Numbered| match &numbered.action {
        Action::Copies(times, _, actions) => times.saturating_mul(memory_of(actions)),
        Action::Repeat(_, actions) => memory_of(actions),
        Action::Parallel(sequences) => sum(&mut sequences.iter().map(|actions| memory_of(actions))),
        Action::Call { args, .. } => sum(&mut args.iter().map(of_arg)),
        Action::Integrate(_, how) => how.states.saturating_add(how.indicators).saturating_mul(WORD),
        _ => 0,
    };
    ACTION
        .saturating_add(sum(&mut sequence.iter().map(|numbered| ACTION.saturating_add(of_action(numbered)))))
}

/// Upper bounds for the memory of an action without its arrays, and of a value in an array, in bytes.
const ACTION: usize = 256;
const WORD: usize = 32;

/// Maximum memory of the calls of a finding in bytes.
const MOST_MEMORY: usize = 1 << 29;

/// Maximum number of threads of a finding.
const MOST_THREADS: usize = 64;

/// Number of executions in which a finding on threads must show, because its results may be different each time.
const MOST_ATTEMPTS: usize = 5;

/// Functions without an argument.
const VERSIONS: [&str; 3] = ["fmi2GetVersion", "fmi3GetVersion", "fmi2GetTypesPlatform"];

/// Returns the number of the last action that the finding needs: the action during which the process ends, the last one whose results
/// are compared, or the last one of the sequence.
fn last(sequence: &CallSequence, evidence: &Evidence) -> Option<u32> {
    let is_needed = |numbered: &&Numbered| match evidence {
        Evidence::End(_, Some(name)) => action_name(&numbered.action) == *name,
        Evidence::Same(calls, _) => calls.iter().any(|call| call.id == numbered.id),
        _ => true,
    };
    sequence.iter().rfind(is_needed).or(sequence.last()).map(|numbered| numbered.id)
}

#[cfg(test)]
mod tests {
    use super::check_calls;
    use crate::call_sequence::{Action, Arg, Kind, Numbered};
    use fmi_abi::Standard;

    #[test]
    fn only_calls_of_fmi_are_executed() {
        let valid = |action: Action| {
            check_calls(&[Numbered { id: 1, forbidden: false, action }], Standard::Fmi2).is_ok()
        };
        let call = |function: &str, args: Vec<Arg>| Action::Call {
            instance: Some(0),
            function: function.to_owned(),
            args,
        };
        assert!(valid(call("fmi2Reset", Vec::new())));
        assert!(!valid(call("fmi2Reset", vec![Arg::Null])));
        assert!(!valid(call("system", Vec::new())) && !valid(call("fmi3Reset", Vec::new())));
        assert!(
            valid(Action::Elsewhere("a b%".to_owned())) && !valid(Action::Elsewhere("../here".to_owned()))
        );
        assert!(!valid(Action::Version("abort".to_owned())));
        assert!(
            valid(Action::Parallel(vec![Vec::new(); 64])) && !valid(Action::Parallel(vec![Vec::new(); 65]))
        );
        let numbered = |action: Action| vec![Numbered { id: 1, forbidden: false, action }];
        let copies = |times: usize, action: Action| valid(Action::Copies(times, 1, numbered(action)));
        assert!(copies(20, Action::Measure) && !copies(1 << 40, Action::Measure));
        assert!(!valid(Action::Copies(1 << 40, 1, Vec::new())));
        // Half a million copies are not too many, unless each of them has a large array.
        let set = |count| call("fmi2DeSerializeFMUstate", vec![Arg::In(Kind::U8, vec![0; count]); 3]);
        assert!(copies(1 << 19, set(1)) && !copies(1 << 19, set(100)));
        let results = |count| call("fmi2GetReal", vec![Arg::Null, Arg::Null, Arg::Out(Kind::F64, count)]);
        assert!(valid(results(1 << 20)) && !valid(results(usize::MAX)));
        let nested = (0..8).fold(Action::Measure, |action, _| Action::Copies(20, 1, numbered(action)));
        assert!(!valid(Action::Parallel(vec![numbered(nested)])));
    }
}

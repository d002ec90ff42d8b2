//! Accepts or rejects an FMU that is being built, with the same checks as `cargo fmu check --quick`.

use anyhow::Result;
use fmi_abi::BaseUnit;
use fmu_check::{Finding, Progress, Report, Severity, check};
use fmu_run::ModelDescription;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Options of the command.
#[derive(clap::Args)]
pub struct Options {
    /// The FMU
    fmu: PathBuf,
    /// Seconds that a call of the model may take
    #[arg(long)]
    time_limit: u64,
}

/// The topics of fmu-check, and the rules of another topic, that are checked. A difference between the interface types is only a
/// warning, because the steps of Co-Simulation may be approximations.
#[rustfmt::skip]
const TOPICS: [&str; 9] = [
    "life_cycle", "start_values", "states", "derivatives", "dependencies", "dynamics", "results.not-finite", "results.interfaces",
    "logs.each-step",
];

/// The topics whose findings prove nothing if the results of a model are random.
const REPEATED: [&str; 2] = ["states", "dynamics"];

/// The rules that show that the same calls have different results, and why. The first that is broken counts.
const UNREPEATABLE: [(&str, &str); 2] = [
    ("results.process", "the results of the model are random"),
    (
        "results.instances",
        "the results of the model depend on its other instances, as through a counter in a `static`, which must be a field of the model",
    ),
];

/// The beginnings of the names of the rules that a model must not break, and what its author changes if it does. The first that fits
/// counts. Findings of other rules are warnings.
const REMEDIES: [(&str, &str); 15] = [
    (
        "dynamics.step-derivative",
        "compare `step` with `by` of the derivative, its `derivative_of`, and the size of the inner steps",
    ),
    ("dynamics.set-again", "`calculate` must not change states, parameters or exact outputs"),
    ("results.not-finite", "the model divides by zero, or takes a root or a logarithm of such a value"),
    ("derivatives.directional", "compare `by` of the variable with the functions of `Partials`"),
    ("derivatives.changed", "the functions of `Partials` must not change the model"),
    ("dependencies.kind", "its equations are not `smooth`"),
    ("dependencies.", "name it in the `depends_on` of the variable"),
    ("life_cycle.states-changed", "return `states_changed: true` from `event`"),
    ("life_cycle.reinit", "add `.reinit()` to its line of variables!, so that importers know that it jumps"),
    // The messages of the model state the reason.
    ("life_cycle.simulation", ""),
    ("life_cycle.rejected", ""),
    ("states.serialized", MEMORY),
    ("states.fresh-process", MEMORY),
    ("states.bytes", MEMORY),
    (
        "states.",
        "reading must change nothing, `Clone` must copy every field, and values that change must not be outside the model or shared, \
         as in a `static`, a `OnceLock` or an `Rc`",
    ),
];

/// What an author does if the bytes of a state lack something.
const MEMORY: &str =
    "name every field that initialize, a step or an event changes after `memory in` of variables!";

/// Rules whose findings are only notes, but usually mistakes of an author, and what to do.
const HINTS: [(&str, &str); 5] = [
    (
        "start_values.no-effect",
        "use it or remove it, unless it acts only with other inputs or later than in this check",
    ),
    ("dependencies.calculated-parameter", "calculate it from parameters in `update`, or make it a constant"),
    (
        "dynamics.counted-entry",
        "`event` must check whether its condition holds, because importers may call it at any time",
    ),
    ("logs.each-step", "log what happens once, such as an event"),
    ("start_values.tunable", "use it in `step`, `event` or `by`, or remove `.tunable()`"),
];

/// How a model ends the process, or never returns, which it must not do in any call sequence.
const ENDS: [&str; 3] = [".crash", ".exit", ".hang"];

/// Time between two lines that show the progress.
const INTERVAL: Duration = Duration::from_secs(5);

/// Checks an FMU and prints the mistakes; returns whether there are none.
pub fn judge(options: &Options) -> Result<bool> {
    let report = checked(options, &TOPICS)?;
    let (mut mistakes, others): (Vec<_>, Vec<_>) = report.findings.iter().partition(|of| is_mistake(of));
    mistakes.sort_by_key(|finding| remedy(finding).map(|(rank, _)| rank));
    if mistakes.iter().any(|finding| REPEATED.contains(&finding.topic())) {
        let findings = checked(options, &["results"])?.findings;
        let reason = UNREPEATABLE.iter().find(|(rule, _)| findings.iter().any(|of| of.name == *rule));
        if let Some((_, reason)) = reason {
            mistakes.retain(|finding| !REPEATED.contains(&finding.topic()));
            println!("warning: {reason}, so its saved states cannot be compared");
        }
    }
    let mut texts = mistakes.iter().map(|finding| text(finding));
    if let Some(first) = texts.next() {
        println!("{first}");
        texts.for_each(|text| println!("error: {text}"));
        return Ok(false);
    }
    for finding in
        others.iter().filter(|finding| finding.severity > Severity::Note || hint(finding).is_some())
    {
        println!("warning: {}", text(finding));
    }
    for warning in units(&description(&options.fmu)?) {
        println!("warning: {warning}");
    }
    let mut unchecked: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for of in report.unreached.iter().filter(|of| !of.allowed) {
        unchecked.entry(&of.why).or_default().push(&of.name);
    }
    for (why, names) in unchecked {
        println!("warning: not checked completely: {}: {why}", names.join(", "));
    }
    Ok(true)
}

/// Returns the model description of an FMU.
fn description(fmu: &Path) -> Result<ModelDescription> {
    let mut archive = zip::ZipArchive::new(File::open(fmu)?)?;
    let text = std::io::read_to_string(archive.by_name("modelDescription.xml")?)?;
    ModelDescription::parse(&text).map_err(anyhow::Error::msg)
}

/// Describes the units whose names mean something else than their definitions. The radian may be left out.
fn units(description: &ModelDescription) -> Vec<String> {
    let mut wrong = Vec::new();
    for (name, unit) in &description.units {
        let Some(base) = unit.base else { continue };
        if let Some(meant) = BaseUnit::of_name(name)
            && !meant.without_radian().equals(&base.without_radian())
        {
            wrong.push(format!("the unit {name} is declared as {base}, but its name means {meant}"));
        }
        for display in &unit.display_units {
            let conversion = BaseUnit::of_name(&display.name)
                .and_then(|meant| base.without_radian().conversion_to(&meant.without_radian()));
            let differs = |one: f64, other: f64| (one - other).abs() > 1e-6 * one.abs().max(other.abs());
            if let Some((factor, offset)) = conversion
                && (differs(factor, display.factor) || differs(offset, display.offset))
            {
                wrong.push(format!(
                    "{} for the unit {name} is displayed with the factor {} and the offset {}, but the names mean {factor} and {offset}",
                    display.name, display.factor, display.offset
                ));
            }
        }
    }
    wrong
}

/// Checks these topics.
fn checked(Options { fmu, time_limit }: &Options, topics: &[&str]) -> Result<Report> {
    let limit = *time_limit as f64;
    let options = fmu_check::Options {
        only: topics.iter().map(|topic| (*topic).to_owned()).collect(),
        quick: true,
        no_shrink: true,
        is_build: true,
        // A call sequence that does not end is repeated with three times the limit.
        limit: limit / 4.0,
        time: 2.0 * limit,
        ..fmu_check::Options::default()
    };
    check(fmu, &options, Progress::Every(INTERVAL))
}

/// Returns whether a finding rejects the build.
fn is_mistake(finding: &Finding) -> bool {
    match remedy(finding).filter(|_| hint(finding).is_none()) {
        // Values that are not finite are only a note for FMUs of other tools.
        Some(_) => finding.severity == Severity::Violation || finding.name == "results.not-finite",
        None => ENDS.iter().any(|end| finding.name.ends_with(end)),
    }
}

/// Returns the rank and the text of the remedy.
fn remedy(finding: &Finding) -> Option<(usize, &'static str)> {
    let rank = REMEDIES.iter().position(|(rule, _)| finding.name.starts_with(rule))?;
    Some((rank, REMEDIES[rank].1))
}

/// Returns the hint for a finding that is only a note.
fn hint(finding: &Finding) -> Option<&'static str> {
    HINTS.iter().find(|(rule, _)| finding.name == *rule).map(|(_, hint)| *hint)
}

/// Returns the message for a finding.
fn text(finding: &Finding) -> String {
    let remedy = match hint(finding).or_else(|| remedy(finding).map(|(_, remedy)| remedy)) {
        _ if finding.name.ends_with(".hang") => {
            "; if it is only slow, allow more with --time-limit SECONDS".to_owned()
        }
        Some(remedy) if !remedy.is_empty() => format!("; {remedy}"),
        _ => String::new(),
    };
    format!("{}{remedy} ({}; cargo fmu check has the calls)", finding.observed, finding.name)
}

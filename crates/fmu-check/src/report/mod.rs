//! Report for a terminal, as an HTML page, as JSON, as JUnit and as SARIF.

mod causes;
mod page;
mod sarif;

use crate::baseline::Baseline;
use crate::checker::{Checker, Unchecked};
use crate::finding::{Finding, Proof, Severity};
use crate::options::{FailOn, Options};
use crate::rules::TOPICS;
use fmi_abi::write::write_atomically;
use fmi_abi::{one_line, shown, shown_to};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

/// Version of the format of the report.
pub const SCHEMA: u32 = 2;

/// Report on an FMU.
#[derive(Clone, serde::Serialize)]
pub struct Report {
    /// Version of the format of the report, which is increased when a field is changed or removed.
    pub schema: u32,
    /// Version of fmu-check.
    pub version: &'static str,
    /// Exit status: 1 if a finding fails the check, otherwise 2 if an interface or a topic was not checked although it must be,
    /// otherwise 0.
    pub status: u8,
    /// Path of the FMU.
    pub fmu: String,
    /// Day of the check (UTC).
    pub date: String,
    /// Name of the model.
    pub model: String,
    /// `guid` or `instantiationToken`.
    pub token: String,
    /// FMI version.
    pub standard: String,
    /// Interface types that were checked.
    pub interfaces: Vec<String>,
    /// Number of call sequences that were executed.
    pub sequences: u64,
    /// Duration of the check in seconds.
    pub seconds: f64,
    /// Seed of random choices.
    pub seed: u64,
    /// Number of variables, and of the variables that most checks read.
    pub variables: [usize; 2],
    /// Topics that were checked and have no finding.
    pub passed: Vec<String>,
    /// Interface types and topics that were not checked, with the reason for each.
    pub unreached: Vec<Unchecked>,
    /// Names in the baseline that match no finding and no unchecked interface or topic.
    pub unused: Vec<String>,
    /// Findings, the most severe first; a finding that may follow from another one is listed after it.
    pub findings: Vec<Finding>,
}

impl Report {
    pub(crate) fn new(path: &Path, checker: &Checker, findings: Vec<Finding>) -> Self {
        Self {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            status: 0,
            unused: Vec::new(),
            fmu: path.display().to_string(),
            date: chrono::Utc::now().date_naive().to_string(),
            model: checker.description.model_name.clone(),
            token: checker.description.token.clone(),
            passed: Vec::new(),
            standard: checker.description.standard.to_string(),
            interfaces: checker
                .trajectories
                .iter()
                .map(|trajectory| trajectory.interface.to_string())
                .collect(),
            sequences: checker.executed(),
            seconds: 0.0,
            seed: checker.seed,
            variables: [checker.description.variables.len(), checker.readable.len()],
            unreached: checker.all_unchecked(),
            findings,
        }
    }

    /// Applies the options and the baseline: decides which findings fail the check and which unchecked topics are allowed.
    pub(crate) fn evaluate(&mut self, options: &Options, baseline: &Baseline) {
        let from = match options.fail_on {
            FailOn::Violation => Some(Severity::Violation),
            FailOn::Fragile => Some(Severity::Fragile),
            FailOn::Note => Some(Severity::Note),
            FailOn::Never => None,
        };
        causes::explain(&mut self.findings);
        self.unused = baseline.unused(&self.findings, &self.unreached);
        for finding in &mut self.findings {
            finding.accepted = baseline.reason(finding);
            finding.fails = finding.accepted.is_none() && from.is_some_and(|from| finding.severity >= from);
        }
        for unchecked in self.unreached.iter_mut().filter(|unchecked| !unchecked.allowed) {
            let reason = baseline.unchecked_reason(&unchecked.name);
            if let Some(reason) = reason {
                unchecked.why = format!("{} (accepted: {reason})", unchecked.why);
            }
            unchecked.allowed = reason.is_some() || options.allow_unchecked.contains(&unchecked.name);
        }
        let is_passed = |topic: &str| {
            !self.unreached.iter().any(|unchecked| unchecked.name == topic)
                && !self.findings.iter().any(|finding| finding.topic() == topic)
        };
        let passed = TOPICS.into_iter().filter(|topic| is_passed(topic));
        self.passed = passed.map(str::to_owned).collect();
        let fails = self.findings.iter().any(|finding| finding.fails);
        let unchecked = self.unreached.iter().any(|unchecked| !unchecked.allowed);
        self.status = if fails { 1 } else { 2 * u8::from(unchecked) };
    }

    /// Returns the number of findings of a severity that are not accepted.
    pub fn count(&self, severity: Severity) -> usize {
        self.findings
            .iter()
            .filter(|finding| finding.severity == severity && finding.accepted.is_none())
            .count()
    }

    /// Returns the names of the interface types that were checked.
    fn offers(&self) -> String {
        if self.interfaces.is_empty() { "no interface".to_owned() } else { self.interfaces.join(" and ") }
    }

    /// Returns the number of findings of each severity, of accepted findings, and of unchecked interfaces and topics.
    fn summary(&self) -> String {
        let many =
            |count: usize, one: &str, more: &str| format!("{count} {}", if count == 1 { one } else { more });
        let unchecked = match self.unreached.iter().filter(|unchecked| !unchecked.allowed).count() {
            0 => String::new(),
            count => format!(", {count} not checked"),
        };
        let accepted = match self.findings.iter().filter(|finding| finding.accepted.is_some()).count() {
            0 => String::new(),
            count => format!(", {count} accepted"),
        };
        format!(
            "{}, {} fragile, {}{accepted}{unchecked}",
            many(self.count(Severity::Violation), "violation", "violations"),
            self.count(Severity::Fragile),
            many(self.count(Severity::Note), "note", "notes")
        )
    }

    /// Formats the report for a terminal.
    pub fn terminal(&self, colours: bool) -> String {
        let mut text =
            format!("{} ({}, {}): {}\n", one_line(&self.fmu), self.standard, self.offers(), self.summary());
        for finding in &self.findings {
            let on = match finding.severity {
                Severity::Violation => "\u{1b}[31m",
                Severity::Fragile => "\u{1b}[33m",
                Severity::Note => "\u{1b}[36m",
            };
            let (on, off) = if colours { (on, "\u{1b}[0m") } else { ("", "") };
            let (severity, observed) = (finding.severity.name(), shown_to(&finding.observed, 160));
            let _ = writeln!(text, "{on}{severity:9}{off} {:26} {observed}", finding.name);
            let more = match finding.more.len() {
                0 => String::new(),
                count => format!("; and {count} more"),
            };
            let calls = match finding.length {
                (0, 0) => String::new(),
                (_, length) => match &finding.proof {
                    Proof::NotShown(why) | Proof::NotRun(why) => {
                        format!("; {length} calls, not reproduced ({why}), so only a note")
                    }
                    Proof::Files | Proof::Shown if length == 1 => "; 1 call reproduces it".to_owned(),
                    Proof::Files | Proof::Shown => format!("; {length} calls reproduce it"),
                },
            };
            let section = if finding.section.is_empty() { "not in the standard" } else { &finding.section };
            let accepted =
                finding.accepted.as_ref().map_or(String::new(), |reason| format!("; accepted: {reason}"));
            let cause =
                finding.cause.as_ref().map_or(String::new(), |cause| format!("; may follow from {cause}"));
            let _ = writeln!(text, "{:36} {section}{calls}{more}{cause}{accepted}", "");
        }
        for Unchecked { name, why, allowed } in &self.unreached {
            let allowed = if *allowed { " (allowed)" } else { "" };
            let _ = writeln!(text, "not checked{allowed}: {name}: {}", shown(why));
        }
        for name in &self.unused {
            let _ = writeln!(text, "baseline: {} matches no finding of this check", shown(name));
        }
        let Self { sequences, seconds, seed, .. } = self;
        text + &format!("{sequences} call sequences, {seconds:.1} s, seed {seed}\n")
    }

    /// Formats the report as JSON.
    ///
    /// # Errors
    /// Fails if the report cannot be serialized.
    pub fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self)
    }

    /// Formats the report as JUnit: one test for each finding, which fails if the finding fails the check, and one for each
    /// unchecked interface type or topic.
    pub fn junit(&self) -> String {
        let escape = |text: &str| {
            let printable = |letter: &char| !letter.is_control() || *letter == '\n';
            page::escape(&text.chars().filter(printable).collect::<String>())
        };
        let case = |class: &str, name: &str, body: &str| {
            format!("  <testcase classname=\"fmu-check{class}\" name=\"{name}\">{body}</testcase>\n")
        };
        let unchecked_case = |Unchecked { name, why, allowed }: &Unchecked| {
            let kind = if *allowed { "skipped" } else { "error" };
            case("", name, &format!("<{kind} message=\"not checked: {}\"/>", escape(why)))
        };
        let finding_case = |finding: &Finding| {
            let Finding { observed, section, requirement, .. } = finding;
            let body = format!("{observed}\n{requirement}\n{section}\n{}", finding.more.join("\n"));
            let accepted = finding.accepted.as_ref().map(|reason| format!("\nAccepted: {reason}"));
            let (severity, body) = (finding.severity.name(), escape(&(body + &accepted.unwrap_or_default())));
            let body = match finding.fails {
                false => format!("<system-out>{severity}: {body}</system-out>"),
                true => {
                    format!("<failure type=\"{severity}\" message=\"{}\">{body}</failure>", escape(observed))
                }
            };
            case(&format!(".{}", finding.topic()), &finding.name, &format!("\n    {body}\n  "))
        };
        let mut cases: Vec<String> = self.unreached.iter().map(unchecked_case).collect();
        cases.extend(self.findings.iter().map(finding_case));
        if self.findings.is_empty() {
            cases.push(case("", "no findings", ""));
        }
        let failures = self.findings.iter().filter(|finding| finding.fails).count();
        let skipped = self.unreached.iter().filter(|unchecked| unchecked.allowed).count();
        let (errors, model) = (self.unreached.len() - skipped, escape(&self.model));
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"fmu-check {model}\" tests=\"{}\" \
             failures=\"{failures}\" errors=\"{errors}\" skipped=\"{skipped}\" time=\"{:.3}\">\n{}</testsuite>\n",
            cases.len(),
            self.seconds,
            cases.concat()
        )
    }

    /// Writes the reports as files to a directory.
    ///
    /// # Errors
    /// Fails if a file cannot be written.
    pub fn write(&self, directory: &Path) -> anyhow::Result<()> {
        // Atomically, so that a full disk does not leave a part of a report.
        let write = |name: &str, content: Vec<u8>| {
            let written = write_atomically(&directory.join(name), |file| file.write_all(&content));
            written.map_err(anyhow::Error::msg)
        };
        write("report.json", self.json()?.into())?;
        write("junit.xml", self.junit().into())?;
        write("report.sarif", serde_json::to_vec_pretty(&sarif::sarif(self))?)?;
        write("report.html", page::page(self).into())?;
        Ok(())
    }
}

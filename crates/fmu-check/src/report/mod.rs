//! The report: for a terminal, as a page, as JSON, as JUnit.

mod page;
mod sarif;

use crate::baseline::Baseline;
use crate::checker::{Checker, Unchecked};
use crate::finding::{Finding, Severity};
use crate::{FailOn, Options};
use std::fmt::Write as _;
use std::path::Path;

/// The report on an FMU.
#[derive(Clone, serde::Serialize)]
pub struct Report {
    /// The version of the report's structure: 1. It changes when a field changes or goes.
    pub schema: u32,
    /// The version of this tool.
    pub version: &'static str,
    /// The exit status: 0, 1 for findings that fail, 2 for an interface or a topic that was not checked.
    pub status: u8,
    /// The file.
    pub fmu: String,
    /// The name of the model.
    pub model: String,
    /// The edition of the standard.
    pub standard: String,
    /// The types of interface that were checked.
    pub interfaces: Vec<String>,
    /// How many sequences of calls were played.
    pub sequences: u64,
    /// How long it took.
    pub seconds: f64,
    /// Chose what was chosen at random.
    pub seed: u64,
    /// How many variables there are, and how many of them most checks read.
    pub variables: [usize; 2],
    /// The interfaces and topics that were not checked, with the reason of each.
    pub unreached: Vec<Unchecked>,
    /// Names in the baseline for which nothing was found.
    pub unused: Vec<String>,
    /// The worst first.
    pub findings: Vec<Finding>,
}

impl Report {
    pub(crate) fn new(path: &Path, checker: &Checker, findings: Vec<Finding>) -> Self {
        Self {
            schema: 1,
            version: env!("CARGO_PKG_VERSION"),
            status: 0,
            unused: Vec::new(),
            fmu: path.display().to_string(),
            model: checker.description.model_name.clone(),
            standard: checker.description.standard.to_string(),
            interfaces: checker
                .trajectories
                .iter()
                .map(|trajectory| trajectory.interface.to_string())
                .collect(),
            sequences: checker.played(),
            seconds: 0.0,
            seed: checker.seed,
            variables: [
                checker.description.variables.len(),
                crate::writer::readable(&checker.description).len(),
            ],
            unreached: checker.take_unchecked(),
            findings,
        }
    }

    /// Decides which findings fail and what is allowed, for all outputs.
    pub(crate) fn judge(&mut self, options: &Options, baseline: &Baseline) {
        let from = match options.fail_on {
            FailOn::Violation => Some(Severity::Violation),
            FailOn::Fragile => Some(Severity::Fragile),
            FailOn::Note => Some(Severity::Note),
            FailOn::Never => None,
        };
        self.unused = baseline.unused(&self.findings, &self.unreached);
        for finding in &mut self.findings {
            finding.accepted = baseline.of_finding(finding);
            finding.fails = finding.accepted.is_none() && from.is_some_and(|from| finding.severity >= from);
        }
        for unchecked in self.unreached.iter_mut().filter(|unchecked| !unchecked.allowed) {
            let reason = baseline.of_unchecked(&unchecked.name);
            if let Some(reason) = reason {
                unchecked.why = format!("{} (accepted: {reason})", unchecked.why);
            }
            unchecked.allowed = reason.is_some() || options.allow_unchecked.contains(&unchecked.name);
        }
        let fails = self.findings.iter().any(|finding| finding.fails);
        let unchecked = self.unreached.iter().any(|unchecked| !unchecked.allowed);
        self.status = if fails { 1 } else { 2 * u8::from(unchecked) };
    }

    /// How many findings there are of a severity.
    pub fn count(&self, severity: Severity) -> usize {
        self.findings
            .iter()
            .filter(|finding| finding.severity == severity && finding.accepted.is_none())
            .count()
    }

    /// The interfaces that were checked.
    fn offers(&self) -> String {
        if self.interfaces.is_empty() { "no interface".to_owned() } else { self.interfaces.join(" and ") }
    }

    /// In a sentence.
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
        let mut text = String::new();
        let _ = writeln!(text, "{} ({}, {}): {}", self.fmu, self.standard, self.offers(), self.summary());
        for finding in &self.findings {
            let (on, off) = match (colours, finding.severity) {
                (false, _) => ("", ""),
                (true, Severity::Violation) => ("\u{1b}[31m", "\u{1b}[0m"),
                (true, Severity::Fragile) => ("\u{1b}[33m", "\u{1b}[0m"),
                (true, Severity::Note) => ("\u{1b}[36m", "\u{1b}[0m"),
            };
            let _ = writeln!(
                text,
                "{on}{:9}{off} {:26} {}",
                finding.severity.name(),
                finding.name,
                short(&finding.observed, 160)
            );
            let more = match finding.more.len() {
                0 => String::new(),
                count => format!("; and {count} more"),
            };
            let calls = match finding.steps {
                (0, 0) => String::new(),
                (_, steps) => format!("; {steps} calls show it"),
            };
            let section = if finding.section.is_empty() { "not in the standard" } else { &finding.section };
            let accepted =
                finding.accepted.as_ref().map_or(String::new(), |reason| format!("; accepted: {reason}"));
            let _ = writeln!(text, "{:36} {section}{calls}{more}{accepted}", "");
        }
        for Unchecked { name, why, allowed } in &self.unreached {
            let allowed = if *allowed { " (allowed)" } else { "" };
            let _ = writeln!(text, "not checked{allowed}: {name}: {why}");
        }
        let _ =
            writeln!(text, "{} call sequences, {:.1} s, seed {}", self.sequences, self.seconds, self.seed);
        text
    }

    /// Formats the report as JSON.
    ///
    /// # Errors
    /// None that is known.
    pub fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self)
    }

    /// Formats the report as JUnit: one test for each finding, which fails if the finding fails the check.
    pub fn junit(&self) -> String {
        let escape = |text: &str| {
            let printable =
                text.chars().filter(|letter| !letter.is_control() || *letter == '\n').collect::<String>();
            printable.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
        };
        let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
        let failures = self.findings.iter().filter(|finding| finding.fails).count();
        let skipped = self.unreached.iter().filter(|unchecked| unchecked.allowed).count();
        let _ = writeln!(
            text,
            "<testsuite name=\"{}\" tests=\"{}\" failures=\"{failures}\" errors=\"{}\" skipped=\"{skipped}\" time=\"{:.3}\">",
            escape(&format!("fmu-check {}", self.model)),
            self.findings.len().max(1) + self.unreached.len(),
            self.unreached.len() - skipped,
            self.seconds
        );
        if self.findings.is_empty() {
            let _ = writeln!(text, "  <testcase classname=\"fmu-check\" name=\"no findings\"/>");
        }
        for Unchecked { name, why, allowed } in &self.unreached {
            let (kind, why) = (if *allowed { "skipped" } else { "error" }, escape(why));
            let _ = writeln!(
                text,
                "  <testcase classname=\"fmu-check\" name=\"{name}\"><{kind} message=\"not checked: {why}\"/></testcase>"
            );
        }
        for finding in &self.findings {
            let _ = writeln!(
                text,
                "  <testcase classname=\"fmu-check.{}\" name=\"{}\">",
                finding.topic(),
                finding.name
            );
            let body = escape(&format!(
                "{}\n{}: {}\n{}",
                finding.observed,
                finding.section,
                finding.requirement,
                finding.more.join("\n")
            ));
            let (severity, observed) = (finding.severity.name(), escape(&finding.observed));
            if !finding.fails {
                let reason = finding
                    .accepted
                    .as_ref()
                    .map_or(String::new(), |reason| escape(&format!("\nAccepted: {reason}")));
                let _ = writeln!(text, "    <system-out>{severity}: {body}{reason}</system-out>");
            } else {
                let _ = writeln!(
                    text,
                    "    <failure type=\"{severity}\" message=\"{observed}\">{body}</failure>"
                );
            }
            let _ = writeln!(text, "  </testcase>");
        }
        text.push_str("</testsuite>\n");
        text
    }

    /// Writes all of it to a directory.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, directory: &Path) -> anyhow::Result<()> {
        std::fs::create_dir_all(directory)?;
        std::fs::write(directory.join("report.json"), self.json()?)?;
        std::fs::write(directory.join("junit.xml"), self.junit())?;
        std::fs::write(directory.join("report.sarif"), serde_json::to_vec_pretty(&sarif::sarif(self))?)?;
        std::fs::write(directory.join("report.html"), page::page(self))?;
        for finding in self.findings.iter().filter(|finding| !finding.c.is_empty()) {
            std::fs::write(directory.join(format!("{}.c", finding.name)), &finding.c)?;
        }
        Ok(())
    }
}

fn short(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((index, _)) => format!("{}...", &text[..index]),
        None => text.to_owned(),
    }
}

//! Report as an HTML page that needs no other files.

use super::Report;
use crate::finding::{Finding, Proof, Severity};
use std::fmt::Write as _;

/// Escapes a string for XML and HTML.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Returns the calls of the finding with this number, and the results that show it; empty if there are none.
fn calls(number: usize, finding: &Finding) -> String {
    if finding.calls.is_empty() {
        return String::new();
    }
    let lines = |lines: &[String]| escape(&lines.join("\n"));
    let expected = match &finding.expected[..] {
        [] => String::new(),
        list => format!("<p>The finding shows if all of this holds:</p><pre>{}</pre>\n", lines(list)),
    };
    format!(
        "<details><summary>{} calls</summary><pre>{}</pre>\n{expected}\
         <p>To repeat the calls: <code>fmu-check replay report.json {number}</code></p></details>\n",
        finding.length.1,
        lines(&finding.calls)
    )
}

/// Returns the section of the finding with this number.
fn section(number: usize, finding: &Finding) -> String {
    let mut text = String::new();
    let name = finding.severity.name();
    let _ = write!(
        text,
        "<section class=\"{name}\"><span class=\"severity\">{name}</span><h2>{}</h2>\n<p>{}</p>\n<p>Rule: {}</p>\n<p>{}</p>\n",
        finding.name,
        escape(&finding.observed),
        escape(&finding.requirement),
        if finding.section.is_empty() { "Not in the standard" } else { &finding.section }
    );
    if let Some(cause) = &finding.cause {
        let _ = writeln!(text, "<p>It may follow from {cause}, which should be fixed first.</p>");
    }
    if let Proof::NotShown(why) | Proof::NotRun(why) = &finding.proof {
        let _ = writeln!(text, "<p>Not reproduced: {}.</p>", escape(why));
    }
    if let Some(reason) = &finding.accepted {
        let _ = writeln!(text, "<p>Accepted: {}</p>", escape(reason));
    }
    if !finding.more.is_empty() {
        let _ = writeln!(text, "<details><summary>{} more</summary><ul>", finding.more.len());
        for more in &finding.more {
            let _ = writeln!(text, "<li>{}</li>", escape(more));
        }
        text.push_str("</ul></details>\n");
    }
    text.push_str(&calls(number, finding));
    text.push_str("</section>\n");
    text
}

/// Returns the page.
pub fn page(report: &Report) -> String {
    let mut text = String::new();
    for (severity, what) in [
        (Severity::Violation, "Violation: the standard forbids the observed behaviour."),
        (
            Severity::Fragile,
            "Fragile: the standard does not forbid the observed behaviour, but importers fail.",
        ),
        (
            Severity::Note,
            "Note: importers work nevertheless, or the calls of the finding do not show it again.",
        ),
    ] {
        let findings: Vec<_> =
            (1..).zip(&report.findings).filter(|(_, finding)| finding.severity == severity).collect();
        if findings.is_empty() {
            continue;
        }
        let _ = writeln!(text, "<p><em>{what}</em></p>");
        for (number, finding) in findings {
            text.push_str(&section(number, finding));
        }
    }
    if report.findings.is_empty() {
        text.push_str("<p>Nothing was found.</p>\n");
    }
    if !report.passed.is_empty() {
        let _ = writeln!(text, "<p>Checked without a finding: {}.</p>", report.passed.join(", "));
    }
    if !report.unreached.is_empty() {
        text.push_str("<p>Not checked:</p><ul>\n");
        for unchecked in &report.unreached {
            let _ = writeln!(text, "<li>{}: {}</li>", unchecked.name, escape(&unchecked.why));
        }
        text.push_str("</ul>\n");
    }
    let values = [
        ("{model}", escape(&report.model)),
        ("{fmu}", escape(&report.fmu)),
        ("{date}", report.date.clone()),
        ("{version}", report.version.to_owned()),
        ("{token}", escape(&report.token)),
        ("{standard}", report.standard.clone()),
        ("{interfaces}", report.offers()),
        ("{summary}", report.summary()),
        ("{sequences}", report.sequences.to_string()),
        ("{seconds}", format!("{:.1}", report.seconds)),
        ("{seed}", report.seed.to_string()),
        ("{findings}", text),
    ];
    filled(include_str!("page.html"), &values)
}

/// Returns a text in which names in braces are replaced by their values. A value may contain a name, which stays.
fn filled(text: &str, values: &[(&str, String)]) -> String {
    let parts = text.split_inclusive('}').map(|part| {
        let found = values.iter().find_map(|(name, value)| Some([part.strip_suffix(name)?, value]));
        found.map_or(part.to_owned(), |found| found.concat())
    });
    parts.collect()
}

#[cfg(test)]
mod tests {
    /// A model can be called `{findings}`.
    #[test]
    fn values_are_not_replaced() {
        let values = [("{model}", "{findings}".to_owned()), ("{findings}", "none".to_owned())];
        assert_eq!(
            super::filled("p { }<h1>{model}</h1>{findings}.", &values),
            "p { }<h1>{findings}</h1>none."
        );
    }
}

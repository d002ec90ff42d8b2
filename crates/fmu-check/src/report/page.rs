//! The report as an HTML page without other files.

use super::Report;
use crate::finding::Severity;
use std::fmt::Write as _;

/// A string in XML and HTML.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The page.
pub fn page(report: &Report) -> String {
    let mut text = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\n\
         <title>fmu-check: {}</title>\n<style>\n\
         body {{ font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 60rem; padding: 0 1rem; color: #222; background: #fff }}\n\
         h1 {{ font-size: 1.5rem }} h2 {{ font-size: 1.05rem; margin: 0 }} code, pre {{ font: 13px/1.4 ui-monospace, monospace }}\n\
         pre {{ overflow: auto; background: #f4f4f4; padding: .8rem; max-height: 30rem }}\n\
         section {{ border-left: .4rem solid; padding: .2rem 0 .2rem 1rem; margin: 1.2rem 0 }} p {{ margin: .3rem 0 }}\n\
         .violation {{ border-color: #b3261e }} .fragile {{ border-color: #b26a00 }} .note {{ border-color: #3567a8 }}\n\
         .severity {{ float: right; font-weight: 600 }}\n\
         @media (prefers-color-scheme: dark) {{ body {{ color: #ddd; background: #181818 }} pre {{ background: #242424 }} }}\n\
         </style></head><body>\n<h1>{}</h1>\n<p>{}, {}, {}: <strong>{}</strong></p>\n",
        escape(&report.model),
        escape(&report.model),
        escape(&report.fmu),
        report.standard,
        report.offers(),
        report.summary()
    );
    let _ = writeln!(
        text,
        "<p>{} call sequences were played in separate processes, in {:.1} s, with seed {}.</p>",
        report.sequences, report.seconds, report.seed
    );
    for (severity, what) in [
        (Severity::Violation, "Violation: the standard says must."),
        (Severity::Fragile, "Fragile: nothing forbids it, but it hurts."),
        (Severity::Note, "Note: good to know."),
    ] {
        let findings: Vec<_> =
            report.findings.iter().filter(|finding| finding.severity == severity).collect();
        if findings.is_empty() {
            continue;
        }
        let _ = writeln!(text, "<p><em>{what}</em></p>");
        for finding in findings {
            let name = severity.name();
            let _ = write!(
                text,
                "<section class=\"{name}\"><span class=\"severity\">{name}</span><h2>{}</h2>\n<p>{}</p>\n<p>{}: {}</p>\n",
                finding.name,
                escape(&finding.observed),
                if finding.section.is_empty() { "Not in the standard" } else { &finding.section },
                escape(&finding.requirement)
            );
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
            if !finding.c.is_empty() {
                let _ = writeln!(
                    text,
                    "<details><summary>Program in C with {} calls that shows the finding</summary><pre>{}</pre></details>",
                    finding.steps.1,
                    escape(&finding.c)
                );
            }
            text.push_str("</section>\n");
        }
    }
    if report.findings.is_empty() {
        text.push_str("<p>Nothing was found.</p>\n");
    }
    if !report.unreached.is_empty() {
        text.push_str("<p>Not checked:</p><ul>\n");
        for unchecked in &report.unreached {
            let _ = writeln!(text, "<li>{}: {}</li>", unchecked.name, escape(&unchecked.why));
        }
        text.push_str("</ul>\n");
    }
    text.push_str("</body></html>\n");
    text
}

//! Report in SARIF 2.1.0, which code scanning services read.

use super::Report;
use crate::finding::{Finding, Severity};
use serde_json::{Value, json};

/// Returns the SARIF level of a severity.
const fn level(severity: Severity) -> &'static str {
    match severity {
        Severity::Violation => "error",
        Severity::Fragile => "warning",
        Severity::Note => "note",
    }
}

/// Returns the report as a SARIF log.
pub fn sarif(report: &Report) -> Value {
    let rules: Vec<Value> = report
        .findings
        .iter()
        .map(|finding| {
            let help = format!("{} {}", finding.requirement, finding.section);
            json!({
                "id": finding.name,
                "shortDescription": {"text": finding.requirement},
                "help": {"text": help.trim()},
                "defaultConfiguration": {"level": level(finding.severity)},
            })
        })
        .collect();
    let result = |(index, finding): (usize, &Finding)| {
        let text = [std::slice::from_ref(&finding.observed), &finding.more].concat().join("\n");
        let mut result = json!({
            "ruleId": finding.name,
            "ruleIndex": index,
            "level": level(finding.severity),
            "message": {"text": text},
            "locations": [{"physicalLocation": {"artifactLocation": {"uri": report.fmu.replace('\\', "/")}}}],
        });
        if let Some(reason) = &finding.accepted {
            result["suppressions"] = json!([{"kind": "external", "justification": reason}]);
        }
        result
    };
    let results: Vec<Value> = report.findings.iter().enumerate().map(result).collect();
    let notifications: Vec<Value> = report
        .unreached
        .iter()
        .map(|unchecked| {
            let level = if unchecked.allowed { "note" } else { "error" };
            json!({"level": level, "message": {"text": format!("not checked: {}: {}", unchecked.name, unchecked.why)}})
        })
        .collect();
    json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{
            "tool": {"driver": {"name": "fmu-check", "version": report.version, "rules": rules}},
            "invocations": [{
                "executionSuccessful": report.status != 2,
                "exitCode": report.status,
                "toolExecutionNotifications": notifications,
            }],
            "results": results,
        }],
    })
}

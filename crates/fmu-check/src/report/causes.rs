//! Finds the findings that may be consequences of another one. For example, if instances share a variable, most other results may
//! be wrong, too.

use crate::finding::Finding;

/// Rules that can cause other findings, each with patterns for their names. A pattern is a prefix, or `*` and a suffix. A rule of
/// this list can itself be a consequence, but only of an earlier rule, so that the search for causes has no circles.
const CAUSES: [(&str, &[&str]); 6] = [
    ("arrays.written-beyond", &["*.crash", "results.", "states.", "reset."]),
    ("results.process", &["results.", "states.", "reset."]),
    (
        "results.instances",
        &[
            "results.threads",
            "results.reading",
            "results.name",
            "results.logging",
            "results.visible",
            "states.",
            "reset.",
        ],
    ),
    (
        "results.reading",
        &["states.changed-by-saving", "derivatives.changed", "rejections.changed", "reset.incomplete"],
    ),
    (
        "states.restore-values",
        &[
            "states.restore",
            "states.twice",
            "states.several",
            "states.modes",
            "states.serialized",
            "states.fresh-process",
        ],
    ),
    ("resources.settings", &["results.", "states.", "reset.", "logs.printed"]),
];

/// Sets the cause of each finding that may follow from another one, and moves the finding after its cause. A finding is at most as
/// severe as its cause, because it says nothing that its cause does not explain.
pub fn explain(findings: &mut Vec<Finding>) {
    let found: Vec<String> = findings.iter().map(|finding| finding.name.clone()).collect();
    for finding in findings.iter_mut() {
        let name = &finding.name;
        let fits = |pattern: &&str| match pattern.strip_prefix('*') {
            Some(end) => name.ends_with(end),
            None => name.starts_with(*pattern),
        };
        let cause = CAUSES.iter().filter(|(cause, _)| found.iter().any(|other| other == cause));
        let cause = cause.take_while(|(cause, _)| cause != name).find(|(_, of)| of.iter().any(fits));
        finding.cause = cause.map(|(cause, _)| (*cause).to_owned());
    }
    // A cause may itself have a cause, which comes earlier in the list.
    for (cause, _) in CAUSES {
        if let Some(severity) = findings.iter().find(|finding| finding.name == cause).map(|of| of.severity) {
            let of = findings.iter_mut().filter(|finding| finding.cause.as_deref() == Some(cause));
            of.for_each(|finding| finding.severity = finding.severity.min(severity));
        }
    }
    let (causes, consequences): (Vec<_>, Vec<_>) =
        std::mem::take(findings).into_iter().partition(|finding| finding.cause.is_none());
    for cause in causes {
        let of = |finding: &&Finding| finding.cause.as_ref() == Some(&cause.name);
        let followers: Vec<Finding> = consequences.iter().filter(of).cloned().collect();
        findings.push(cause);
        findings.extend(followers);
    }
    // A finding whose cause also has a cause was not listed after its cause, so it is added at the end.
    let listed: Vec<String> = findings.iter().map(|finding| finding.name.clone()).collect();
    findings.extend(consequences.into_iter().filter(|finding| !listed.contains(&finding.name)));
}

#[cfg(test)]
mod tests {
    use super::explain;
    use crate::finding::{Finding, Severity};

    #[test]
    fn consequences_follow_their_cause() {
        let named = |name: &str| {
            let severity = if name == "results.process" { Severity::Fragile } else { Severity::Violation };
            Finding { name: name.to_owned(), severity, ..Finding::default() }
        };
        let names =
            ["reset.incomplete", "logs.utf8", "results.process", "states.restore", "results.instances"];
        let mut findings: Vec<Finding> = names.map(named).into();
        explain(&mut findings);
        let listed: Vec<(&str, Option<&str>)> =
            findings.iter().map(|finding| (finding.name.as_str(), finding.cause.as_deref())).collect();
        let cause = Some("results.process");
        assert_eq!(
            listed,
            [
                ("logs.utf8", None),
                ("results.process", None),
                ("reset.incomplete", cause),
                ("states.restore", cause),
                ("results.instances", cause),
            ]
        );
        let violations = findings.iter().filter(|finding| finding.severity == Severity::Violation);
        assert_eq!(violations.map(|finding| &finding.name[..]).collect::<Vec<_>>(), ["logs.utf8"]);
    }
}

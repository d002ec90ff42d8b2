//! Lists of findings and of interfaces and topics that were not checked.

use crate::finding::Finding;

/// Interface or topic that was not checked.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Unchecked {
    /// Name of the interface or topic.
    pub name: String,
    /// Reason why it was not checked.
    pub why: String,
    /// Whether an option or the baseline allows it.
    pub allowed: bool,
}

/// Adds a finding to the list, which has one finding for each name, because one fault is often found by many call sequences. The most
/// severe finding stays, and of equally severe ones the one with the shortest call sequence, which is the easiest to understand. Its
/// field `more` lists what the others observed.
pub fn record(found: &mut Vec<Finding>, mut finding: Finding) {
    let Some(kept) = found.iter_mut().find(|kept| kept.name == finding.name) else {
        found.push(finding);
        return;
    };
    let rank = |finding: &Finding| (finding.severity, std::cmp::Reverse(finding.sequence.len()));
    if rank(&finding) > rank(kept) {
        std::mem::swap(kept, &mut finding);
    }
    for observed in std::iter::once(finding.observed).chain(finding.more) {
        if observed != kept.observed && !kept.more.contains(&observed) {
            kept.more.push(observed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::record;
    use crate::finding::{Finding, Severity};

    /// Checks that a more severe finding replaces one of the same name, and that the observation of the replaced finding is still
    /// listed.
    #[test]
    fn no_evidence_is_lost() {
        let finding = |name: &str, severity, observed: &str| Finding {
            name: name.to_owned(),
            severity,
            observed: observed.to_owned(),
            ..Finding::default()
        };
        let mut found = Vec::new();
        for (severity, observed) in [
            (Severity::Note, "a"),
            (Severity::Note, "b"),
            (Severity::Violation, "c"),
            (Severity::Fragile, "d"),
            (Severity::Violation, "c"),
            (Severity::Violation, "e"),
            (Severity::Note, "b"),
        ] {
            record(&mut found, finding("topic.name", severity, observed));
        }
        record(&mut found, finding("topic.other", Severity::Note, "a"));
        let [one, other] = &found[..] else { panic!("{} findings", found.len()) };
        assert_eq!((one.severity, one.observed.as_str()), (Severity::Violation, "c"));
        assert_eq!(one.more, ["a", "b", "d", "e"]);
        assert_eq!((other.severity, other.observed.as_str(), other.more.len()), (Severity::Note, "a", 0));
    }
}

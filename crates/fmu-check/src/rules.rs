//! Rules, which are read from RULES.md, so that the program and its users read the same text. A row of its table has the name of a rule,
//! its requirement and, for FMI 2.0 and FMI 3.0, the severity and the section of the standard. A sentence of the standard may follow the
//! requirement, after a line break.

use crate::finding::{Finding, Severity};
use fmi_abi::Standard;

/// Topics of the checks. The rules of the topics `arrays` and `*` belong to every check.
pub const TOPICS: [&str; 15] = [
    "description",
    "package",
    "functions",
    "start_values",
    "life_cycle",
    "states",
    "derivatives",
    "dependencies",
    "dynamics",
    "results",
    "reset",
    "rejections",
    "logs",
    "resources",
    "malformed",
];

/// Name of a rule that the files of the FMU break, and the observation.
pub type Observation = (&'static str, String);

/// Page with all rules.
const PAGE: &str = include_str!("../RULES.md");

/// Row of the table of rules.
struct Rule {
    /// Topic, a dot, and the name within the topic.
    name: &'static str,
    requirement: &'static str,
    /// Sentence of the standard that states the requirement, with its section. `None` if RULES.md quotes none, because the requirement
    /// follows from several sentences, or is not in the standard.
    quotation: Option<&'static str>,
    /// For FMI 2.0 and FMI 3.0, the severity and the section, such as `note, 2.1.5`, or `note, not in the standard`.
    judgements: [&'static str; 2],
}

impl Rule {
    /// Returns the severity, and the section of the standard with its edition; the section is empty if the rule is not part of
    /// the standard.
    fn severity(&self, standard: Standard) -> Option<(Severity, String)> {
        let (name, section) = self.judgements[standard as usize].split_once(", ")?;
        let section = match (section, standard) {
            ("not in the standard", _) => String::new(),
            (section, Standard::Fmi2) => format!("FMI 2.0.5 section {section}"),
            (section, Standard::Fmi3) => format!("FMI 3.0.2 section {section}"),
        };
        let severities = [Severity::Note, Severity::Fragile, Severity::Violation];
        Some((severities.into_iter().find(|severity| severity.name() == name)?, section))
    }

    /// Returns the rule as text, in which the rule has this name.
    fn text(&self, name: &str) -> String {
        let judgement = |standard: Standard| match self.severity(standard).unwrap_or_default() {
            (severity, section) if section.is_empty() => {
                format!("* {standard}: {}, not in the standard\n", severity.name())
            }
            (severity, section) => format!("* {} in {section}\n", severity.name()),
        };
        let judgements = [Standard::Fmi2, Standard::Fmi3].map(judgement).concat();
        let quotation = self.quotation.map_or(String::new(), |quotation| format!("\n> {quotation}\n"));
        format!("## {name}\n\n{}\n\n{judgements}{quotation}", self.requirement)
    }
}

/// Returns all rules in the order of the page.
fn rules() -> impl Iterator<Item = Rule> {
    PAGE.lines().filter_map(|line| {
        let cells: Vec<&str> = line.strip_prefix("| `")?.strip_suffix(" |")?.split(" | ").collect();
        let [name, requirement, ref judgements @ ..] = cells[..] else { return None };
        let name = name.trim_end_matches('`');
        let (requirement, quotation) = match requirement.split_once("<br>") {
            Some((requirement, quotation)) => (requirement, Some(quotation)),
            None => (requirement, None),
        };
        Some(Rule { name, requirement, quotation, judgements: judgements.try_into().ok()? })
    })
}

/// Returns the rule of this name. For the end of a process (`crash`, `exit`, `hang`), this is the rule of the call sequence (for
/// `states.fresh-process.crash`, it is `states.fresh-process`), or the general rule (for `states.crash`, it is `*.crash`).
fn find(name: &str) -> Option<Rule> {
    let same = |name: &str| rules().find(|rule| rule.name == name);
    let of_end = |(base, end): (&str, &str)| {
        let end = ["crash", "exit", "hang"].contains(&end).then(|| same(&format!("*.{end}")))?;
        same(base).or_else(|| end.filter(|_| TOPICS.contains(&base)))
    };
    same(name).or_else(|| of_end(name.rsplit_once('.')?))
}

/// Returns whether there is a rule of this name.
pub fn is_known(name: &str) -> bool {
    find(name).is_some()
}

/// Returns the text of a rule, or of all rules; `None` if there is no such rule.
pub fn explain(name: &str) -> Option<String> {
    match name {
        "all" => Some(rules().map(|rule| rule.text(rule.name)).collect::<Vec<_>>().join("\n")),
        name => find(name).map(|rule| rule.text(name)),
    }
}

/// Returns the finding that an FMU breaks a rule.
///
/// # Panics
/// Panics if there is no such rule. A test checks the names in the sources.
pub fn broken(standard: Standard, name: &str, observed: String) -> Finding {
    let rule = find(name).unwrap_or_else(|| panic!("no rule is called {name}"));
    let (severity, section) = rule.severity(standard).unwrap_or_default();
    Finding {
        name: name.to_owned(),
        severity,
        section,
        requirement: rule.requirement.to_owned(),
        observed,
        ..Finding::default()
    }
}

#[cfg(test)]
mod tests {
    use super::{Severity, TOPICS, broken, explain, find, rules};
    use fmi_abi::Standard::{Fmi2, Fmi3};

    #[test]
    fn every_rule_is_written_once_in_order_with_a_topic() {
        let names: Vec<&str> = rules().map(|rule| rule.name).collect();
        assert!(names.len() > 100 && names.is_sorted_by(|one, other| one < other));
        for rule in rules() {
            let topic = rule.name.split('.').next().unwrap_or_default();
            assert!(["*", "arrays"].contains(&topic) || TOPICS.contains(&topic), "{}", rule.name);
            let complete = [Fmi2, Fmi3].iter().all(|standard| rule.severity(*standard).is_some());
            assert!(complete && rule.requirement.ends_with('.'), "{}", rule.name);
        }
    }

    #[test]
    fn every_topic_has_a_rule_and_the_readme_counts_them() {
        let has_rule = |topic: &&str| rules().any(|rule| rule.name.split('.').next() == Some(*topic));
        assert!(TOPICS.iter().all(has_rule));
        let count = format!("There are {} topics", TOPICS.len());
        assert!(include_str!("../README.md").contains(&count), "{count}");
    }

    #[test]
    fn a_finding_has_the_severity_and_the_section_of_its_fmi_version() {
        let [two, three] = [Fmi2, Fmi3].map(|standard| broken(standard, "logs.category", String::new()));
        assert_eq!((two.severity, two.section.as_str()), (Severity::Note, "FMI 2.0.5 section 2.1.5"));
        assert_eq!(
            (three.severity, three.section.as_str()),
            (Severity::Violation, "FMI 3.0.2 section 2.3.1")
        );
        let hang = broken(Fmi2, "malformed.times.hang", String::new());
        assert_eq!((hang.severity, hang.section.as_str()), (Severity::Fragile, ""));
    }

    #[test]
    fn ends_of_processes_have_a_rule_in_every_topic() {
        assert_eq!(find("states.crash").map(|rule| rule.name), Some("*.crash"));
        let of_sequence = find("states.fresh-process.crash").map(|rule| rule.name);
        assert_eq!(of_sequence, Some("states.fresh-process"));
        assert_eq!(find("states.restore").map(|rule| rule.name), Some("states.restore"));
        assert!(find("nothing.crash").is_none() && find("states.nothing").is_none());
    }

    #[test]
    fn a_rule_is_explained_by_its_row() {
        let text = explain("states.crash").expect("a rule");
        assert!(
            text.starts_with("## states.crash\n\nA call that") && text.ends_with("section 2.2.4\n"),
            "{text}"
        );
        assert!(explain("states.nothing").is_none());
        let text = explain("states.twice").expect("a rule");
        assert!(
            text.ends_with("\n\n> FMI 2.0.5 section 2.1.8: “The FMUstate copy still exists.”\n"),
            "{text}"
        );
        assert!(explain("all").is_some_and(|all| all.contains(&text)));
    }

    /// Checks that the sources of the checks, and the other sources that name rules, name only rules that exist.
    #[test]
    fn every_name_in_the_sources_is_a_rule() {
        let directory = concat!(env!("CARGO_MANIFEST_DIR"), "/src/checks");
        let paths = std::fs::read_dir(directory).expect("the checks").flatten().map(|entry| entry.path());
        let others = [
            "checker/evaluation.rs",
            "checker/proofs.rs",
            "always.rs",
            "consistency.rs",
            "description.rs",
            "schema.rs",
        ];
        let others = others.map(|name| format!("{directory}/../{name}").into());
        for path in paths.chain(others) {
            let source: String = std::fs::read_to_string(&path).expect("a source");
            // String literals that are names of rules. The end of a process, such as ".hang", is a separate literal without a
            // topic.
            let names = source.split('"').filter(|name| {
                let topic = name.split_once('.').filter(|(_, rule)| !rule.is_empty());
                topic.is_some_and(|(topic, _)| topic == "arrays" || super::TOPICS.contains(&topic))
            });
            let unknown: Vec<&str> = names.filter(|name| find(name).is_none()).collect();
            assert_eq!(unknown, Vec::<&str>::new(), "{}", path.display());
        }
    }
}

//! Text file with the accepted findings of a project and the reason for each.

use crate::finding::Finding;
use anyhow::Context as _;
use std::collections::HashSet;
use std::path::Path;

/// Line of a baseline. It accepts all observations of a rule, or only those that contain `text`; it may also accept that an
/// interface or a topic is not checked.
struct Accepted {
    name: String,
    text: Option<String>,
    reason: String,
}

impl Accepted {
    /// Returns whether this line accepts an observation of a finding.
    fn accepts(&self, finding: &Finding, observed: &str) -> bool {
        self.name == finding.name && self.text.as_ref().is_none_or(|text| observed.contains(text.as_str()))
    }
}

/// Accepted findings of a project; empty without a file.
#[derive(Default)]
pub struct Baseline {
    accepted: Vec<Accepted>,
}

impl Baseline {
    /// Reads a file of lines such as `logs.silent: known since 2024` or `rejections.tolerated "J2": intended`.
    ///
    /// # Errors
    /// Fails if the file cannot be read, or if a line has an unknown name or no reason.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text =
            std::fs::read_to_string(path).with_context(|| format!("{}: cannot be read", path.display()))?;
        Self::parse(&text).map_err(|(line, why)| anyhow::anyhow!("{}: line {line} {why}", path.display()))
    }

    /// Parses the lines of a baseline; the error is the number of the first invalid line, and what is wrong with it.
    fn parse(text: &str) -> Result<Self, (usize, String)> {
        let form = |number| {
            let why = "is not of the form NAME: REASON or NAME \"PART OF THE OBSERVATION\": REASON";
            (number, why.to_owned())
        };
        let mut new = HashSet::new();
        let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
        let accepted =
            lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')).map(|(number, line)| {
                let end = line.find([':', ' ', '\t']).ok_or_else(|| form(number))?;
                let (name, rest) = (&line[..end], line[end..].trim_start());
                let (text, reason) = match rest.strip_prefix('"') {
                    Some(rest) => {
                        let (text, rest) = rest.split_once('"').ok_or_else(|| form(number))?;
                        (Some(text.to_owned()), rest.trim_start())
                    }
                    None => (None, rest),
                };
                let reason = reason.strip_prefix(':').map(str::trim).filter(|reason| !reason.is_empty());
                let is_rule = crate::rules::is_known(name);
                let known = is_rule
                    || crate::options::INTERFACES.contains(&name)
                    || crate::rules::TOPICS.contains(&name);
                match reason {
                    Some(_) if known && !is_rule && text.is_some() => Err((
                        number,
                        format!(
                            "has a part of an observation, but {name} is no rule, so it has no observations"
                        ),
                    )),
                    Some(_) if known && !new.insert((name, text.clone())) => {
                        Err((number, format!("accepts {name} again, like a line above; keep one of them")))
                    }
                    Some(reason) if known => {
                        Ok(Accepted { name: name.to_owned(), text, reason: reason.to_owned() })
                    }
                    Some(_) => Err((
                        number,
                        format!("has {name:?}, which is no rule, topic or interface; see --explain all"),
                    )),
                    None => Err(form(number)),
                }
            });
        Ok(Self { accepted: accepted.collect::<Result<_, _>>()? })
    }

    /// Returns the reasons why all observations of a finding are accepted; `None` if one of them is not.
    pub fn reason(&self, finding: &Finding) -> Option<String> {
        let mut reasons: Vec<&str> = Vec::new();
        for observed in std::iter::once(&finding.observed).chain(&finding.more) {
            let accepted = self.accepted.iter().find(|accepted| accepted.accepts(finding, observed))?;
            if !reasons.contains(&accepted.reason.as_str()) {
                reasons.push(&accepted.reason);
            }
        }
        Some(reasons.join("; "))
    }

    /// Returns the reason why an interface or a topic need not be checked; `None` if the baseline has none.
    pub fn unchecked_reason(&self, name: &str) -> Option<&str> {
        self.accepted.iter().find(|accepted| accepted.name == name).map(|accepted| accepted.reason.as_str())
    }

    /// Returns the names in the lines that match no finding and no unchecked interface or topic.
    pub fn unused(&self, findings: &[Finding], unchecked: &[crate::checker::Unchecked]) -> Vec<String> {
        let used = |accepted: &&Accepted| {
            unchecked.iter().any(|unchecked| unchecked.name == accepted.name)
                || findings.iter().any(|finding| {
                    let mut all = std::iter::once(&finding.observed).chain(&finding.more);
                    all.any(|observed| accepted.accepts(finding, observed))
                })
        };
        self.accepted
            .iter()
            .filter(|accepted| !used(accepted))
            .map(|accepted| accepted.name.clone())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::Baseline;
    use crate::finding::Finding;

    #[test]
    fn a_reason_is_needed_for_each_observation() {
        let text =
            "# known\nlogs.silent: since 2024\n\nrejections.tolerated \"J2\": intended: see the manual\n";
        let baseline = Baseline::parse(text).unwrap_or_default();
        let finding = |name: &str, observed: &[&str]| {
            let more = observed[1..].iter().map(|observed| (*observed).to_owned()).collect();
            Finding { name: name.to_owned(), observed: observed[0].to_owned(), more, ..Finding::default() }
        };
        assert_eq!(baseline.reason(&finding("logs.silent", &["a", "b"])), Some("since 2024".to_owned()));
        let accepted = finding("rejections.tolerated", &["a value for J2"]);
        assert_eq!(baseline.reason(&accepted), Some("intended: see the manual".to_owned()));
        assert_eq!(
            baseline.reason(&finding("rejections.tolerated", &["a value for J2", "one for J3"])),
            None
        );
        assert_eq!(baseline.reason(&finding("states.restore", &["x"])), None);
        assert_eq!(baseline.unused(&[accepted], &[]), ["logs.silent"]);
    }

    #[test]
    fn a_line_without_reason_or_with_an_unknown_name_is_an_error() {
        for (text, line, part) in [
            ("logs.silent", 1, "is not of the form NAME: REASON"),
            ("# all\nlogs.silent:", 2, "is not of the form NAME: REASON"),
            ("logs.silen: typo", 1, "has \"logs.silen\", which is no rule"),
            ("co-simulation \"a\": b", 1, "has a part of an observation, but co-simulation is no rule"),
            ("logs.silent: a\nlogs.silent \"b\": a\nlogs.silent: b", 3, "accepts logs.silent again"),
            ("logs.silent \"a: b", 1, "is not of the form NAME: REASON"),
        ] {
            let (number, why) = Baseline::parse(text).err().unwrap_or_default();
            assert!(number == line && why.starts_with(part), "{text}: {number} {why}");
        }
        assert!(Baseline::parse("scheduled-execution: not used").is_ok());
    }
}

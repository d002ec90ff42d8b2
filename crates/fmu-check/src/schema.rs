//! Compares model descriptions with the XML schemas of the standard.

use crate::checker::Checker;
use crate::rules::Observation;
use crate::run::Stop;
use fmi_abi::{Standard, shown};
use std::time::Instant;
use uppsala::dom::Document;
use uppsala::error::ValidationError;
use uppsala::xsd::XsdValidator;

/// Schema of an FMI version, in one file.
const fn schema(standard: Standard) -> &'static str {
    match standard {
        Standard::Fmi2 => include_str!("../schema/fmi2.xsd"),
        Standard::Fmi3 => include_str!("../schema/fmi3.xsd"),
    }
}

/// Maximum size of a description that is compared, in bytes, because the comparison of a larger one takes seconds.
const LARGEST: usize = 20 << 20;

/// Maximum number of violations whose lines are all calculated, because uppsala reads the description up to the violation for each line.
const MOST_LINES: usize = 100;

/// Number of elements at the beginning in which the line of the first of many violations is looked for.
const BEGINNING: usize = 1000;

/// Compares the model description with the schema, and records the first violation, or else the first attribute that cannot be read.
pub fn check(checker: &Checker) -> anyhow::Result<()> {
    if Instant::now() >= checker.deadline {
        return Err(Stop::TimeOver.into());
    }
    let description = &checker.description;
    let violation = violation(description.standard, &description.version, &description.text);
    if let Some((rule, why)) = violation.or_else(|| description.unreadable()) {
        checker.add(checker.broken(rule, why));
    }
    Ok(())
}

/// Returns the first violation of the schema in a model description of this `fmiVersion`; the others often follow from it. Later
/// editions of FMI 3 may have more elements, so their descriptions are not compared.
fn violation(standard: Standard, version: &str, text: &str) -> Option<Observation> {
    if text.len() > LARGEST || !["2.0", "3.0"].contains(&version) {
        return None;
    }
    let validator = uppsala::parse(schema(standard)).and_then(|schema| XsdValidator::from_schema(&schema));
    // The parser of fmi-abi has accepted the description. This one also limits the depth of its elements.
    let (validator, document) = (validator.ok()?, uppsala::parse(text).ok()?);
    // A document that owns its strings has no lines.
    let errors = validator.validate(&document.into_static());
    let first = errors.first()?;
    let is_first = |error: &ValidationError| error.message == first.message;
    let mut document = uppsala::parse(text).ok()?;
    if errors.len() > MOST_LINES {
        keep_beginning(&mut document);
    }
    let line = validator.validate(&document).into_iter().find(is_first).and_then(|error| error.line);
    let line = line.map_or(String::new(), |line| format!("line {line}: "));
    let more = match errors.len() - 1 {
        count if count >= MOST_LINES => format!(", the first of {} violations", errors.len()),
        _ => String::new(),
    };
    let message = first.message.replace(" (no wildcard permits additional attributes)", "");
    Some(("description.schema", format!("{line}{}{more}", shown(&message))))
}

/// Removes all elements after the first `BEGINNING` ones.
fn keep_beginning(document: &mut Document) {
    let elements = document.descendants(document.root()).into_iter();
    let elements: Vec<_> = elements.filter(|node| document.element(*node).is_some()).collect();
    elements.into_iter().skip(BEGINNING).for_each(|node| document.detach(node));
}

#[cfg(test)]
mod tests {
    use super::violation;
    use fmi_abi::Standard;

    #[test]
    fn a_violation_names_its_line() {
        let of = |standard: Standard, before: &str, after: &str| {
            let (version, file) = [("2.0", "wagon2.xml"), ("3.0", "wagon3.xml")][standard as usize];
            let text = fmu_test_kit::c_models::read(file);
            assert!(text.contains(before), "{before}");
            violation(standard, version, &text.replacen(before, after, 1)).map(|(_, why)| why)
        };
        let boolean = of(Standard::Fmi2, r#"canGetAndSetFMUstate="true""#, r#"canGetAndSetFMUstate="yes""#);
        assert_eq!(boolean.as_deref(), Some("line 3: 'yes' is not a valid boolean"));
        for (standard, before, after) in [
            (Standard::Fmi2, r#"numberOfEventIndicators="1""#, r#"numberOfEventIndicators="-1""#),
            (Standard::Fmi2, "<Outputs>", "<Exits/><Outputs>"),
            (Standard::Fmi2, r#"<Real start="2"/>"#, r#"<Real start="2" colour="red"/>"#),
            (Standard::Fmi2, r#"<Real start="2"/>"#, r#"<Real start="1,5"/>"#),
            (Standard::Fmi2, "<DefaultExperiment", "<ModelVariables/><DefaultExperiment"),
            (Standard::Fmi2, r#" modelName="wagon""#, ""),
            (Standard::Fmi3, r#"canGetAndSetFMUState="true""#, r#"canGetAndSetFMUState="yes""#),
            (Standard::Fmi3, r#"valueReference="1" "#, ""),
            (Standard::Fmi3, r#"variability="fixed""#, r#"variability="sometimes""#),
            (Standard::Fmi3, r#"causality="local""#, r#"causality="local" initial="guessed""#),
            (Standard::Fmi3, r#"causality="local""#, r#"causality="local" previous="x""#),
        ] {
            assert!(of(standard, before, after).is_some(), "{before}: {after}");
        }
        // The lines of so many violations would take minutes.
        let variable = "<ScalarVariable name='y' valueReference='1' colour='red'><Real/></ScalarVariable>\n";
        let many =
            of(Standard::Fmi2, "<ModelVariables>", &format!("<ModelVariables>\n{}", variable.repeat(5000)));
        let why = "line 8: Attribute 'colour' is not allowed, the first of 5000 violations";
        assert_eq!(many.as_deref(), Some(why));
    }
}

//! Compares model descriptions with the XML schemas of the standard.

use crate::rules::Observation;
use fmi_abi::{Standard, shown};
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

/// Returns the first violation of the schema in a model description of this `fmiVersion`; the others often follow from it. Later
/// editions of FMI 3 may have more elements, so their descriptions are not compared.
pub fn violation(standard: Standard, version: &str, text: &str) -> Option<Observation> {
    if text.len() > LARGEST || !["2.0", "3.0"].contains(&version) {
        return None;
    }
    let validator = uppsala::parse(schema(standard)).and_then(|schema| XsdValidator::from_schema(&schema));
    // The parser of fmi-abi has accepted the description. This one also limits the depth of its elements.
    let (validator, document) = (validator.ok()?, uppsala::parse(text).ok()?);
    let error = validator.validate(&document).into_iter().next()?;
    let line = error.line.map_or(String::new(), |line| format!("line {line}: "));
    let message = error.message.replace(" (no wildcard permits additional attributes)", "");
    Some(("description.schema", format!("{line}{}", shown(&message))))
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
    }
}

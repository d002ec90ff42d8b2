//! Writes the model structure (section 2.2.8 of FMI 2.0, 2.4.8 of FMI 3.0).

use crate::Standard;
use crate::description::{ModelDescription, Unknown};
use crate::write::Element;

impl ModelDescription {
    pub(super) fn model_structure(&self) -> Element {
        let groups = [
            ("Outputs", "Output", &self.outputs),
            ("Derivatives", "ContinuousStateDerivative", &self.derivatives),
            ("InitialUnknowns", "InitialUnknown", &self.initial_unknowns),
            ("", "EventIndicator", &self.indicators),
        ];
        let element = Element::new("ModelStructure");
        match self.standard {
            Standard::Fmi2 => element.containing(groups.into_iter().filter_map(|(group, _, unknowns)| {
                Element::list(group, unknowns.iter().map(|of| self.unknown("Unknown", "index", of)))
            })),
            Standard::Fmi3 => element.containing(groups.into_iter().flat_map(|(_, name, unknowns)| {
                unknowns.iter().map(move |of| self.unknown(name, "valueReference", of))
            })),
        }
    }

    /// Returns the XML element of an unknown. Empty lists state that it depends on nothing; without a list it depends on everything.
    fn unknown(&self, name: &str, attribute: &str, of: &Unknown) -> Element {
        let number = |index: usize| match self.standard {
            Standard::Fmi2 => (index + 1).to_string(),
            Standard::Fmi3 => self.variables[index].reference.to_string(),
        };
        let dependencies = of.dependencies.as_ref();
        let known =
            dependencies.map(|list| list.iter().map(|index| number(*index)).collect::<Vec<_>>().join(" "));
        let has_kinds = dependencies.is_some_and(|list| list.len() == of.kinds.len());
        let kinds = || of.kinds.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
        Element::new(name)
            .with(attribute, number(of.variable))
            .with_some("dependencies", known)
            .with_some("dependenciesKind", has_kinds.then(kinds))
    }
}

//! Writes model descriptions.

mod definitions;
mod structure;
mod variables;

use super::{LogCategory, ModelDescription, Offer, Variable, offer::FLAGS};
use crate::write::{Element, filled};
use crate::{BaseType, Standard};

impl ModelDescription {
    /// Returns the `modelDescription.xml` that [`parse`](Self::parse) reads as this description. The sizes of arrays are written as numbers,
    /// even where they were read from structural parameters.
    ///
    /// # Errors
    /// Fails if the description has faults or an array of unknown size, because a part of what was read would be lost. Also fails if a
    /// variable or a declared type has a type that the FMI version lacks or that is unknown.
    pub fn to_xml(&self) -> Result<String, String> {
        if let Some((_, why)) = self.faults.first() {
            return Err(format!("a model description with a fault cannot be written: {why}"));
        }
        if let Some(of) = self.variables.iter().find(|of| of.dimensions.is_none()) {
            return Err(format!(
                "a model description with {}, whose size is unknown, cannot be written",
                of.name
            ));
        }
        let is_known =
            |base: Option<BaseType>| base.is_some_and(|base| base.element(self.standard).is_some());
        let is_clock = |of: &Variable| of.base.is_none() && of.clock.is_some();
        let variables = self.variables.iter().filter(|of| !is_known(of.base) && !is_clock(of));
        let types = self.types.iter().filter(|(_, of)| !is_known(of.base));
        if let Some(name) = variables.map(|of| &of.name).chain(types.map(|(name, _)| name)).next() {
            return Err(format!("{name} cannot be written: its type is unknown in {}", self.standard));
        }
        let offers = [
            ("ModelExchange", &self.model_exchange),
            ("CoSimulation", &self.co_simulation),
            ("ScheduledExecution", &self.scheduled_execution),
        ];
        let offers = offers.into_iter().filter_map(|(name, offer)| Some((name, offer.as_ref()?)));
        let children = [
            self.unit_definitions(),
            self.type_definitions(),
            Element::list("LogCategories", self.log_categories.iter().map(log_category)),
            self.default_experiment(),
            Some(self.model_variables()),
            Some(self.model_structure()),
        ];
        let root = self
            .root()
            .containing(offers.map(|(name, offer)| self.offer_element(name, offer)))
            .containing(children.into_iter().flatten());
        root.document().map_err(|error| error.to_string())
    }

    fn root(&self) -> Element {
        let token = match self.standard {
            Standard::Fmi2 => "guid",
            Standard::Fmi3 => "instantiationToken",
        };
        let about = &self.about;
        let indicators = self.event_indicators.filter(|count| *count > 0 || self.model_exchange.is_some());
        Element::new("fmiModelDescription")
            .with("fmiVersion", &self.version)
            .with("modelName", &self.model_name)
            .with(token, &self.token)
            .with_some("description", filled(&about.description))
            .with_some("author", filled(&about.author))
            .with_some("version", filled(&about.version))
            .with_some("copyright", filled(&about.copyright))
            .with_some("license", filled(&about.license))
            .with_some("generationTool", filled(&about.generation_tool))
            .with("variableNamingConvention", if self.structured_names { "structured" } else { "flat" })
            .with_some("numberOfEventIndicators", indicators.filter(|_| self.standard == Standard::Fmi2))
    }

    /// Returns the element of an interface type (sections 3.3.1 and 4.3.1 of FMI 2.0, 2.4.2 of FMI 3.0).
    fn offer_element(&self, name: &str, offer: &Offer) -> Element {
        let mut element = Element::new(name).with("modelIdentifier", &offer.identifier);
        for name in FLAGS {
            element = element.with_some(name, offer.flags.get(name));
            if name == "canInterpolateInputs" {
                element = element.with_some("maxOutputDerivativeOrder", offer.max_output_derivative_order);
            }
        }
        let files = offer.source_files.iter().map(|name| Element::new("File").with("name", name));
        element
            .with_some("fixedInternalStepSize", offer.fixed_internal_step_size)
            .containing(Element::list("SourceFiles", files))
    }

    fn default_experiment(&self) -> Option<Element> {
        let [start, stop, step] = self.default_experiment;
        let element = Element::new("DefaultExperiment")
            .with_some("startTime", start)
            .with_some("stopTime", stop)
            .with_some("tolerance", self.default_tolerance)
            .with_some("stepSize", step);
        (!element.attributes.is_empty()).then_some(element)
    }
}

fn log_category(of: &LogCategory) -> Element {
    Element::new("Category").with("name", &of.name).with_some("description", filled(&of.description))
}

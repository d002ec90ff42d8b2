//! What the model descriptions of all versions have in common.

use crate::changes::Changes;
use crate::definitions::{filled, list};
use crate::structure::Unknown;
use crate::xml::Element;
use fmu_export::{Category, Causality, Exported, Initial, Variability, Variable};

/// The root of the description, with the facts about the model.
pub(crate) fn root<M: Exported>(version: &str, guid: &str, changes: &Changes) -> Element {
    let info = M::INFO;
    // The time of generation would make every build a different file.
    Element::new("fmiModelDescription")
        .with("fmiVersion", version)
        .with("modelName", info.name)
        .with(guid, changes.guid.as_deref().unwrap_or(info.guid))
        .with_some("description", filled(info.description))
        .with_some("author", filled(info.author))
        .with_some("version", filled(info.version))
        .with_some("copyright", filled(info.copyright))
        .with_some("license", filled(info.license))
        .with("generationTool", concat!("fmu-package ", env!("CARGO_PKG_VERSION")))
        .with("variableNamingConvention", if M::ARRAYS { "structured" } else { "flat" })
}

pub(crate) fn log_categories() -> Option<Element> {
    let category = |category: Category| {
        Element::new("Category")
            .with("name", category.name().to_string_lossy())
            .with("description", category.description())
    };
    list("LogCategories", Category::ALL.map(category))
}

pub(crate) fn default_experiment<M: Exported>() -> Element {
    let of = M::INFO.default_experiment;
    Element::new("DefaultExperiment")
        .with("startTime", of.start_time)
        .with("stopTime", of.stop_time)
        .with("tolerance", of.tolerance)
        .with("stepSize", of.step_size)
}

/// The element with what a variable of this name is, whatever its type.
pub(crate) fn with_facts<M>(
    element: Element,
    name: &str,
    variable: &Variable<M>,
    vr: u32,
    tunable_parameters: bool,
) -> Element {
    element
        .with("name", name)
        .with("valueReference", vr)
        .with_some("description", filled(variable.description()))
        .with("causality", causality(variable.causality()))
        .with("variability", variability(variable, tunable_parameters))
        .with_some("initial", variable.initial().map(initial))
}

fn causality(causality: Causality) -> &'static str {
    match causality {
        Causality::Parameter => "parameter",
        Causality::CalculatedParameter => "calculatedParameter",
        Causality::Input => "input",
        Causality::Output => "output",
        Causality::Local => "local",
        Causality::Independent => "independent",
    }
}

/// What follows from tunable parameters is tunable as well.
fn variability<M>(variable: &Variable<M>, tunable_parameters: bool) -> &'static str {
    match (variable.causality(), variable.variability()) {
        (Causality::Parameter | Causality::CalculatedParameter, _) if tunable_parameters => "tunable",
        (_, Variability::Constant) => "constant",
        (_, Variability::Fixed) => "fixed",
        (_, Variability::Tunable) => "tunable",
        (_, Variability::Discrete) => "discrete",
        (_, Variability::Continuous) => "continuous",
    }
}

fn initial(initial: Initial) -> &'static str {
    match initial {
        Initial::Exact => "exact",
        Initial::Approx => "approx",
        Initial::Calculated => "calculated",
    }
}

/// Whether events may change the variable; only importers that integrate need to know.
pub(crate) fn is_reinit<M: Exported>(variable: &Variable<M>) -> Option<bool> {
    (M::MODEL_EXCHANGE.is_some() && variable.is_reinit()).then_some(true)
}

/// The element with what the unknown depends on, given by `place`.
///
/// Empty lists say that it depends on nothing; without a list it would depend on everything.
pub(crate) fn with_dependencies(element: Element, unknown: &Unknown, place: fn(u32) -> u32) -> Element {
    let dependencies: Vec<_> =
        unknown.dependencies.iter().map(|(known, _)| place(*known).to_string()).collect();
    let kinds: Vec<_> = unknown.dependencies.iter().map(|(_, kind)| kind.to_string()).collect();
    element.with("dependencies", dependencies.join(" ")).with("dependenciesKind", kinds.join(" "))
}

//! What the model descriptions of all versions have in common.

use crate::changes::Changes;
use crate::definitions::{filled, list};
use crate::structure::Unknown;
use crate::table::{Table, Variable};
use crate::xml::Element;
use fmi_abi::{Category, Causality, Variability};

/// The root of the description, with the facts about the model.
pub(crate) fn root(table: &Table, version: &str, guid: &str, changes: &Changes) -> Element {
    let info = &table.info;
    // The time of generation would make every build a different file.
    Element::new("fmiModelDescription")
        .with("fmiVersion", version)
        .with("modelName", &info.name)
        .with(guid, changes.guid.as_ref().unwrap_or(&info.guid))
        .with_some("description", filled(&info.description))
        .with_some("author", filled(&info.author))
        .with_some("version", filled(&info.version))
        .with_some("copyright", filled(&info.copyright))
        .with_some("license", filled(&info.license))
        .with("generationTool", concat!("fmu-package ", env!("CARGO_PKG_VERSION")))
        .with("variableNamingConvention", if table.arrays { "structured" } else { "flat" })
}

pub(crate) fn log_categories() -> Option<Element> {
    let category = |category: Category| {
        Element::new("Category")
            .with("name", category.name().to_string_lossy())
            .with("description", category.description())
    };
    list("LogCategories", Category::ALL.map(category))
}

pub(crate) fn default_experiment(table: &Table) -> Element {
    Element::new("DefaultExperiment")
        .with("startTime", table.info.start_time)
        .with("stopTime", table.info.stop_time)
        .with("tolerance", table.info.tolerance)
        .with("stepSize", table.info.step_size)
}

/// The element with what a variable of this name is, whatever its type.
pub(crate) fn with_facts(
    element: Element,
    name: &str,
    variable: &Variable,
    vr: u32,
    tunable_parameters: bool,
) -> Element {
    // What follows from tunable parameters is tunable as well.
    let variability = match variable.causality {
        Causality::Parameter | Causality::CalculatedParameter if tunable_parameters => Variability::Tunable,
        _ => variable.variability,
    };
    element
        .with("name", name)
        .with("valueReference", vr)
        .with_some("description", filled(&variable.description))
        .with("causality", variable.causality)
        .with("variability", variability)
        .with_some("initial", variable.initial)
}

/// Whether events may change the variable; only importers that integrate need to know.
pub(crate) fn is_reinit(table: &Table, variable: &Variable) -> Option<bool> {
    (table.model_exchange.is_some() && variable.reinit).then_some(true)
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

//! The model description (section 2.2).

use crate::changes::Changes;
use crate::check::check;
use crate::definitions::{filled, list, type_definitions, unit_definitions, with_attributes};
use crate::structure::{ModelStructure, Unknown};
use crate::xml::Element;
use anyhow::Result;
use fmu_export::{Category, Causality, Exported, Initial, Interface, Value, Variability, Variable};

/// The text of `modelDescription.xml` for a model.
///
/// # Errors
/// When the model contradicts itself (two variables of one name, an empty range, a start value outside of it or other
/// than through the other interface type, a dependency that it has not declared), or `changes` has a start value that
/// is impossible, or is for no variable that has one.
pub fn describe<M: Exported>(changes: &Changes) -> Result<String> {
    let starts = check::<M>(changes)?;
    let structure = ModelStructure::of::<M>(changes.tunable_parameters)?;
    let types: Vec<_> = M::TABLE.iter().map(Variable::of).collect();
    let names: Vec<_> = M::TABLE.iter().map(Variable::name).collect();
    let variables = M::TABLE.iter().zip(starts).zip(0..);
    let variables = variables.map(|((variable, start), vr)| scalar_variable(variable, vr, start, changes));

    let info = M::INFO;
    let indicators = M::MODEL_EXCHANGE.map(|offer| offer.indicators);
    // The time of generation would make every build a different file.
    let root = Element::new("fmiModelDescription")
        .with("fmiVersion", "2.0")
        .with("modelName", info.name)
        .with("guid", changes.guid.as_deref().unwrap_or(info.guid))
        .with_some("description", filled(info.description))
        .with_some("author", filled(info.author))
        .with_some("version", filled(info.version))
        .with_some("copyright", filled(info.copyright))
        .with_some("license", filled(info.license))
        .with("generationTool", concat!("fmu-package ", env!("CARGO_PKG_VERSION")))
        .with("variableNamingConvention", "flat")
        .with_some("numberOfEventIndicators", indicators);
    let children = [
        M::MODEL_EXCHANGE.map(|_| interface::<M>(Interface::ModelExchange)),
        M::CO_SIMULATION.map(|_| interface::<M>(Interface::CoSimulation)),
        unit_definitions(&types)?,
        type_definitions(&types, &names)?,
        list("LogCategories", Category::ALL.map(log_category)),
        Some(default_experiment::<M>()),
        Some(Element::new("ModelVariables").containing(variables)),
        Some(model_structure(&structure)),
    ];
    root.containing(children.into_iter().flatten()).document()
}

/// The element of an interface type, with what the FMU can do through it (sections 3.3.1 and 4.3.1).
fn interface<M: Exported>(interface: Interface) -> Element {
    let element = match interface {
        Interface::ModelExchange => {
            let told = M::MODEL_EXCHANGE.is_some_and(|offer| offer.step_completed);
            Element::new("ModelExchange")
                .with("modelIdentifier", M::INFO.identifier)
                .with("completedIntegratorStepNotNeeded", !told)
        }
        Interface::CoSimulation => {
            let variable_step_size = M::CO_SIMULATION.is_some_and(|offer| offer.variable_step_size);
            Element::new("CoSimulation")
                .with("modelIdentifier", M::INFO.identifier)
                .with("canHandleVariableCommunicationStepSize", variable_step_size)
                .with("canInterpolateInputs", M::INPUT_DERIVATIVES)
                .with("maxOutputDerivativeOrder", M::OUTPUT_DERIVATIVES)
        }
    };
    element
        .with("canNotUseMemoryManagementFunctions", true)
        .with("canGetAndSetFMUstate", true)
        .with("canSerializeFMUstate", true)
        .with("providesDirectionalDerivative", M::PARTIALS)
}

fn log_category(category: Category) -> Element {
    Element::new("Category")
        .with("name", category.name().to_string_lossy())
        .with("description", category.description())
}

fn default_experiment<M: Exported>() -> Element {
    let of = M::INFO.default_experiment;
    Element::new("DefaultExperiment")
        .with("startTime", of.start_time)
        .with("stopTime", of.stop_time)
        .with("tolerance", of.tolerance)
        .with("stepSize", of.step_size)
}

/// Many importers never look types up: what a type says is repeated at the variable.
fn scalar_variable<M: Exported>(
    variable: &Variable<M>,
    vr: u32,
    start: Option<Value>,
    changes: &Changes,
) -> Element {
    let of = variable.of();
    let reinit = M::MODEL_EXCHANGE.is_some() && variable.is_reinit();
    let value = Element::new(of.base().to_string())
        .with_some("declaredType", filled(of.name))
        .with_some("start", start)
        .with_some("derivative", variable.differentiates().map(index))
        .with_some("reinit", reinit.then_some(true));
    Element::new("ScalarVariable")
        .with("name", variable.name())
        .with("valueReference", vr)
        .with_some("description", filled(variable.description()))
        .with("causality", causality(variable.causality()))
        .with("variability", variability(variable, changes.tunable_parameters))
        .with_some("initial", variable.initial().map(initial))
        .containing([with_attributes(value, of)])
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

/// The place in `ModelVariables`, which counts from 1.
fn index(vr: u32) -> u32 {
    vr + 1
}

fn model_structure(structure: &ModelStructure) -> Element {
    let lists = [
        ("Outputs", &structure.outputs),
        ("Derivatives", &structure.derivatives),
        ("InitialUnknowns", &structure.initial_unknowns),
    ];
    let lists = lists.into_iter().filter_map(|(name, unknowns)| list(name, unknowns.iter().map(unknown)));
    Element::new("ModelStructure").containing(lists)
}

/// Empty lists say that it depends on nothing; without a list it would depend on everything (section 2.2.8).
fn unknown(unknown: &Unknown) -> Element {
    let dependencies: Vec<_> =
        unknown.dependencies.iter().map(|(known, _)| index(*known).to_string()).collect();
    let kinds: Vec<_> = unknown.dependencies.iter().map(|(_, kind)| kind.to_string()).collect();
    Element::new("Unknown")
        .with("index", index(unknown.vr))
        .with("dependencies", dependencies.join(" "))
        .with("dependenciesKind", kinds.join(" "))
}

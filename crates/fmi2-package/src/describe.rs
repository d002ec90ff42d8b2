//! Builds the model description (section 2.2).

use crate::check::{check_changes, check_info, check_starts, has_start};
use crate::structure::{Dependency, ModelStructure};
use crate::types::{type_definitions, type_name, unit_definitions};
use crate::variant::{Start, Variant};
use crate::xml;
use anyhow::Result;
use fmi_schema::fmi2::{
    self, Boolean, Category, DefaultExperiment, Derivatives, Fmi2ModelDescription, Fmi2VariableDependency,
    InitialUnknowns, Integer, LogCategories, ModelVariables, Outputs, Real, ScalarVariable,
    ScalarVariableElement,
};
use fmi2_export::{Causality, Initial, Model, ModelInfo, Variability, Variable};

/// What differs from the model as it was compiled.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Another guid.
    pub guid: Option<String>,
    /// Other start values, by variable name.
    pub start: Vec<(String, Start)>,
    /// Parameters are `tunable` instead of `fixed`.
    pub tunable_parameters: bool,
}

impl Changes {
    /// The other start value of a variable, if it has one.
    pub(crate) fn start_of(&self, variable: &Variable) -> Option<Start> {
        self.start.iter().find(|(name, _)| name == variable.name()).map(|(_, start)| *start)
    }
}

impl From<&Variant> for Changes {
    fn from(variant: &Variant) -> Self {
        Self { guid: Some(variant.guid()), start: variant.start.clone(), tunable_parameters: variant.tunable }
    }
}

/// The text of `modelDescription.xml` for a model.
///
/// # Errors
/// When the model contradicts itself (two variables of one name, a state without derivative, an empty range,
/// a start value outside of it or other than the table's, a dependency that it has not declared), or `changes`
/// has a start value that is impossible, or is for no variable that has one.
pub fn describe<M: Model>(changes: &Changes) -> Result<String> {
    let info = M::INFO;
    check_info(&info)?;
    check_starts::<M>()?;
    check_changes::<M>(changes)?;
    let structure = ModelStructure::of::<M>(changes.tunable_parameters)?;
    let variables =
        info.variables.iter().zip(0..).map(|(variable, vr)| scalar_variable(variable, vr, changes));
    let some = |text: &str| (!text.is_empty()).then(|| text.to_owned());
    let description = Fmi2ModelDescription {
        fmi_version: "2.0".into(),
        model_name: info.name.into(),
        guid: changes.guid.clone().unwrap_or_else(|| info.guid.into()),
        description: some(info.description),
        author: some(info.author),
        version: some(info.version),
        copyright: some(info.copyright),
        license: some(info.license),
        generation_tool: some(concat!("fmi2-package ", env!("CARGO_PKG_VERSION"))),
        // The time would make every build a different file.
        generation_date_and_time: None,
        variable_naming_convention: some("flat"),
        number_of_event_indicators: info.model_exchange.map(|_| 0),
        model_exchange: model_exchange(&info),
        co_simulation: co_simulation(&info),
        log_categories: Some(log_categories()),
        default_experiment: Some(DefaultExperiment {
            start_time: Some(info.default_experiment.start_time),
            stop_time: Some(info.default_experiment.stop_time),
            tolerance: Some(info.default_experiment.tolerance),
            step_size: Some(info.default_experiment.step_size),
        }),
        unit_definitions: unit_definitions(info.variables)?,
        type_definitions: type_definitions(info.variables)?,
        model_variables: ModelVariables { variables: variables.collect() },
        model_structure: fmi2::ModelStructure {
            outputs: Outputs { unknowns: unknowns(&structure.outputs) },
            derivatives: Derivatives { unknowns: unknowns(&structure.derivatives) },
            initial_unknowns: InitialUnknowns { unknowns: unknowns(&structure.initial_unknowns) },
        },
    };
    xml::to_text(&description)
}

fn model_exchange(info: &ModelInfo) -> Option<fmi2::ModelExchange> {
    info.model_exchange.map(|offer| fmi2::ModelExchange {
        model_identifier: info.identifier.into(),
        completed_integrator_step_not_needed: Some(true),
        can_not_use_memory_management_functions: Some(true),
        can_get_and_set_fmu_state: Some(true),
        can_serialize_fmu_state: Some(offer.serializes_state),
        provides_directional_derivative: Some(offer.directional_derivative),
        ..fmi2::ModelExchange::default()
    })
}

fn co_simulation(info: &ModelInfo) -> Option<fmi2::CoSimulation> {
    info.co_simulation.map(|offer| fmi2::CoSimulation {
        model_identifier: info.identifier.into(),
        can_handle_variable_communication_step_size: Some(offer.variable_step_size),
        can_interpolate_inputs: Some(offer.interpolates_inputs),
        max_output_derivative_order: Some(offer.max_output_derivative_order),
        can_not_use_memory_management_functions: Some(true),
        can_get_and_set_fmu_state: Some(true),
        can_serialize_fmu_state: Some(offer.serializes_state),
        provides_directional_derivative: Some(offer.directional_derivative),
        ..fmi2::CoSimulation::default()
    })
}

fn log_categories() -> LogCategories {
    let category = |category: fmi2_export::Category| Category {
        name: category.name().to_string_lossy().into_owned(),
        description: Some(category.description().into()),
    };
    LogCategories { categories: fmi2_export::Category::ALL.map(category).into() }
}

fn scalar_variable(variable: &Variable, vr: u32, changes: &Changes) -> ScalarVariable {
    let own = Start::of(&variable.kind());
    let start = has_start(variable).then_some(changes.start_of(variable).unwrap_or(own));
    let declared_type = type_name(&variable.kind());
    ScalarVariable {
        name: variable.name().into(),
        value_reference: vr,
        description: (!variable.description().is_empty()).then(|| variable.description().into()),
        causality: match variable.causality() {
            Causality::Parameter => fmi2::Causality::Parameter,
            Causality::Input => fmi2::Causality::Input,
            Causality::Output => fmi2::Causality::Output,
            // check_info has refused what is unknown.
            _ => fmi2::Causality::Local,
        },
        variability: Some(match (variable.causality(), variable.variability()) {
            (Causality::Parameter, _) if changes.tunable_parameters => fmi2::Variability::Tunable,
            (_, Variability::Fixed) => fmi2::Variability::Fixed,
            (_, Variability::Tunable) => fmi2::Variability::Tunable,
            (_, Variability::Discrete) => fmi2::Variability::Discrete,
            _ => fmi2::Variability::Continuous,
        }),
        initial: variable.initial().map(|initial| match initial {
            Initial::Exact => fmi2::Initial::Exact,
            Initial::Calculated => fmi2::Initial::Calculated,
        }),
        elem: match own {
            Start::Real(_) => ScalarVariableElement::Real(Real {
                declared_type,
                start: start
                    .and_then(|start| if let Start::Real(value) = start { Some(value) } else { None }),
                derivative: variable.differentiates().map(index),
                reinit: None,
            }),
            Start::Integer(_) => ScalarVariableElement::Integer(Integer {
                declared_type,
                start: start
                    .and_then(|start| if let Start::Integer(value) = start { Some(value) } else { None }),
            }),
            Start::Boolean(_) => ScalarVariableElement::Boolean(Boolean {
                declared_type,
                start: start
                    .and_then(|start| if let Start::Boolean(value) = start { Some(value) } else { None }),
            }),
        },
    }
}

/// The place in `ModelVariables`, which counts from 1.
fn index(vr: u32) -> u32 {
    vr + 1
}

fn unknowns(list: &[(u32, Vec<Dependency>)]) -> Vec<Fmi2VariableDependency> {
    list.iter()
        .map(|(unknown, dependencies)| Fmi2VariableDependency {
            index: index(*unknown),
            dependencies: dependencies.iter().map(|dependency| index(dependency.known)).collect(),
            dependencies_kind: dependencies.iter().map(|dependency| dependency.kind.clone()).collect(),
        })
        .collect()
}

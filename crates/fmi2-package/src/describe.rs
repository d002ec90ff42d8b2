//! Builds the model description (section 2.2).

use crate::structure::{Dependency, ModelStructure};
use crate::types::{type_definitions, type_name, unit_definitions};
use crate::variant::{Start, Variant};
use crate::xml;
use anyhow::{Result, bail, ensure};
use fmi_schema::fmi2::{
    self, Boolean, Category, DefaultExperiment, Derivatives, Fmi2ModelDescription, Fmi2VariableDependency,
    InitialUnknowns, Integer, LogCategories, ModelVariables, Outputs, Real, ScalarVariable,
    ScalarVariableElement,
};
use fmi2_export::{Causality, Initial, Interface, Kind, Model, ModelInfo, Variability, Variable};
use std::collections::HashSet;

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

impl From<&Variant> for Changes {
    fn from(variant: &Variant) -> Self {
        Self { guid: Some(variant.guid()), start: variant.start.clone(), tunable_parameters: variant.tunable }
    }
}

/// The text of `modelDescription.xml` for a model.
///
/// # Errors
/// When the model contradicts itself (two variables of one name, a state without derivative, a start value
/// that differs from the table's), or `changes` names a variable that is not there, has another type or
/// has no start value.
pub fn describe<M: Model>(changes: &Changes) -> Result<String> {
    let info = M::INFO;
    ensure!(
        info.co_simulation.is_some() || info.model_exchange.is_some(),
        "{} offers neither Co-Simulation nor Model Exchange",
        info.name
    );
    check_names(info.variables)?;
    check_starts::<M>()?;
    check_changes(info.variables, changes)?;
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

fn check_names(variables: &[Variable]) -> Result<()> {
    let mut names = HashSet::new();
    for Variable { name, .. } in variables {
        ensure!(!name.is_empty(), "a variable has no name");
        ensure!(names.insert(name), "there are two variables with the name {name}");
    }
    Ok(())
}

/// The model must start with what its table says, through each interface type.
fn check_starts<M: Model>() -> Result<()> {
    let offered = [
        M::INFO.co_simulation.map(|_| Interface::CoSimulation),
        M::INFO.model_exchange.map(|_| Interface::ModelExchange),
    ];
    for interface in offered.into_iter().flatten() {
        let model = M::new(interface);
        for (vr, variable) in (0..).zip(M::INFO.variables).filter(|(_, variable)| has_start(variable)) {
            let (table, actual) = match variable.kind {
                Kind::Real { start, .. } => (Start::Real(start), Start::Real(model.real(vr))),
                Kind::Integer { start, .. } => (Start::Integer(start), Start::Integer(model.integer(vr))),
                Kind::Boolean { start } => (Start::Boolean(start), Start::Boolean(model.boolean(vr))),
            };
            let name = variable.name;
            ensure!(
                table == actual,
                "{name} starts with {table:?} in the table and with {actual:?} in the model"
            );
        }
    }
    Ok(())
}

fn check_changes(variables: &[Variable], changes: &Changes) -> Result<()> {
    for (name, start) in &changes.start {
        let Some(variable) = variables.iter().find(|variable| variable.name == name) else {
            bail!("there is no variable {name} to give a start value to");
        };
        ensure!(has_start(variable), "{name} is calculated and has no start value");
        match (variable.kind, start) {
            (Kind::Real { of, .. }, Start::Real(value)) => {
                ensure!(value.is_finite(), "{name} must be a finite number, it is {value}");
                if let Some(min) = of.min {
                    ensure!(*value >= min, "{name} must be >= {min}, it is {value}");
                }
                if let Some(max) = of.max {
                    ensure!(*value <= max, "{name} must be <= {max}, it is {value}");
                }
            }
            (Kind::Integer { min, max, .. }, Start::Integer(value)) => {
                ensure!((min..=max).contains(value), "{name} must be between {min} and {max}, it is {value}");
            }
            (Kind::Boolean { .. }, Start::Boolean(_)) => {}
            (kind, _) => bail!("{name} is {:?}, the start value {start:?} is not", kind.base_type()),
        }
    }
    Ok(())
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
    let changed = changes.start.iter().find(|(name, _)| name == variable.name).map(|(_, start)| *start);
    let start = has_start(variable).then_some(changed.unwrap_or(table_start(&variable.kind)));
    let declared_type = type_name(&variable.kind);
    ScalarVariable {
        name: variable.name.into(),
        value_reference: vr,
        description: (!variable.description.is_empty()).then(|| variable.description.into()),
        causality: match variable.causality {
            Causality::Parameter => fmi2::Causality::Parameter,
            Causality::Input => fmi2::Causality::Input,
            Causality::Output => fmi2::Causality::Output,
            Causality::Local => fmi2::Causality::Local,
        },
        variability: Some(match (variable.causality, variable.variability) {
            (Causality::Parameter, _) if changes.tunable_parameters => fmi2::Variability::Tunable,
            (_, Variability::Fixed) => fmi2::Variability::Fixed,
            (_, Variability::Tunable) => fmi2::Variability::Tunable,
            (_, Variability::Discrete) => fmi2::Variability::Discrete,
            (_, Variability::Continuous) => fmi2::Variability::Continuous,
        }),
        initial: variable.initial.map(|initial| match initial {
            Initial::Exact => fmi2::Initial::Exact,
            Initial::Calculated => fmi2::Initial::Calculated,
        }),
        elem: match variable.kind {
            Kind::Real { .. } => ScalarVariableElement::Real(Real {
                declared_type,
                start: start
                    .and_then(|start| if let Start::Real(value) = start { Some(value) } else { None }),
                derivative: variable.derivative_of.map(index),
                reinit: None,
            }),
            Kind::Integer { .. } => ScalarVariableElement::Integer(Integer {
                declared_type,
                start: start
                    .and_then(|start| if let Start::Integer(value) = start { Some(value) } else { None }),
            }),
            Kind::Boolean { .. } => ScalarVariableElement::Boolean(Boolean {
                declared_type,
                start: start
                    .and_then(|start| if let Start::Boolean(value) = start { Some(value) } else { None }),
            }),
        },
    }
}

/// Inputs and what is `exact` start from a value, what is `calculated` does not (section 2.2.7).
fn has_start(variable: &Variable) -> bool {
    variable.initial != Some(Initial::Calculated)
}

fn table_start(kind: &Kind) -> Start {
    match *kind {
        Kind::Real { start, .. } => Start::Real(start),
        Kind::Integer { start, .. } => Start::Integer(start),
        Kind::Boolean { start } => Start::Boolean(start),
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

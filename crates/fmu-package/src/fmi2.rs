//! The model description of FMI 2.0 (section 2.2).

use crate::changes::Changes;
use crate::definitions::{filled, items, list, type_definitions, unit_definitions, with_attributes};
use crate::describe::{default_experiment, is_reinit, log_categories, root, with_dependencies, with_facts};
use crate::model::LoadedModel;
use crate::structure::{ModelStructure, Unknown, checked_starts};
use crate::table::{CoSimulation, ModelExchange, Table, Type, Variable};
use crate::xml::Element;
use anyhow::{Result, ensure};
use fmi_abi::Value;

/// The text of `modelDescription.xml` for a model as FMU of FMI 2.0.
///
/// # Errors
/// When the model contradicts itself (two variables of one name, an empty range, a start value outside of it or other
/// than through the other interface type, a dependency that it has not declared), or has a variable of a type that FMI 2.0
/// lacks.
pub fn describe(model: &LoadedModel, changes: &Changes) -> Result<String> {
    let table = &model.table;
    for variable in &table.variables {
        let base = variable.base();
        ensure!(
            base.is_in_fmi2(),
            "{} is {base}, which FMI 2.0 lacks; add --fmi 3 to make an FMU for FMI 3.0 only",
            variable.name
        );
    }
    let starts = checked_starts(model)?;
    let structure = ModelStructure::of(model, changes.tunable_parameters)?;
    let types: Vec<_> = table.variables.iter().map(|of| &of.of).collect();
    let names: Vec<_> = table.variables.iter().map(|of| of.name.as_str()).collect();
    let variables = table.variables.iter().zip(starts.iter().cloned()).zip(0..);
    let variables = variables.map(|((of, start), vr)| scalar_variable(table, of, vr, start, changes));

    let indicators = table.model_exchange.as_ref().map(|offer| offer.indicators);
    let root = root(table, "2.0", "guid", changes).with_some("numberOfEventIndicators", indicators);
    let children = [
        table.model_exchange.as_ref().map(|offer| model_exchange(table, offer, changes)),
        table.co_simulation.as_ref().map(|offer| co_simulation(table, offer, changes)),
        unit_definitions(&types)?,
        type_definitions(&types, &names, simple_type)?,
        log_categories(),
        Some(default_experiment(table)),
        Some(Element::new("ModelVariables").containing(variables)),
        Some(model_structure(&structure)),
    ];
    root.containing(children.into_iter().flatten()).document()
}

/// Section 3.3.1.
fn model_exchange(table: &Table, offer: &ModelExchange, changes: &Changes) -> Element {
    let element = Element::new("ModelExchange")
        .with("modelIdentifier", &table.info.identifier)
        .with("completedIntegratorStepNotNeeded", !offer.step_completed);
    with_capabilities(element, table, changes)
}

/// Section 4.3.1.
fn co_simulation(table: &Table, offer: &CoSimulation, changes: &Changes) -> Element {
    let element = Element::new("CoSimulation")
        .with("modelIdentifier", &table.info.identifier)
        .with("canHandleVariableCommunicationStepSize", offer.variable_step_size)
        .with("canInterpolateInputs", table.input_derivatives)
        .with("maxOutputDerivativeOrder", table.output_derivatives);
    with_capabilities(element, table, changes)
}

/// The element of an interface type, with what the FMU can do through each.
fn with_capabilities(element: Element, table: &Table, changes: &Changes) -> Element {
    element
        .with("canNotUseMemoryManagementFunctions", true)
        .with("canGetAndSetFMUstate", true)
        .with("canSerializeFMUstate", true)
        .with("providesDirectionalDerivative", table.partials)
        .containing(list("SourceFiles", changes.source_files.iter().map(source_file)))
}

fn source_file(name: &String) -> Element {
    Element::new("File").with("name", name)
}

fn simple_type(of: &Type) -> Element {
    let element = with_attributes(Element::new(of.base.to_string()), of).containing(items(of));
    Element::new("SimpleType").with("name", &of.name).containing([element])
}

/// Many importers never look types up: what a type says is repeated at the variable.
fn scalar_variable(
    table: &Table,
    variable: &Variable,
    vr: u32,
    start: Option<Value>,
    changes: &Changes,
) -> Element {
    let of = &variable.of;
    let value = Element::new(of.base.to_string())
        .with_some("declaredType", filled(&of.name))
        .with_some("start", start)
        .with_some("derivative", variable.differentiates.map(index))
        .with_some("reinit", is_reinit(table, variable));
    with_facts(Element::new("ScalarVariable"), &variable.name, variable, vr, changes.tunable_parameters)
        .containing([with_attributes(value, of)])
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

fn unknown(unknown: &Unknown) -> Element {
    with_dependencies(Element::new("Unknown").with("index", index(unknown.vr)), unknown, index)
}

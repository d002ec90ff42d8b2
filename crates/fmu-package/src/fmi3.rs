//! The model description of FMI 3.0 (section 2.4).
//!
//! Behind the table come variables that only FMI 3.0 asks for: the time, where it is no variable of the model, and the
//! event indicators. Value references count from 1 in this order, an array as many times as it has elements.

use crate::changes::Changes;
use crate::definitions::{filled, items, type_definitions, unit_definitions, with_attributes, with_range};
use crate::describe::{default_experiment, is_reinit, log_categories, root, with_dependencies, with_facts};
use crate::model::LoadedModel;
use crate::structure::{ModelStructure, Unknown, checked_starts};
use crate::table::{CoSimulation, Table, Type, Variable};
use crate::xml::Element;
use anyhow::{Result, ensure};
use fmi_abi::{BaseType, Standard, Value};

/// The text of `modelDescription.xml` for a model as FMU of FMI 3.0.
///
/// # Errors
/// As [`fmi2::describe`](crate::fmi2::describe), and when a variable has the name of one that FMI 3.0 asks for.
pub fn describe(model: &LoadedModel, changes: &Changes) -> Result<String> {
    let table = &model.table;
    let starts = checked_starts(model)?;
    let structure = ModelStructure::of_fmi3(model, changes.tunable_parameters)?;
    let types: Vec<_> = table.variables.iter().map(|of| &of.of).collect();
    let names: Vec<_> = table.variables.iter().map(|of| of.name_of_array.as_str()).collect();
    let generated = generated(table);
    for name in generated.iter().filter_map(|variable| variable.attribute("name")) {
        ensure!(
            !names.contains(&name),
            "{name} is the name of a variable that FMI 3.0 asks for; declare the time as independent, rename what else \
             has the name"
        );
    }
    let variables = (0..).zip(&table.variables).filter(|(_, of)| of.element == 0).map(|(place, of)| {
        let starts = starts[place as usize..][..of.length()].iter().flatten();
        variable(table, of, reference(place), starts, changes)
    });
    let variables = variables.chain(generated);

    let children = [
        table.model_exchange.as_ref().map(|offer| {
            interface(table, "ModelExchange").with("needsCompletedIntegratorStep", offer.step_completed)
        }),
        table.co_simulation.as_ref().map(|offer| co_simulation(table, offer)),
        unit_definitions(&types)?,
        type_definitions(&types, &names, type_definition)?,
        log_categories(),
        Some(default_experiment(table)),
        Some(Element::new("ModelVariables").containing(variables)),
        Some(model_structure(table, &structure)),
    ];
    let root = root(table, "3.0", "instantiationToken", changes);
    root.containing(children.into_iter().flatten()).document()
}

fn reference(place: u32) -> u32 {
    Standard::Fmi3.reference(place)
}

/// The variables that are not in the table. Every FMU has a time (section 2.4.7.4); indicators that no variable stands
/// for get one of their own (section 2.4.8).
fn generated(table: &Table) -> Vec<Element> {
    let variable = |name: String, place: u32, description: &str, causality: &str| {
        Element::new("Float64")
            .with("name", name)
            .with("valueReference", reference(place))
            .with("description", description)
            .with("causality", causality)
            .with("variability", "continuous")
    };
    let time = table.time();
    let is_behind = table.variable(time).is_none();
    let time = is_behind.then(|| variable("time".to_owned(), time, "Simulation time", "independent"));
    let of_indicator = |number: usize| {
        let name = format!("eventIndicator[{}]", number + 1);
        let description = "An event happens where it changes its sign";
        variable(name, table.indicator(number), description, "local").with("initial", "calculated")
    };
    time.into_iter().chain((0..table.indicators()).map(of_indicator)).collect()
}

/// The element of an interface type, with what the FMU can do through each (section 2.4.2).
fn interface(table: &Table, name: &str) -> Element {
    Element::new(name)
        .with("modelIdentifier", &table.info.identifier)
        .with("canGetAndSetFMUState", true)
        .with("canSerializeFMUState", true)
        .with("providesDirectionalDerivatives", table.partials)
        .with("providesAdjointDerivatives", table.partials)
}

/// Section 4.4.
fn co_simulation(table: &Table, offer: &CoSimulation) -> Element {
    interface(table, "CoSimulation")
        .with("canHandleVariableCommunicationStepSize", offer.variable_step_size)
        .with("maxOutputDerivativeOrder", table.output_derivatives)
        .with("providesIntermediateUpdate", false)
        .with("canReturnEarlyAfterIntermediateUpdate", false)
        .with("mightReturnEarlyFromDoStep", offer.ends_early)
        .with("hasEventMode", offer.event_mode)
}

/// The name of the element of a variable.
fn name(base: BaseType) -> String {
    match base {
        BaseType::Real => "Float64".to_owned(),
        BaseType::Integer => "Int32".to_owned(),
        other => other.to_string(),
    }
}

fn type_definition(of: &Type) -> Element {
    let element = Element::new(format!("{}Type", name(of.base))).with("name", &of.name);
    // FMPy 0.3 does not read a BinaryType that says more; the variables do.
    let element = if of.base == BaseType::Binary { element } else { with_attributes(element, of) };
    element.containing(items(of))
}

/// A scalar, or an array with the start values of its elements.
///
/// Of what the type says, only the range is repeated: fmi-sim 0.7 reads no FMU whose variables have a quantity, a unit or a
/// nominal value themselves, although they may (section 2.4.7.3).
fn variable<'a>(
    table: &Table,
    of: &Variable,
    vr: u32,
    starts: impl Iterator<Item = &'a Value>,
    changes: &Changes,
) -> Element {
    let variable_type = &of.of;
    let starts = starts.map(|start| match start {
        // As short as single precision allows.
        Value::Real(value) if of.base() == BaseType::Float32 => (*value as f32).to_string(),
        other => other.to_string(),
    });
    let is_element = matches!(of.base(), BaseType::String | BaseType::Binary);
    let (children, list): (Vec<_>, Vec<_>) = starts.partition(|_| is_element);
    let start = (!list.is_empty()).then(|| list.join(" "));
    let dimension = |size: &usize| Element::new("Dimension").with("start", size);
    let element = Element::new(name(of.base()));
    let element = with_facts(element, &of.name_of_array, of, vr, changes.tunable_parameters)
        .with_some("declaredType", filled(&variable_type.name))
        .with_some("start", start)
        .with_some("derivative", of.differentiates.map(reference))
        .with_some("reinit", is_reinit(table, of));
    let with = if variable_type.name.is_empty() { with_attributes } else { with_range };
    with(element, variable_type)
        .containing(of.dimensions.iter().map(dimension))
        .containing(children.into_iter().map(|start| Element::new("Start").with("value", start)))
}

fn model_structure(table: &Table, structure: &ModelStructure) -> Element {
    let unknowns = [
        ("Output", &structure.outputs),
        ("ContinuousStateDerivative", &structure.derivatives),
        ("InitialUnknown", &structure.initial_unknowns),
    ];
    let unknowns = unknowns.into_iter().flat_map(|(name, list)| list.iter().map(|of| unknown(name, of)));
    // Without a list of dependencies they depend on everything.
    let of_indicator =
        |number| Element::new("EventIndicator").with("valueReference", reference(table.indicator(number)));
    Element::new("ModelStructure").containing(unknowns).containing((0..table.indicators()).map(of_indicator))
}

fn unknown(name: &str, of: &Unknown) -> Element {
    with_dependencies(Element::new(name).with("valueReference", reference(of.vr)), of, reference)
}

//! The model description of FMI 3.0 (section 2.4).
//!
//! Behind the table come variables that only FMI 3.0 asks for: the [time](independent), where it is no variable of the
//! model, and the [event indicators](indicator). [Value references](reference()) count from 1 in this order, an array as many
//! times as it has elements.

use crate::changes::Changes;
use crate::check::check;
use crate::definitions::{filled, items, type_definitions, unit_definitions, with_attributes, with_range};
use crate::describe::{default_experiment, is_reinit, log_categories, root, with_dependencies, with_facts};
use crate::memory;
use crate::structure::{ModelStructure, Unknown};
use crate::xml::Element;
use anyhow::{Result, ensure};
use fmu_export::fmi3::{independent, indicator, reference};
use fmu_export::{BaseType, Exported, Interface, Type, Value, Variable};

/// The text of `modelDescription.xml` for a model as FMU of FMI 3.0.
///
/// # Errors
/// As [`fmi2::describe`](crate::fmi2::describe), and when a variable has the name of one that FMI 3.0 asks for.
pub fn describe<M: Exported>(changes: &Changes) -> Result<String> {
    let starts = check::<M>(changes)?;
    memory::check::<M>(&starts)?;
    let structure = ModelStructure::of_fmi3::<M>(changes.tunable_parameters)?;
    let types: Vec<_> = M::TABLE.iter().map(Variable::variable_type).collect();
    let names: Vec<_> = M::TABLE.iter().map(Variable::name_of_array).collect();
    let generated = generated::<M>();
    for name in generated.iter().filter_map(|variable| variable.attribute("name")) {
        ensure!(
            !names.contains(&name),
            "{name} is the name of a variable that FMI 3.0 asks for; declare the time as independent, rename what else \
             has the name"
        );
    }
    let variables = (0..).zip(M::TABLE).filter(|(_, of)| of.element() == 0).map(|(place, of)| {
        let starts = starts[place as usize..][..of.length()].iter().flatten();
        variable(of, reference(place), starts, changes)
    });
    let variables = variables.chain(generated);

    let children = [
        M::MODEL_EXCHANGE.map(|_| interface::<M>(Interface::ModelExchange)),
        M::CO_SIMULATION.map(|_| interface::<M>(Interface::CoSimulation)),
        unit_definitions(&types)?,
        type_definitions(&types, &names, type_definition)?,
        log_categories(),
        Some(default_experiment::<M>()),
        Some(Element::new("ModelVariables").containing(variables)),
        Some(model_structure::<M>(&structure)),
    ];
    let root = root::<M>("3.0", "instantiationToken", changes);
    root.containing(children.into_iter().flatten()).document()
}

/// The variables that are not in the table. Every FMU has a time (section 2.4.7.4); indicators that no variable stands
/// for get one of their own (section 2.4.8).
fn generated<M: Exported>() -> Vec<Element> {
    let variable = |name: String, place: u32, description: &str, causality: &str| {
        Element::new("Float64")
            .with("name", name)
            .with("valueReference", reference(place))
            .with("description", description)
            .with("causality", causality)
            .with("variability", "continuous")
    };
    let (time, of) = independent::<M>();
    let time = M::TABLE
        .get(time as usize)
        .is_none()
        .then(|| variable(of.name().to_owned(), time, of.description(), "independent"));
    let of_indicator = |number: usize| {
        let name = format!("eventIndicator[{}]", number + 1);
        let description = "An event happens where it changes its sign";
        variable(name, indicator::<M>(number), description, "local").with("initial", "calculated")
    };
    time.into_iter().chain((0..indicators::<M>()).map(of_indicator)).collect()
}

fn indicators<M: Exported>() -> usize {
    M::MODEL_EXCHANGE.map_or(0, |offer| offer.indicators)
}

/// The element of an interface type, with what the FMU can do through it (sections 2.4.2, 3.4 and 4.4).
fn interface<M: Exported>(interface: Interface) -> Element {
    let element = |name: &str| {
        Element::new(name)
            .with("modelIdentifier", M::INFO.identifier)
            .with("canGetAndSetFMUState", true)
            .with("canSerializeFMUState", true)
            .with("providesDirectionalDerivatives", M::PARTIALS)
            .with("providesAdjointDerivatives", M::PARTIALS)
    };
    match interface {
        Interface::ModelExchange => {
            let told = M::MODEL_EXCHANGE.is_some_and(|offer| offer.step_completed);
            element("ModelExchange").with("needsCompletedIntegratorStep", told)
        }
        Interface::CoSimulation => {
            let variable_step_size = M::CO_SIMULATION.is_some_and(|offer| offer.variable_step_size);
            let events = M::CO_SIMULATION.is_some_and(|offer| offer.has_event_mode());
            let ends_early = M::CO_SIMULATION.is_some_and(|offer| offer.ends_early);
            element("CoSimulation")
                .with("canHandleVariableCommunicationStepSize", variable_step_size)
                .with("maxOutputDerivativeOrder", M::OUTPUT_DERIVATIVES)
                .with("providesIntermediateUpdate", false)
                .with("canReturnEarlyAfterIntermediateUpdate", false)
                .with("mightReturnEarlyFromDoStep", ends_early)
                .with("hasEventMode", events)
        }
    }
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
    let element = Element::new(format!("{}Type", name(of.base()))).with("name", of.name);
    // FMPy 0.3 does not read a BinaryType that says more; the variables do.
    let element = if of.base() == BaseType::Binary { element } else { with_attributes(element, of) };
    element.containing(items(of))
}

/// A scalar, or an array with the start values of its elements.
///
/// Of what the type says, only the range is repeated: fmi-sim 0.7 reads no FMU whose variables have a quantity, a unit or a
/// nominal value themselves, although they may (section 2.4.7.3).
fn variable<'a, M: Exported>(
    of: &Variable<M>,
    vr: u32,
    starts: impl Iterator<Item = &'a Value>,
    changes: &Changes,
) -> Element {
    let variable_type = of.variable_type();
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
    let element = with_facts(element, of.name_of_array(), of, vr, changes.tunable_parameters)
        .with_some("declaredType", filled(variable_type.name))
        .with_some("start", start)
        .with_some("derivative", of.differentiates().map(reference))
        .with_some("reinit", is_reinit(of));
    let with = if variable_type.name.is_empty() { with_attributes } else { with_range };
    with(element, variable_type)
        .containing(of.dimensions().iter().map(dimension))
        .containing(children.into_iter().map(|start| Element::new("Start").with("value", start)))
}

fn model_structure<M: Exported>(structure: &ModelStructure) -> Element {
    let unknowns = [
        ("Output", &structure.outputs),
        ("ContinuousStateDerivative", &structure.derivatives),
        ("InitialUnknown", &structure.initial_unknowns),
    ];
    let unknowns = unknowns.into_iter().flat_map(|(name, list)| list.iter().map(|of| unknown(name, of)));
    // Without a list of dependencies they depend on everything.
    let of_indicator =
        |number| Element::new("EventIndicator").with("valueReference", reference(indicator::<M>(number)));
    Element::new("ModelStructure").containing(unknowns).containing((0..indicators::<M>()).map(of_indicator))
}

fn unknown(name: &str, of: &Unknown) -> Element {
    with_dependencies(Element::new(name).with("valueReference", reference(of.vr)), of, reference)
}

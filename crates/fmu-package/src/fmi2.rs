//! The model description of FMI 2.0 (section 2.2).

use crate::changes::Changes;
use crate::check::check;
use crate::definitions::{filled, items, list, type_definitions, unit_definitions, with_attributes};
use crate::describe::{default_experiment, is_reinit, log_categories, root, with_dependencies, with_facts};
use crate::memory;
use crate::structure::{ModelStructure, Unknown};
use crate::xml::Element;
use anyhow::{Result, ensure};
use fmu_export::{Exported, Interface, Type, Value, Variable};

/// The text of `modelDescription.xml` for a model as FMU of FMI 2.0.
///
/// # Errors
/// When the model contradicts itself (two variables of one name, an empty range, a start value outside of it or other
/// than through the other interface type, a dependency that it has not declared), has a variable of a type that FMI 2.0
/// lacks, or `changes` has a start value that is impossible, or is for no variable that has one.
pub fn describe<M: Exported>(changes: &Changes) -> Result<String> {
    for variable in M::TABLE {
        let base = variable.base();
        ensure!(
            base.is_in_fmi2(),
            "{} is {base}, which FMI 2.0 lacks; add --fmi 3 to make an FMU for FMI 3.0 only",
            variable.name()
        );
    }
    let starts = check::<M>(changes)?;
    memory::check::<M>(&starts)?;
    let structure = ModelStructure::of::<M>(changes.tunable_parameters)?;
    let types: Vec<_> = M::TABLE.iter().map(Variable::variable_type).collect();
    let names: Vec<_> = M::TABLE.iter().map(Variable::name).collect();
    let variables = M::TABLE.iter().zip(starts).zip(0..);
    let variables = variables.map(|((variable, start), vr)| scalar_variable(variable, vr, start, changes));

    let indicators = M::MODEL_EXCHANGE.map(|offer| offer.indicators);
    let root = root::<M>("2.0", "guid", changes).with_some("numberOfEventIndicators", indicators);
    let children = [
        M::MODEL_EXCHANGE.map(|_| interface::<M>(Interface::ModelExchange, changes)),
        M::CO_SIMULATION.map(|_| interface::<M>(Interface::CoSimulation, changes)),
        unit_definitions(&types)?,
        type_definitions(&types, &names, simple_type)?,
        log_categories(),
        Some(default_experiment::<M>()),
        Some(Element::new("ModelVariables").containing(variables)),
        Some(model_structure(&structure)),
    ];
    root.containing(children.into_iter().flatten()).document()
}

/// The element of an interface type, with what the FMU can do through it (sections 3.3.1 and 4.3.1).
fn interface<M: Exported>(interface: Interface, changes: &Changes) -> Element {
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
        .containing(list("SourceFiles", changes.source_files.iter().map(source_file)))
}

fn source_file(name: &String) -> Element {
    Element::new("File").with("name", name)
}

fn simple_type(of: &Type) -> Element {
    let element = with_attributes(Element::new(of.base().to_string()), of).containing(items(of));
    Element::new("SimpleType").with("name", of.name).containing([element])
}

/// Many importers never look types up: what a type says is repeated at the variable.
fn scalar_variable<M: Exported>(
    variable: &Variable<M>,
    vr: u32,
    start: Option<Value>,
    changes: &Changes,
) -> Element {
    let of = variable.variable_type();
    let value = Element::new(of.base().to_string())
        .with_some("declaredType", filled(of.name))
        .with_some("start", start)
        .with_some("derivative", variable.differentiates().map(index))
        .with_some("reinit", is_reinit(variable));
    with_facts(Element::new("ScalarVariable"), variable.name(), variable, vr, changes.tunable_parameters)
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

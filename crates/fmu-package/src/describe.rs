//! The model description (section 2.2 of FMI 2.0, 2.4 of FMI 3.0).
//!
//! The variables of the table are followed by variables that only FMI 3.0 needs: the time, unless the model declares it, and the
//! event indicators. In FMI 3.0, value references count from 1 in this order, and an array occupies as many as it has elements.

use crate::model::LoadedModel;
use crate::structure::{self, ModelStructure, checked_starts};
use crate::table::{CoSimulation, ModelExchange, Table, Variable};
use anyhow::{Result, anyhow, bail, ensure};
use fmi_abi::description::{self, Attributes, LogCategory, ModelDescription, Offer, Type, Unknown};
use fmi_abi::stamp::NO_GUID;
use fmi_abi::{BaseType, Category, Causality, Initial, Standard, Unit, Value, Variability};
use indexmap::IndexMap;
use indexmap::map::Entry;

/// Values of the description that differ from the compiled model.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Whether parameters are `tunable` instead of `fixed`.
    pub tunable_parameters: bool,
    /// The files in the directory `sources` that an importer compiles (FMI 2.0).
    pub source_files: Vec<String>,
}

/// Returns `modelDescription.xml` of the model's FMU for this version of FMI, with the guid [`NO_GUID`].
///
/// # Errors
/// When the model contradicts itself, for example because a range is empty, a start value is outside its range or differs between
/// Co-Simulation and Model Exchange, or a dependency is not declared. Also when FMI 2.0 does not have the type of a variable, or when a
/// variable has the same name as one that is generated for FMI 3.0.
pub fn describe(model: &LoadedModel, fmi: Standard, changes: &Changes) -> Result<String> {
    let table = &model.table;
    let lacking = table.variables.iter().find(|variable| !variable.base.is_in_fmi2());
    if let (Some(variable), Standard::Fmi2) = (lacking, fmi) {
        bail!(
            "{} is {}, which FMI 2.0 lacks; add --fmi 3 to make an FMU for FMI 3.0 only",
            variable.name,
            variable.base
        );
    }
    let try_model = || {
        let starts = checked_starts(model)?;
        Ok((starts, ModelStructure::of(model, fmi, changes.tunable_parameters)?))
    };
    let tried: Result<_> = try_model();
    model.monitor.end();
    // A panic is reported first, because other errors may only be its consequences.
    model.monitor.check()?;
    let (starts, structure) = tried?;
    let description = Description { table, fmi, changes }.of_model(starts, &structure)?;
    description.to_xml().map_err(|why| anyhow!(why))
}

struct Description<'a> {
    table: &'a Table,
    fmi: Standard,
    changes: &'a Changes,
}

impl Description<'_> {
    fn of_model(&self, starts: &[Option<Value>], structure: &ModelStructure) -> Result<ModelDescription> {
        let Self { table, fmi, .. } = *self;
        let is_fmi3 = fmi == Standard::Fmi3;
        let described: Vec<_> =
            (0..).zip(&table.variables).filter(|(_, variable)| !is_fmi3 || variable.element == 0).collect();
        let generated = self.generated();
        // The position of each variable in the description, by its index in the table.
        let indices =
            described.iter().map(|(index, _)| *index).chain(generated.iter().map(|(index, _)| *index));
        let positions: IndexMap<u32, usize> = indices.zip(0..).collect();
        let own =
            described.iter().map(|(index, variable)| self.variable(*index, variable, starts, &positions));
        let mut variables: Vec<_> = own.collect();
        for (_, generated) in generated {
            ensure!(
                !variables.iter().any(|variable| variable.name == generated.name),
                "{} is the name of a variable that FMI 3.0 needs; declare it as independent if it is the time, else rename it",
                generated.name
            );
            variables.push(generated);
        }
        let unknowns = |list: &[structure::Unknown]| list.iter().map(|of| unknown(of, &positions)).collect();
        let indicators = 0..if is_fmi3 { table.indicators() } else { 0 };
        // An event indicator without a list of dependencies depends on everything.
        let indicators = indicators.map(|number| Unknown {
            variable: positions[&table.indicator(number)],
            dependencies: None,
            kinds: Vec::new(),
        });
        let variables_of_table: Vec<_> = described.into_iter().map(|(_, variable)| variable).collect();
        let info = &table.info;
        Ok(ModelDescription {
            standard: fmi,
            version: if is_fmi3 { "3.0" } else { "2.0" }.to_owned(),
            model_name: info.name.clone(),
            token: NO_GUID.to_owned(),
            about: info.about.clone(),
            co_simulation: table.co_simulation.as_ref().map(|offer| self.co_simulation(offer)),
            model_exchange: table.model_exchange.as_ref().map(|offer| self.model_exchange(offer)),
            scheduled_execution: None,
            default_experiment: [info.start_time, info.stop_time, info.step_size].map(Some),
            default_tolerance: Some(info.tolerance),
            outputs: unknowns(&structure.outputs),
            derivatives: unknowns(&structure.derivatives),
            initial_unknowns: unknowns(&structure.initial_unknowns),
            event_indicators: Some(table.indicators()),
            indicators: indicators.collect(),
            log_categories: Category::ALL.map(log_category).to_vec(),
            units: units(&variables_of_table)?,
            types: self.types(&variables_of_table, &variables)?,
            structured_names: table.arrays,
            variables,
            faults: Vec::new(),
        })
    }

    /// The capabilities in Model Exchange (section 3.3.1 of FMI 2.0, 2.4.2 of FMI 3.0).
    fn model_exchange(&self, offer: &ModelExchange) -> Offer {
        self.offer(&match self.fmi {
            Standard::Fmi2 => [("completedIntegratorStepNotNeeded", !offer.step_completed)],
            Standard::Fmi3 => [("needsCompletedIntegratorStep", offer.step_completed)],
        })
    }

    /// The capabilities in Co-Simulation (section 4.3.1 of FMI 2.0, 4.4 of FMI 3.0).
    fn co_simulation(&self, offer: &CoSimulation) -> Offer {
        let step_size = ("canHandleVariableCommunicationStepSize", offer.variable_step_size);
        let flags = match self.fmi {
            Standard::Fmi2 => vec![step_size, ("canInterpolateInputs", self.table.input_derivatives)],
            Standard::Fmi3 => vec![
                step_size,
                ("providesIntermediateUpdate", false),
                ("canReturnEarlyAfterIntermediateUpdate", false),
                ("mightReturnEarlyFromDoStep", offer.ends_early),
                ("hasEventMode", offer.event_mode),
            ],
        };
        let mut offer = self.offer(&flags);
        offer.max_output_derivative_order = Some(self.table.output_derivatives);
        offer
    }

    /// The capabilities in an interface type: those given and those that are the same for both.
    fn offer(&self, flags: &[(&'static str, bool)]) -> Offer {
        let partials = self.table.partials;
        let common = match self.fmi {
            Standard::Fmi2 => [
                ("canNotUseMemoryManagementFunctions", true),
                ("canGetAndSetFMUstate", true),
                ("canSerializeFMUstate", true),
                ("providesDirectionalDerivative", partials),
            ],
            Standard::Fmi3 => [
                ("canGetAndSetFMUState", true),
                ("canSerializeFMUState", true),
                ("providesDirectionalDerivatives", partials),
                ("providesAdjointDerivatives", partials),
            ],
        };
        let mut offer = Offer::new(self.fmi, &*self.table.info.identifier, &[flags, &common].concat());
        if self.fmi == Standard::Fmi2 {
            offer.source_files.clone_from(&self.changes.source_files);
        }
        offer
    }

    /// Returns a variable of the description. In FMI 3.0, the first element of an array gives the whole array, with the start values of
    /// all elements.
    fn variable(
        &self,
        index: u32,
        of: &Variable,
        starts: &[Option<Value>],
        positions: &IndexMap<u32, usize>,
    ) -> description::Variable {
        // A parameter that is calculated from tunable parameters is tunable.
        let variability = match of.causality {
            Causality::Parameter | Causality::CalculatedParameter if self.changes.tunable_parameters => {
                Variability::Tunable
            }
            _ => of.variability,
        };
        let (name, shape) = match self.fmi {
            Standard::Fmi2 => (&of.name, Vec::new()),
            Standard::Fmi3 => (&of.name_of_array, of.shape.clone()),
        };
        let size = shape.iter().product();
        let start = starts[index as usize..][..size].iter().flatten().map(|start| match start {
            // Writes as few digits as single precision needs.
            Value::Real(value) if of.base == BaseType::Float32 => (*value as f32).to_string(),
            other => other.to_string(),
        });
        description::Variable {
            name: name.clone(),
            reference: self.fmi.reference(index),
            variability,
            start: start.collect(),
            dimensions: Some(shape),
            size: Some(size),
            derivative_of: of.derivative_of.map(|state| positions[&(state as u32)]),
            // Only importers that integrate need to know whether events may change the variable.
            reinit: of.reinit && self.table.model_exchange.is_some(),
            ..of.described.clone()
        }
    }

    /// Returns the declared types, in the order of their first use.
    ///
    /// # Errors
    /// When two different types share a name, or a type and a variable do.
    fn types(
        &self,
        of_table: &[&Variable],
        variables: &[description::Variable],
    ) -> Result<IndexMap<String, Type>> {
        let mut types: IndexMap<String, (Type, Option<&Unit>)> = IndexMap::new();
        for of in of_table {
            let Some(name) = &of.declared_type else { continue };
            ensure!(
                !variables.iter().any(|variable| variable.name == *name),
                "{name} is a variable and a type; rename one of them (section 2.2.3 of FMI 2.0)"
            );
            let attributes = match of.base {
                // FMPy 0.3 rejects a BinaryType with attributes, so only the variables have them.
                BaseType::Binary => Attributes::default(),
                _ => of.attributes.clone(),
            };
            let declared =
                Type { base: Some(of.base), attributes, items: of.items.clone(), description: String::new() };
            match types.entry(name.clone()) {
                Entry::Occupied(known) => ensure!(
                    *known.get() == (declared, of.unit.as_ref()),
                    "there are two different types with the name {name}"
                ),
                Entry::Vacant(place) => {
                    place.insert((declared, of.unit.as_ref()));
                }
            }
        }
        Ok(types.into_iter().map(|(name, (declared, _))| (name, declared)).collect())
    }

    /// Returns the variables that FMI 3.0 requires in addition to the table, each with its index: an independent variable (section 2.4.7.4
    /// of FMI 3.0), and a variable for each event indicator (section 2.4.8).
    fn generated(&self) -> Vec<(u32, description::Variable)> {
        let table = self.table;
        if self.fmi == Standard::Fmi2 {
            return Vec::new();
        }
        let time = Some(table.time()).filter(|time| table.variable(*time).is_none());
        let time = time.map(|index| {
            let name = "time".to_owned();
            (index, generated(self.fmi.reference(index), name, "Simulation time", Causality::Independent))
        });
        let indicator = |number: usize| {
            let index = table.indicator(number);
            let name = format!("eventIndicator[{}]", number + 1);
            let description = "An event happens where it changes its sign";
            (index, generated(self.fmi.reference(index), name, description, Causality::Local))
        };
        time.into_iter().chain((0..table.indicators()).map(indicator)).collect()
    }
}

/// Returns a continuous variable, which is calculated unless it is independent.
fn generated(reference: u32, name: String, description: &str, causality: Causality) -> description::Variable {
    description::Variable {
        initial: (causality != Causality::Independent).then_some(Initial::Calculated),
        description: description.to_owned(),
        ..description::Variable::scalar(name, reference, BaseType::Real, causality, Variability::Continuous)
    }
}

/// Returns the units, in the order of their first use.
///
/// # Errors
/// When two different units share a name.
fn units(variables: &[&Variable]) -> Result<IndexMap<String, Unit>> {
    let mut units: IndexMap<String, Unit> = IndexMap::new();
    for of in variables {
        let (Some(name), Some(unit)) = (&of.attributes.unit, &of.unit) else { continue };
        match units.entry(name.to_string()) {
            Entry::Occupied(known) => {
                ensure!(known.get() == unit, "there are two different units with the name {name}");
            }
            Entry::Vacant(place) => {
                place.insert(unit.clone());
            }
        }
    }
    Ok(units)
}

/// Returns an unknown of the description.
fn unknown(of: &structure::Unknown, positions: &IndexMap<u32, usize>) -> Unknown {
    let (known, kinds) = of.dependencies.iter().map(|(known, kind)| (positions[known], *kind)).unzip();
    Unknown { variable: positions[&of.index], dependencies: Some(known), kinds }
}

fn log_category(category: Category) -> LogCategory {
    LogCategory {
        name: category.name().to_string_lossy().into_owned(),
        description: category.description().to_owned(),
    }
}

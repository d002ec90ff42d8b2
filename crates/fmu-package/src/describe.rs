//! The model description (section 2.2 of FMI 2.0, 2.4 of FMI 3.0).
//!
//! The variables of the table are followed by variables that only FMI 3.0 needs: the time, unless the model declares it, and the
//! event indicators. In FMI 3.0, value references count from 1 in this order, and an array occupies as many as it has elements.

use crate::definitions::{
    filled, items, list, type_definitions, unit_definitions, with_attributes, with_range,
};
use crate::model::LoadedModel;
use crate::structure::{ModelStructure, Unknown, checked_starts};
use crate::table::{CoSimulation, ModelExchange, Table, Type, Variable};
use anyhow::{Result, bail, ensure};
use fmi_abi::stamp::NO_GUID;
use fmi_abi::write::Element;
use fmi_abi::{BaseType, Category, Causality, Standard, Value, Variability};

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
    let lacking = table.variables.iter().find(|variable| !variable.base().is_in_fmi2());
    if let (Some(variable), Standard::Fmi2) = (lacking, fmi) {
        bail!(
            "{} is {}, which FMI 2.0 lacks; add --fmi 3 to make an FMU for FMI 3.0 only",
            variable.name,
            variable.base()
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
    Description { table, fmi, changes }.document(starts, &structure)
}

/// Counts from 1 instead of 0, as the indices of FMI 2.0 and the value references of FMI 3.0 do.
fn position(index: u32) -> u32 {
    index + 1
}

struct Description<'a> {
    table: &'a Table,
    fmi: Standard,
    changes: &'a Changes,
}

impl Description<'_> {
    fn document(&self, starts: &[Option<Value>], structure: &ModelStructure) -> Result<String> {
        let Self { table, fmi, .. } = self;
        let is_fmi2 = *fmi == Standard::Fmi2;
        let described: Vec<_> =
            (0..).zip(&table.variables).filter(|(_, variable)| is_fmi2 || variable.element == 0).collect();
        let types: Vec<_> = described.iter().map(|(_, variable)| &variable.variable_type).collect();
        let names: Vec<_> = described.iter().map(|(_, variable)| self.name(variable)).collect();
        let generated = self.generated();
        for name in generated.iter().filter_map(|variable| variable.attribute("name")) {
            ensure!(
                !names.contains(&name),
                "{name} is the name of a variable that FMI 3.0 needs; declare it as independent if it is the time, else rename it"
            );
        }
        let variables = described
            .iter()
            .map(|(index, variable)| self.variable(*index, variable, starts))
            .chain(generated);
        let children = [
            table.model_exchange.as_ref().map(|offer| self.model_exchange(offer)),
            table.co_simulation.as_ref().map(|offer| self.co_simulation(offer)),
            unit_definitions(&types)?,
            type_definitions(&types, &names, |definition| self.type_definition(definition))?,
            list("LogCategories", Category::ALL.map(log_category)),
            Some(default_experiment(table)),
            Some(Element::new("ModelVariables").containing(variables)),
            Some(self.structure(structure)),
        ];
        Ok(self.root().containing(children.into_iter().flatten()).document()?)
    }

    /// Returns the root element with the attributes of the model.
    fn root(&self) -> Element {
        let Self { table: Table { info, arrays, .. }, fmi, .. } = self;
        let (version, guid) = match fmi {
            Standard::Fmi2 => ("2.0", "guid"),
            Standard::Fmi3 => ("3.0", "instantiationToken"),
        };
        let indicators = self.table.model_exchange.as_ref().map(|offer| offer.indicators);
        // There is no generationDateAndTime, because with it every build would give a different file.
        Element::new("fmiModelDescription")
            .with("fmiVersion", version)
            .with("modelName", &info.name)
            .with(guid, NO_GUID)
            .with_some("description", filled(&info.description))
            .with_some("author", filled(&info.author))
            .with_some("version", filled(&info.version))
            .with_some("copyright", filled(&info.copyright))
            .with_some("license", filled(&info.license))
            .with("generationTool", concat!("fmu-package ", env!("CARGO_PKG_VERSION")))
            .with("variableNamingConvention", if *arrays { "structured" } else { "flat" })
            .with_some("numberOfEventIndicators", indicators.filter(|_| *fmi == Standard::Fmi2))
    }

    /// The element of Model Exchange (section 3.3.1 of FMI 2.0, 2.4.2 of FMI 3.0).
    fn model_exchange(&self, offer: &ModelExchange) -> Element {
        let element = self.interface("ModelExchange");
        match self.fmi {
            Standard::Fmi2 => self
                .with_capabilities(element.with("completedIntegratorStepNotNeeded", !offer.step_completed)),
            Standard::Fmi3 => {
                self.with_capabilities(element).with("needsCompletedIntegratorStep", offer.step_completed)
            }
        }
    }

    /// The element of Co-Simulation (section 4.3.1 of FMI 2.0, 4.4 of FMI 3.0).
    fn co_simulation(&self, offer: &CoSimulation) -> Element {
        let element = self.interface("CoSimulation");
        let (step_size, order) = ("canHandleVariableCommunicationStepSize", "maxOutputDerivativeOrder");
        match self.fmi {
            Standard::Fmi2 => self.with_capabilities(
                element
                    .with(step_size, offer.variable_step_size)
                    .with("canInterpolateInputs", self.table.input_derivatives)
                    .with(order, self.table.output_derivatives),
            ),
            Standard::Fmi3 => self
                .with_capabilities(element)
                .with(step_size, offer.variable_step_size)
                .with(order, self.table.output_derivatives)
                .with("providesIntermediateUpdate", false)
                .with("canReturnEarlyAfterIntermediateUpdate", false)
                .with("mightReturnEarlyFromDoStep", offer.ends_early)
                .with("hasEventMode", offer.event_mode),
        }
    }

    fn interface(&self, name: &str) -> Element {
        Element::new(name).with("modelIdentifier", &self.table.info.identifier)
    }

    /// Adds the capabilities that are the same for both interface types.
    fn with_capabilities(&self, element: Element) -> Element {
        let file = |name: &String| Element::new("File").with("name", name);
        match self.fmi {
            Standard::Fmi2 => element
                .with("canNotUseMemoryManagementFunctions", true)
                .with("canGetAndSetFMUstate", true)
                .with("canSerializeFMUstate", true)
                .with("providesDirectionalDerivative", self.table.partials)
                .containing(list("SourceFiles", self.changes.source_files.iter().map(file))),
            Standard::Fmi3 => element
                .with("canGetAndSetFMUState", true)
                .with("canSerializeFMUState", true)
                .with("providesDirectionalDerivatives", self.table.partials)
                .with("providesAdjointDerivatives", self.table.partials),
        }
    }

    /// Returns the name of the XML element for a base type.
    fn name_of_type(&self, base: BaseType) -> String {
        match (base, self.fmi) {
            (BaseType::Real, Standard::Fmi3) => "Float64".to_owned(),
            (BaseType::Integer, Standard::Fmi3) => "Int32".to_owned(),
            _ => base.to_string(),
        }
    }

    fn type_definition(&self, definition: &Type) -> Element {
        let (element, name) = (self.name_of_type(definition.base), &definition.name);
        match self.fmi {
            Standard::Fmi2 => {
                let element = with_attributes(Element::new(element), definition);
                Element::new("SimpleType")
                    .with("name", name)
                    .containing([element.containing(items(definition))])
            }
            Standard::Fmi3 => {
                let element = Element::new(format!("{element}Type")).with("name", name);
                // FMPy 0.3 rejects a BinaryType with more attributes, so the variables have them instead.
                let has_attributes = definition.base != BaseType::Binary;
                let element = if has_attributes { with_attributes(element, definition) } else { element };
                element.containing(items(definition))
            }
        }
    }

    /// Returns the name of a variable. For an element of an array, this is the name of the whole array in FMI 3.0.
    fn name<'v>(&self, variable: &'v Variable) -> &'v str {
        if self.fmi == Standard::Fmi2 { &variable.name } else { &variable.name_of_array }
    }

    /// Returns the XML element of a variable. In FMI 3.0, the first element of an array gives the XML element of the whole array, with
    /// the start values of all elements.
    fn variable(&self, index: u32, variable: &Variable, starts: &[Option<Value>]) -> Element {
        let Self { table, fmi, changes } = self;
        // A parameter that is calculated from tunable parameters is tunable.
        let variability = match variable.causality {
            Causality::Parameter | Causality::CalculatedParameter if changes.tunable_parameters => {
                Variability::Tunable
            }
            _ => variable.variability,
        };
        let with_common_attributes = |name: String| {
            Element::new(name)
                .with("name", self.name(variable))
                .with("valueReference", fmi.reference(index))
                .with_some("description", filled(&variable.description))
                .with("causality", variable.causality)
                .with("variability", variability)
                .with_some("initial", variable.initial)
        };
        // Only importers that integrate need to know whether events may change the variable.
        let reinit = (table.model_exchange.is_some() && variable.reinit).then_some(true);
        let with_value = |element: Element, start: Option<String>| {
            element
                .with_some("declaredType", filled(&variable.variable_type.name))
                .with_some("start", start)
                .with_some("derivative", variable.differentiates.map(position))
                .with_some("reinit", reinit)
        };
        let name = self.name_of_type(variable.base());
        let count = if *fmi == Standard::Fmi2 { 1 } else { variable.length() };
        let starts = starts[index as usize..][..count].iter().flatten();
        if *fmi == Standard::Fmi2 {
            // Many importers do not look types up, so the attributes of the type are repeated.
            let value = with_value(Element::new(name), starts.map(Value::to_string).next());
            return with_common_attributes("ScalarVariable".to_owned())
                .containing([with_attributes(value, &variable.variable_type)]);
        }
        let starts = starts.map(|start| match start {
            // Writes as few digits as single precision needs.
            Value::Real(value) if variable.base() == BaseType::Float32 => (*value as f32).to_string(),
            other => other.to_string(),
        });
        let is_element = matches!(variable.base(), BaseType::String | BaseType::Binary);
        let (children, list): (Vec<_>, Vec<_>) = starts.partition(|_| is_element);
        let element = with_value(with_common_attributes(name), (!list.is_empty()).then(|| list.join(" ")));
        // Only the range of the type is repeated: fmi-sim 0.7 rejects an FMU in which a variable with a declared type also has
        // a quantity, a unit or a nominal value, although section 2.4.7.3 of FMI 3.0 allows that.
        let with = if variable.variable_type.name.is_empty() { with_attributes } else { with_range };
        with(element, &variable.variable_type)
            .containing(variable.dimensions.iter().map(|size| Element::new("Dimension").with("start", size)))
            .containing(children.into_iter().map(|start| Element::new("Start").with("value", start)))
    }

    /// Returns the variables that FMI 3.0 requires in addition to the table: an independent variable (section 2.4.7.4 of FMI 3.0), and a
    /// variable for each event indicator (section 2.4.8).
    fn generated(&self) -> Vec<Element> {
        let table = self.table;
        if self.fmi == Standard::Fmi2 {
            return Vec::new();
        }
        let variable = |name: String, index: u32, description: &str, causality: &str| {
            Element::new("Float64")
                .with("name", name)
                .with("valueReference", self.fmi.reference(index))
                .with("description", description)
                .with("causality", causality)
                .with("variability", "continuous")
        };
        let time = Some(table.time()).filter(|time| table.variable(*time).is_none());
        let time = time.map(|time| variable("time".to_owned(), time, "Simulation time", "independent"));
        let indicator = |number: usize| {
            let name = format!("eventIndicator[{}]", number + 1);
            let description = "An event happens where it changes its sign";
            variable(name, table.indicator(number), description, "local").with("initial", "calculated")
        };
        time.into_iter().chain((0..table.indicators()).map(indicator)).collect()
    }

    fn structure(&self, structure: &ModelStructure) -> Element {
        let lists = [&structure.outputs, &structure.derivatives, &structure.initial_unknowns];
        let element = Element::new("ModelStructure");
        if self.fmi == Standard::Fmi2 {
            let lists = ["Outputs", "Derivatives", "InitialUnknowns"].into_iter().zip(lists);
            return element.containing(lists.filter_map(|(name, unknowns)| {
                list(name, unknowns.iter().map(|unknown| with_dependencies("Unknown", "index", unknown)))
            }));
        }
        let lists = ["Output", "ContinuousStateDerivative", "InitialUnknown"].into_iter().zip(lists);
        let unknowns = lists.flat_map(|(name, unknowns)| {
            unknowns.iter().map(move |unknown| with_dependencies(name, "valueReference", unknown))
        });
        // An event indicator without a list of dependencies depends on everything.
        let indicator = |number| {
            Element::new("EventIndicator").with("valueReference", position(self.table.indicator(number)))
        };
        element.containing(unknowns).containing((0..self.table.indicators()).map(indicator))
    }
}

/// Returns the XML element of an unknown. Empty lists state that it depends on nothing; without a list it would depend on everything.
fn with_dependencies(name: &str, reference: &str, unknown: &Unknown) -> Element {
    let (known, kinds): (Vec<_>, Vec<_>) = unknown
        .dependencies
        .iter()
        .map(|(known, kind)| (position(*known).to_string(), kind.to_string()))
        .unzip();
    Element::new(name)
        .with(reference, position(unknown.index))
        .with("dependencies", known.join(" "))
        .with("dependenciesKind", kinds.join(" "))
}

fn log_category(category: Category) -> Element {
    Element::new("Category")
        .with("name", category.name().to_string_lossy())
        .with("description", category.description())
}

fn default_experiment(table: &Table) -> Element {
    Element::new("DefaultExperiment")
        .with("startTime", table.info.start_time)
        .with("stopTime", table.info.stop_time)
        .with("tolerance", table.info.tolerance)
        .with("stepSize", table.info.step_size)
}

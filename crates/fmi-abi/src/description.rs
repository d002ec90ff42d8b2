//! Reads model descriptions, and accepts faulty ones as far as possible: missing attributes get the defaults of the FMI
//! standard or stay empty, and each [`Fault`] is listed. An attribute whose value cannot be read is such a fault.

use crate::attribute::{Typed, unreadable, value, values};
use crate::{
    BaseType, Causality, DependencyKind, Initial, Interface, Standard, Variability, is_plain_file_name, shown,
};
use roxmltree::Node;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::sync::Arc;

/// Maximum number of values in all arrays together. The size of an array that would exceed it counts as unknown.
pub const MAX_VALUES: usize = 1 << 22;
/// Upper bounds for the memory that a variable and a value in a list take, in bytes.
const VARIABLE: usize = 1000;
const VALUE: usize = 64;
/// Maximum number of faults that are listed for each kind.
const MAX_FAULTS: usize = 100;

/// A variable; an array of FMI 3.0 is one variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name; empty if missing.
    pub name: String,
    /// Value reference.
    pub reference: u32,
    /// Base type; `None` for a clock or an unknown type. Int32 of FMI 3.0 is Integer, Float64 is Real.
    pub base: Option<BaseType>,
    /// Causality; local if it is missing or unknown.
    pub causality: Causality,
    /// Variability; the default of the standard if it is missing or unknown.
    pub variability: Variability,
    /// Whether the description contains the variability.
    pub has_variability: bool,
    /// Source of the first value; the default of the standard, if there is one, if it is missing or unknown.
    pub initial: Option<Initial>,
    /// Start values as strings, as many as the description contains. If an array has only one, it applies to each
    /// element.
    pub start: Vec<String>,
    /// Sizes of the dimensions of an array; empty for a scalar, `None` if a size is unknown or too large.
    pub dimensions: Option<Vec<usize>>,
    /// Number of values: 1 for a scalar. `None` if it is unknown or [too large](Self::is_too_large).
    pub size: Option<usize>,
    /// Whether the array, together with the arrays before it that are not too large, has more than [`MAX_VALUES`]
    /// values.
    pub is_too_large: bool,
    /// Smallest value of the variable or of its declared type, if given.
    pub min: Option<f64>,
    /// Largest value of the variable or of its declared type, if given.
    pub max: Option<f64>,
    /// Nominal value of the variable or of its declared type; 1 if it is missing or not positive.
    pub nominal: f64,
    /// Unit of the variable or of its declared type, if given.
    pub unit: Option<Arc<str>>,
    /// Display unit of the variable or of its declared type, if given.
    pub display_unit: Option<Arc<str>>,
    /// Whether the variable or its declared type is a difference of physical quantities (`relativeQuantity`), whose conversion to a
    /// display unit has no offset (section 2.2.3 of FMI 2.0, 2.4.4 of FMI 3.0).
    pub is_relative: bool,
    /// Name of the declared type, if given.
    pub declared_type: Option<String>,
    /// Index of the variable of which this variable is the time derivative.
    pub derivative_of: Option<usize>,
    /// Whether an event may change the variable, which is a continuous state (attribute `reinit`).
    pub reinit: bool,
    /// Whether the variable is clocked (attribute `clocks`).
    pub clocked: bool,
    /// Whether the variable may be set only once per time instant.
    pub once_per_instant: bool,
    /// Whether the variable is an input clock that the importer must activate at times that follow from its interval: a clock whose
    /// `intervalVariability` is not `triggered` (section 2.2.8.1 of FMI 3.0).
    pub is_periodic: bool,
    /// Description; empty if missing.
    pub description: String,
    /// Further names of the variable (section 2.4.7 of FMI 3.0).
    pub aliases: Vec<Alias>,
}

/// A further name of a variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Alias {
    /// Name; empty if missing.
    pub name: String,
    /// Display unit, if given.
    pub display_unit: Option<Arc<str>>,
    /// Description; empty if missing.
    pub description: String,
}

impl Variable {
    /// Returns the start value of an element. If an array has only one start value, it applies to each element.
    pub fn start_of(&self, element: usize) -> Option<&str> {
        let is_repeated = self.start.len() == 1 && self.size.is_some_and(|size| element < size);
        self.start.get(if is_repeated { 0 } else { element }).map(String::as_str)
    }

    /// Returns the number of start values. If an array has only one start value, it counts once for each element.
    pub fn starts_count(&self) -> usize {
        match (self.size, self.start.len()) {
            (Some(size), 1) => size,
            (_, count) => count,
        }
    }

    /// Returns the start values of all elements as numbers, with 0 and 1 for Booleans, up to the first value that is
    /// not a number.
    pub fn starts(&self) -> Vec<f64> {
        let number = |value: &str| match value {
            "true" => Some(1.0),
            "false" => Some(0.0),
            "INF" => Some(f64::INFINITY),
            "-INF" => Some(f64::NEG_INFINITY),
            other => other.parse().ok(),
        };
        match (&*self.start, self.size) {
            ([one], Some(size)) => number(one).map_or(Vec::new(), |one| vec![one; size]),
            (all, _) => all.iter().map_while(|value| number(value)).collect(),
        }
    }

    /// Subtracts the size of an array from the number of values that remain for all arrays. If too few remain, the
    /// size becomes unknown.
    fn limit(&mut self, remaining: &mut usize) {
        if self.dimensions.as_ref().is_none_or(Vec::is_empty) {
            return;
        }
        match self.size.and_then(|size| remaining.checked_sub(size)) {
            Some(rest) => *remaining = rest,
            None => (self.dimensions, self.size, self.is_too_large) = (None, None, true),
        }
    }

    /// Returns whether an importer may set a value before Initialization Mode: the variable is an input, or its first value is the
    /// start value and it is not constant.
    pub fn is_settable(&self) -> bool {
        let is_exact = self.initial == Some(Initial::Exact) && self.variability != Variability::Constant;
        self.causality == Causality::Input || is_exact
    }

    /// Returns whether the values are floating-point numbers.
    pub fn is_float(&self) -> bool {
        self.base.is_some_and(BaseType::is_float)
    }

    /// Returns whether the values are numbers or Booleans.
    pub fn is_number(&self) -> bool {
        !matches!(self.base, None | Some(BaseType::String | BaseType::Binary))
    }
}

/// An unknown of the model structure.
#[derive(Clone, Debug, PartialEq)]
pub struct Unknown {
    /// Index of the variable.
    pub variable: usize,
    /// Indices of the variables on which the unknown depends; `None` if the attribute is missing.
    pub dependencies: Option<Vec<usize>>,
    /// `dependenciesKind`, in the order of the dependencies; empty if the attribute is missing or has another length.
    pub kinds: Vec<DependencyKind>,
}

/// Capabilities of an FMU for one interface type.
#[derive(Clone, Debug, PartialEq)]
pub struct Offer {
    /// `modelIdentifier`, the name of the library; empty if missing.
    pub identifier: String,
    /// Whether a process may have only one instance.
    pub once_per_process: bool,
    /// Whether the library starts another program, which must be installed.
    pub needs_execution_tool: bool,
    /// Whether steps of Co-Simulation may have different sizes (`canHandleVariableCommunicationStepSize`).
    pub variable_step_size: bool,
    /// Whether the FMU accepts input derivatives (FMI 2.0, `canInterpolateInputs`).
    pub input_derivatives: bool,
    /// Whether the FMU provides directional derivatives (`providesDirectionalDerivative`, in FMI 3.0 with a final s).
    pub directional_derivatives: bool,
    /// Whether the state of an instance can be saved and restored (`canGetAndSetFMUstate`, in FMI 3.0
    /// `canGetAndSetFMUState`).
    pub saves_states: bool,
    /// Whether saved states can be serialized (`canSerializeFMUstate`).
    pub serializes_states: bool,
    /// Names of the attributes that are true.
    flags: BTreeSet<&'static str>,
    fixed_internal_step_size: Option<f64>,
}

/// The Boolean attributes of interface types in FMI 2.0 and 3.0.
const FLAGS: [&str; 21] = [
    "canBeInstantiatedOnlyOncePerProcess",
    "canGetAndSetFMUState",
    "canGetAndSetFMUstate",
    "canHandleVariableCommunicationStepSize",
    "canInterpolateInputs",
    "canNotUseMemoryManagementFunctions",
    "canReturnEarlyAfterIntermediateUpdate",
    "canRunAsynchronuously",
    "canSerializeFMUState",
    "canSerializeFMUstate",
    "completedIntegratorStepNotNeeded",
    "hasEventMode",
    "mightReturnEarlyFromDoStep",
    "needsCompletedIntegratorStep",
    "needsExecutionTool",
    "providesAdjointDerivatives",
    "providesDirectionalDerivative",
    "providesDirectionalDerivatives",
    "providesEvaluateDiscreteStates",
    "providesIntermediateUpdate",
    "providesPerElementDependencies",
];

impl Offer {
    fn read(node: Node, standard: Standard, faults: &Faults) -> Self {
        let is_true = |name: &&str| faults.read(node, name) == Some(true);
        let flags: BTreeSet<&'static str> = FLAGS.into_iter().filter(is_true).collect();
        let is_either = |names: &[&str]| names.iter().any(|name| flags.contains(name));
        Self {
            identifier: attribute_or_empty(node, "modelIdentifier"),
            once_per_process: is_either(&["canBeInstantiatedOnlyOncePerProcess"]),
            needs_execution_tool: is_either(&["needsExecutionTool"]),
            variable_step_size: is_either(&["canHandleVariableCommunicationStepSize"]),
            input_derivatives: standard == Standard::Fmi2 && is_either(&["canInterpolateInputs"]),
            directional_derivatives: is_either(&[
                "providesDirectionalDerivative",
                "providesDirectionalDerivatives",
            ]),
            saves_states: is_either(&["canGetAndSetFMUstate", "canGetAndSetFMUState"]),
            serializes_states: is_either(&["canSerializeFMUstate", "canSerializeFMUState"]),
            flags,
            fixed_internal_step_size: faults.read(node, "fixedInternalStepSize"),
        }
    }

    /// Fails if the identifier is not safe as the name of a file, because the library is named after it. A library can be loaded even
    /// if the identifier is not an identifier of C, as FMI requires. A missing identifier passes, because it is listed as a fault.
    fn check(&self) -> Result<(), String> {
        if self.identifier.is_empty() || is_plain_file_name(&self.identifier) {
            return Ok(());
        }
        Err(format!(
            "modelDescription.xml: modelIdentifier \"{}\" is not the name of a library, such as Model_1",
            shown(&self.identifier)
        ))
    }

    /// Returns whether at least one of these attributes is true.
    pub fn can(&self, names: &[&str]) -> bool {
        names.iter().any(|name| self.flags.contains(name))
    }

    /// Returns the step size to which communication points should be aligned (`fixedInternalStepSize`, FMI 3.0), if it is a
    /// positive and finite number.
    pub fn fixed_internal_step_size(&self) -> Option<f64> {
        self.fixed_internal_step_size.filter(|size| *size > 0.0 && size.is_finite())
    }
}

/// Kinds of faults in a model description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The name of the model, its guid or instantiation token, a `modelIdentifier`, or the value of a `Start` is missing.
    Attribute,
    /// A variable has no value reference.
    Reference,
    /// A variable has no type, or an unknown one.
    Type,
    /// `ModelStructure` or the attribute `derivative` refers to a variable that does not exist, or does not fit together.
    Structure,
    /// The value of an attribute is not of the attribute's type. The attribute counts as missing.
    Value,
}

/// The faults that have been found so far, at most [`MAX_FAULTS`] of each kind.
#[derive(Default)]
struct Faults(RefCell<Vec<(Fault, String)>>);

impl Faults {
    /// Adds a fault. The message is only made if the fault is listed.
    fn add(&self, fault: Fault, why: impl FnOnce() -> String) {
        let mut all = self.0.borrow_mut();
        if all.iter().filter(|(of, _)| *of == fault).count() < MAX_FAULTS {
            all.push((fault, why()));
        }
    }

    /// Reads an attribute. If its value cannot be read, this is a fault, and the attribute counts as missing.
    fn read<T: Typed>(&self, node: Node, name: &str) -> Option<T> {
        value(node, name)?.map_err(|text| self.add(Fault::Value, || unreadable::<T>(node, name, text))).ok()
    }

    /// Reads an attribute that is a list. If one of its values cannot be read, this is a fault, and the attribute counts as missing.
    fn read_list<T: Typed>(&self, node: Node, name: &str) -> Option<Vec<T>> {
        values(node, name)?.map_err(|text| self.add(Fault::Value, || unreadable::<T>(node, name, text))).ok()
    }
}

/// Content of a model description.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelDescription {
    /// FMI version.
    pub standard: Standard,
    /// `fmiVersion` as written.
    pub version: String,
    /// Name of the model.
    pub model_name: String,
    /// `guid` of FMI 2.0, `instantiationToken` of FMI 3.0.
    pub token: String,
    /// Capabilities in Co-Simulation, if the FMU supports it.
    pub co_simulation: Option<Offer>,
    /// Capabilities in Model Exchange, if the FMU supports it.
    pub model_exchange: Option<Offer>,
    /// Whether the FMU supports Scheduled Execution.
    pub scheduled_execution: bool,
    /// Start time, stop time and step size of the default experiment, s, if given.
    pub default_experiment: [Option<f64>; 3],
    /// Relative tolerance of the default experiment, if given.
    pub default_tolerance: Option<f64>,
    /// Variables, in the order of the file.
    pub variables: Vec<Variable>,
    /// Outputs of the model structure.
    pub outputs: Vec<Unknown>,
    /// Derivatives of the continuous states.
    pub derivatives: Vec<Unknown>,
    /// Unknowns of the initialization.
    pub initial_unknowns: Vec<Unknown>,
    /// Number of event indicators; `None` if it is unknown.
    pub event_indicators: Option<usize>,
    /// Names of the log categories.
    pub log_categories: Vec<String>,
    /// Units by name, each with the exponents of SI base units, factor and offset as written in the file.
    pub units: BTreeMap<String, Vec<(String, String)>>,
    /// Display units by the name of the unit, each with name, factor and offset.
    pub display_units: BTreeMap<String, Vec<(String, f64, f64)>>,
    /// Names of the declared types.
    pub types: BTreeSet<String>,
    /// Enumerations by name, each with the names and numbers of its items.
    pub enumerations: BTreeMap<String, Vec<(String, i64)>>,
    /// Faults, each with a message.
    pub faults: Vec<(Fault, String)>,
}

impl ModelDescription {
    /// Reads a `modelDescription.xml`.
    ///
    /// # Errors
    /// Fails if the string is not well-formed XML or would take too much memory or time, if the FMI version is not
    /// supported, and if `modelIdentifier` is not safe as the name of a file. The message names the reason.
    pub fn parse(xml: &str) -> Result<Self, String> {
        Self::parse_configured(xml, &HashMap::new())
    }

    /// Reads a `modelDescription.xml` for an instance in which structural parameters have other values than their start
    /// values. `structure` maps their value references to these values, which determine the sizes of arrays (section
    /// 2.4.7.2 of FMI 3.0).
    ///
    /// # Errors
    /// Fails for the same reasons as [`parse`](Self::parse).
    pub fn parse_configured(xml: &str, structure: &HashMap<u32, usize>) -> Result<Self, String> {
        let document = crate::xml::parse(xml, "modelDescription.xml")?;
        let root = document.root_element();
        let version = attribute_or_empty(root, "fmiVersion");
        let (standard, token) = match version.as_str() {
            "2.0" => (Standard::Fmi2, "guid"),
            version if version.starts_with("3.") => (Standard::Fmi3, "instantiationToken"),
            "1.0" => {
                let why = "its fmiVersion is \"1.0\"; FMI 2.0 and 3.0 are supported here, and FMPy and PyFMI run FMI 1.0";
                return Err(why.to_owned());
            }
            other => {
                return Err(format!("its fmiVersion is \"{}\"; FMI 2.0 and 3.0 are supported", shown(other)));
            }
        };
        let faults = Faults::default();
        let needs = |node: Node, name: &str| {
            if node.attribute(name).is_none() {
                faults.add(Fault::Attribute, || format!("{} lacks {name}", node.tag_name().name()));
            }
        };
        needs(root, "modelName");
        needs(root, token);
        let offer = |name: &str| {
            let node = child(root, name)?;
            needs(node, "modelIdentifier");
            Some(Offer::read(node, standard, &faults))
        };
        let (co_simulation, model_exchange) = (offer("CoSimulation"), offer("ModelExchange"));
        [&co_simulation, &model_exchange].into_iter().flatten().try_for_each(Offer::check)?;
        let experiment = child(root, "DefaultExperiment");
        let time = |name: &str| -> Option<f64> { faults.read(experiment?, name) };
        let named = |list| elements(root, list).filter_map(|node| Some(node.attribute("name")?.to_owned()));
        let (variables, positions) = variables(root, standard, structure, &faults)?;
        let units = || elements(root, "UnitDefinitions");
        let types = || elements(root, "TypeDefinitions");
        let mut description = Self {
            standard,
            version,
            model_name: attribute_or_empty(root, "modelName"),
            token: attribute_or_empty(root, token),
            co_simulation,
            model_exchange,
            scheduled_execution: child(root, "ScheduledExecution").is_some(),
            default_experiment: ["startTime", "stopTime", "stepSize"].map(time),
            default_tolerance: time("tolerance")
                .filter(|tolerance| tolerance.is_finite() && *tolerance > 0.0),
            variables,
            outputs: Vec::new(),
            derivatives: Vec::new(),
            initial_unknowns: Vec::new(),
            event_indicators: None,
            log_categories: named("LogCategories").collect(),
            units: units().map(|node| unit(node, &faults)).collect(),
            display_units: units().map(|node| display_units(node, &faults)).collect(),
            types: named("TypeDefinitions").collect(),
            enumerations: types().filter_map(|node| enumeration(node, &faults)).collect(),
            faults: Vec::new(),
        };
        description.structure(root, &positions, &faults);
        description.faults = faults.0.into_inner();
        Ok(description)
    }

    /// Returns the capabilities for this interface type, if the FMU supports it.
    pub fn offer(&self, interface: Interface) -> Option<&Offer> {
        match interface {
            Interface::CoSimulation => self.co_simulation.as_ref(),
            Interface::ModelExchange => self.model_exchange.as_ref(),
        }
    }

    /// Reads the model structure, which refers to variables by position in FMI 2.0, counted from 1, and by value
    /// reference in FMI 3.0.
    fn structure(&mut self, root: Node, positions: &Positions, faults: &Faults) {
        let by_reference: HashMap<u32, usize> =
            self.variables.iter().enumerate().rev().map(|(index, of)| (of.reference, index)).collect();
        let standard = self.standard;
        let find = |number: u32| {
            let found = match standard {
                Standard::Fmi2 => positions.find(number),
                Standard::Fmi3 => by_reference.get(&number).copied().map(Some),
            };
            if found.is_none() {
                let why = || format!("ModelStructure refers to {number}, which does not exist");
                faults.add(Fault::Structure, why);
            }
            found.flatten()
        };
        let attribute = if standard == Standard::Fmi2 { "index" } else { "valueReference" };
        let list = |group: &str, of_fmi3: &str| -> Vec<Unknown> {
            let Some(structure) = child(root, "ModelStructure") else { return Vec::new() };
            // Only the first entry of a variable counts.
            let mut known = HashSet::new();
            let new = |node| unknown(node, attribute, &find, faults);
            let mut new = |node| new(node).filter(|unknown: &Unknown| known.insert(unknown.variable));
            match standard {
                Standard::Fmi2 => elements(structure, group).filter_map(&mut new).collect(),
                Standard::Fmi3 => {
                    let nodes = structure.children().filter(|node| node.has_tag_name(of_fmi3));
                    nodes.filter_map(&mut new).collect()
                }
            }
        };
        self.outputs = list("Outputs", "Output");
        self.derivatives = list("Derivatives", "ContinuousStateDerivative");
        self.initial_unknowns = list("InitialUnknowns", "InitialUnknown");
        let indicators = list("", "EventIndicator");
        self.event_indicators = match standard {
            Standard::Fmi2 if root.has_attribute("numberOfEventIndicators") => {
                faults.read(root, "numberOfEventIndicators")
            }
            Standard::Fmi2 => Some(0),
            Standard::Fmi3 => indicators.iter().try_fold(0_usize, |count, unknown| {
                count.checked_add(self.variables[unknown.variable].size?)
            }),
        };
    }
}

/// Reads an unknown. `find` returns the index of a variable, or `None` if it does not exist or cannot be read. If one of the dependencies
/// cannot be read, the unknown may depend on everything, as if the attribute were missing.
fn unknown(
    node: Node,
    attribute: &str,
    find: &impl Fn(u32) -> Option<usize>,
    faults: &Faults,
) -> Option<Unknown> {
    let kind = node.tag_name().name();
    if node.attribute(attribute).is_none() {
        faults.add(Fault::Structure, || format!("ModelStructure has an {kind} without {attribute}"));
    }
    let variable = find(faults.read(node, attribute)?)?;
    let dependencies: Option<Vec<u32>> = faults.read_list(node, "dependencies");
    let dependencies =
        dependencies.and_then(|list| list.into_iter().map(find).collect::<Option<Vec<usize>>>());
    let mut kinds: Vec<DependencyKind> = faults.read_list(node, "dependenciesKind").unwrap_or_default();
    if dependencies.as_ref().is_none_or(|list| list.len() != kinds.len()) {
        kinds.clear();
    }
    Some(Unknown { variable, dependencies, kinds })
}

/// The index of each variable of the file among the variables that could be read, in the order of the file.
struct Positions(Vec<Option<usize>>);

impl Positions {
    /// Returns the index of the variable at a position, which counts from 1. The outer `None` means that the file has no such variable,
    /// the inner one that it could not be read.
    fn find(&self, number: u32) -> Option<Option<usize>> {
        self.0.get((number as usize).checked_sub(1)?).copied()
    }
}

/// Reads the variables. Variables without a value reference or a type are left out.
fn variables(
    root: Node,
    standard: Standard,
    structure: &HashMap<u32, usize>,
    faults: &Faults,
) -> Result<(Vec<Variable>, Positions), String> {
    let types: HashMap<&str, Declared> = elements(root, "TypeDefinitions")
        .filter_map(|node| Some((node.attribute("name")?, Declared::read(node, faults))))
        .collect();
    let nodes: Vec<Node> = elements(root, "ModelVariables").collect();
    reserve(root, &nodes)?;
    let quiet = |node: Node, name: &str| value(node, name).and_then(Result::ok);
    // Start values of structural parameters, which are sizes.
    let starts: HashMap<u32, Option<usize>> = nodes
        .iter()
        .rev()
        .filter_map(|node| {
            Some((u32::try_from(quiet(*node, "valueReference")?).ok()?, quiet(*node, "start")))
        })
        .collect();
    let (mut found, mut positions) = (Vec::new(), Positions(Vec::with_capacity(nodes.len())));
    let mut derivatives = Vec::new();
    let mut remaining = MAX_VALUES;
    for node in &nodes {
        let named = || shown(node.attribute("name").unwrap_or_default());
        let is_type = |child: &Node| base_of(standard, child.tag_name().name()).is_some();
        let of_type = match standard {
            Standard::Fmi2 => node.children().find(is_type),
            Standard::Fmi3 => Some(*node).filter(|node| is_type(node) || node.has_tag_name("Clock")),
        };
        let reference: Option<u32> = faults.read(*node, "valueReference");
        if node.attribute("valueReference").is_none() {
            faults.add(Fault::Reference, || format!("{} has no value reference", named()));
        } else if of_type.is_none() {
            faults.add(Fault::Type, || match standard {
                Standard::Fmi2 => format!("{} has no type", named()),
                Standard::Fmi3 => {
                    format!("{} has the type {}, which is unknown", named(), shown(node.tag_name().name()))
                }
            });
        }
        let (Some(reference), Some(of_type)) = (reference, of_type) else {
            positions.0.push(None);
            continue;
        };
        positions.0.push(Some(found.len()));
        let declared = of_type.attribute("declaredType").and_then(|name| types.get(name));
        // A size is a number, or the value of a structural parameter (section 2.4.7.2 of FMI 3.0).
        let size = |dimension: Node| {
            faults.read(dimension, "start").or_else(|| {
                let parameter = faults.read(dimension, "valueReference")?;
                structure.get(&parameter).copied().or_else(|| *starts.get(&parameter)?)
            })
        };
        let dimensions = node.children().filter(|child| child.has_tag_name("Dimension")).map(size).collect();
        let mut variable = variable(*node, of_type, declared, (standard, reference, dimensions), faults);
        variable.limit(&mut remaining);
        derivatives.push(faults.read::<u32>(of_type, "derivative"));
        found.push(variable);
    }
    let by_reference: HashMap<u32, usize> =
        found.iter().enumerate().rev().map(|(index, of)| (of.reference, index)).collect();
    for (variable, derivative) in found.iter_mut().zip(derivatives) {
        let Some(of) = derivative else { continue };
        let state = match standard {
            Standard::Fmi2 => positions.find(of),
            Standard::Fmi3 => by_reference.get(&of).copied().map(Some),
        };
        if state.is_none() {
            let name = shown(&variable.name);
            faults
                .add(Fault::Structure, || format!("{name} is the derivative of {of}, which does not exist"));
        }
        variable.derivative_of = state.flatten();
    }
    Ok((found, positions))
}

/// Checks that there is enough memory for the variables and for the values in lists.
fn reserve(root: Node, nodes: &[Node]) -> Result<(), String> {
    let lists = root
        .descendants()
        .flat_map(|node| ["start", "dependencies", "dependenciesKind"].map(|name| node.attribute(name)));
    let values: usize = lists.flatten().map(|list| list.split_ascii_whitespace().count()).sum();
    let aliases = nodes.iter().flat_map(Node::children).filter(|child| child.has_tag_name("Alias")).count();
    crate::xml::reserve(VARIABLE * (nodes.len() + aliases) + VALUE * values)
        .map_err(|why| format!("modelDescription.xml cannot be read: {why}"))
}

/// Attributes of a declared type, which are read once for all variables of this type.
struct Declared {
    unit: Option<Arc<str>>,
    display_unit: Option<Arc<str>>,
    min: Option<f64>,
    max: Option<f64>,
    nominal: Option<f64>,
    is_relative: Option<bool>,
}

impl Declared {
    /// In FMI 2.0, a child element has the attributes (section 2.2.3).
    fn read(node: Node, faults: &Faults) -> Self {
        let inner = node.first_element_child();
        let owner = |name: &str| match inner {
            Some(inner) if !node.has_attribute(name) => inner,
            _ => node,
        };
        let text = |name: &str| owner(name).attribute(name).map(Arc::from);
        let number = |name: &str| faults.read(owner(name), name);
        Self {
            unit: text("unit"),
            display_unit: text("displayUnit"),
            min: number("min"),
            max: number("max"),
            nominal: number("nominal"),
            is_relative: faults.read(owner("relativeQuantity"), "relativeQuantity"),
        }
    }
}

/// Reads a variable. The attributes of its type are in the element `of_type`, or else in the declared type.
fn variable(
    node: Node,
    of_type: Node,
    declared: Option<&Declared>,
    (standard, reference, dimensions): (Standard, u32, Option<Vec<usize>>),
    faults: &Faults,
) -> Variable {
    let shared = |name: &str, of_declared: fn(&Declared) -> Option<Arc<str>>| {
        of_type.attribute(name).map(Arc::from).or_else(|| of_declared(declared?))
    };
    let limit = |name: &str, of_declared: fn(&Declared) -> Option<f64>| match of_type.has_attribute(name) {
        true => faults.read(of_type, name),
        false => declared.and_then(of_declared),
    };
    let is_relative = match of_type.has_attribute("relativeQuantity") {
        true => faults.read(of_type, "relativeQuantity"),
        false => declared.and_then(|of| of.is_relative),
    };
    let base = base_of(standard, of_type.tag_name().name());
    let causality = faults.read(node, "causality").unwrap_or(Causality::Local);
    let variability = faults.read(node, "variability");
    let has_variability = node.has_attribute("variability");
    let variability = variability.unwrap_or_else(|| default_variability(standard, causality, base));
    let initial = faults.read(node, "initial").or_else(|| default_initial(causality, variability));
    let product = |sizes: &Vec<usize>| sizes.iter().try_fold(1_usize, |all, size| all.checked_mul(*size));
    let size = dimensions.as_ref().and_then(product);
    Variable {
        name: attribute_or_empty(node, "name"),
        reference,
        base,
        causality,
        variability,
        has_variability,
        initial,
        start: start_values(node, of_type, base, faults),
        dimensions,
        size,
        is_too_large: false,
        min: limit("min", |of| of.min),
        max: limit("max", |of| of.max),
        nominal: limit("nominal", |of| of.nominal).filter(|nominal| *nominal > 0.0).unwrap_or(1.0),
        unit: shared("unit", |of| of.unit.clone()),
        display_unit: shared("displayUnit", |of| of.display_unit.clone()),
        is_relative: is_relative == Some(true),
        declared_type: of_type.attribute("declaredType").map(str::to_owned),
        derivative_of: None,
        reinit: faults.read(of_type, "reinit") == Some(true),
        clocked: node.attribute("clocks").is_some(),
        once_per_instant: faults.read(node, "canHandleMultipleSetPerTimeInstant") == Some(false),
        is_periodic: node.has_tag_name("Clock")
            && causality == Causality::Input
            && node.attribute("intervalVariability").map(str::trim) != Some("triggered"),
        description: attribute_or_empty(node, "description"),
        aliases: node.children().filter(|child| child.has_tag_name("Alias")).map(alias).collect(),
    }
}

fn alias(node: Node) -> Alias {
    Alias {
        name: attribute_or_empty(node, "name"),
        display_unit: node.attribute("displayUnit").map(Arc::from),
        description: attribute_or_empty(node, "description"),
    }
}

/// Reads the start values as written. In FMI 3.0, strings and binary values are in child elements (section 2.4.7.5).
fn start_values(node: Node, of_type: Node, base: Option<BaseType>, faults: &Faults) -> Vec<String> {
    let list = of_type.attribute("start");
    let start: Vec<String> = match base {
        Some(BaseType::String | BaseType::Binary) | None => list.map(str::to_owned).into_iter().collect(),
        Some(_) => list.unwrap_or_default().split_whitespace().map(str::to_owned).collect(),
    };
    if !start.is_empty() {
        return start;
    }
    let starts = node.children().filter(|child| child.has_tag_name("Start"));
    let value = |child: Node| {
        if !child.has_attribute("value") {
            let name = || shown(node.attribute("name").unwrap_or_default());
            faults.add(Fault::Attribute, || format!("a Start of {} lacks its value", name()));
        }
        attribute_or_empty(child, "value")
    };
    starts.map(value).collect()
}

/// Returns the default of `initial`, if there is one (table in section 2.2.7 of FMI 2.0, 2.4.7.4 of FMI 3.0).
fn default_initial(causality: Causality, variability: Variability) -> Option<Initial> {
    use Causality::{CalculatedParameter, Independent, Input, Local, Output, Parameter, StructuralParameter};
    match (causality, variability) {
        (Input | Independent, _) => None,
        (Parameter | StructuralParameter, _) | (Local | Output, Variability::Constant) => {
            Some(Initial::Exact)
        }
        (CalculatedParameter | Output | Local, _) => Some(Initial::Calculated),
    }
}

fn default_variability(standard: Standard, causality: Causality, base: Option<BaseType>) -> Variability {
    use Causality::{CalculatedParameter, Parameter, StructuralParameter};
    match causality {
        Parameter | CalculatedParameter | StructuralParameter if standard == Standard::Fmi3 => {
            Variability::Fixed
        }
        _ if base.is_some_and(BaseType::is_float) => Variability::Continuous,
        _ => Variability::Discrete,
    }
}

/// Returns the base type of an XML element.
fn base_of(standard: Standard, element: &str) -> Option<BaseType> {
    BaseType::ALL.into_iter().find(|base| base.element(standard) == Some(element))
}

/// Reads a unit (section 2.2.2 of FMI 2.0, 2.4.3 of FMI 3.0).
fn unit(node: Node, faults: &Faults) -> (String, Vec<(String, String)>) {
    let base = child(node, "BaseUnit");
    if let Some(base) = base {
        for name in ["factor", "offset"] {
            faults.read::<f64>(base, name);
        }
        for name in ["kg", "m", "s", "A", "K", "mol", "cd", "rad"] {
            faults.read::<i32>(base, name);
        }
    }
    (attribute_or_empty(node, "name"), base.map(attributes).unwrap_or_default())
}

/// Reads display units: value in the display unit = factor * value in the unit + offset. Skips inverse units of FMI 3.0, and those
/// of which something cannot be read.
fn display_units(node: Node, faults: &Faults) -> (String, Vec<(String, f64, f64)>) {
    let one = |of: Node| {
        let number = |name, default| match of.has_attribute(name) {
            true => faults.read(of, name),
            false => Some(default),
        };
        let is_inverse = of.has_attribute("inverse") && faults.read(of, "inverse") != Some(false);
        let (factor, offset) = (number("factor", 1.0)?, number("offset", 0.0)?);
        Some((of.attribute("name")?.to_owned(), factor, offset)).filter(|_| !is_inverse)
    };
    let others = node.children().filter(|of| of.has_tag_name("DisplayUnit")).filter_map(one);
    (attribute_or_empty(node, "name"), others.collect())
}

/// Reads an enumeration. In FMI 2.0 the type element contains an element for the base type (section 2.2.3);
/// in FMI 3.0 they are one element (2.4.4).
fn enumeration(node: Node, faults: &Faults) -> Option<(String, Vec<(String, i64)>)> {
    let items = node.descendants().filter(|item| item.has_tag_name("Item"));
    let item = |item: Node| Some((item.attribute("name")?.to_owned(), faults.read(item, "value")?));
    let items: Vec<_> = items.filter_map(item).collect();
    (!items.is_empty()).then(|| Some((node.attribute("name")?.to_owned(), items)))?
}

fn attribute_or_empty(node: Node, name: &str) -> String {
    node.attribute(name).unwrap_or_default().to_owned()
}

fn attributes(node: Node) -> Vec<(String, String)> {
    node.attributes().map(|of| (of.name().to_owned(), of.value().to_owned())).collect()
}

fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    node.children().find(|child| child.has_tag_name(name))
}

fn elements<'a>(node: Node<'a, 'a>, list: &str) -> impl Iterator<Item = Node<'a, 'a>> {
    child(node, list).into_iter().flat_map(|list| list.children()).filter(Node::is_element)
}

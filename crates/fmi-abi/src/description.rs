//! Reads model descriptions, and accepts faulty ones as far as possible: missing attributes get the defaults of the FMI
//! standard or stay empty, and each [`Fault`] is listed.

use crate::{
    BaseType, Causality, DependencyKind, Initial, Interface, Standard, Variability, boolean,
    is_plain_file_name, shown,
};
use roxmltree::Node;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::sync::Arc;

/// Maximum number of values in all arrays together. The size of an array that would exceed it counts as unknown.
pub const MAX_VALUES: usize = 1 << 22;
/// Upper bounds for the memory that a variable and a value in a list take, in bytes.
const VARIABLE: usize = 1000;
const VALUE: usize = 64;
/// Maximum number of faults that are listed for references to missing variables.
const MAX_LOST: usize = 100;

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
    attributes: HashMap<String, String>,
}

impl Offer {
    fn read(node: Node, standard: Standard) -> Self {
        let is_true = |name| matches!(node.attribute(name), Some("true" | "1"));
        Self {
            identifier: attribute_or_empty(node, "modelIdentifier"),
            once_per_process: is_true("canBeInstantiatedOnlyOncePerProcess"),
            needs_execution_tool: is_true("needsExecutionTool"),
            variable_step_size: is_true("canHandleVariableCommunicationStepSize"),
            input_derivatives: standard == Standard::Fmi2 && is_true("canInterpolateInputs"),
            directional_derivatives: is_true("providesDirectionalDerivative")
                || is_true("providesDirectionalDerivatives"),
            saves_states: is_true("canGetAndSetFMUstate") || is_true("canGetAndSetFMUState"),
            serializes_states: is_true("canSerializeFMUstate") || is_true("canSerializeFMUState"),
            attributes: attributes(node).into_iter().collect(),
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
        names.iter().any(|name| matches!(self.attributes.get(*name).map(String::as_str), Some("true" | "1")))
    }

    /// Returns the value of an attribute, if it is a positive and finite number.
    pub fn number(&self, name: &str) -> Option<f64> {
        let number: Option<f64> = self.attributes.get(name)?.trim().parse().ok();
        number.filter(|number| *number > 0.0 && number.is_finite())
    }
}

/// Kinds of faults in a model description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The name of the model, its guid or instantiation token, or a `modelIdentifier` is missing.
    Attribute,
    /// A variable has no value reference.
    Reference,
    /// A variable has no type.
    Type,
    /// `ModelStructure` refers to a variable that does not exist.
    Structure,
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
    pub enumerations: BTreeMap<String, Vec<(String, String)>>,
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
        let mut faults = Vec::new();
        let mut needs = |node: Node, name: &str| {
            if node.attribute(name).is_none() {
                faults.push((Fault::Attribute, format!("{} lacks {name}", node.tag_name().name())));
            }
        };
        needs(root, "modelName");
        needs(root, token);
        let mut offer = |name: &str| {
            let node = child(root, name)?;
            needs(node, "modelIdentifier");
            Some(Offer::read(node, standard))
        };
        let (co_simulation, model_exchange) = (offer("CoSimulation"), offer("ModelExchange"));
        [&co_simulation, &model_exchange].into_iter().flatten().try_for_each(Offer::check)?;
        let experiment = child(root, "DefaultExperiment");
        let time = |name: &str| -> Option<f64> { experiment?.attribute(name)?.trim().parse().ok() };
        let named = |list| elements(root, list).filter_map(|node| Some(node.attribute("name")?.to_owned()));
        let variables = variables(root, standard, structure, &mut faults)?;
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
            units: elements(root, "UnitDefinitions").map(unit).collect(),
            display_units: elements(root, "UnitDefinitions").map(display_units).collect(),
            types: named("TypeDefinitions").collect(),
            enumerations: elements(root, "TypeDefinitions").filter_map(enumeration).collect(),
            faults,
        };
        description.structure(root);
        Ok(description)
    }

    /// Returns the capabilities for this interface type, if the FMU supports it.
    pub fn offer(&self, interface: Interface) -> Option<&Offer> {
        match interface {
            Interface::CoSimulation => self.co_simulation.as_ref(),
            Interface::ModelExchange => self.model_exchange.as_ref(),
        }
    }

    /// Reads the model structure, which refers to variables by index in FMI 2.0, counted from 1, and by value
    /// reference in FMI 3.0.
    fn structure(&mut self, root: Node) {
        let by_reference: HashMap<u32, usize> =
            self.variables.iter().enumerate().rev().map(|(index, of)| (of.reference, index)).collect();
        let (count, standard) = (self.variables.len(), self.standard);
        let mut lost = Vec::new();
        let mut find = |text: &str| {
            let number: Option<u32> = text.parse().ok();
            let found = match standard {
                Standard::Fmi2 => number.and_then(from_one).filter(|index| *index < count),
                Standard::Fmi3 => number.and_then(|number| by_reference.get(&number).copied()),
            };
            if found.is_none() && lost.len() < MAX_LOST {
                lost.push(format!("ModelStructure refers to {}, which does not exist", shown(text)));
            }
            found
        };
        let attribute = if standard == Standard::Fmi2 { "index" } else { "valueReference" };
        let mut unknown = |node: Node| {
            let variable = find(node.attribute(attribute)?.trim())?;
            let list = node.attribute("dependencies");
            let dependencies: Option<Vec<usize>> =
                list.map(|list| list.split_whitespace().filter_map(&mut find).collect());
            let kinds = node.attribute("dependenciesKind").unwrap_or_default().split_whitespace();
            // A kind with an unknown name is read as the one that states least.
            let kind = |name| DependencyKind::of_name(name).unwrap_or(DependencyKind::Dependent);
            let mut kinds: Vec<DependencyKind> = kinds.map(kind).collect();
            if dependencies.as_ref().is_none_or(|list| list.len() != kinds.len()) {
                kinds.clear();
            }
            Some(Unknown { variable, dependencies, kinds })
        };
        let mut list = |group: &str, of_fmi3: &str| -> Vec<Unknown> {
            let Some(structure) = child(root, "ModelStructure") else { return Vec::new() };
            // Only the first entry of a variable counts.
            let mut known = HashSet::new();
            let mut new = |node| unknown(node).filter(|unknown: &Unknown| known.insert(unknown.variable));
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
            Standard::Fmi2 => root.attribute("numberOfEventIndicators").map_or(Some(0), |n| n.parse().ok()),
            Standard::Fmi3 => indicators.iter().try_fold(0_usize, |count, unknown| {
                count.checked_add(self.variables[unknown.variable].size?)
            }),
        };
        self.faults.extend(lost.into_iter().map(|why| (Fault::Structure, why)));
    }
}

fn variables(
    root: Node,
    standard: Standard,
    structure: &HashMap<u32, usize>,
    faults: &mut Vec<(Fault, String)>,
) -> Result<Vec<Variable>, String> {
    let types: HashMap<&str, Declared> = elements(root, "TypeDefinitions")
        .filter_map(|node| Some((node.attribute("name")?, Declared::read(node))))
        .collect();
    let nodes: Vec<Node> = elements(root, "ModelVariables").collect();
    let lists = root
        .descendants()
        .flat_map(|node| ["start", "dependencies", "dependenciesKind"].map(|name| node.attribute(name)));
    let values: usize = lists.flatten().map(|list| list.split_ascii_whitespace().count()).sum();
    crate::xml::reserve(VARIABLE * nodes.len() + VALUE * values)
        .map_err(|why| format!("modelDescription.xml cannot be read: {why}"))?;
    let mut remaining = MAX_VALUES;
    let indexed = nodes.iter().enumerate().rev();
    // The index of each variable, and its start value, which is a size if it is a structural parameter.
    let by_reference: HashMap<u32, (usize, Option<usize>)> = indexed
        .filter_map(|(index, node)| Some((number(*node, "valueReference")?, (index, number(*node, "start")))))
        .collect();
    let mut found = Vec::new();
    for node in &nodes {
        let Some(reference) = number(*node, "valueReference") else {
            faults.push((
                Fault::Reference,
                format!("{} has no value reference", shown(node.attribute("name").unwrap_or_default())),
            ));
            continue;
        };
        let is_type = |child: &Node| base_of(standard, child.tag_name().name()).is_some();
        let of_type = match standard {
            Standard::Fmi2 => node.children().find(is_type),
            Standard::Fmi3 => Some(*node),
        };
        let Some(of_type) = of_type else {
            faults.push((
                Fault::Type,
                format!("{} has no type", shown(node.attribute("name").unwrap_or_default())),
            ));
            continue;
        };
        let declared = of_type.attribute("declaredType").and_then(|name| types.get(name));
        let base = base_of(standard, of_type.tag_name().name());
        // A size is a number, or the value of a structural parameter (section 2.4.7.2 of FMI 3.0).
        let size = |dimension: Node| {
            number(dimension, "start").or_else(|| {
                let parameter = number(dimension, "valueReference")?;
                structure.get(&parameter).copied().or_else(|| by_reference.get(&parameter)?.1)
            })
        };
        let dimensions = node.children().filter(|child| child.has_tag_name("Dimension")).map(size);
        let derivative_of = number(of_type, "derivative").and_then(|of| match standard {
            Standard::Fmi2 => from_one(of).filter(|index| *index < nodes.len()),
            Standard::Fmi3 => by_reference.get(&of).map(|(index, _)| *index),
        });
        let mut variable = variable(*node, of_type, declared, (standard, base), dimensions.collect());
        (variable.reference, variable.derivative_of) = (reference, derivative_of);
        variable.limit(&mut remaining);
        found.push(variable);
    }
    let count = found.len();
    let exists = |index: &usize| *index < count;
    found.iter_mut().for_each(|of| of.derivative_of = of.derivative_of.filter(exists));
    Ok(found)
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
    fn read(node: Node) -> Self {
        let inner = node.first_element_child();
        let attribute = |name| node.attribute(name).or_else(|| inner?.attribute(name));
        let number = |name| attribute(name)?.trim().parse().ok();
        Self {
            unit: attribute("unit").map(Arc::from),
            display_unit: attribute("displayUnit").map(Arc::from),
            min: number("min"),
            max: number("max"),
            nominal: number("nominal"),
            is_relative: attribute("relativeQuantity").and_then(boolean),
        }
    }
}

/// Reads a variable. The attributes of its type are in the element `of_type`, or else in the declared type.
fn variable(
    node: Node,
    of_type: Node,
    declared: Option<&Declared>,
    (standard, base): (Standard, Option<BaseType>),
    dimensions: Option<Vec<usize>>,
) -> Variable {
    let shared = |name: &str, of_declared: fn(&Declared) -> Option<Arc<str>>| {
        of_type.attribute(name).map(Arc::from).or_else(|| of_declared(declared?))
    };
    let limit = |name: &str, of_declared: fn(&Declared) -> Option<f64>| match of_type.attribute(name) {
        Some(value) => value.trim().parse().ok(),
        None => declared.and_then(of_declared),
    };
    let is_relative = match of_type.attribute("relativeQuantity") {
        Some(value) => boolean(value),
        None => declared.and_then(|of| of.is_relative),
    };
    let causality = node.attribute("causality").and_then(Causality::of_name).unwrap_or(Causality::Local);
    let variability = node.attribute("variability");
    let has_variability = variability.is_some();
    let variability = variability
        .and_then(Variability::of_name)
        .unwrap_or_else(|| default_variability(standard, causality, base));
    let initial = node
        .attribute("initial")
        .and_then(Initial::of_name)
        .or_else(|| default_initial(causality, variability));
    let product = |sizes: &Vec<usize>| sizes.iter().try_fold(1_usize, |all, size| all.checked_mul(*size));
    let size = dimensions.as_ref().and_then(product);
    Variable {
        name: attribute_or_empty(node, "name"),
        reference: 0,
        base,
        causality,
        variability,
        has_variability,
        initial,
        start: start_values(node, of_type, base),
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
        reinit: matches!(of_type.attribute("reinit"), Some("true" | "1")),
        clocked: node.attribute("clocks").is_some(),
        once_per_instant: node.attribute("canHandleMultipleSetPerTimeInstant") == Some("false"),
        is_periodic: node.has_tag_name("Clock")
            && causality == Causality::Input
            && node.attribute("intervalVariability").map(str::trim) != Some("triggered"),
        description: attribute_or_empty(node, "description"),
    }
}

/// Reads the start values as written. In FMI 3.0, strings and binary values are in child elements (section 2.4.7.5).
fn start_values(node: Node, of_type: Node, base: Option<BaseType>) -> Vec<String> {
    let list = of_type.attribute("start");
    let start: Vec<String> = match base {
        Some(BaseType::String | BaseType::Binary) | None => list.map(str::to_owned).into_iter().collect(),
        Some(_) => list.unwrap_or_default().split_whitespace().map(str::to_owned).collect(),
    };
    if !start.is_empty() {
        return start;
    }
    let starts = node.children().filter(|child| child.has_tag_name("Start"));
    starts.filter_map(|child| Some(child.attribute("value")?.to_owned())).collect()
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
fn unit(node: Node) -> (String, Vec<(String, String)>) {
    (attribute_or_empty(node, "name"), child(node, "BaseUnit").map(attributes).unwrap_or_default())
}

/// Reads display units: value in the display unit = factor * value in the unit + offset. Skips inverse units
/// of FMI 3.0.
fn display_units(node: Node) -> (String, Vec<(String, f64, f64)>) {
    let others = node.children().filter(|of| {
        of.has_tag_name("DisplayUnit") && of.attribute("inverse").and_then(boolean) != Some(true)
    });
    let others = others.filter_map(|of| {
        let number =
            |name, default| of.attribute(name).and_then(|value| value.parse().ok()).unwrap_or(default);
        Some((of.attribute("name")?.to_owned(), number("factor", 1.0), number("offset", 0.0)))
    });
    (attribute_or_empty(node, "name"), others.collect())
}

/// Reads an enumeration. In FMI 2.0 the type element contains an element for the base type (section 2.2.3);
/// in FMI 3.0 they are one element (2.4.4).
fn enumeration(node: Node) -> Option<(String, Vec<(String, String)>)> {
    let items = node.descendants().filter(|item| item.has_tag_name("Item"));
    let item = |item: Node| Some((item.attribute("name")?.to_owned(), item.attribute("value")?.to_owned()));
    let items: Vec<_> = items.filter_map(item).collect();
    (!items.is_empty()).then(|| Some((node.attribute("name")?.to_owned(), items)))?
}

/// Converts an index that counts from 1 to one that counts from 0; `None` for 0.
fn from_one(number: u32) -> Option<usize> {
    (number as usize).checked_sub(1)
}

fn attribute_or_empty(node: Node, name: &str) -> String {
    node.attribute(name).unwrap_or_default().to_owned()
}

fn number<T: std::str::FromStr>(node: Node, name: &str) -> Option<T> {
    node.attribute(name)?.trim().parse().ok()
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

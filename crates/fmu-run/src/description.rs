//! Reads the parts of the model description that running or connecting an FMU needs.

use crate::arrays::{Array, Arrays};
use fmi_abi::{BaseType, Interface, Standard};
use roxmltree::{Document, Node};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// A variable of an FMU. Each element of an array of FMI 3.0 is a variable, with a name as in FMI 2.0:
/// `T[3]`, `T[1,2]`, `der(T[3])`.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name.
    pub name: String,
    /// Value reference; for an array element, a number that is no value reference of the FMU.
    pub reference: u32,
    /// Base type; Int32 of FMI 3.0 is Integer, Float64 is Real.
    pub base: BaseType,
    /// `input`, `output`, `parameter` and so on; `local` by default.
    pub causality: String,
    /// `fixed`, `tunable`, `discrete` or `continuous`, if given.
    pub variability: Option<String>,
    /// Start value as written in the file, if given.
    pub start: Option<String>,
    /// Unit of the variable or of its declared type, if given.
    pub unit: Option<String>,
    /// Smallest value of the variable or of its declared type, if given.
    pub min: Option<f64>,
    /// Largest value of the variable or of its declared type, if given.
    pub max: Option<f64>,
    /// Name of the declared type, if given.
    pub declared_type: Option<String>,
    /// Display unit of the variable or of its declared type, if given.
    pub display_unit: Option<String>,
    /// Name of the continuous state of which this variable is the time derivative, if it is one.
    pub derivative_of: Option<String>,
    /// For an output: value references of the variables on which it depends without a step. `None` if not
    /// given; then it may depend on all inputs (section 2.2.8 of FMI 2.0, 2.4.8 of FMI 3.0).
    pub depends_on: Option<Vec<u32>>,
    /// Description.
    pub description: String,
}

/// Capabilities of an FMU for one interface type.
#[derive(Clone, Debug, PartialEq)]
pub struct Offer {
    /// `modelIdentifier`, the name of the library.
    pub identifier: String,
    /// Whether a process may have only one instance.
    pub once_per_process: bool,
    /// Whether the library starts another program, which must be installed.
    pub needs_execution_tool: bool,
    /// Whether it accepts input derivatives (FMI 2.0, `canInterpolateInputs`).
    pub input_derivatives: bool,
    /// Whether it provides directional derivatives (`providesDirectionalDerivative`, in FMI 3.0 with a final
    /// s).
    pub directional_derivatives: bool,
    /// Whether its state can be saved and restored (`canGetAndSetFMUstate`, in FMI 3.0
    /// `canGetAndSetFMUState`).
    pub saves_states: bool,
    /// Whether saved states can be serialized (`canSerializeFMUstate`).
    pub serializes_states: bool,
}

/// Parts of the model description of an FMU that running or connecting it needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// FMI version.
    pub standard: Standard,
    /// Name of the model.
    pub model_name: String,
    /// `guid` of FMI 2.0, `instantiationToken` of FMI 3.0.
    pub token: String,
    /// Capabilities in Co-Simulation, if the FMU supports it.
    pub co_simulation: Option<Offer>,
    /// Capabilities in Model Exchange, if the FMU supports it.
    pub model_exchange: Option<Offer>,
    /// Start time, stop time and step size of the default experiment, s, if given.
    pub default_experiment: [Option<f64>; 3],
    /// Number of continuous states.
    pub states: usize,
    /// Number of event indicators.
    pub event_indicators: usize,
    /// Variables, in the order of the model description.
    pub variables: Vec<Variable>,
    /// Units by name, each with the exponents of SI base units, factor and offset as written in the file.
    pub units: BTreeMap<String, Vec<(String, String)>>,
    /// Display units by unit, each with name, factor and offset.
    pub display_units: BTreeMap<String, Vec<(String, f64, f64)>>,
    /// Enumerations by name, each with the names and numbers of its items.
    pub enumerations: BTreeMap<String, Vec<(String, String)>>,
    /// Arrays to which variables belong.
    pub(crate) arrays: Arc<Arrays>,
    places: HashMap<String, usize>,
}

impl Description {
    /// Reads a `modelDescription.xml`.
    ///
    /// # Errors
    /// The message names the fault.
    pub fn parse(text: &str) -> Result<Self, String> {
        let document =
            Document::parse(text).map_err(|error| format!("modelDescription.xml is no XML: {error}"))?;
        let root = document.root_element();
        let version = root.attribute("fmiVersion").unwrap_or_default();
        let standard = match version {
            "2.0" => Standard::Fmi2,
            version if version.starts_with("3.") => Standard::Fmi3,
            _ => return Err(format!("its fmiVersion is {version:?}; 2.0 and 3.0 can be run")),
        };
        let offer = |name: &str| child(root, name).map(|node| offer(standard, node)).transpose();
        let (co_simulation, model_exchange) = (offer("CoSimulation")?, offer("ModelExchange")?);
        if co_simulation.is_none() && model_exchange.is_none() {
            return Err("it has neither Co-Simulation nor Model Exchange".to_owned());
        }
        let (token, (mut variables, arrays)) = match standard {
            Standard::Fmi2 => ("guid", (variables_of_fmi2(root)?, Arrays::default())),
            Standard::Fmi3 => ("instantiationToken", variables_of_fmi3(root)?),
        };
        depend(root, standard, &mut variables, &arrays);
        differentiate(root, standard, &mut variables, &arrays);
        Ok(Self {
            standard,
            model_name: needed(root, "modelName")?,
            token: needed(root, token)?,
            co_simulation,
            model_exchange,
            default_experiment: default_experiment(root),
            states: states(root, &arrays),
            event_indicators: event_indicators(root, &arrays)?,
            arrays: Arc::new(arrays),
            places: variables.iter().enumerate().map(|(place, of)| (of.name.clone(), place)).collect(),
            variables,
            units: elements(root, "UnitDefinitions").map(unit).collect(),
            display_units: elements(root, "UnitDefinitions").map(display_units).collect(),
            enumerations: elements(root, "TypeDefinitions").filter_map(enumeration).collect(),
        })
    }

    /// Returns the capabilities for this interface type, if the FMU supports it.
    pub fn offer(&self, interface: Interface) -> Option<&Offer> {
        match interface {
            Interface::CoSimulation => self.co_simulation.as_ref(),
            Interface::ModelExchange => self.model_exchange.as_ref(),
        }
    }

    /// Returns the variable of this name.
    pub fn variable(&self, name: &str) -> Option<&Variable> {
        self.places.get(name).map(|place| &self.variables[*place])
    }

    /// Returns whether directional derivatives with respect to this variable may exist: for inputs,
    /// parameters and continuous states.
    pub(crate) fn is_known(&self, name: &str) -> bool {
        self.variable(name).is_some_and(Variable::is_settable)
            || self.variables.iter().any(|of| of.derivative_of.as_deref() == Some(name))
    }

    /// Returns names and numbers of the items of a variable's enumeration, if it has one.
    pub fn items(&self, of: &Variable) -> Option<&[(String, String)]> {
        self.enumerations.get(of.declared_type.as_ref()?).map(Vec::as_slice)
    }

    /// Checks that an output may be connected to an input of this or another FMU: types, units and items must
    /// be equal.
    ///
    /// # Errors
    /// The message names the difference.
    pub fn connects(&self, output: &Variable, to: &Self, input: &Variable) -> Result<(), String> {
        let [one, other] = [output, input].map(Variable::kind);
        if one != other {
            return Err(format!("the one is {one}, the other {other}"));
        }
        if let (Some(one), Some(other)) = (&output.unit, &input.unit)
            && one != other
        {
            return Err(format!("the one is in {one}, the other in {other}"));
        }
        match (self.items(output), to.items(input)) {
            (Some(one), Some(other)) if one != other => Err("they have different items".to_owned()),
            _ => Ok(()),
        }
    }
}

impl Variable {
    /// Returns whether a caller may set the variable after the initialization, according to its causality.
    pub(crate) fn is_settable(&self) -> bool {
        matches!(self.causality.as_str(), "input" | "parameter" | "structuralParameter")
    }

    /// Returns the kind of its values, for use in a message.
    pub(crate) fn what(&self) -> &'static str {
        match self.kind() {
            "Boolean" => "a Boolean",
            "String" => "a text",
            "Binary" => "binary",
            "Enumeration" => "an enumeration",
            _ => "a number",
        }
    }

    /// Returns the type as in FMI 2.0, which has one type for all floating-point numbers and one for all
    /// integers.
    pub fn kind(&self) -> &'static str {
        match self.base {
            BaseType::Real | BaseType::Float32 => "Real",
            BaseType::Boolean => "Boolean",
            BaseType::String => "String",
            BaseType::Binary => "Binary",
            BaseType::Enumeration => "Enumeration",
            _ => "Integer",
        }
    }
}

fn needed(node: Node, name: &str) -> Result<String, String> {
    node.attribute(name)
        .map(str::to_owned)
        .ok_or_else(|| format!("modelDescription.xml: {} lacks {name}", node.tag_name().name()))
}

fn offer(standard: Standard, node: Node) -> Result<Offer, String> {
    let is_true = |name| matches!(node.attribute(name), Some("true" | "1"));
    Ok(Offer {
        identifier: needed(node, "modelIdentifier")?,
        once_per_process: is_true("canBeInstantiatedOnlyOncePerProcess"),
        needs_execution_tool: is_true("needsExecutionTool"),
        input_derivatives: standard == Standard::Fmi2 && is_true("canInterpolateInputs"),
        directional_derivatives: is_true("providesDirectionalDerivative")
            || is_true("providesDirectionalDerivatives"),
        saves_states: is_true("canGetAndSetFMUstate") || is_true("canGetAndSetFMUState"),
        serializes_states: is_true("canSerializeFMUstate") || is_true("canSerializeFMUState"),
    })
}

fn default_experiment(root: Node) -> [Option<f64>; 3] {
    let of = |name| child(root, "DefaultExperiment")?.attribute(name)?.trim().parse().ok();
    [of("startTime"), of("stopTime"), of("stepSize")]
}

/// Returns the number of continuous states: each has one derivative (section 2.2.8 of FMI 2.0, 2.4.8 of FMI
/// 3.0).
fn states(root: Node, arrays: &Arrays) -> usize {
    let structure = child(root, "ModelStructure");
    let of_fmi2 = structure.map_or(0, |structure| elements(structure, "Derivatives").count());
    of_fmi2 + count(root, "ContinuousStateDerivative", arrays)
}

/// Returns the number of event indicators: an attribute in FMI 2.0, variables in FMI 3.0.
fn event_indicators(root: Node, arrays: &Arrays) -> Result<usize, String> {
    let of_fmi2 = match root.attribute("numberOfEventIndicators") {
        Some(text) => text.parse().map_err(|_| {
            format!("modelDescription.xml: numberOfEventIndicators is {text:?}, which is no number")
        })?,
        None => 0,
    };
    Ok(of_fmi2 + count(root, "EventIndicator", arrays))
}

/// Counts elements of this name in the structure of FMI 3.0; an array counts once per element.
fn count(root: Node, name: &str, arrays: &Arrays) -> usize {
    let listed = elements(root, "ModelStructure").filter(|node| node.has_tag_name(name));
    listed.map(|node| number(node, "valueReference").map_or(1, |reference| arrays.length(reference))).sum()
}

fn number(node: Node, name: &str) -> Option<u32> {
    node.attribute(name)?.trim().parse().ok()
}

fn attributes(node: Node) -> Vec<(String, String)> {
    node.attributes().map(|of| (of.name().to_owned(), of.value().to_owned())).collect()
}

/// Reads a unit (section 2.2.2 of FMI 2.0, 2.4.3 of FMI 3.0).
fn unit(node: Node) -> (String, Vec<(String, String)>) {
    let base = child(node, "BaseUnit").map(attributes).unwrap_or_default();
    (node.attribute("name").unwrap_or_default().to_owned(), base)
}

/// Reads display units: value in the display unit = factor * value in the unit + offset. Skips inverse units
/// of FMI 3.0.
fn display_units(node: Node) -> (String, Vec<(String, f64, f64)>) {
    let number =
        |of: Node, name, default| of.attribute(name).and_then(|text| text.parse().ok()).unwrap_or(default);
    let others = node.children().filter(|of| {
        of.has_tag_name("DisplayUnit") && !matches!(of.attribute("inverse"), Some("true" | "1"))
    });
    let others = others.filter_map(|of| {
        Some((of.attribute("name")?.to_owned(), number(of, "factor", 1.0), number(of, "offset", 0.0)))
    });
    (node.attribute("name").unwrap_or_default().to_owned(), others.collect())
}

/// Reads the dependencies of outputs: indices in FMI 2.0, counted from 1; value references in FMI 3.0.
fn depend(root: Node, standard: Standard, variables: &mut [Variable], arrays: &Arrays) {
    let list = |node: Node, name: &str| -> Option<Vec<u32>> {
        let list = node.attribute(name)?.split_whitespace();
        Some(list.filter_map(|number| number.parse().ok()).collect())
    };
    match standard {
        Standard::Fmi2 => {
            let place = |number: u32| (number as usize).wrapping_sub(1);
            let outputs = child(root, "ModelStructure").map(|structure| elements(structure, "Outputs"));
            for node in outputs.into_iter().flatten() {
                let known = list(node, "dependencies").map(|places| {
                    places
                        .iter()
                        .filter_map(|number| Some(variables.get(place(*number))?.reference))
                        .collect()
                });
                let output = list(node, "index").and_then(|index| index.first().copied());
                if let Some(output) = output.and_then(|number| variables.get_mut(place(number))) {
                    output.depends_on = known;
                }
            }
        }
        Standard::Fmi3 => {
            let outputs = elements(root, "ModelStructure").filter(|node| node.has_tag_name("Output"));
            for node in outputs {
                let Some(reference) = number(node, "valueReference") else { continue };
                let own = arrays.elements(reference);
                let known = list(node, "dependencies").filter(|known| {
                    // Skips very large arrays; these then depend on all inputs.
                    own.len() * known.iter().map(|known| arrays.length(*known)).sum::<usize>() < 1 << 22
                });
                let known: Option<Vec<u32>> =
                    known.map(|known| known.into_iter().flat_map(|known| arrays.elements(known)).collect());
                let outputs = variables.iter_mut().filter(|of| own.contains(&of.reference));
                outputs.for_each(|output| output.depends_on.clone_from(&known));
            }
        }
    }
}

/// Sets `derivative_of`: from indices in FMI 2.0, counted from 1; from value references in FMI 3.0.
fn differentiate(root: Node, standard: Standard, variables: &mut [Variable], arrays: &Arrays) {
    let names: HashMap<u32, String> = match standard {
        Standard::Fmi2 => (1..).zip(variables.iter().map(|of| of.name.clone())).collect(),
        Standard::Fmi3 => variables.iter().map(|of| (of.reference, of.name.clone())).collect(),
    };
    let of_type = |node: Node| node.children().find_map(|child| number(child, "derivative"));
    let mut found = HashMap::new();
    for (place, node) in elements(root, "ModelVariables").enumerate() {
        match (standard, number(node, "valueReference")) {
            (Standard::Fmi2, Some(_)) => {
                found.extend(of_type(node).map(|state| (variables[place].name.clone(), names.get(&state))));
            }
            (Standard::Fmi3, Some(own)) => {
                let Some(state) = number(node, "derivative") else { continue };
                let pairs = arrays.elements(own).zip(arrays.elements(state));
                found.extend(
                    pairs.filter_map(|(own, state)| Some((names.get(&own)?.clone(), names.get(&state)))),
                );
            }
            _ => {}
        }
    }
    for variable in variables {
        variable.derivative_of = found.get(&variable.name).copied().flatten().cloned();
    }
}

/// Reads an enumeration. In FMI 2.0 the type element contains an element for the base type (section 2.2.3);
/// in FMI 3.0 they are one element (2.4.4).
fn enumeration(node: Node) -> Option<(String, Vec<(String, String)>)> {
    let items = node.descendants().filter(|item| item.has_tag_name("Item"));
    let item = |item: Node| Some((item.attribute("name")?.to_owned(), item.attribute("value")?.to_owned()));
    let items: Vec<_> = items.filter_map(item).collect();
    (!items.is_empty()).then(|| Some((node.attribute("name")?.to_owned(), items)))?
}

fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    node.children().find(|child| child.has_tag_name(name))
}

/// Declared types by name, each with the elements that may have attributes: in FMI 2.0, the type element and
/// its child.
type Types<'a> = HashMap<&'a str, Vec<Node<'a, 'a>>>;

fn types<'a>(root: Node<'a, 'a>) -> Types<'a> {
    let types = elements(root, "TypeDefinitions");
    types.filter_map(|of| Some((of.attribute("name")?, of.children().chain([of]).collect()))).collect()
}

/// Reads the variables of FMI 2.0: each is a `ScalarVariable` with an element for its type (section 2.2.7
/// there).
fn variables_of_fmi2(root: Node) -> Result<Vec<Variable>, String> {
    let mut found = Vec::new();
    let types = types(root);
    for node in elements(root, "ModelVariables") {
        let of_type = node.children().find_map(|child| Some((child, base_of_fmi2(child.tag_name().name())?)));
        let (of_type, base) =
            of_type.ok_or_else(|| format!("modelDescription.xml: {} has no type", name_of(node)))?;
        found.push(variable(node, of_type, base, &types)?);
    }
    Ok(found)
}

/// Reads the variables of FMI 3.0: the element name is the type (section 2.4.7 there). Replaces an array by
/// its elements. Skips clocks, and arrays whose size is unknown or too large.
fn variables_of_fmi3(root: Node) -> Result<(Vec<Variable>, Arrays), String> {
    let mut found = Vec::new();
    let types = types(root);
    let largest = elements(root, "ModelVariables").filter_map(|node| number(node, "valueReference")).max();
    let mut arrays = Arrays::after(largest.unwrap_or_default());
    for node in elements(root, "ModelVariables") {
        let Some(base) = base_of_fmi3(node.tag_name().name()) else { continue };
        let variable = variable(node, node, base, &types)?;
        let mut dimensions = node.children().filter(|child| child.has_tag_name("Dimension")).peekable();
        if dimensions.peek().is_none() {
            found.push(variable);
            continue;
        }
        let sizes: Option<Vec<usize>> = dimensions.map(|dimension| size(root, dimension)).collect();
        let texts = node.children().filter(|child| child.has_tag_name("Start"));
        let start: Vec<&str> = match node.attribute("start") {
            Some(list) => list.split_whitespace().collect(),
            None => texts.filter_map(|start| start.attribute("value")).collect(),
        };
        let Some(sizes) = sizes else { continue };
        let array = Array::new(variable.reference, base, sizes, &start);
        let Some(references) = arrays.push(array) else { continue };
        let array = &arrays.all()[arrays.all().len() - 1];
        found.extend(references.enumerate().map(|(number, reference)| Variable {
            name: array.name(&variable.name, number),
            reference,
            start: array.start(number).map(str::to_owned),
            ..variable.clone()
        }));
    }
    Ok((found, arrays))
}

/// Returns the size of an array dimension: a number, or the start value of a structural parameter (section
/// 2.4.7.5.1 of FMI 3.0).
fn size(root: Node, dimension: Node) -> Option<usize> {
    if let Some(size) = dimension.attribute("start") {
        return size.trim().parse().ok();
    }
    let reference = number(dimension, "valueReference")?;
    let parameter =
        elements(root, "ModelVariables").find(|node| number(*node, "valueReference") == Some(reference))?;
    parameter.attribute("start")?.trim().parse().ok()
}

fn elements<'a>(root: Node<'a, 'a>, list: &str) -> impl Iterator<Item = Node<'a, 'a>> {
    child(root, list).into_iter().flat_map(|node| node.children()).filter(Node::is_element)
}

fn name_of<'a>(node: Node<'a, 'a>) -> &'a str {
    node.attribute("name").unwrap_or("a variable without a name")
}

fn variable(node: Node, of_type: Node, base: BaseType, types: &Types) -> Result<Variable, String> {
    let reference = node.attribute("valueReference").and_then(|text| text.parse().ok());
    let text = |name: &str| node.attribute(name).map(str::to_owned);
    let start = match base {
        // Section 2.4.7.5 of FMI 3.0: start values of strings are child elements.
        BaseType::String if of_type.attribute("start").is_none() => {
            child(of_type, "Start").and_then(|start| start.attribute("value"))
        }
        _ => of_type.attribute("start"),
    };
    let declared_type = of_type.attribute("declaredType");
    let declared = declared_type.and_then(|name| types.get(name)).map_or(&[][..], Vec::as_slice);
    let of_both = |name: &str| {
        of_type.attribute(name).or_else(|| declared.iter().find_map(|node| node.attribute(name)))
    };
    let limit = |name: &str| of_both(name).and_then(|text| text.parse().ok());
    Ok(Variable {
        name: name_of(node).to_owned(),
        reference: reference
            .ok_or_else(|| format!("modelDescription.xml: {} has no value reference", name_of(node)))?,
        base,
        causality: text("causality").unwrap_or_else(|| "local".to_owned()),
        variability: text("variability"),
        start: start.map(str::to_owned),
        unit: of_both("unit").map(str::to_owned),
        min: limit("min"),
        max: limit("max"),
        declared_type: declared_type.map(str::to_owned),
        display_unit: of_both("displayUnit").map(str::to_owned),
        derivative_of: None,
        depends_on: None,
        description: text("description").unwrap_or_default(),
    })
}

fn base_of_fmi2(name: &str) -> Option<BaseType> {
    Some(match name {
        "Real" => BaseType::Real,
        "Integer" => BaseType::Integer,
        "Boolean" => BaseType::Boolean,
        "String" => BaseType::String,
        "Enumeration" => BaseType::Enumeration,
        _ => return None,
    })
}

fn base_of_fmi3(name: &str) -> Option<BaseType> {
    Some(match name {
        "Float64" => BaseType::Real,
        "Float32" => BaseType::Float32,
        "Int32" => BaseType::Integer,
        "Int8" => BaseType::Int8,
        "UInt8" => BaseType::UInt8,
        "Int16" => BaseType::Int16,
        "UInt16" => BaseType::UInt16,
        "UInt32" => BaseType::UInt32,
        "Int64" => BaseType::Int64,
        "UInt64" => BaseType::UInt64,
        "Boolean" => BaseType::Boolean,
        "String" => BaseType::String,
        "Binary" => BaseType::Binary,
        "Enumeration" => BaseType::Enumeration,
        _ => return None,
    })
}

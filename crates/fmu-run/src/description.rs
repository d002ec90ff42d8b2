//! What the model description says, as far as running or wiring the FMU needs it.

use crate::arrays::{Array, Arrays};
use fmi_abi::{BaseType, Interface, Standard};
use roxmltree::{Document, Node};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// A variable of an FMU. Each element of an array of FMI 3.0 is one, called as FMI 2.0 calls it: `T[3]`, `T[1,2]`, `der(T[3])`.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Its value reference; of an element of an array a number of its own, which no variable has.
    pub reference: u32,
    /// Its type; an Int32 of FMI 3.0 is an Integer, a Float64 a Real.
    pub base: BaseType,
    /// `input`, `output`, `parameter` and so on; `local` if nothing is said.
    pub causality: String,
    /// `fixed`, `tunable`, `discrete` or `continuous`, if it is said.
    pub variability: Option<String>,
    /// Its start value as it is written, if it has one.
    pub start: Option<String>,
    /// Its unit, or that of its declared type, if there is one.
    pub unit: Option<String>,
    /// Its smallest value, or that of its declared type, if there is one.
    pub min: Option<f64>,
    /// Its largest value, or that of its declared type, if there is one.
    pub max: Option<f64>,
    /// The name of its declared type, if it has one.
    pub declared_type: Option<String>,
    /// The unit that its values are displayed in, or that of its declared type, if there is one.
    pub display_unit: Option<String>,
    /// The name of the continuous state whose derivative with respect to time it is, if it is one.
    pub derivative_of: Option<String>,
    /// Of an output: the value references of what it depends on without a step; `None` if nothing is said, for then it may be
    /// all inputs (section 2.2.8 of FMI 2.0, 2.4.8 of FMI 3.0).
    pub depends_on: Option<Vec<u32>>,
    /// What it means.
    pub description: String,
}

/// What an FMU offers to those who use it by one type of interface.
#[derive(Clone, Debug, PartialEq)]
pub struct Offer {
    /// What the library is called.
    pub identifier: String,
    /// One instance in a process is all there may be.
    pub once_per_process: bool,
    /// Its library starts another program, which must be installed.
    pub needs_execution_tool: bool,
    /// It takes input derivatives (FMI 2.0, `canInterpolateInputs`).
    pub input_derivatives: bool,
    /// It calculates directional derivatives (`providesDirectionalDerivative`, in FMI 3.0 with an s at the end).
    pub directional_derivatives: bool,
    /// Its state can be saved and restored (`canGetAndSetFMUstate`, in FMI 3.0 with a capital S).
    pub saves_states: bool,
    /// Saved states can be serialized (`canSerializeFMUstate`).
    pub serializes_states: bool,
}

/// The model description of an FMU, as far as running or wiring it needs it.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// The edition of the standard.
    pub standard: Standard,
    /// The name of the model.
    pub model_name: String,
    /// `guid` of FMI 2.0, `instantiationToken` of FMI 3.0.
    pub token: String,
    /// What it offers in Co-Simulation, if it has that.
    pub co_simulation: Option<Offer>,
    /// What it offers in Model Exchange, if it has that.
    pub model_exchange: Option<Offer>,
    /// The experiment that it proposes: start, stop and step size of the communication, s, as far as it says them.
    pub default_experiment: [Option<f64>; 3],
    /// The number of continuous states.
    pub states: usize,
    /// The number of event indicators.
    pub event_indicators: usize,
    /// In the order of the model description.
    pub variables: Vec<Variable>,
    /// The units by their names, each with the exponents of SI's base units, factor and offset as they are written.
    pub units: BTreeMap<String, Vec<(String, String)>>,
    /// By units, what else values in them may be given in: its name, factor and offset.
    pub display_units: BTreeMap<String, Vec<(String, f64, f64)>>,
    /// The enumerations by their names, each with the names and numbers of its items.
    pub enumerations: BTreeMap<String, Vec<(String, String)>>,
    /// What the elements of arrays are.
    pub(crate) arrays: Arc<Arrays>,
    places: HashMap<String, usize>,
}

impl Description {
    /// Reads a `modelDescription.xml`.
    ///
    /// # Errors
    /// A sentence on what is wrong or missing.
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

    /// What it offers for this type of interface, if it has that.
    pub fn offer(&self, interface: Interface) -> Option<&Offer> {
        match interface {
            Interface::CoSimulation => self.co_simulation.as_ref(),
            Interface::ModelExchange => self.model_exchange.as_ref(),
        }
    }

    /// The variable of this name.
    pub fn variable(&self, name: &str) -> Option<&Variable> {
        self.places.get(name).map(|place| &self.variables[*place])
    }

    /// Whether directional derivatives with respect to this variable may exist: it is an input, a parameter or a continuous state.
    pub(crate) fn is_known(&self, name: &str) -> bool {
        self.variable(name).is_some_and(Variable::is_settable)
            || self.variables.iter().any(|of| of.derivative_of.as_deref() == Some(name))
    }

    /// The names and numbers of the items of a variable's enumeration, if it is of one.
    pub fn items(&self, of: &Variable) -> Option<&[(String, String)]> {
        self.enumerations.get(of.declared_type.as_ref()?).map(Vec::as_slice)
    }

    /// Whether an output may feed an input of another FMU or the same: both of the same type, unit and items.
    ///
    /// # Errors
    /// What differs, in a few words.
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
    /// Whether a caller may set it after the initialization, as far as its causality tells.
    pub(crate) fn is_settable(&self) -> bool {
        matches!(self.causality.as_str(), "input" | "parameter" | "structuralParameter")
    }

    /// What its values are, in a sentence.
    pub(crate) fn what(&self) -> &'static str {
        match self.kind() {
            "Boolean" => "a Boolean",
            "String" => "a text",
            "Binary" => "binary",
            "Enumeration" => "an enumeration",
            _ => "a number",
        }
    }

    /// Its type as those have it who tell numbers of FMI 3.0 apart as little as FMI 2.0.
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

/// A derivative for each (section 2.2.8 of FMI 2.0, 2.4.8 of FMI 3.0).
fn states(root: Node, arrays: &Arrays) -> usize {
    let structure = child(root, "ModelStructure");
    let of_fmi2 = structure.map_or(0, |structure| elements(structure, "Derivatives").count());
    of_fmi2 + count(root, "ContinuousStateDerivative", arrays)
}

/// A number in FMI 2.0, in FMI 3.0 they are variables.
fn event_indicators(root: Node, arrays: &Arrays) -> Result<usize, String> {
    let of_fmi2 = match root.attribute("numberOfEventIndicators") {
        Some(text) => text.parse().map_err(|_| {
            format!("modelDescription.xml: numberOfEventIndicators is {text:?}, which is no number")
        })?,
        None => 0,
    };
    Ok(of_fmi2 + count(root, "EventIndicator", arrays))
}

/// How many there are of these in the structure of FMI 3.0, where an array counts as many times as it has elements.
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

/// Section 2.2.2 of FMI 2.0, 2.4.3 of FMI 3.0.
fn unit(node: Node) -> (String, Vec<(String, String)>) {
    let base = child(node, "BaseUnit").map(attributes).unwrap_or_default();
    (node.attribute("name").unwrap_or_default().to_owned(), base)
}

/// Value in the display unit = factor * value in the unit + offset; in FMI 3.0 it may be inverse.
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

/// Which outputs depend on what: by places in FMI 2.0, counted from 1, by value references in FMI 3.0.
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
                    // Of large arrays, which may depend on all inputs for all that is known here.
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

/// The states of derivatives: by places in FMI 2.0, counted from 1, by value references in FMI 3.0.
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

/// A type's element in FMI 2.0 holds one for its kind (section 2.2.3); in FMI 3.0 it is that itself (2.4.4).
fn enumeration(node: Node) -> Option<(String, Vec<(String, String)>)> {
    let items = node.descendants().filter(|item| item.has_tag_name("Item"));
    let item = |item: Node| Some((item.attribute("name")?.to_owned(), item.attribute("value")?.to_owned()));
    let items: Vec<_> = items.filter_map(item).collect();
    (!items.is_empty()).then(|| Some((node.attribute("name")?.to_owned(), items)))?
}

fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    node.children().find(|child| child.has_tag_name(name))
}

/// The declared types by name, each as the elements that have attributes: in FMI 2.0 one for the kind is in the type's.
type Types<'a> = HashMap<&'a str, Vec<Node<'a, 'a>>>;

fn types<'a>(root: Node<'a, 'a>) -> Types<'a> {
    let types = elements(root, "TypeDefinitions");
    types.filter_map(|of| Some((of.attribute("name")?, of.children().chain([of]).collect()))).collect()
}

/// Each is a `ScalarVariable` with an element for its type (section 2.2.7 of FMI 2.0).
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

/// The element's name is the type (section 2.4.7 of FMI 3.0). An array is replaced by its elements. Clocks are passed over, and
/// arrays whose size is not known or beyond all use: nothing here sets or reads them.
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

/// Of an array in one direction: a number, or the start value of a structural parameter (section 2.4.7.5.1 of FMI 3.0).
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
        // Section 2.4.7.5 of FMI 3.0: texts have theirs in an element.
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

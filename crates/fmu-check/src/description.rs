//! The model description, read for what it requirements. `fmu-run` reads what it needs to run an FMU; here it is all that can
//! be held against the library, arrays and clocks too, and what is wrong is told instead of refused.

use crate::call_sequence::Kind;
use crate::rules::Observation;
use fmi_abi::{BaseType, Interface, Standard};
use roxmltree::{Document, Node};
use std::collections::{BTreeMap, HashMap, HashSet};

/// A variable.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Its value reference.
    pub reference: u32,
    /// Its type; `None` for clocks.
    pub base: Option<BaseType>,
    /// `input`, `output` and so on; `local` if nothing is said.
    pub causality: String,
    /// `fixed`, `continuous` and so on, with the standard's default.
    pub variability: String,
    /// `exact`, `approx` or `calculated`, with the standard's default; empty for those that have none.
    pub initial: String,
    /// Its start values as they are written; none if there is none.
    pub start: Vec<String>,
    /// How many values it has; `None` if that cannot be known from the text.
    pub size: Option<usize>,
    /// Its smallest value.
    pub min: Option<f64>,
    /// Its largest value.
    pub max: Option<f64>,
    /// Its nominal value.
    pub nominal: f64,
    /// The name of its unit.
    pub unit: Option<String>,
    /// The name of its declared type.
    pub declared_type: Option<String>,
    /// Index of the variable that this variable is the derivative of.
    pub derivative_of: Option<usize>,
    /// Whether clocks set the variable.
    pub clocked: bool,
    /// Whether the variable may be set only once per time instant.
    pub once_per_instant: bool,
}

/// An unknown of the model structure.
#[derive(Clone, Debug)]
pub struct Unknown {
    /// The variable, by index.
    pub variable: usize,
    /// Indices and kinds of the dependencies; `None` if the attribute is missing.
    pub dependencies: Option<Vec<(usize, String)>>,
}

/// Capabilities of an interface type.
#[derive(Clone, Debug)]
pub struct Offer {
    /// The name of its library.
    pub identifier: String,
    attributes: HashMap<String, String>,
}

impl Offer {
    /// A positive number among its attributes.
    pub fn number(&self, name: &str) -> Option<f64> {
        self.attributes
            .get(name)?
            .trim()
            .parse()
            .ok()
            .filter(|number: &f64| *number > 0.0 && number.is_finite())
    }

    /// Whether a capability is declared; those of FMI 2.0 and 3.0 may be spelled differently.
    pub fn can(&self, names: &[&str]) -> bool {
        names.iter().any(|name| matches!(self.attributes.get(*name).map(String::as_str), Some("true" | "1")))
    }
}

/// The model description.
#[derive(Clone, Debug)]
pub struct Description {
    /// The edition of the standard.
    pub standard: Standard,
    /// `fmiVersion` as it is written.
    pub version: String,
    /// The name of the model.
    pub model_name: String,
    /// `guid` of FMI 2.0, `instantiationToken` of FMI 3.0.
    pub token: String,
    /// What it offers.
    pub co_simulation: Option<Offer>,
    /// What it offers.
    pub model_exchange: Option<Offer>,
    /// Whether it offers Scheduled Execution.
    pub scheduled_execution: bool,
    /// Variables in the order of the description.
    pub variables: Vec<Variable>,
    /// List of the model structure.
    pub outputs: Vec<Unknown>,
    /// List of the model structure.
    pub derivatives: Vec<Unknown>,
    /// List of the model structure.
    pub initial_unknowns: Vec<Unknown>,
    /// How many event indicators there are.
    pub event_indicators: Option<usize>,
    /// Their names.
    pub log_categories: Vec<String>,
    /// Start time of the default experiment.
    pub start_time: f64,
    /// Stop time of the default experiment, if it has one.
    pub stop_time: Option<f64>,
    /// The size of its steps, if it is said.
    pub step_size: Option<f64>,
    /// Errors in the description: the name of the finding, the section, a sentence.
    pub wrong: Vec<Observation>,
}

impl Description {
    /// Reads it.
    ///
    /// # Errors
    /// A sentence, when nothing can be done with it.
    pub fn parse(text: &str) -> Result<Self, String> {
        let document =
            Document::parse(text).map_err(|error| format!("modelDescription.xml is no XML: {error}"))?;
        let root = document.root_element();
        let version = root.attribute("fmiVersion").unwrap_or_default().to_owned();
        let standard = match version.as_str() {
            "2.0" => Standard::Fmi2,
            version if version.starts_with("3.") => Standard::Fmi3,
            other => return Err(format!("its fmiVersion is {other:?}; FMI 2.0 and 3.0 can be checked")),
        };
        let offer = |name: &str| {
            child(root, name).map(|node| Offer {
                identifier: node.attribute("modelIdentifier").unwrap_or_default().to_owned(),
                attributes: node
                    .attributes()
                    .map(|of| (of.name().to_owned(), of.value().to_owned()))
                    .collect(),
            })
        };
        let token = if standard == Standard::Fmi2 { "guid" } else { "instantiationToken" };
        let mut wrong = Vec::new();
        let variables = variables(root, standard, &mut wrong);
        let experiment = child(root, "DefaultExperiment");
        let time = |name: &str| -> Option<f64> { experiment?.attribute(name)?.trim().parse().ok() };
        let mut description = Self {
            standard,
            version,
            model_name: root.attribute("modelName").unwrap_or_default().to_owned(),
            token: root.attribute(token).unwrap_or_default().to_owned(),
            co_simulation: offer("CoSimulation"),
            model_exchange: offer("ModelExchange"),
            scheduled_execution: child(root, "ScheduledExecution").is_some(),
            variables,
            outputs: Vec::new(),
            derivatives: Vec::new(),
            initial_unknowns: Vec::new(),
            event_indicators: None,
            log_categories: elements(root, "LogCategories")
                .filter_map(|node| Some(node.attribute("name")?.to_owned()))
                .collect(),
            start_time: time("startTime").unwrap_or(0.0),
            stop_time: time("stopTime"),
            step_size: time("stepSize").filter(|size| *size > 0.0 && size.is_finite()),
            wrong,
        };
        description.structure(root);
        description.judge(root);
        Ok(description)
    }

    /// Capabilities of this interface type.
    pub fn offer(&self, interface: Interface) -> Option<&Offer> {
        match interface {
            Interface::CoSimulation => self.co_simulation.as_ref(),
            Interface::ModelExchange => self.model_exchange.as_ref(),
        }
    }

    fn structure(&mut self, root: Node) {
        let by_reference: HashMap<u32, usize> =
            self.variables.iter().enumerate().rev().map(|(index, of)| (of.reference, index)).collect();
        let (count, standard) = (self.variables.len(), self.standard);
        let mut lost = Vec::new();
        let mut find = |text: &str| {
            let number: Option<u32> = text.parse().ok();
            let found = match standard {
                Standard::Fmi2 => {
                    number.map(|number| (number as usize).wrapping_sub(1)).filter(|index| *index < count)
                }
                Standard::Fmi3 => number.and_then(|number| by_reference.get(&number).copied()),
            };
            if found.is_none() {
                lost.push(format!("ModelStructure refers to {text:?}, which is no variable"));
            }
            found
        };
        let attribute = if standard == Standard::Fmi2 { "index" } else { "valueReference" };
        let mut unknown = |node: Node| -> Option<Unknown> {
            let variable = find(node.attribute(attribute)?.trim())?;
            let kinds: Vec<String> = node
                .attribute("dependenciesKind")
                .unwrap_or_default()
                .split_whitespace()
                .map(str::to_owned)
                .collect();
            let dependencies = node.attribute("dependencies").map(|list| {
                let kind = |index: usize| kinds.get(index).cloned().unwrap_or_else(|| "dependent".to_owned());
                let found = list.split_whitespace().enumerate();
                found.filter_map(|(index, text)| Some((find(text)?, kind(index)))).collect()
            });
            Some(Unknown { variable, dependencies })
        };
        if let Some(structure) = child(root, "ModelStructure") {
            let mut list = |group: &str, of_fmi3: &str| -> Vec<Unknown> {
                match standard {
                    Standard::Fmi2 => elements(structure, group).filter_map(&mut unknown).collect(),
                    Standard::Fmi3 => structure
                        .children()
                        .filter(|node| node.has_tag_name(of_fmi3))
                        .filter_map(&mut unknown)
                        .collect(),
                }
            };
            self.outputs = list("Outputs", "Output");
            self.derivatives = list("Derivatives", "ContinuousStateDerivative");
            self.initial_unknowns = list("InitialUnknowns", "InitialUnknown");
            let indicators = list("none", "EventIndicator");
            self.event_indicators = match standard {
                Standard::Fmi2 => {
                    root.attribute("numberOfEventIndicators").map_or(Some(0), |text| text.parse().ok())
                }
                Standard::Fmi3 => {
                    indicators.iter().map(|unknown| self.variables[unknown.variable].size).sum()
                }
            };
        }
        self.wrong.extend(lost.into_iter().map(|why| ("description.structure", why)));
    }

    /// Errors of the XML itself.
    fn judge(&mut self, root: Node) {
        let mut wrong = Vec::new();
        if self.token.is_empty() {
            wrong.push(("description.token", "guid or instantiationToken is missing or empty".to_owned()));
        }
        if self.co_simulation.is_none() && self.model_exchange.is_none() && !self.scheduled_execution {
            wrong.push(("description.interfaces", "it offers no interface type".to_owned()));
        }
        for offer in [&self.co_simulation, &self.model_exchange].into_iter().flatten() {
            if !is_c_name(&offer.identifier) {
                let why = format!("modelIdentifier {:?} is no name in C", offer.identifier);
                wrong.push(("description.identifier", why));
            }
        }
        let named = |group: &str| -> HashSet<String> {
            elements(root, group).filter_map(|node| Some(node.attribute("name")?.to_owned())).collect()
        };
        let (units, types) = (named("UnitDefinitions"), named("TypeDefinitions"));
        let outputs: HashSet<usize> = self.outputs.iter().map(|unknown| unknown.variable).collect();
        let (mut names, mut references) = (HashSet::new(), HashSet::new());
        for (index, variable) in self.variables.iter().enumerate() {
            let name = &variable.name;
            let of_declared = |of: &Option<String>, known: &HashSet<String>| {
                of.as_ref().filter(|of| !known.contains(of.as_str())).cloned()
            };
            let (listed, output) = (outputs.contains(&index), variable.causality == "output");
            let mut tell = |rule, why: String| wrong.push((rule, why));
            if !names.insert(name) {
                tell("description.names", format!("two variables are called {name:?}"));
            }
            if self.standard == Standard::Fmi3 && !references.insert(variable.reference) {
                let why =
                    format!("value reference {} of {name} is that of another variable", variable.reference);
                tell("description.references", why);
            }
            if output && !listed && !variable.clocked {
                tell(
                    "description.structure",
                    format!("output {name} is not among the outputs of ModelStructure"),
                );
            }
            if !output && listed {
                tell(
                    "description.structure",
                    format!("{name} is no output, and is among those of ModelStructure"),
                );
            }
            if let Some(unit) = of_declared(&variable.unit, &units) {
                tell(
                    "description.units",
                    format!("{name} is in {unit:?}, which is no unit of UnitDefinitions"),
                );
            }
            if let Some(of) = of_declared(&variable.declared_type, &types) {
                tell(
                    "description.types",
                    format!("{name} is of type {of:?}, which is none of TypeDefinitions"),
                );
            }
            wrong.extend(variable.wrong());
        }
        // A derivative that is not listed may be one that is no state's (section 2.2.8 of FMI 2.0).
        for unknown in &self.derivatives {
            if self.variables[unknown.variable].derivative_of.is_none() {
                let name = &self.variables[unknown.variable].name;
                wrong.push((
                    "description.structure",
                    format!("{name} is among the derivatives, and is not declared to be one"),
                ));
            }
        }
        if self.stop_time.is_some_and(|stop| stop <= self.start_time) {
            wrong
                .push(("description.experiment", "the default experiment stops before it starts".to_owned()));
        }
        self.wrong.extend(wrong);
    }

    /// Whether Co-Simulation needs Event Mode: FMUs with clocks do (section 2.3.1 of FMI 3.0, `eventModeUsed`).
    pub fn event_mode(&self) -> bool {
        let has_clocks = self.variables.iter().any(|variable| variable.base.is_none() || variable.clocked);
        has_clocks && self.co_simulation.as_ref().is_some_and(|offer| offer.can(&["hasEventMode"]))
    }

    /// The variables that an index of the same type and reference stands for.
    pub fn aliases(&self, index: usize) -> impl Iterator<Item = usize> + '_ {
        let of = &self.variables[index];
        let (reference, kind) = (of.reference, of.base.map(|base| kind_of(self.standard, base)));
        self.variables.iter().enumerate().filter_map(move |(index, other)| {
            let same =
                other.reference == reference && other.base.map(|base| kind_of(self.standard, base)) == kind;
            same.then_some(index)
        })
    }

    /// The continuous states, by indices, in the order of their derivatives.
    pub fn states(&self) -> Vec<usize> {
        self.derivatives.iter().filter_map(|unknown| self.variables[unknown.variable].derivative_of).collect()
    }

    /// How many numbers the vector of states has.
    pub fn states_count(&self) -> Option<usize> {
        self.derivatives.iter().map(|unknown| self.variables[unknown.variable].size).sum()
    }
}

impl Variable {
    /// Its start values as numbers; none where they are none.
    pub fn starts(&self) -> Vec<f64> {
        self.start
            .iter()
            .map_while(|text| match text.as_str() {
                "true" => Some(1.0),
                "false" => Some(0.0),
                "INF" => Some(f64::INFINITY),
                "-INF" => Some(f64::NEG_INFINITY),
                other => other.parse().ok(),
            })
            .collect()
    }

    /// Whether it is a floating-point number.
    pub fn is_float(&self) -> bool {
        self.base.is_some_and(BaseType::is_float)
    }

    /// Whether it is a number or a boolean value, no text and no bytes.
    pub fn is_number(&self) -> bool {
        !matches!(self.base, None | Some(BaseType::String | BaseType::Binary))
    }
}

/// Combinations of causality and variability, each with the values of `initial` that it may have: the tables of section 2.2.7
/// of FMI 2.0.5 and section 2.4.7.4 of FMI 3.0.2.
const COMBINATIONS: &[(&str, &[&str], &[&str])] = &[
    ("parameter", &["fixed", "tunable"], &["exact"]),
    ("structuralParameter", &["fixed", "tunable"], &["exact"]),
    ("calculatedParameter", &["fixed", "tunable"], &["calculated", "approx"]),
    ("input", &["discrete", "continuous"], &["", "exact"]),
    ("output", &["constant"], &["exact"]),
    ("output", &["discrete", "continuous"], &["calculated", "exact", "approx"]),
    ("local", &["constant"], &["exact"]),
    ("local", &["fixed", "tunable"], &["calculated", "approx"]),
    ("local", &["discrete", "continuous"], &["calculated", "exact", "approx"]),
    ("independent", &["continuous"], &[""]),
];

impl Variable {
    /// The rules that it breaks by itself.
    fn wrong(&self) -> Vec<Observation> {
        let (name, mut wrong) = (&self.name, Vec::new());
        let mut tell = |rule, why: String| wrong.push((rule, why));
        let fits = |(causality, variabilities, _): &&(&str, &[&str], &[&str])| {
            *causality == self.causality && variabilities.contains(&self.variability.as_str())
        };
        let (causality, variability, initial) = (&self.causality, &self.variability, &self.initial);
        match COMBINATIONS.iter().find(fits) {
            _ if self.base.is_none() || self.clocked => {}
            None => tell("description.combination", format!("{name} is {causality} and {variability}")),
            Some((.., initials)) if !initials.contains(&initial.as_str()) => {
                let why = format!("{name} is {causality} and {variability}, with initial = {initial}");
                tell("description.combination", why);
            }
            Some(_) => {}
        }
        if variability == "continuous" && !self.is_float() && self.base.is_some() {
            tell("description.combination", format!("{name} is continuous and no floating-point number"));
        }
        let needs_start =
            ["exact", "approx"].contains(&initial.as_str()) || causality == "input" && self.base.is_some();
        if needs_start && self.start.is_empty() && causality != "independent" && !self.clocked {
            tell("description.start", format!("{name} ({causality}) has no start value"));
        }
        if initial == "calculated" && !self.start.is_empty() && self.base.is_some() {
            tell("description.start", format!("{name} is calculated and has a start value"));
        }
        if let (Some(min), Some(max)) = (self.min, self.max)
            && min > max
        {
            tell("description.range", format!("{name} has a min of {min} and a max of {max}"));
        }
        let outside = |number: &f64| {
            self.min.is_some_and(|min| *number < min) || self.max.is_some_and(|max| *number > max)
        };
        if let Some(number) = self.starts().into_iter().find(outside) {
            let why = format!("the start value of {name}, {number}, is outside its min and max");
            tell("description.range", why);
        }
        let texts = [BaseType::String, BaseType::Binary, BaseType::Boolean];
        let number =
            |text: &String| text.parse::<f64>().is_ok() || ["INF", "-INF", "NaN"].contains(&text.as_str());
        if self.base.is_some_and(|base| !texts.contains(&base)) && !self.start.iter().all(number) {
            let why = format!("the start value of {name}, {:?}, is no number", self.start.join(" "));
            tell("description.start", why);
        }
        wrong
    }
}

/// The end of the names of the functions of a type.
pub fn type_name(standard: Standard, base: BaseType) -> &'static str {
    match (standard, base) {
        (Standard::Fmi2, BaseType::Real) => "Real",
        (Standard::Fmi2, BaseType::Boolean) => "Boolean",
        (Standard::Fmi2, BaseType::String) => "String",
        (Standard::Fmi2, _) => "Integer",
        (_, BaseType::Real) => "Float64",
        (_, BaseType::Float32) => "Float32",
        (_, BaseType::Integer) => "Int32",
        (_, BaseType::Int8) => "Int8",
        (_, BaseType::UInt8) => "UInt8",
        (_, BaseType::Int16) => "Int16",
        (_, BaseType::UInt16) => "UInt16",
        (_, BaseType::UInt32) => "UInt32",
        (_, BaseType::Int64 | BaseType::Enumeration) => "Int64",
        (_, BaseType::UInt64) => "UInt64",
        (_, BaseType::Boolean) => "Boolean",
        (_, BaseType::String) => "String",
        (_, BaseType::Binary) => "Binary",
    }
}

/// How values of a type lie in memory.
pub fn kind_of(standard: Standard, base: BaseType) -> Kind {
    match type_name(standard, base) {
        "Real" | "Float64" => Kind::F64,
        "Float32" => Kind::F32,
        "Int8" => Kind::I8,
        "UInt8" => Kind::U8,
        "Int16" => Kind::I16,
        "UInt16" => Kind::U16,
        "UInt32" => Kind::U32,
        "Int64" => Kind::I64,
        "UInt64" => Kind::U64,
        "String" | "Binary" => Kind::Pointer,
        "Boolean" if standard == Standard::Fmi3 => Kind::U8,
        _ => Kind::I32,
    }
}

fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    node.children().find(|child| child.has_tag_name(name))
}

fn elements<'a>(node: Node<'a, 'a>, group: &str) -> impl Iterator<Item = Node<'a, 'a>> {
    child(node, group).into_iter().flat_map(|group| group.children()).filter(Node::is_element)
}

fn base_of(standard: Standard, name: &str) -> Option<BaseType> {
    Some(match (standard, name) {
        (Standard::Fmi2, "Real") | (Standard::Fmi3, "Float64") => BaseType::Real,
        (Standard::Fmi2, "Integer") | (Standard::Fmi3, "Int32") => BaseType::Integer,
        (_, "Boolean") => BaseType::Boolean,
        (_, "String") => BaseType::String,
        (_, "Enumeration") => BaseType::Enumeration,
        (Standard::Fmi3, "Float32") => BaseType::Float32,
        (Standard::Fmi3, "Int8") => BaseType::Int8,
        (Standard::Fmi3, "UInt8") => BaseType::UInt8,
        (Standard::Fmi3, "Int16") => BaseType::Int16,
        (Standard::Fmi3, "UInt16") => BaseType::UInt16,
        (Standard::Fmi3, "UInt32") => BaseType::UInt32,
        (Standard::Fmi3, "Int64") => BaseType::Int64,
        (Standard::Fmi3, "UInt64") => BaseType::UInt64,
        (Standard::Fmi3, "Binary") => BaseType::Binary,
        _ => return None,
    })
}

/// The default of `initial`: the table of section 2.2.7 of FMI 2.0, 2.4.7.4 of FMI 3.0.
fn default_initial(causality: &str, variability: &str) -> &'static str {
    match (causality, variability) {
        ("parameter" | "structuralParameter", _) => "exact",
        ("local" | "output", "constant") => "exact",
        ("calculatedParameter" | "output" | "local", _) => "calculated",
        _ => "",
    }
}

/// Whether a string is a valid identifier of C.
fn is_c_name(text: &str) -> bool {
    let mut letters = text.chars();
    letters.next().is_some_and(|first| first.is_ascii_alphabetic() || first == '_')
        && letters.all(|letter| letter.is_ascii_alphanumeric() || letter == '_')
}

/// The default of `variability`.
fn default_variability(standard: Standard, causality: &str, base: Option<BaseType>) -> &'static str {
    match causality {
        "parameter" | "calculatedParameter" | "structuralParameter" if standard == Standard::Fmi3 => "fixed",
        _ if base.is_some_and(BaseType::is_float) => "continuous",
        _ => "discrete",
    }
}

/// The number of elements; `None` if it is not known. `sizes` has the start values of structural parameters.
fn array_size(node: Node, sizes: &HashMap<u32, Option<usize>>) -> Option<usize> {
    let dimensions = node.children().filter(|child| child.has_tag_name("Dimension"));
    dimensions.into_iter().try_fold(1, |size, dimension| {
        let fixed = dimension.attribute("start").and_then(|text| text.parse::<usize>().ok());
        let other = dimension.attribute("valueReference").and_then(|text| text.parse::<u32>().ok());
        let of_other = other.and_then(|reference| sizes.get(&reference).copied().flatten());
        Some(size * fixed.or(of_other)?)
    })
}

/// The start values; one value for an array stands for all elements.
fn start_values(node: Node, of_type: Node, base: Option<BaseType>, size: Option<usize>) -> Vec<String> {
    let mut start: Vec<String> = match (base, of_type.attribute("start")) {
        (Some(BaseType::String | BaseType::Binary) | None, Some(text)) => vec![text.to_owned()],
        (_, Some(text)) => text.split_whitespace().map(str::to_owned).collect(),
        (_, None) => Vec::new(),
    };
    if start.is_empty() {
        let starts = node.children().filter(|child| child.has_tag_name("Start"));
        start = starts.filter_map(|child| Some(child.attribute("value")?.to_owned())).collect();
    }
    let is_array = node.children().any(|child| child.has_tag_name("Dimension"));
    match (size, &start[..]) {
        (Some(size), [one]) if is_array => vec![one.clone(); size],
        _ => start,
    }
}

fn variables(root: Node, standard: Standard, wrong: &mut Vec<Observation>) -> Vec<Variable> {
    let types: HashMap<&str, Node> =
        elements(root, "TypeDefinitions").filter_map(|node| Some((node.attribute("name")?, node))).collect();
    let nodes: Vec<Node> = elements(root, "ModelVariables").collect();
    let by_reference: BTreeMap<u32, usize> = nodes
        .iter()
        .enumerate()
        .rev()
        .filter_map(|(index, node)| Some((node.attribute("valueReference")?.parse().ok()?, index)))
        .collect();
    let mut found: Vec<Variable> = Vec::new();
    let mut sizes: HashMap<u32, Option<usize>> = HashMap::new();
    for node in &nodes {
        let name = node.attribute("name").unwrap_or_default().to_owned();
        let Some(reference) = node.attribute("valueReference").and_then(|text| text.trim().parse().ok())
        else {
            wrong.push(("description.references", format!("{name} has no value reference")));
            continue;
        };
        let is_type = |child: &Node| base_of(standard, child.tag_name().name()).is_some();
        let of_type = match standard {
            Standard::Fmi2 => node.children().find(is_type),
            Standard::Fmi3 => Some(*node),
        };
        let Some(of_type) = of_type else {
            wrong.push(("description.types", format!("{name} has no type")));
            continue;
        };
        let base = base_of(standard, of_type.tag_name().name());
        let declared_type = of_type.attribute("declaredType").map(str::to_owned);
        let declared = declared_type.as_ref().and_then(|name| types.get(name.as_str()));
        let of_both = |name: &str| {
            of_type.attribute(name).or_else(|| {
                let node = declared?;
                node.attribute(name).or_else(|| node.children().find_map(|child| child.attribute(name)))
            })
        };
        let number = |name: &str| of_both(name).and_then(|text| text.trim().parse::<f64>().ok());
        let causality = node.attribute("causality").unwrap_or("local").to_owned();
        let variability = node
            .attribute("variability")
            .unwrap_or_else(|| default_variability(standard, &causality, base))
            .to_owned();
        let initial = node
            .attribute("initial")
            .map_or_else(|| default_initial(&causality, &variability).to_owned(), str::to_owned);
        let size = array_size(*node, &sizes);
        let start = start_values(*node, of_type, base, size);
        // Structural parameters, which define the sizes of arrays.
        if base.is_some_and(|base| base == BaseType::UInt64) {
            sizes.insert(reference, start.first().and_then(|text| text.parse().ok()));
        }
        let derivative_of = of_type.attribute("derivative").and_then(|text| {
            let number: u32 = text.trim().parse().ok()?;
            match standard {
                Standard::Fmi2 => (number as usize).checked_sub(1),
                Standard::Fmi3 => by_reference.get(&number).copied(),
            }
        });
        found.push(Variable {
            name,
            reference,
            base,
            causality,
            variability,
            initial,
            start,
            size,
            min: number("min"),
            max: number("max"),
            nominal: number("nominal").filter(|nominal| *nominal > 0.0).unwrap_or(1.0),
            unit: of_both("unit").map(str::to_owned),
            declared_type,
            derivative_of,
            clocked: node.attribute("clocks").is_some(),
            once_per_instant: node.attribute("canHandleMultipleSetPerTimeInstant") == Some("false"),
        });
    }
    found
}

//! Reads the description of a model that its library returns: general information, the variables and their start values.

use anyhow::{Context, Result, anyhow, ensure};
use fmi_abi::description::{self, About, Attributes, Item};
use fmi_abi::{BaseType, BaseUnit, Causality, DisplayUnit, Initial, Interface, Unit, Value, Variability};
use serde_json::Value as Json;
use std::ops::Deref;
use std::str::FromStr;
use std::sync::Arc;

/// The version of the description's format that is read here.
const VERSION: u64 = 1;

/// The description of a model.
#[derive(Debug)]
pub(crate) struct Table {
    pub info: Info,
    /// Whether any variable is an array.
    pub arrays: bool,
    pub co_simulation: Option<CoSimulation>,
    pub model_exchange: Option<ModelExchange>,
    pub partials: bool,
    pub input_derivatives: bool,
    /// The highest order of output derivatives.
    pub output_derivatives: u32,
    /// The states and their derivatives, as indices in the list of variables.
    pub states: Vec<(u32, u32)>,
    /// The variables; an array has one entry for each element. The index of a variable is its value reference in FMI 2.0.
    pub variables: Vec<Variable>,
    /// The start values for each interface type that the model offers.
    pub starts: Vec<(Interface, Start)>,
}

/// General information about a model (section 2.2.1 of FMI 2.0).
#[derive(Debug)]
pub(crate) struct Info {
    pub name: String,
    pub identifier: String,
    pub guid: String,
    pub about: About,
    pub start_time: f64,
    pub stop_time: f64,
    pub step_size: f64,
    pub tolerance: f64,
    pub smooth: bool,
}

#[derive(Debug)]
pub(crate) struct CoSimulation {
    pub variable_step_size: bool,
    pub event_mode: bool,
    pub ends_early: bool,
}

#[derive(Debug)]
pub(crate) struct ModelExchange {
    pub indicators: usize,
    pub step_completed: bool,
}

/// A variable, or an element of an array, with what only the build needs of it.
#[derive(Debug)]
pub(crate) struct Variable {
    /// The variable in FMI 2.0, where each element of an array is one. It has no start value yet.
    pub described: description::Variable,
    pub base: BaseType,
    /// The name without indices.
    pub name_of_array: String,
    /// The sizes of its array; empty for a scalar.
    pub shape: Vec<usize>,
    /// The number of the element, counted from 0, row by row.
    pub element: usize,
    /// The items of its enumeration.
    pub items: Vec<Item>,
    /// The definition of its unit.
    pub unit: Option<Unit>,
    /// The indices of the variables that it depends on, if the model declares them.
    pub dependencies: Option<Vec<u32>>,
    pub depends_on_time: bool,
    pub state: bool,
}

/// Gives access to what the description contains.
impl Deref for Variable {
    type Target = description::Variable;

    fn deref(&self) -> &description::Variable {
        &self.described
    }
}

/// The start values of a new model.
#[derive(Debug)]
pub(crate) enum Start {
    /// The start value of each variable, by index, `None` if it has none; and the index of the first event indicator that the model
    /// does not overwrite, if there is one.
    Values { values: Vec<Option<Value>>, forgotten_indicator: Option<usize> },
    /// The index of a variable that cannot be read.
    Unreadable(usize),
    /// The reason why the model cannot be instantiated: the error or the panic of its `new`.
    Error(String),
}

impl Table {
    /// Reads the description that a library returns.
    pub fn read(description: &str) -> Result<Self> {
        let json: Json = serde_json::from_str(description)
            .context("the library returns no description, as its model panics")?;
        ensure!(
            json["version"].as_u64() == Some(VERSION),
            "its version of fmu-export differs from the version of fmu-package, {}",
            env!("CARGO_PKG_VERSION")
        );
        let variables = json["variables"].as_array().with_context(lacks("variables"))?.iter().enumerate();
        let variables: Vec<_> =
            variables.map(|(index, json)| variable(index, json)).collect::<Result<_>>()?;
        let starts = list(&json, "starts", |json| start(json, &variables))?;
        let mut table = Self {
            info: info(&json)?,
            arrays: flag(&json, "arrays")?,
            co_simulation: some(&json, "coSimulation", |json| {
                Ok(CoSimulation {
                    variable_step_size: flag(json, "variableStepSize")?,
                    event_mode: flag(json, "eventMode")?,
                    ends_early: flag(json, "endsEarly")?,
                })
            })?,
            model_exchange: some(&json, "modelExchange", |json| {
                let indicators = count(&json["indicators"])?;
                Ok(ModelExchange { indicators, step_completed: flag(json, "stepCompleted")? })
            })?,
            partials: flag(&json, "partials")?,
            input_derivatives: flag(&json, "inputDerivatives")?,
            output_derivatives: count(&json["outputDerivatives"])?,
            states: list(&json, "states", |pair| Ok((count(&pair[0])?, count(&pair[1])?)))?,
            variables,
            starts: Vec::new(),
        };
        table.starts = table.interfaces().zip(starts).collect();
        Ok(table)
    }

    /// The interface types that the model offers.
    pub fn interfaces(&self) -> impl Iterator<Item = Interface> + use<> {
        let co_simulation = self.co_simulation.as_ref().map(|_| Interface::CoSimulation);
        let model_exchange = self.model_exchange.as_ref().map(|_| Interface::ModelExchange);
        [co_simulation, model_exchange].into_iter().flatten()
    }

    /// Returns the variable with this index; `None` for a time or an event indicator that is not a variable of the model.
    pub fn variable(&self, index: u32) -> Option<&Variable> {
        self.variables.get(index as usize)
    }

    /// Returns the index of the time; the index after the last variable if the model does not declare the time.
    pub fn time(&self) -> u32 {
        let is_time = |variable: &Variable| variable.causality == Causality::Independent;
        self.variables.iter().position(is_time).unwrap_or(self.variables.len()) as u32
    }

    /// Returns the indices of all elements of the array that this element belongs to; for a scalar, only its own index.
    pub fn array(&self, index: u32) -> Vec<u32> {
        let variable = &self.variables[index as usize];
        (index - variable.element as u32..).take(variable.length()).collect()
    }

    /// Returns the name of a variable, or `time` for an undeclared time.
    pub fn name(&self, index: u32) -> &str {
        self.variable(index).map_or("time", |variable| variable.name.as_str())
    }

    /// The number of event indicators.
    pub fn indicators(&self) -> usize {
        self.model_exchange.as_ref().map_or(0, |offer| offer.indicators)
    }

    /// Returns the index of the event indicator with this number, counted from 0. The indicators follow the variables and the time.
    pub fn indicator(&self, number: usize) -> u32 {
        (self.variables.len() as u32).max(self.time() + 1) + number as u32
    }

    /// The indices of the variables that are selected.
    pub fn find(&self, is_selected: impl Fn(&Variable) -> bool) -> Vec<u32> {
        (0..)
            .zip(&self.variables)
            .filter(|(_, variable)| is_selected(variable))
            .map(|(index, _)| index)
            .collect()
    }
}

impl Variable {
    /// The number of elements of its array; 1 for a scalar.
    pub fn length(&self) -> usize {
        self.shape.iter().product()
    }

    /// The smallest and the largest integer that the model allows; `None` for a variable that is no integer.
    pub fn range(&self) -> Option<(i128, i128)> {
        let limit = |limit: &Option<Value>, default| match limit {
            Some(Value::Integer(limit)) => *limit,
            _ => default,
        };
        let (min, max) = self.base.range()?;
        Some((limit(&self.attributes.min, min), limit(&self.attributes.max, max)))
    }

    /// Whether it has a start value: inputs, and variables whose `initial` is exact or approx (section 2.2.7 of FMI 2.0).
    pub fn has_start(&self) -> bool {
        self.causality == Causality::Input || matches!(self.initial, Some(Initial::Exact | Initial::Approx))
    }

    /// Whether its value can differ from its start value.
    pub fn is_moved(&self) -> bool {
        self.variability != Variability::Constant
    }

    /// Whether it begins with exactly its start value, which the importer may change.
    pub fn is_exact(&self) -> bool {
        self.initial == Some(Initial::Exact) && self.variability != Variability::Constant
    }

    /// Whether other variables may depend on it (section 2.2.8 of FMI 2.0): inputs, states, the time, and variables with an exact
    /// start value.
    pub fn is_known(&self) -> bool {
        matches!(self.causality, Causality::Input | Causality::Independent) || self.state || self.is_exact()
    }
}

fn info(json: &Json) -> Result<Info> {
    Ok(Info {
        name: text(json, "name")?,
        identifier: text(json, "identifier")?,
        guid: text(json, "guid")?,
        about: About {
            description: text(json, "description")?,
            author: text(json, "author")?,
            version: text(json, "modelVersion")?,
            license: text(json, "license")?,
            copyright: text(json, "copyright")?,
            generation_tool: concat!("fmu-package ", env!("CARGO_PKG_VERSION")).to_owned(),
        },
        start_time: number(json, "startTime")?,
        stop_time: number(json, "stopTime")?,
        step_size: number(json, "stepSize")?,
        tolerance: number(json, "tolerance")?,
        smooth: flag(json, "smooth")?,
    })
}

/// Reads the variable at this index.
fn variable(index: usize, json: &Json) -> Result<Variable> {
    let initial = json["initial"].as_str().map(|name| Initial::of_name(name).with_context(lacks("initial")));
    let of_type = &json["type"];
    let base = text(of_type, "base")?;
    let base =
        BaseType::ALL.into_iter().find(|known| known.to_string() == base).with_context(lacks("base"))?;
    let causality = Causality::of_name(&text(json, "causality")?).with_context(lacks("causality"))?;
    let variability = Variability::of_name(&text(json, "variability")?).with_context(lacks("variability"))?;
    let scalar = description::Variable::scalar(
        text(json, "name")?,
        u32::try_from(index)?,
        base,
        causality,
        variability,
    );
    let described = description::Variable {
        initial: initial.transpose()?,
        attributes: attributes(base, of_type)?,
        declared_type: Some(text(of_type, "name")?).filter(|name| !name.is_empty()),
        derivative_of: some(json, "differentiates", count)?,
        reinit: flag(json, "reinit")?,
        description: text(json, "description")?,
        ..scalar
    };
    Ok(Variable {
        described,
        base,
        name_of_array: text(json, "array")?,
        shape: list(json, "dimensions", count)?,
        element: count(&json["element"])?,
        items: of_type["items"]
            .is_array()
            .then(|| list(of_type, "items", item))
            .transpose()?
            .unwrap_or_default(),
        unit: some(of_type, "unit", unit)?,
        dependencies: match json["dependencies"].is_null() {
            true => None,
            false => Some(list(json, "dependencies", count)?),
        },
        depends_on_time: json["dependsOnTime"] == true,
        state: flag(json, "state")?,
    })
}

fn item(json: &Json) -> Result<Item> {
    let value = json["value"].as_i64().with_context(lacks("value"))?;
    Ok(Item { name: text(json, "name")?, value, description: text(json, "description")? })
}

/// Reads the attributes of a type. A limit that is the smallest or the largest value of an integer type anyway is no limit.
fn attributes(base: BaseType, json: &Json) -> Result<Attributes> {
    let filled = |name: &str| match json[name].is_null() {
        true => Ok(None),
        false => anyhow::Ok(Some(Arc::from(text(json, name)?)).filter(|text: &Arc<str>| !text.is_empty())),
    };
    let real = |name| some(json, name, |_| number(json, name)).map(|limit| limit.map(Value::Real));
    let integer = |name| some(json, name, |_| number(json, name));
    let (smallest, largest) = base.range().unzip();
    let [min, max] = [integer("smallest")?, integer("largest")?];
    let unit = &json["unit"];
    Ok(Attributes {
        quantity: filled("quantity")?,
        unit: some(json, "unit", |unit| Ok(Arc::from(text(unit, "name")?)))?,
        display_unit: some(unit, "display", |display| Ok(Arc::from(text(display, "name")?)))?,
        is_relative: false,
        min: real("min")?.or(min.filter(|_| min != smallest).map(Value::Integer)),
        max: real("max")?.or(max.filter(|_| max != largest).map(Value::Integer)),
        nominal: some(json, "nominal", |_| number(json, "nominal"))?,
        mime_type: some(json, "mimeType", |_| Ok(Arc::from(text(json, "mimeType")?)))?,
        max_size: some(json, "maxSize", count)?,
    })
}

fn unit(json: &Json) -> Result<Unit> {
    let display = |json: &Json| {
        Ok(DisplayUnit {
            name: text(json, "name")?,
            factor: number(json, "factor")?,
            offset: number(json, "offset")?,
        })
    };
    let exponent = |json: &Json| json.as_i64().and_then(|exponent| exponent.try_into().ok());
    let exponents = list(json, "exponents", |json| exponent(json).with_context(lacks("exponents")))?;
    let base = BaseUnit {
        exponents: exponents.try_into().ok().with_context(lacks("exponents"))?,
        factor: number(json, "factor")?,
        offset: number(json, "offset")?,
    };
    Ok(Unit { base: Some(base), display_units: Vec::from_iter(some(json, "display", display)?) })
}

fn start(json: &Json, variables: &[Variable]) -> Result<Start> {
    if let Some(error) = json["error"].as_str() {
        return Ok(Start::Error(error.to_owned()));
    }
    let values = list(json, "values", |json| Ok(json.clone()))?;
    if let Some(index) = values.iter().position(|value| *value == false) {
        return Ok(Start::Unreadable(index));
    }
    let value = |(variable, json): (&Variable, &Json)| {
        let read = |text| Value::read(variable.base, text).with_context(lacks("values"));
        json.as_str().map(read).transpose()
    };
    Ok(Start::Values {
        values: variables.iter().zip(&values).map(value).collect::<Result<_>>()?,
        forgotten_indicator: some(json, "forgottenIndicator", count)?,
    })
}

fn lacks(name: &str) -> impl Fn() -> String + use<'_> {
    move || format!("the library's description of its model lacks a valid {name}")
}

fn text(json: &Json, name: &str) -> Result<String> {
    Ok(json[name].as_str().with_context(lacks(name))?.to_owned())
}

/// Reads a number that is written as a string, with all its digits.
fn number<T: FromStr>(json: &Json, name: &str) -> Result<T> {
    text(json, name)?.parse().map_err(|_| anyhow!(lacks(name)()))
}

fn flag(json: &Json, name: &str) -> Result<bool> {
    json[name].as_bool().with_context(lacks(name))
}

fn count<T: TryFrom<u64>>(json: &Json) -> Result<T> {
    json.as_u64().and_then(|count| count.try_into().ok()).with_context(lacks("number"))
}

fn list<T>(json: &Json, name: &str, read: impl Fn(&Json) -> Result<T>) -> Result<Vec<T>> {
    json[name].as_array().with_context(lacks(name))?.iter().map(read).collect()
}

fn some<T>(json: &Json, name: &str, read: impl Fn(&Json) -> Result<T>) -> Result<Option<T>> {
    Some(&json[name]).filter(|json| !json.is_null()).map(read).transpose()
}

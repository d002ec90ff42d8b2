//! Reads the description of a model that its library returns: general information, the variables and their start values.

use anyhow::{Context, Result, anyhow, ensure};
use fmi_abi::{BaseType, BaseUnit, Causality, DisplayUnit, Initial, Interface, Value, Variability};
use serde_json::Value as Json;
use std::str::FromStr;

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
    pub description: String,
    pub author: String,
    pub version: String,
    pub license: String,
    pub copyright: String,
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

/// A variable, or an element of an array.
#[derive(Debug)]
pub(crate) struct Variable {
    /// The name; the name of an element of an array has its indices.
    pub name: String,
    /// The name without indices.
    pub name_of_array: String,
    pub dimensions: Vec<usize>,
    /// The number of the element, counted from 0, row by row.
    pub element: usize,
    pub description: String,
    pub causality: Causality,
    pub variability: Variability,
    pub initial: Option<Initial>,
    pub variable_type: Type,
    /// The index of the variable whose derivative this is.
    pub differentiates: Option<u32>,
    /// The indices of the variables that it depends on, if the model declares them.
    pub dependencies: Option<Vec<u32>>,
    pub depends_on_time: bool,
    pub state: bool,
    pub reinit: bool,
}

#[derive(Debug, PartialEq)]
pub(crate) struct Type {
    pub name: String,
    pub base: BaseType,
    pub attributes: Attributes,
}

#[derive(Debug, PartialEq)]
pub(crate) enum Attributes {
    Real { quantity: String, unit: Unit, min: Option<f64>, max: Option<f64>, nominal: Option<f64> },
    Integer { min: i128, max: i128 },
    Binary { mime_type: String, max_size: usize },
    Enumeration(Vec<Item>),
    Other,
}

#[derive(Debug, PartialEq)]
pub(crate) struct Item {
    pub name: String,
    pub value: i32,
    pub description: String,
}

#[derive(Debug, PartialEq)]
pub(crate) struct Unit {
    pub name: String,
    pub base: BaseUnit,
    pub display: Option<DisplayUnit>,
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
        let variables: Vec<_> = list(&json, "variables", variable)?;
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
    pub fn base(&self) -> BaseType {
        self.variable_type.base
    }

    /// The number of elements of its array; 1 for a scalar.
    pub fn length(&self) -> usize {
        self.dimensions.iter().product()
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

impl Type {
    /// The unit of a Real.
    pub fn unit(&self) -> Option<&Unit> {
        match &self.attributes {
            Attributes::Real { unit, .. } => Some(unit),
            _ => None,
        }
    }
}

fn info(json: &Json) -> Result<Info> {
    Ok(Info {
        name: text(json, "name")?,
        identifier: text(json, "identifier")?,
        guid: text(json, "guid")?,
        description: text(json, "description")?,
        author: text(json, "author")?,
        version: text(json, "modelVersion")?,
        license: text(json, "license")?,
        copyright: text(json, "copyright")?,
        start_time: number(json, "startTime")?,
        stop_time: number(json, "stopTime")?,
        step_size: number(json, "stepSize")?,
        tolerance: number(json, "tolerance")?,
        smooth: flag(json, "smooth")?,
    })
}

fn variable(json: &Json) -> Result<Variable> {
    let initial = json["initial"].as_str().map(|name| Initial::of_name(name).with_context(lacks("initial")));
    Ok(Variable {
        name: text(json, "name")?,
        name_of_array: text(json, "array")?,
        dimensions: list(json, "dimensions", count)?,
        element: count(&json["element"])?,
        description: text(json, "description")?,
        causality: Causality::of_name(&text(json, "causality")?).with_context(lacks("causality"))?,
        variability: Variability::of_name(&text(json, "variability")?).with_context(lacks("variability"))?,
        initial: initial.transpose()?,
        variable_type: variable_type(&json["type"])?,
        differentiates: some(json, "differentiates", count)?,
        dependencies: match json["dependencies"].is_null() {
            true => None,
            false => Some(list(json, "dependencies", count)?),
        },
        depends_on_time: json["dependsOnTime"] == true,
        state: flag(json, "state")?,
        reinit: flag(json, "reinit")?,
    })
}

fn variable_type(json: &Json) -> Result<Type> {
    let base = text(json, "base")?;
    let base = BaseType::ALL.into_iter().find(|known| known.to_string() == base);
    let limit = |name| json[name].is_string().then(|| number(json, name)).transpose();
    let attributes = if json["unit"].is_object() {
        Attributes::Real {
            quantity: text(json, "quantity")?,
            unit: unit(&json["unit"])?,
            min: limit("min")?,
            max: limit("max")?,
            nominal: limit("nominal")?,
        }
    } else if json["smallest"].is_string() {
        Attributes::Integer { min: number(json, "smallest")?, max: number(json, "largest")? }
    } else if json["mimeType"].is_string() {
        Attributes::Binary { mime_type: text(json, "mimeType")?, max_size: count(&json["maxSize"])? }
    } else if json["items"].is_array() {
        Attributes::Enumeration(list(json, "items", |item| {
            let value = item["value"].as_i64().and_then(|value| value.try_into().ok());
            let value = value.with_context(lacks("value"))?;
            Ok(Item { name: text(item, "name")?, value, description: text(item, "description")? })
        })?)
    } else {
        Attributes::Other
    };
    Ok(Type { name: text(json, "name")?, base: base.with_context(lacks("base"))?, attributes })
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
    Ok(Unit {
        name: text(json, "name")?,
        base: BaseUnit {
            exponents: exponents.try_into().ok().with_context(lacks("exponents"))?,
            factor: number(json, "factor")?,
            offset: number(json, "offset")?,
        },
        display: some(json, "display", display)?,
    })
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
        let read = |text| Value::read(variable.base(), text).with_context(lacks("values"));
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

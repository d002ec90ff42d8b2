//! An instance of a model, called as an importer calls it.
//!
//! Instances use FMI 3.0, because it has all types. Only derivatives of inputs need FMI 2.0, because FMI 3.0 does not have them.

use crate::model::{Group, LoadedModel};
use crate::table::Variable;
use fmi_abi::client::{Continuous, Rejection, Settings};
use fmi_abi::{BaseType, Interface, Standard, Value};

/// The result of a call; the error is the message of the model.
pub(crate) type Outcome<T = ()> = Result<T, String>;

/// An instance.
pub(crate) struct Instance<'a> {
    model: &'a LoadedModel,
    pub interface: Interface,
    standard: Standard,
    event_mode: bool,
    client: fmi_abi::client::Instance,
    pub time: f64,
}

impl<'a> Instance<'a> {
    /// Creates an instance. `event_mode` enables Event Mode in Co-Simulation of FMI 3.0.
    pub fn new(
        model: &'a LoadedModel,
        interface: Interface,
        standard: Standard,
        event_mode: bool,
    ) -> Outcome<Self> {
        let settings = Settings {
            token: model.guid(),
            resources: model.resources(),
            event_mode,
            early_return: true,
            ..Settings::new(interface)
        };
        model.monitor.begin("the instantiation");
        let client = fmi_abi::client::Instance::new(model.functions(standard), &settings).map_err(message)?;
        Ok(Self { model, client, interface, standard, event_mode, time: 0.0 })
    }

    /// Returns the client for a call, and records the call, which has this name in messages.
    fn client(&mut self, call: &'static str) -> &mut fmi_abi::client::Instance {
        self.model.monitor.begin(call);
        &mut self.client
    }

    pub fn initialize(&mut self, start: f64, stop: Option<f64>, tolerance: Option<f64>) -> Outcome {
        self.time = start;
        self.client("initialize").initialize(start, stop, tolerance).map_err(message)
    }

    pub fn initialized(&mut self) -> Outcome {
        self.client("exit_initialization_mode").exit_initialization_mode().map_err(message)
    }

    /// Leaves Event Mode after the initialization without iterating an event, because an event would change discrete variables.
    pub fn run(&mut self) -> Outcome {
        match self.interface {
            Interface::ModelExchange => {
                self.client("enter_continuous_time_mode").enter_continuous_time_mode().map_err(message)
            }
            Interface::CoSimulation if self.event_mode => {
                self.client("enter_step_mode").enter_step_mode().map_err(message)
            }
            Interface::CoSimulation => Ok(()),
        }
    }

    /// Does a step of Co-Simulation. Returns false if the model ends the simulation.
    pub fn step(&mut self, size: f64) -> Outcome<bool> {
        let time = self.time;
        match self.client("step").step(time, size) {
            Ok(reached) => {
                self.time = reached;
                Ok(true)
            }
            Err(rejection) => match rejection.ended() {
                Some(time) => {
                    self.time = time;
                    Ok(false)
                }
                None => Err(message(rejection)),
            },
        }
    }

    /// Sets first time derivatives of inputs, in FMI 2.0 only.
    pub fn set_input_derivatives(&mut self, indices: &[u32], values: &[f64]) -> Outcome {
        if self.standard != Standard::Fmi2 || indices.is_empty() {
            return Ok(());
        }
        self.client("set_input_derivatives")
            .set_input_derivatives(indices, &vec![1; indices.len()], values)
            .map_err(message)
    }

    /// Sets the selected variables that have a value, arrays as a whole, with one call for each type. The model checks all values after
    /// each call, so values that it rejects are set again after those of the other types.
    pub fn set(&mut self, values: &[Option<Value>], is_selected: impl Fn(&Variable) -> bool) -> Outcome {
        let variables = &self.model.table.variables;
        let mut chosen: Vec<bool> = variables
            .iter()
            .zip(values)
            .map(|(variable, value)| value.is_some() && is_selected(variable))
            .collect();
        for (first, variable) in variables
            .iter()
            .enumerate()
            .filter(|(_, variable)| variable.element == 0 && variable.length() > 1)
        {
            let array = &mut chosen[first..first + variable.length()];
            let any = array.contains(&true);
            array.fill(any);
        }
        let is_set = |index: &u32| chosen[*index as usize];
        let mut remaining: Vec<_> =
            self.model.groups.iter().filter(|group| group.indices.iter().any(&is_set)).collect();
        loop {
            let before = remaining.len();
            let mut rejected = None;
            remaining.retain(|group| {
                let indices: Vec<u32> = group.indices.iter().copied().filter(&is_set).collect();
                let values: Vec<Value> =
                    indices.iter().flat_map(|index| values[*index as usize].clone()).collect();
                if !self.client.has_type(group.base) {
                    return false;
                }
                let references = self.references(&indices);
                let outcome =
                    self.client("set_values").set_values(group.base, &references, &values).map_err(message);
                let is_rejected = outcome.is_err();
                rejected = outcome.err().or(rejected.take());
                is_rejected
            });
            match rejected {
                None => return Ok(()),
                Some(message) if remaining.len() == before => return Err(message),
                Some(_) => {}
            }
        }
    }

    /// Returns the value references of variables; in FMI 3.0, an array has the reference of its first element.
    fn references(&self, indices: &[u32]) -> Vec<u32> {
        let has_reference = |index: &&u32| {
            self.standard == Standard::Fmi2
                || self.model.table.variable(**index).is_none_or(|variable| variable.element == 0)
        };
        indices.iter().filter(has_reference).map(|index| self.standard.reference(*index)).collect()
    }

    /// Returns the values of all variables; NaN for a value that the model does not return.
    pub fn values(&mut self) -> Vec<Value> {
        let mut all = vec![Value::Real(f64::NAN); self.model.table.variables.len()];
        for Group { base, indices } in &self.model.groups {
            if self.read(*base, indices, &mut all).is_err() {
                for index in indices {
                    if !self.references(&[*index]).is_empty() {
                        let _ = self.read(*base, &self.array(*index), &mut all);
                    }
                }
            }
        }
        all
    }

    /// Reads variables of a type into their places in `all`, the values of all variables.
    fn read(&mut self, base: BaseType, indices: &[u32], all: &mut [Value]) -> Outcome {
        let references = self.references(indices);
        let values = self.get_values(base, &references, indices.len())?;
        indices.iter().zip(values).for_each(|(index, value)| all[*index as usize] = value);
        Ok(())
    }

    /// Returns the variables that must be read and set together with this one: in FMI 3.0, all elements of its array.
    fn array(&self, index: u32) -> Vec<u32> {
        match self.standard {
            Standard::Fmi2 => vec![index],
            Standard::Fmi3 => self.model.table.array(index),
        }
    }

    fn get_values(&mut self, base: BaseType, vr: &[u32], count: usize) -> Outcome<Vec<Value>> {
        if !self.client.has_type(base) {
            // FMI 2.0 does not have this type. A constant stands in for the values.
            return Ok(vec![Value::Boolean(false); count]);
        }
        self.client("get_values").get_values(base, vr, count).map_err(message)
    }

    /// Returns the partial derivatives of Reals, arrays as a whole, with respect to one Real: `None` for a derivative that the model
    /// does not provide. NaN if the call fails for another reason, such as an infinite result.
    pub fn partials(&mut self, unknowns: &[u32], known: u32) -> Vec<Option<f64>> {
        if let Ok(all) = self.all_partials(unknowns, known) {
            return all.into_iter().map(Some).collect();
        }
        let mut found = Vec::with_capacity(unknowns.len());
        while let Some(index) = unknowns.get(found.len()) {
            let array = self.array(*index);
            match self.all_partials(&array, known) {
                Ok(all) => found.extend(all.into_iter().map(Some)),
                Err(message) => {
                    // A failure without a message also counts as a derivative that is not provided.
                    let has_none = message.is_empty() || message.ends_with("is not provided");
                    found.extend(array.iter().map(|_| (!has_none).then_some(f64::NAN)));
                }
            }
        }
        found
    }

    /// Returns the partial derivatives of unknowns, which must include all elements of their arrays; fails if one is not provided.
    fn all_partials(&mut self, unknowns: &[u32], known: u32) -> Outcome<Vec<f64>> {
        let (length, element) = match self.model.table.variable(known) {
            Some(variable) if self.standard == Standard::Fmi3 => (variable.length(), variable.element),
            _ => (1, 0),
        };
        let mut seed = vec![0.0; length];
        seed[element] = 1.0;
        let known = [self.standard.reference(known - element as u32)];
        let references = self.references(unknowns);
        let mut found = vec![f64::NAN; unknowns.len()];
        self.client("directional_derivative")
            .directional_derivative(&references, &known, &seed, &mut found)
            .map_err(message)?;
        Ok(found)
    }

    fn continuous(&mut self, what: Continuous, count: usize) -> Outcome<Vec<f64>> {
        let mut values = vec![0.0; count];
        self.client("get_continuous").get_continuous(what, &mut values).map_err(message)?;
        Ok(values)
    }

    pub fn states(&mut self) -> Outcome<Vec<f64>> {
        self.continuous(Continuous::States, self.model.table.states.len())
    }

    pub fn set_states(&mut self, states: &[f64]) -> Outcome {
        self.client("set_continuous_states").set_continuous_states(states).map_err(message)
    }
}

/// Returns the message of the model, without the name of the function that rejects a call; empty if there is none.
fn message(rejection: Rejection) -> String {
    let text = rejection.reason().map(|message| message.text.as_str()).unwrap_or_default();
    let (function, rest) = text.split_once(": ").unwrap_or_default();
    if function.starts_with("fmi") { rest.to_owned() } else { text.to_owned() }
}

//! Model description of an FMU, with the rules that it breaks.

use crate::call_sequence::Kind;
use crate::rules::Observation;
use fmi_abi::description::{Fault, ModelDescription};
pub use fmi_abi::description::{Offer, Unknown, Variable};
use fmi_abi::{
    BaseType, Causality, Initial, Standard, Value, Variability, empty_range, ends_too_early, is_c_identifier,
    shown,
};
use std::collections::HashSet;
use std::ops::Deref;

/// Model description, with values that the checks derive from it.
#[derive(Clone, Debug)]
pub struct Description {
    written: ModelDescription,
    /// The file.
    pub text: String,
    pub start_time: f64,
    /// Stop time of the default experiment, if it has one.
    pub stop_time: Option<f64>,
    /// Step size of the default experiment, if it has a positive one.
    pub step_size: Option<f64>,
    /// Rules that the model description breaks, except those of `consistency`.
    pub wrong: Vec<Observation>,
    /// Types and value references of the variables that may be read in Initialization Mode of FMI 2.0.
    early: HashSet<Handle>,
}

/// Gives access to the fields of the model description.
impl Deref for Description {
    type Target = ModelDescription;

    fn deref(&self) -> &ModelDescription {
        &self.written
    }
}

impl Description {
    /// Parses a `modelDescription.xml`.
    ///
    /// # Errors
    /// Fails if `ModelDescription::parse` rejects the string, for example because it is not XML, or if it has another FMI version
    /// or a draft of FMI 3.0.
    pub fn parse(text: &str) -> Result<Self, String> {
        let written = ModelDescription::parse(text)?;
        if written.standard == Standard::Fmi3 && written.version.contains('-') {
            return Err(format!(
                "its fmiVersion is {:?}, a draft of FMI 3.0, whose functions may differ; FMI 2.0 and 3.0 are supported",
                written.version
            ));
        }
        let [start_time, stop_time, step_size] = written.default_experiment;
        let observation = |(fault, why): &(Fault, String)| {
            let rule = match fault {
                Fault::Interface => "description.interfaces",
                Fault::Reference => "description.references",
                Fault::Type | Fault::Definition => "description.types",
                Fault::Structure | Fault::Unknown => "description.structure",
                Fault::Unit => "description.units",
                Fault::Dimension => "description.dimensions",
                Fault::Experiment => "description.tolerance",
                Fault::Attribute | Fault::Value => return None,
            };
            Some((rule, why.clone()))
        };
        let mut description = Self {
            start_time: start_time.unwrap_or(0.0),
            stop_time,
            step_size: step_size.filter(|size| *size > 0.0 && size.is_finite()),
            wrong: written.faults.iter().filter_map(observation).collect(),
            early: early(&written),
            text: text.to_owned(),
            written,
        };
        let wrong = description.evaluate();
        description.wrong.extend(wrong);
        Ok(description)
    }

    /// Returns the broken rules that `ModelDescription::parse` does not report.
    fn evaluate(&self) -> Vec<Observation> {
        let mut wrong = Vec::new();
        let token = if self.standard == Standard::Fmi2 { "guid" } else { "instantiationToken" };
        let is_missing = |(fault, why): &(Fault, String)| *fault == Fault::Attribute && why.ends_with(token);
        if self.faults.iter().any(is_missing) {
            wrong.push(("description.token", format!("{token} is missing")));
        } else if self.token.is_empty() {
            wrong.push(("description.empty-token", format!("{token} is empty")));
        }
        if self.co_simulation.is_none() && self.model_exchange.is_none() && self.scheduled_execution.is_none()
        {
            wrong.push(("description.interfaces", "it offers no interface type".to_owned()));
        }
        for offer in [&self.co_simulation, &self.model_exchange].into_iter().flatten() {
            let identifier = &offer.identifier;
            if identifier.is_empty() {
                wrong.push(("description.identifier", "modelIdentifier is missing or empty".to_owned()));
            } else if !is_c_identifier(identifier) {
                wrong.push(("description.identifier", format!("modelIdentifier is {identifier:?}")));
            }
        }
        let outputs: HashSet<usize> = self.outputs.iter().map(|unknown| unknown.variable).collect();
        let (mut names, mut references) = (HashSet::new(), HashSet::new());
        for (index, variable) in self.variables.iter().enumerate() {
            let name = &variable.name;
            let (listed, output) = (outputs.contains(&index), variable.causality == Causality::Output);
            let mut add = |rule, why: String| wrong.push((rule, why));
            if !names.insert(name) {
                add("description.names", format!("two variables are called {name:?}"));
            }
            if self.standard == Standard::Fmi3 && !references.insert(variable.reference) {
                let why =
                    format!("another variable has the value reference {} of {name}, too", variable.reference);
                add("description.references", why);
            }
            if output && !listed && !variable.clocked {
                let why = format!("output {name} is not among the outputs of ModelStructure");
                add("description.structure", why);
            }
            if !output && listed {
                let why = format!("{name} is not an output, but is among the outputs of ModelStructure");
                add("description.structure", why);
            }
            if let Some(unit) =
                variable.attributes.unit.as_ref().filter(|unit| !self.units.contains_key(&***unit))
            {
                let why = format!("{name} is in \"{}\", which is not a unit of UnitDefinitions", shown(unit));
                add("description.units", why);
            }
            let declared = variable.declared_type.as_ref();
            if let Some(declared) = declared.filter(|declared| !self.types.contains_key(*declared)) {
                let why = format!(
                    "{name} is of type \"{}\", which is not among the TypeDefinitions",
                    shown(declared)
                );
                add("description.types", why);
            }
            if variable.attributes.display_unit.is_some() && variable.attributes.unit.is_none() {
                add("description.units", format!("{name} has a displayUnit, but no unit"));
            }
            wrong.extend(faults(self.standard, variable));
        }
        let independent = self.variables.iter().filter(|of| of.causality == Causality::Independent).count();
        if independent > 1 || independent == 0 && self.standard == Standard::Fmi3 {
            let why = format!("{independent} variables have the causality independent");
            wrong.push(("description.independent", why));
        }
        if let Some(why) = self.stop_time.and_then(|stop| ends_too_early(self.start_time, stop)) {
            wrong.push(("description.experiment", why));
        }
        wrong
    }

    /// Returns the first attribute whose value is not of its type. The comparison with the schema finds it too, where there is one.
    pub fn unreadable(&self) -> Option<Observation> {
        let (_, why) = self.faults.iter().find(|(fault, _)| *fault == Fault::Value)?;
        Some(("description.schema", why.clone()))
    }

    /// Returns whether most checks use Co-Simulation with Event Mode (section 2.3.1 of FMI 3.0, `eventModeUsed`): only if the FMU
    /// has clocks and offers this mode.
    pub fn event_mode(&self) -> bool {
        let has_clocks = self.variables.iter().any(|variable| variable.base.is_none() || variable.clocked);
        has_clocks && self.co_simulation.as_ref().is_some_and(|offer| offer.can(&["hasEventMode"]))
    }

    /// Returns the variables with the type and value reference of this variable, including the variable itself.
    pub fn aliases(&self, index: usize) -> impl Iterator<Item = usize> + '_ {
        let variable = &self.variables[index];
        let handle = handle(self.standard, variable);
        let all = self.variables.iter().enumerate();
        all.filter(move |(_, other)| crate::description::handle(self.standard, other) == handle)
            .map(|(index, _)| index)
    }

    /// Returns the C type of the values of a variable.
    pub fn kind(&self, index: usize) -> Kind {
        kind_of(self.standard, self.variables[index].base.unwrap_or(BaseType::Boolean))
    }

    /// Returns whether a variable may be read in Initialization Mode. FMI 2.0 allows outputs, continuous states, their
    /// derivatives (note 2 of the tables in sections 3.2.3 and 4.2.4 of FMI 2.0.5) and the initial unknowns; FMI 3.0 allows all
    /// variables.
    pub fn is_readable_while_initializing(&self, index: usize) -> bool {
        self.standard == Standard::Fmi3 || self.early.contains(&handle(self.standard, &self.variables[index]))
    }

    /// Returns the relative difference up to which results of a solver with variable steps are regarded as equal: the tolerance
    /// of the default experiment, or 1e-4.
    pub fn tolerance(&self) -> f64 {
        self.default_tolerance.unwrap_or(1e-4)
    }

    /// Returns the indices of the continuous states, in the order of their derivatives in ModelStructure.
    pub fn states(&self) -> Vec<usize> {
        self.derivatives.iter().filter_map(|unknown| self.variables[unknown.variable].derivative_of).collect()
    }

    /// Returns the number of elements of the state vector; 0 if a size is unknown.
    pub fn states_count(&self) -> usize {
        let sizes = self.derivatives.iter().map(|unknown| self.variables[unknown.variable].size);
        sizes.sum::<Option<usize>>().unwrap_or(0)
    }

    /// Returns the number of event indicators; 0 if it is unknown.
    pub fn indicators_count(&self) -> usize {
        self.event_indicators.unwrap_or(0)
    }

    /// Returns the independent variable, if there is one.
    pub fn independent(&self) -> Option<usize> {
        self.variables.iter().position(|variable| variable.causality == Causality::Independent)
    }

    /// Returns whether a variable is a continuous floating-point number that is not clocked.
    pub fn is_continuous(&self, index: usize) -> bool {
        let variable = &self.variables[index];
        variable.is_float() && variable.variability == Variability::Continuous && !variable.clocked
    }

    /// Returns the names of the elements of these variables. The name of an element of an array has its index, counted from 1.
    pub fn element_names(&self, indices: &[usize]) -> Vec<String> {
        let names = |index: &usize| {
            let variable = &self.variables[*index];
            let count = variable.size.unwrap_or(1);
            (1..=count).map(move |element| match count {
                1 => variable.name.clone(),
                _ => format!("{}[{element}]", variable.name),
            })
        };
        indices.iter().flat_map(names).collect()
    }
}

/// Type in the names of getters and setters, and value reference. In FMI 2.0, variables of different types may have the same reference.
pub type Handle = (Option<&'static str>, u32);

pub fn handle(standard: Standard, variable: &Variable) -> Handle {
    (variable.base.map(|base| type_name(standard, base)), variable.reference)
}

/// Returns the types and value references of outputs, continuous states, their derivatives and initial unknowns.
fn early(written: &ModelDescription) -> HashSet<Handle> {
    let unknowns = written.derivatives.iter().chain(&written.outputs).chain(&written.initial_unknowns);
    let listed = unknowns.map(|unknown| unknown.variable);
    let states = written.derivatives.iter().filter_map(|of| written.variables[of.variable].derivative_of);
    let outputs =
        (0..written.variables.len()).filter(|index| written.variables[*index].causality == Causality::Output);
    let all = listed.chain(states).chain(outputs);
    all.map(|index| handle(written.standard, &written.variables[index])).collect()
}

/// Returns the rules that a single variable breaks.
fn faults(standard: Standard, variable: &Variable) -> Vec<Observation> {
    let (name, mut wrong) = (&variable.name, Vec::new());
    let mut add = |rule, why: String| wrong.push((rule, why));
    let Variable { causality, variability, initial, .. } = *variable;
    if variable.base.is_none() || variable.clocked {
        // Clocks and clocked variables have other rules.
    } else if !causality.permits(variability) {
        add("description.combination", format!("{name} is {causality} and {variability}"));
    } else if !causality.permits_initial(standard, variability, initial) {
        let initial = initial.map_or_else(String::new, |initial| initial.to_string());
        let why = format!("{name} is {causality} and {variability}, with initial = {initial}");
        add("description.combination", why);
    }
    if variability == Variability::Continuous && !variable.is_float() && variable.base.is_some() {
        add("description.combination", format!("{name} is continuous, but not a floating-point number"));
    }
    let needs_start = matches!(initial, Some(Initial::Exact | Initial::Approx))
        || causality == Causality::Input && variable.base.is_some();
    if needs_start && variable.start.is_empty() && causality != Causality::Independent && !variable.clocked {
        add("description.start", format!("{name} ({causality}) has no start value"));
    }
    if initial == Some(Initial::Calculated) && !variable.start.is_empty() && variable.base.is_some() {
        add("description.start", format!("{name} is calculated and has a start value"));
    }
    if let (Some(min), Some(max)) = (variable.min(), variable.max())
        && let Some(why) = empty_range(min, max)
    {
        add("description.range", format!("the range of {name} is empty: {why}"));
    }
    let outside = |number: &f64| {
        variable.min().is_some_and(|min| *number < min) || variable.max().is_some_and(|max| *number > max)
    };
    if let Some(number) = variable.starts().into_iter().find(outside) {
        let why = format!("the start value of {name}, {number}, is outside its min and max");
        add("description.range", why);
    }
    let is_value = |text: &String| variable.base.is_none_or(|base| Value::read(base, text).is_some());
    if !variable.start.iter().all(is_value) {
        let what = variable.base.map_or("value".to_owned(), |base| base.to_string());
        let why = format!("the start value of {name}, {:?}, is not a {what}", variable.start.join(" "));
        add("description.start", why);
    }
    wrong
}

/// Returns the type as it is written in the names of getters and setters, for example `Float64` for fmi3GetFloat64.
pub fn type_name(standard: Standard, base: BaseType) -> &'static str {
    match (standard, base) {
        (Standard::Fmi2, BaseType::Enumeration) => "Integer",
        (Standard::Fmi3, BaseType::Enumeration) => "Int64",
        (_, base) => base.element(standard).unwrap_or("Integer"),
    }
}

/// Returns the C type of the values of an FMI type.
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

#[cfg(test)]
mod tests {
    use super::Description;

    /// In FMI 2.0, variables of different types may have the same value reference (section 2.2.7), but they are not aliases, so another
    /// one may be readable in other modes.
    #[test]
    fn references_belong_to_a_type() {
        let variables: String = [("a", "output", "Real"), ("b", "local", "Integer"), ("c", "local", "Boolean")]
            .map(|(name, causality, of)| {
                let variability = if of == "Real" { "continuous" } else { "discrete" };
                format!(
                    "<ScalarVariable name='{name}' valueReference='1' causality='{causality}' variability='{variability}'>\
                     <{of}/></ScalarVariable>"
                )
            })
            .concat();
        let text = format!(
            "<fmiModelDescription fmiVersion='2.0' guid='g' modelName='m'><CoSimulation modelIdentifier='m'/>\
             <ModelVariables>{variables}</ModelVariables></fmiModelDescription>"
        );
        let description = Description::parse(&text).expect("a model description");
        for index in 0..3 {
            assert_eq!(description.aliases(index).collect::<Vec<_>>(), [index]);
            assert_eq!(description.is_readable_while_initializing(index), index == 0);
        }
    }

    #[test]
    fn start_values_fit_their_type() {
        let is_wrong = |start: &str| {
            let text = format!(
                "<fmiModelDescription fmiVersion='3.0' instantiationToken='t' modelName='m'><CoSimulation modelIdentifier='m'/>\
                 <ModelVariables><Int8 name='a' valueReference='1' causality='parameter' variability='fixed' start='{start}'/>\
                 </ModelVariables></fmiModelDescription>"
            );
            let description = Description::parse(&text).expect("a model description");
            description.wrong.iter().any(|(rule, _)| *rule == "description.start")
        };
        assert_eq!(["-128", "127", "128", "1.5"].map(is_wrong), [false, false, true, true]);
    }
}

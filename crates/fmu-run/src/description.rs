//! The model description with array elements as variables, for running and connecting FMUs.

use crate::arrays::{Array, Arrays};
use crate::change::Change;
use crate::index::Index;
use fmi_abi::client::VariableNames;
use fmi_abi::description::{Fault, Item, MAX_VALUES, ModelDescription, Unknown, Variable as Declared};
use fmi_abi::{BaseType, BaseUnit, Causality, Value, Variability};
use std::ops::{Deref, Range};
use std::sync::Arc;

/// A variable of an FMU. Each element of an array of FMI 3.0 is a variable, with a name as in FMI 2.0:
/// `T[3]`, `T[1,2]`, `der(T[3])`.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name.
    pub name: String,
    /// Value reference. An array element has a number that is not a value reference of the FMU.
    pub reference: u32,
    /// Start value as written in the model description, if there is one.
    pub start: Option<Arc<str>>,
    /// Index, among the variables of the FMU, of the continuous state or input whose time derivative this variable is, if there is one.
    pub derivative_of: Option<usize>,
    /// Further attributes, shared by the elements of an array.
    attributes: Arc<Attributes>,
}

/// Attributes of a [`Variable`], or of all elements of an array.
#[derive(Clone, Debug, PartialEq)]
pub struct Attributes {
    /// Base type. Int32 of FMI 3.0 is Integer, and Float64 is Real.
    pub base: BaseType,
    /// `input`, `output`, `parameter` and so on; `local` by default.
    pub causality: Causality,
    /// `constant`, `fixed`, `tunable`, `discrete` or `continuous`, if given.
    pub variability: Option<Variability>,
    /// Unit of the variable or of its declared type, if given.
    pub unit: Option<Arc<str>>,
    /// Smallest value of the variable or of its declared type, if given.
    pub min: Option<f64>,
    /// Largest value of the variable or of its declared type, if given.
    pub max: Option<f64>,
    /// Name of the declared type, if given.
    pub declared_type: Option<String>,
    /// Display unit of the variable or of its declared type, if given.
    pub display_unit: Option<Arc<str>>,
    /// Whether the variable is a difference of physical quantities, such as a temperature rise: its conversion to a display unit has
    /// no offset.
    pub is_relative: bool,
    /// For an output, the variables on which it depends directly, that is, on their values at the same instant. `None` if they are not
    /// declared; then the output may depend on all inputs (section 2.2.8 of FMI 2.0, 2.4.8 of FMI 3.0).
    pub depends_on: Option<Dependencies>,
    /// Value references of the clocks of a clocked variable; empty for any other variable.
    pub clocks: Vec<u32>,
    /// Description.
    pub description: String,
}

/// Gives access to the attributes as if they were fields of the variable.
impl Deref for Variable {
    type Target = Attributes;

    fn deref(&self) -> &Attributes {
        &self.attributes
    }
}

/// A set of variables, stored as ranges of keys because the elements of an array have consecutive value references.
#[derive(Clone, Debug, PartialEq)]
pub struct Dependencies(Arc<[Range<u64>]>);

impl Dependencies {
    fn of(mut ranges: Vec<Range<u64>>) -> Self {
        ranges.sort_unstable_by_key(|range| (range.start, range.end));
        ranges.dedup_by(|next, before| {
            let overlap = next.start <= before.end;
            if overlap {
                before.end = before.end.max(next.end);
            }
            overlap
        });
        Self(ranges.into())
    }

    /// Returns whether the set contains this variable.
    pub fn contains(&self, variable: &Variable) -> bool {
        let key = variable.key();
        let index = self.0.partition_point(|range| range.end <= key);
        self.0.get(index).is_some_and(|range| range.contains(&key))
    }

    /// Returns the ranges of the [keys](Variable::key), in increasing order.
    pub(crate) fn ranges(&self) -> &Arc<[Range<u64>]> {
        &self.0
    }
}

/// The model description of an FMU, with the variables that can be set, read or connected.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    written: ModelDescription,
    /// Variables, in the order of the model description, and after them their aliases (section 2.4.7 of FMI 3.0), each of which is a
    /// variable with the same value reference.
    pub variables: Vec<Variable>,
    /// Clocked variables, which are not among `variables` because they have values only while a clock is active. An array has several.
    pub clocked: Vec<Variable>,
    /// Indices of the clocks among the variables of the file.
    clocks: Vec<usize>,
    /// Number of continuous states.
    pub states: usize,
    /// Number of event indicators.
    pub event_indicators: usize,
    /// Arrays, whose elements are variables.
    pub(crate) arrays: Arc<Arrays>,
    indices: Index,
    /// For each variable of the file, the range of its entries in `variables`: one entry, or one for each element of an array. The
    /// range is empty for a clock, a clocked variable, or an array whose size is unknown or too large.
    spans: Vec<Range<usize>>,
    /// Structural parameters to which the caller has given values; they are set in Configuration Mode.
    pub(crate) structure: Vec<Structural>,
}

/// A structural parameter with its value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Structural {
    pub base: BaseType,
    pub reference: u32,
    pub value: Value,
}

/// Gives access to the model description, in which arrays are not split into elements.
impl Deref for Description {
    type Target = ModelDescription;

    fn deref(&self) -> &ModelDescription {
        &self.written
    }
}

impl Description {
    /// Reads a `modelDescription.xml`.
    ///
    /// # Errors
    /// Returns a message that names the fault.
    pub fn parse(text: &str) -> Result<Self, String> {
        Self::parse_configured(text, Vec::new())
    }

    /// Reads a `modelDescription.xml` and replaces the values of structural parameters.
    pub(crate) fn parse_configured(text: &str, structure: Vec<Structural>) -> Result<Self, String> {
        let size = |of: &Structural| match of.value {
            Value::Integer(size) => Some((of.reference, usize::try_from(size).ok()?)),
            _ => None,
        };
        let written = ModelDescription::parse_configured(text, &structure.iter().filter_map(size).collect())?;
        if written.co_simulation.is_none() && written.model_exchange.is_none() {
            let why = if written.scheduled_execution.is_some() {
                "it has only Scheduled Execution, which is not supported here; FMPy supports it with its class FMU3ScheduledExecution"
            } else {
                "it has neither Co-Simulation nor Model Exchange"
            };
            return Err(why.to_owned());
        }
        let prevents_runs = |(fault, _): &&(Fault, String)| {
            matches!(
                fault,
                Fault::Attribute | Fault::Interface | Fault::Reference | Fault::Type | Fault::Value
            )
        };
        if let Some((_, why)) = written.faults.iter().find(prevents_runs) {
            return Err(format!("modelDescription.xml: {why}"));
        }
        let mut sizes = written.derivatives.iter().map(|of| written.variables[of.variable].size);
        let states = sizes.try_fold(0_usize, |all, size| all.checked_add(size?));
        // Only Model Exchange needs these numbers.
        let count = |what: &str, count: Option<usize>| match count {
            Some(count) if count > MAX_VALUES => {
                Err(format!("modelDescription.xml: {count} {what} are too many"))
            }
            None if written.model_exchange.is_some() => Err(format!(
                "modelDescription.xml: the number of {what} is unknown, because an array has an unknown size"
            )),
            count => Ok(count.unwrap_or(0)),
        };
        let event_indicators = count("event indicators", written.event_indicators)?;
        let states = count("continuous states", states)?;
        let largest = written.variables.iter().map(|of| of.reference).max();
        let mut arrays = Arrays::after(largest.unwrap_or_default());
        let elements: Vec<_> = written.variables.iter().map(|of| elements_of(of, &mut arrays)).collect();
        let count = elements
            .iter()
            .zip(&written.variables)
            .map(|(elements, of)| {
                elements.as_ref().map_or(0, |elements| (1 + of.aliases.len()) * elements.len())
            })
            .sum();
        fmi_abi::xml::reserve(arrays.bytes())
            .map_err(|why| format!("modelDescription.xml cannot be read: {why}"))?;
        let (mut variables, mut clocked) = (Vec::with_capacity(count), Vec::new());
        let mut spans = Vec::with_capacity(elements.len());
        for (of, elements) in written.variables.iter().zip(elements) {
            let begin = variables.len();
            spread(of, elements, &arrays, if of.clocked { &mut clocked } else { &mut variables });
            spans.push(begin..variables.len());
        }
        relate(&written, &spans, &mut variables);
        add_aliases(&written, &spans, &arrays, &mut variables);
        Ok(Self {
            states,
            event_indicators,
            arrays: Arc::new(arrays),
            indices: Index::of(variables.iter().map(|of| of.name.as_str())),
            variables,
            clocked,
            clocks: (0..written.variables.len())
                .filter(|index| written.variables[*index].clock.is_some())
                .collect(),
            spans,
            written,
            structure,
        })
    }

    /// Returns the variables of these unknowns: for an array, all of its elements.
    pub fn elements<'a>(&'a self, of: &'a [Unknown]) -> impl Iterator<Item = &'a Variable> {
        of.iter().flat_map(|unknown| &self.variables[self.spans[unknown.variable].clone()])
    }

    /// Returns the reason why a variable of the file is not in `variables`; `None` if it is, or if it does not exist.
    pub(crate) fn why_missing(&self, name: &str) -> Option<&'static str> {
        if self.indices.is_shared(name, |index| &self.variables[index].name) {
            return Some("is the name of several variables in modelDescription.xml");
        }
        let is_named = |of: &&Declared| of.name == name || of.aliases.iter().any(|alias| alias.name == name);
        let of = self.written.variables.iter().find(is_named)?;
        match (of.base, &of.dimensions) {
            (None, _) => Some(
                "is a clock; only the function run, for a single FMU, ticks clocks, and lists their ticks as events",
            ),
            _ if of.clocked => Some(
                "has a value only while its clock ticks; only the function run, for a single FMU, sets it as an input and reads it as an \
                output",
            ),
            (_, Some(sizes)) if sizes.is_empty() => None,
            (_, None) if !of.is_too_large => Some("is an array of unknown size"),
            (_, Some(sizes)) if sizes.contains(&0) => {
                Some("is an array without elements, because a dimension is 0")
            }
            _ if self.variable(&format!("{name}[1]")).is_some() => None,
            _ => Some("is an array with too many elements; FMPy sets and reads it"),
        }
    }

    /// Returns the name of a clock without whose ticks the FMU does not calculate what it should. A triggered input clock ticks only
    /// when the importer wants it to.
    pub(crate) fn needed_clock(&self) -> Option<&str> {
        self.written_clocks().find(|of| of.is_time_based()).map(|of| of.name.as_str())
    }

    /// Returns the clocks of the file.
    pub(crate) fn written_clocks(&self) -> impl Iterator<Item = &Declared> {
        self.clocks.iter().map(|index| &self.written.variables[*index])
    }

    /// Returns the clocked variable with this name, if there is one.
    pub(crate) fn clocked(&self, name: &str) -> Option<&Variable> {
        self.clocked.iter().find(|of| of.name == name)
    }

    /// Returns the variable with this name, if there is one.
    pub fn variable(&self, name: &str) -> Option<&Variable> {
        self.indices.find(name, |index| &self.variables[index].name).map(|index| &self.variables[index])
    }

    /// Returns whether directional derivatives with respect to this variable may exist, which is possible for inputs, parameters and
    /// continuous states.
    pub(crate) fn is_known(&self, name: &str) -> bool {
        self.variable(name).is_some_and(|own| {
            let is_own = |state: usize| self.variables[state].key() == own.key();
            own.is_settable() || self.variables.iter().any(|of| of.derivative_of.is_some_and(is_own))
        })
    }

    /// Returns the names and numbers of the items of a variable's enumeration, if it has one.
    pub fn items(&self, of: &Variable) -> Option<&[Item]> {
        self.items_of(of.declared_type.as_deref())
    }

    /// Checks that an output may be connected to an input of this or another FMU. Both must have the same [kind](Variable::kind),
    /// and, if both declare them, equal units and enumeration items. Units are equal if their definitions are (section 2.2.2 of FMI
    /// 2.0, 2.4.3 of FMI 3.0); without definitions, if their names are.
    ///
    /// # Errors
    /// Returns a message that names the difference.
    pub fn connects(&self, output: &Variable, to: &Self, input: &Variable) -> Result<(), String> {
        check_kinds(output, input)?;
        if let (Some(one), Some(other)) = (&output.unit, &input.unit) {
            match (self.unit_of(output), to.unit_of(input)) {
                (Some(of_one), Some(of_other)) if of_one.equals(&of_other) => {}
                (Some(of_one), Some(of_other)) if one == other => {
                    return Err(format!(
                        "both are in {one}, but the output's is {of_one} and the input's {of_other}"
                    ));
                }
                (None, _) | (_, None) if one == other => {}
                _ => return Err(format!("the output is in {one}, the input in {other}")),
            }
        }
        self.check_items(output, to, input)
    }

    /// Checks that an output may be connected to an input by a connection that changes values. Units have been converted.
    pub(crate) fn connects_by(
        &self,
        change: &Change,
        output: &Variable,
        to: &Self,
        input: &Variable,
    ) -> Result<(), String> {
        if change.is_linear() && [output, input].map(Variable::kind) != ["Real"; 2] {
            return Err("linear transformations are only for Real".to_owned());
        }
        check_kinds(output, input)?;
        if change.maps() > 0 { Ok(()) } else { self.check_items(output, to, input) }
    }

    /// Fails if the variables have enumerations with different items.
    fn check_items(&self, output: &Variable, to: &Self, input: &Variable) -> Result<(), String> {
        match (self.items(output), to.items(input)) {
            (Some(one), Some(other)) if !Item::are_same(one, other) => {
                Err("their enumerations have different items".to_owned())
            }
            _ => Ok(()),
        }
    }

    /// Returns the definition of the unit of a variable, if there is one. An empty `BaseUnit` defines nothing: some tools write one for
    /// each unit that they do not know.
    pub(crate) fn unit_of(&self, variable: &Variable) -> Option<BaseUnit> {
        let unit = self.units.get(variable.unit.as_deref()?)?.base.filter(|base| *base != BaseUnit::ONE)?;
        Some(if variable.is_relative { unit.of_difference() } else { unit })
    }
}

/// Fails if the values of an output are of another kind than those of an input. Integers and enumerations are of one kind: FMI 2.0 has the
/// same functions for both.
fn check_kinds(output: &Variable, input: &Variable) -> Result<(), String> {
    let kinds = [output, input].map(Variable::kind);
    let are_integers = kinds.iter().all(|kind| matches!(*kind, "Integer" | "Enumeration"));
    match kinds[0] == kinds[1] || are_integers {
        true => Ok(()),
        false => Err(format!("the output is {}, the input {}", kinds[0], kinds[1])),
    }
}

impl VariableNames for Description {
    fn name_of(&self, base: BaseType, reference: u32) -> Option<String> {
        let is_same = |of: &&Declared| {
            let is_integer = base == BaseType::Integer && of.base == Some(BaseType::Enumeration);
            of.reference == reference && (of.base == Some(base) || is_integer)
        };
        self.written.variables.iter().find(is_same).map(|of| of.name.clone())
    }
}

impl Variable {
    /// Returns whether the variable is an input or a parameter, which a caller may set.
    pub(crate) fn is_settable(&self) -> bool {
        matches!(self.causality, Causality::Input | Causality::Parameter | Causality::StructuralParameter)
    }

    /// Returns whether the variable is a structural parameter, which determines the sizes of arrays and is set in Configuration Mode.
    pub(crate) fn is_structural(&self) -> bool {
        self.causality == Causality::StructuralParameter
    }

    /// Returns a copy of the variable with another start value.
    pub(crate) fn starting_at(&self, start: Option<Arc<str>>) -> Self {
        Self { start, ..self.clone() }
    }

    /// Returns a copy of the variable for a connector that has another unit.
    pub(crate) fn in_unit(&self, unit: Arc<str>) -> Self {
        let (unit, display_unit, min, max) = (Some(unit), None, None, None);
        let attributes = Attributes { unit, display_unit, min, max, ..(*self.attributes).clone() };
        Self { attributes: Arc::new(attributes), ..self.clone() }
    }

    /// Returns a number that identifies the value of the variable in its FMU.
    pub(crate) fn key(&self) -> u64 {
        key_of(self.base, self.reference)
    }

    /// Returns the type of the variable, as it follows “is” in messages: `a string`, `binary`.
    pub(crate) fn kind_in_words(&self) -> &'static str {
        match self.kind() {
            "Boolean" => "a Boolean",
            "String" => "a string",
            "Binary" => "binary",
            "Enumeration" => "an enumeration",
            "Integer" => "an integer",
            _ => "a number",
        }
    }

    /// Returns the name of the type. As in FMI 2.0, there is one name for all floating-point types (`Real`) and one for all integer
    /// types (`Integer`).
    pub fn kind(&self) -> &'static str {
        kind_of(self.base)
    }
}

fn kind_of(base: BaseType) -> &'static str {
    match base {
        BaseType::Real | BaseType::Float32 => "Real",
        BaseType::Boolean => "Boolean",
        BaseType::String => "String",
        BaseType::Binary => "Binary",
        BaseType::Enumeration => "Enumeration",
        _ => "Integer",
    }
}

/// Returns a number that identifies the value of a variable in its FMU. It contains the type, because in FMI 2.0 variables of different
/// types may have the same value reference, and only integers and enumerations share them (section 2.2.7 of FMI 2.0).
pub(crate) fn key_of(base: BaseType, reference: u32) -> u64 {
    let kind = match kind_of(base) {
        "Real" => 0,
        "Integer" | "Enumeration" => 1,
        "Boolean" => 2,
        "String" => 3,
        _ => 4,
    };
    kind << u32::BITS | u64::from(reference)
}

/// Adds the elements of an array to `arrays` and returns their value references. Returns a meaningless range of length 1 for a
/// scalar, and `None` for a clock or an array whose size is unknown or too large.
fn elements_of(of: &Declared, arrays: &mut Arrays) -> Option<Range<u32>> {
    let (base, sizes) = (of.base?, of.dimensions.as_ref()?);
    let names = || std::iter::once(&*of.name).chain(of.aliases.iter().map(|alias| &*alias.name));
    match sizes.is_empty() {
        true => Some(0..1),
        false => arrays.push(Array::new(of, base)?, names()),
    }
}

/// Adds a variable, or each element of an array, to `variables`.
fn spread(of: &Declared, elements: Option<Range<u32>>, arrays: &Arrays, variables: &mut Vec<Variable>) {
    let (Some(base), Some(sizes), Some(elements)) = (of.base, &of.dimensions, elements) else { return };
    let attributes = Arc::new(Attributes {
        base,
        causality: of.causality,
        variability: of.has_variability.then_some(of.variability),
        unit: given(&of.attributes.unit),
        min: of.min(),
        max: of.max(),
        declared_type: of.declared_type.clone(),
        display_unit: given(&of.attributes.display_unit),
        is_relative: of.attributes.is_relative,
        depends_on: None,
        clocks: of.clocks.clone(),
        description: of.description.clone(),
    });
    let variable = |name, reference, start| Variable {
        name,
        reference,
        start,
        derivative_of: None,
        attributes: Arc::clone(&attributes),
    };
    if sizes.is_empty() {
        // A start value such as "7 .5" is kept whole, because its first part alone would be another number.
        let start = (!of.start.is_empty()).then(|| Arc::from(of.start.join(" ")));
        return variables.push(variable(of.name.clone(), of.reference, start));
    }
    // Several arrays may have the same value reference, so the array is identified by its first element.
    let Some((index, _)) = arrays.find(elements.start) else { return };
    let array = &arrays.all()[index];
    variables.extend(elements.enumerate().map(|(number, reference)| {
        variable(array.name(&of.name, number), reference, array.start(number).cloned())
    }));
}

/// Sets `depends_on` of outputs and `derivative_of` of derivatives. `spans` contains the range in `variables` for each variable of
/// the file.
fn relate(written: &ModelDescription, spans: &[Range<usize>], variables: &mut [Variable]) {
    let keys = |span: &Range<usize>, variables: &[Variable]| match &variables[span.clone()] {
        [] => None,
        [first, .., last] => Some(first.key()..last.key() + 1),
        [one] => Some(one.key()..one.key() + 1),
    };
    for unknown in &written.outputs {
        let own = spans[unknown.variable].clone();
        let Some(first) = variables.get(own.start).filter(|_| !own.is_empty()) else { continue };
        let ranges =
            |known: &Vec<usize>| known.iter().filter_map(|known| keys(&spans[*known], variables)).collect();
        let depends_on = unknown.dependencies.as_ref().map(ranges).map(Dependencies::of);
        let attributes = Arc::new(Attributes { depends_on, ..(*first.attributes).clone() });
        variables[own].iter_mut().for_each(|output| output.attributes = Arc::clone(&attributes));
    }
    for (own, of) in spans.iter().zip(&written.variables) {
        let Some(state) = of.derivative_of else { continue };
        for (own, state) in own.clone().zip(spans[state].clone()) {
            variables[own].derivative_of = Some(state);
        }
    }
}

/// Adds the aliases of all variables. `spans` contains the range in `variables` for each variable of the file.
fn add_aliases(
    written: &ModelDescription,
    spans: &[Range<usize>],
    arrays: &Arrays,
    variables: &mut Vec<Variable>,
) {
    for (span, of) in spans.iter().zip(&written.variables) {
        let array = variables.get(span.start).and_then(|first| arrays.find(first.reference));
        for alias in &of.aliases {
            let Some(first) = variables.get(span.start).filter(|_| !span.is_empty()) else { continue };
            let attributes = Arc::new(Attributes {
                display_unit: given(&alias.display_unit).or_else(|| first.display_unit.clone()),
                description: alias.description.clone(),
                ..(*first.attributes).clone()
            });
            for (number, own) in span.clone().enumerate() {
                let name = match array {
                    Some((index, _)) => arrays.all()[index].name(&alias.name, number),
                    None => alias.name.clone(),
                };
                let attributes = Arc::clone(&attributes);
                variables.push(Variable { name, attributes, ..variables[own].clone() });
            }
        }
    }
}

/// Returns a unit that is given: some tools write `unit=""` for a variable without a unit.
fn given(unit: &Option<Arc<str>>) -> Option<Arc<str>> {
    unit.clone().filter(|unit| !unit.is_empty())
}

#[cfg(test)]
mod tests {
    use super::Description;

    fn with_unit(unit: &str, definition: &str, attributes: &str) -> Description {
        let text = format!(
            "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"M\" guid=\"m\"><CoSimulation modelIdentifier=\"m\"/>\
             <UnitDefinitions><Unit name=\"{unit}\">{definition}</Unit></UnitDefinitions><ModelVariables>\
             <ScalarVariable name=\"v\" valueReference=\"1\" causality=\"output\"><Real unit=\"{unit}\" {attributes}/></ScalarVariable>\
             </ModelVariables></fmiModelDescription>"
        );
        Description::parse(&text).unwrap()
    }

    #[test]
    fn units_are_compared_by_definition() {
        let torque = r#"<BaseUnit kg="1" m="2" s="-2"/>"#;
        let (degree, short) = (
            r#"<BaseUnit rad="1" factor="0.017453292519943295"/>"#,
            r#"<BaseUnit rad="1" factor="0.01745329"/>"#,
        );
        let celsius = r#"<BaseUnit K="1" offset="273.15"/>"#;
        for (one, other, why) in [
            (("Nm", torque, ""), ("N.m", torque, ""), Ok(())),
            (("deg", degree, ""), ("deg", short, ""), Ok(())),
            (("deg", "", ""), ("deg", degree, ""), Ok(())),
            (("degC", celsius, r#"relativeQuantity="1""#), ("K", r#"<BaseUnit K="1"/>"#, ""), Ok(())),
            (
                ("deg", degree, ""),
                ("deg", r#"<BaseUnit rad="1"/>"#, ""),
                Err("both are in deg, but the output's is 0.017453292519943295 rad and the input's 1 rad"),
            ),
            (
                ("u", celsius, ""),
                ("u", torque, ""),
                Err("both are in u, but the output's is 1 K + 273.15 and the input's 1 kg.m2.s-2"),
            ),
            (("Nm", "", ""), ("N.m", torque, ""), Err("the output is in Nm, the input in N.m")),
            (("Nm", torque, ""), ("deg", degree, ""), Err("the output is in Nm, the input in deg")),
        ] {
            let [one, other] =
                [one, other].map(|(unit, definition, attributes)| with_unit(unit, definition, attributes));
            let found = one.connects(&one.variables[0], &other, &other.variables[0]);
            assert_eq!(found, why.map_err(str::to_owned));
        }
    }
}

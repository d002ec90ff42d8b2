//! Variables of model descriptions.

use super::{Attributes, Clock};
use crate::{BaseType, Causality, Initial, IntervalVariability, Value, Variability};
use std::sync::Arc;

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
    /// Whether the array, together with the arrays before it that are not too large, has more than [`MAX_VALUES`](super::MAX_VALUES)
    /// values.
    pub is_too_large: bool,
    /// Attributes of the variable or of its declared type.
    pub attributes: Attributes,
    /// Name of the declared type, if given.
    pub declared_type: Option<String>,
    /// Index of the variable of which this variable is the time derivative.
    pub derivative_of: Option<usize>,
    /// Whether an event may change the variable, which is a continuous state (attribute `reinit`).
    pub reinit: bool,
    /// Whether the variable is clocked (attribute `clocks`).
    pub clocked: bool,
    /// Value references of the clocks of a clocked variable.
    pub clocks: Vec<u32>,
    /// Whether the variable may be set only once per time instant.
    pub once_per_instant: bool,
    /// Attributes of a clock; `None` for any other variable.
    pub clock: Option<Box<Clock>>,
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
    /// Returns a scalar without start value, whose other attributes are missing. `initial` has no default then.
    pub fn scalar(
        name: impl Into<String>,
        reference: u32,
        base: BaseType,
        causality: Causality,
        variability: Variability,
    ) -> Self {
        Self {
            name: name.into(),
            reference,
            base: Some(base),
            causality,
            variability,
            has_variability: true,
            initial: None,
            start: Vec::new(),
            dimensions: Some(Vec::new()),
            size: Some(1),
            is_too_large: false,
            attributes: Attributes::default(),
            declared_type: None,
            derivative_of: None,
            reinit: false,
            clocked: false,
            clocks: Vec::new(),
            once_per_instant: false,
            clock: None,
            description: String::new(),
            aliases: Vec::new(),
        }
    }

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

    /// Returns the smallest value, if given. A large integer is rounded.
    pub fn min(&self) -> Option<f64> {
        self.attributes.min.as_ref().map(number)
    }

    /// Returns the largest value, if given. A large integer is rounded.
    pub fn max(&self) -> Option<f64> {
        self.attributes.max.as_ref().map(number)
    }

    /// Returns the nominal value; 1 if it is missing or not positive.
    pub fn nominal(&self) -> f64 {
        self.attributes.nominal.filter(|nominal| *nominal > 0.0).unwrap_or(1.0)
    }

    /// Subtracts the size of an array from the number of values that remain for all arrays. If too few remain, the
    /// size becomes unknown.
    pub(super) fn limit(&mut self, remaining: &mut usize) {
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

    /// Returns whether the variable is an input clock that the importer must activate at times that follow from its interval: a clock
    /// whose `intervalVariability` is not `triggered` (section 2.2.8.2 of FMI 3.0).
    pub fn is_time_based(&self) -> bool {
        let of_clock = |clock: &Clock| clock.interval_variability != Some(IntervalVariability::Triggered);
        self.causality == Causality::Input && self.clock.as_deref().is_some_and(of_clock)
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

fn number(limit: &Value) -> f64 {
    match limit {
        Value::Integer(limit) => *limit as f64,
        other => other.real(),
    }
}

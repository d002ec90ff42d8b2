//! Start values: looks up names, and checks and converts values.

use crate::error::{Error, request};
use crate::lookup::{Found, is_exact};
use crate::selection::{Assigned, Target, fits};
use crate::system::System;
use fmi_abi::{BaseType, Value, boolean};
use std::borrow::Cow;

/// Start value of a variable. A [string](Value::String) is the value of a string variable, the name of an item of an enumeration, or
/// `true`, `false`, `1` or `0` for a Boolean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start<'a> {
    /// One number for all runs or instances; 0 or 1 for a Boolean.
    Same(f64),
    /// A number for each run or instance.
    Each(&'a [f64]),
    /// One value of any type for all runs or instances, for example a string, bytes or a 64-bit integer.
    Value(&'a Value),
    /// A value of any type for each run or instance.
    EachValue(&'a [Value]),
}

impl Start<'_> {
    /// Returns the number of runs or instances for which there are separate values; `None` if one value is for all.
    pub(crate) fn count(&self) -> Option<usize> {
        match self {
            Self::Same(_) | Self::Value(_) => None,
            Self::Each(values) => Some(values.len()),
            Self::EachValue(values) => Some(values.len()),
        }
    }
}

/// Checked start values. Each variable has one value for all runs or instances, or a value for each run or instance.
#[derive(Clone, Debug, Default)]
pub(crate) struct StartValues<'a> {
    numbers: Vec<(Target, Cow<'a, [f64]>)>,
    /// Values that `f64` cannot represent: strings, bytes, 64-bit integers.
    values: Vec<(Target, Vec<Value>)>,
}

impl<'a> StartValues<'a> {
    /// Returns the given start values, and the system's own start values of all other variables.
    pub fn of(system: &System, given: &[(&str, Start<'a>)]) -> Result<Self, Error> {
        let mut all = Self::default();
        for own in system.own_start() {
            let (found, name, value) = own?;
            found.check_start(&name)?;
            all.put(StartValues::found(&[found], &name, Start::Value(value))?.into_owned());
        }
        all.put(Self::given(system, given)?);
        Ok(all)
    }

    /// Checks the given start values. Each name may occur only once.
    pub fn given(system: &System, given: &[(&str, Start<'a>)]) -> Result<Self, Error> {
        let (mut all, mut known) = (Self::default(), Assigned::default());
        for (name, start) in given {
            let found = system.find_startable(name)?;
            known.add(name, &found);
            all.put(Self::found(&found, name, *start)?);
        }
        known.check("start values")?;
        Ok(all)
    }

    /// Adds start values and removes earlier values of the same variables.
    pub fn put(&mut self, new: Self) {
        let is_new = |index: &Target| {
            new.numbers.iter().any(|(of, _)| of == index) || new.values.iter().any(|(of, _)| of == index)
        };
        self.numbers.retain(|(index, _)| !is_new(index));
        self.values.retain(|(index, _)| !is_new(index));
        self.numbers.extend(new.numbers);
        self.values.extend(new.values);
    }

    /// Returns the numbers of a run or an instance, by its index.
    pub fn numbers(&self, of: usize) -> impl Iterator<Item = (Target, f64)> {
        self.numbers.iter().filter_map(move |(index, values)| Some((*index, *one(values, of)?)))
    }

    /// Returns the strings, bytes and 64-bit integers of a run or an instance, by its index.
    pub fn values(&self, of: usize) -> impl Iterator<Item = (Target, &Value)> {
        self.values.iter().filter_map(move |(index, values)| Some((*index, one(values, of)?)))
    }

    /// Returns whether each variable has one value for all runs or instances.
    pub fn is_for_all(&self) -> bool {
        self.numbers.iter().all(|(_, numbers)| numbers.len() == 1)
            && self.values.iter().all(|(_, values)| values.len() == 1)
    }

    /// Copies borrowed values, to remove the lifetime.
    pub fn into_owned(self) -> StartValues<'static> {
        let own = |(index, numbers): (_, Cow<[f64]>)| (index, Cow::Owned(numbers.into_owned()));
        StartValues { numbers: self.numbers.into_iter().map(own).collect(), values: self.values }
    }

    /// Converts a start value to the types of the variables that a name denotes.
    fn found(variables: &[Found], name: &str, start: Start<'a>) -> Result<Self, Error> {
        let mut all = Self::default();
        for found in variables.iter().copied() {
            let target = Target::of(found);
            if is_exact(target.base) {
                let values = match start {
                    Start::Same(number) => vec![Value::Real(number)],
                    Start::Each(numbers) => numbers.iter().copied().map(Value::Real).collect(),
                    Start::Value(value) => vec![value.clone()],
                    Start::EachValue(values) => values.to_vec(),
                };
                let values = values.into_iter().map(|value| exact(found, name, value));
                all.values.push((target, values.collect::<Result<_, _>>()?));
                continue;
            }
            let number = |value: &Value| number_of(found, name, value);
            let numbers = match start {
                Start::Same(number) => Cow::Owned(vec![number]),
                Start::Each(numbers) => Cow::Borrowed(numbers),
                Start::Value(value) => Cow::Owned(vec![number(value)?]),
                Start::EachValue(values) => Cow::Owned(values.iter().map(number).collect::<Result<_, _>>()?),
            };
            fits(name, (target.base, found.description.standard), &numbers)?;
            let change = found.connector.map(|(_, end)| &end.into).filter(|change| !change.is_identity());
            let numbers = match change {
                Some(change) => numbers.iter().map(|number| change.apply(*number)).collect(),
                None => numbers,
            };
            all.numbers.push((target, numbers));
        }
        Ok(all)
    }
}

/// Checks and converts a value for a variable of a type for which [`is_exact`] holds.
pub(crate) fn exact(found: Found, name: &str, value: Value) -> Result<Value, Error> {
    /// Integers up to this magnitude are exact in `f64`.
    const EXACT: f64 = (1_u64 << f64::MANTISSA_DIGITS) as f64;
    let base = found.variable.base;
    let value = match (base, value) {
        (BaseType::String, Value::String(text)) if text.contains('\0') => {
            return request(format!("the value of {name} must not contain a character NUL"));
        }
        (BaseType::String, value @ Value::String(_)) | (BaseType::Binary, value @ Value::Binary(_)) => value,
        (BaseType::Int64 | BaseType::UInt64, Value::Real(number))
            if number.fract() == 0.0 && number.abs() > EXACT =>
        {
            return request(format!(
                "{name} is a 64-bit integer, and the floating-point number {number} may not be the one that is meant; give an \
                integer"
            ));
        }
        (BaseType::Int64 | BaseType::UInt64, Value::Real(number)) if number.fract() == 0.0 => {
            Value::Integer(number as i128)
        }
        (BaseType::Int64 | BaseType::UInt64, Value::Boolean(boolean)) => Value::Integer(boolean.into()),
        (BaseType::Int64 | BaseType::UInt64, value @ Value::Integer(_)) => value,
        (_, value) => {
            let value = match value {
                Value::String(text) => format!("{text:?}"),
                Value::Binary(bytes) => format!("{} bytes", bytes.len()),
                other => other.to_string(),
            };
            return request(format!(
                "{name} is {}, its value cannot be {value}",
                found.variable.kind_in_words()
            ));
        }
    };
    if let (Value::Integer(number), Some((low, high))) = (&value, base.range())
        && !(low..=high).contains(number)
    {
        return request(format!("{name} is an integer from {low} to {high} and cannot be {number}"));
    }
    Ok(value)
}

/// Returns the value with this index, or the only value.
fn one<T>(values: &[T], of: usize) -> Option<&T> {
    if values.len() == 1 { values.first() } else { values.get(of) }
}

/// Converts a value to `f64`, for a variable whose type is a number. A string is a Boolean or the name of an item of an enumeration.
pub(crate) fn number_of(found: Found, name: &str, value: &Value) -> Result<f64, Error> {
    found.check_number(name)?;
    let kind = || found.variable.kind_in_words();
    let text = match value {
        Value::Real(number) => return Ok(*number),
        // A floating-point variable gets the nearest number. For other types, an integer that is rounded here is out of range, so
        // it is rejected later.
        Value::Integer(number) => return Ok(*number as f64),
        Value::Boolean(boolean) => return Ok(f64::from(u8::from(*boolean))),
        Value::Binary(_) => return request(format!("{name} is {}, its value cannot be bytes", kind())),
        Value::String(text) => text,
    };
    if found.variable.base == BaseType::Boolean
        && let Some(boolean) = boolean(text)
    {
        return Ok(f64::from(u8::from(boolean)));
    }
    let Some(items) = found.description.items(found.variable) else {
        return request(format!("{name} is {}, its start value cannot be {text:?}", kind()));
    };
    let number = items.iter().find(|item| item.name == *text).map(|item| item.value as f64);
    let known = || items.iter().map(|item| item.name.as_str()).collect::<Vec<_>>().join(", ");
    number.ok_or_else(|| {
        Error::Request(format!("{name} is one of {}, its start value cannot be {text:?}", known()))
    })
}

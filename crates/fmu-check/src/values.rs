//! Values that the checks set: within the range of a variable, and near its start value or different from it.

use crate::call_sequence::Values;
use crate::description::{Description, Variable, kind_of};
use fmi_abi::{BaseType, Causality, Variability};

/// Largest relative difference of results that are equal up to their last digits: a model may convert units, or iterate in its
/// initialization.
pub const LAST_DIGITS: f64 = 1e-9;

/// Returns the start values of a variable; `None` for a clock or a binary variable, and if not every element has one that can be read.
pub fn start_values(description: &Description, index: usize) -> Option<Values> {
    let variable = &description.variables[index];
    let size = variable.size?;
    match variable.base? {
        BaseType::String => {
            let texts = (0..size).map(|element| Some(variable.start_of(element)?.as_bytes().to_owned()));
            Some(Values::Strings(texts.map(|text| text.map(Some)).collect::<Option<_>>()?))
        }
        BaseType::Binary => None,
        _ => {
            let numbers = variable.starts();
            (numbers.len() == size).then(|| Values::new(description.kind(index), numbers))
        }
    }
}

/// Returns values of a variable other than its start values: near numbers, the next or previous integer, the other Boolean, a
/// non-ASCII string, or bytes with NULs. A floating-point number that starts at its maximum keeps its value. Returns `None` for
/// clocks, for enumerations without a maximum, and if no other integer is within the range.
pub fn other_values(description: &Description, index: usize) -> Option<Values> {
    let variable = &description.variables[index];
    let (starts, size) = (variable.starts(), variable.size?);
    let is_text = matches!(variable.base?, BaseType::String | BaseType::Binary);
    if !is_text && starts.len() != size {
        // The start value cannot be read, which is a finding of the description.
        return None;
    }
    let kind = kind_of(description.standard, variable.base?);
    Some(match variable.base? {
        BaseType::Real | BaseType::Float32 => {
            Values::new(kind, starts.iter().map(|start| near(variable, *start, 1.0 / 64.0)))
        }
        BaseType::String => Values::strings("Gödel, Escher, Bach".as_bytes(), size),
        BaseType::Binary => Values::strings(&Vec::from_iter((0..300).map(|byte| (byte % 256) as u8)), size),
        BaseType::Boolean => Values::new(kind, starts.iter().map(|start| 1.0 - start)),
        BaseType::Enumeration if variable.max().is_none() => return None,
        _ => {
            let other = |start: &f64| match variable.max().is_some_and(|max| start + 1.0 > max) {
                true => start - 1.0,
                false => start + 1.0,
            };
            let others: Vec<f64> = starts.iter().map(other).collect();
            let inside = |number: &f64| variable.min().is_none_or(|min| *number >= min);
            if !others.iter().all(inside) {
                return None;
            }
            Values::new(kind, others)
        }
    })
}

/// Returns values for at most 1000 inputs: floating-point inputs that are not discrete get values near their start values and
/// within their ranges, which change with `phase`. If `discrete` is set, Boolean inputs change, too. Clocked inputs and inputs of
/// other types are left out.
pub fn input_values(description: &Description, phase: usize, discrete: bool) -> Vec<(usize, Values)> {
    let mut values = Vec::new();
    for (index, variable) in description.variables.iter().enumerate() {
        if values.len() == 1000 {
            break;
        }
        let (Some(size), true) = (variable.size, variable.causality == Causality::Input && !variable.clocked)
        else {
            continue;
        };
        if variable.once_per_instant {
            continue;
        }
        let (starts, kind) = (variable.starts(), description.kind(index));
        if variable.is_float() && variable.variability != Variability::Discrete {
            let numbers = (0..size).map(|element| {
                let start = starts.get(element).copied().unwrap_or(0.0);
                near(variable, start, 0.1 * ((phase * 7 + index * 3 + element) as f64 * 0.7).sin())
            });
            values.push((index, Values::new(kind, numbers)));
        } else if discrete && variable.base == Some(BaseType::Boolean) {
            let on = f64::from(u8::from(phase / 4 % 2 == 1));
            let numbers = (0..size).map(|element| (starts.get(element).copied().unwrap_or(0.0) - on).abs());
            values.push((index, Values::new(kind, numbers)));
        }
    }
    values
}

/// Returns values for at most 1000 continuous inputs: their start values, changed with `near` by the fraction `by`.
pub fn inputs_by(description: &Description, by: f64) -> Vec<(usize, Values)> {
    let is_wanted = |(index, variable): &(usize, &Variable)| {
        variable.causality == Causality::Input
            && description.is_continuous(*index)
            && !variable.once_per_instant
            && variable.size == Some(variable.starts().len())
    };
    let inputs = description.variables.iter().enumerate().filter(is_wanted).take(1000);
    let value = |(index, variable): (usize, &Variable)| {
        let numbers = variable.starts().into_iter().map(|start| near(variable, start, by));
        (index, Values::new(description.kind(index), numbers))
    };
    inputs.map(value).collect()
}

/// Returns values of at most 1000 floating-point variables of these causalities that differ clearly from their start values.
pub fn other_numbers(description: &Description, causalities: &[Causality]) -> Vec<(usize, Values)> {
    let variables = description.variables.iter().enumerate().filter(|(_, variable)| {
        causalities.contains(&variable.causality)
            && variable.is_float()
            && !variable.clocked
            && variable.size == Some(variable.starts().len())
    });
    let values = variables.map(|(index, variable)| {
        let other = |start: f64| near(variable, start, if start == 0.0 { 0.5 } else { 0.2 });
        (index, Values::new(description.kind(index), variable.starts().into_iter().map(other)))
    });
    values.take(1000).collect()
}

/// Returns the number within the range of a variable that is nearest to `start + by * scale`. The scale is the nominal value or
/// the magnitude of the start value (at most 1e6), whichever is larger, but at most the width of the range.
pub fn near(variable: &Variable, start: f64, by: f64) -> f64 {
    let range =
        variable.min().zip(variable.max()).map(|(min, max)| max - min).filter(|range| range.is_finite());
    let scale = range.unwrap_or(f64::INFINITY).min(variable.nominal().max(start.abs().min(1e6)));
    let number = start + by * scale;
    let number = variable.min().map_or(number, |min| number.max(min));
    variable.max().map_or(number, |max| number.min(max))
}

/// Returns whether a time differs from another one by more than rounding errors.
pub fn is_other_time(time: f64, other: f64) -> bool {
    (time - other).abs() > 1e-9 * (1.0 + other.abs())
}

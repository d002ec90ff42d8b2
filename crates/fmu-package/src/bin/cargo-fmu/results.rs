//! The results of a simulation: columns of a table, with the names of enumeration items and with strings.

use anyhow::Result;
use fmu_run::{BaseType, Description, Value, Variability, Variable};
use std::path::Path;

/// A variable over time.
pub struct Column<'a> {
    pub name: &'a str,
    /// The unit; empty for numbers without unit.
    pub unit: &'a str,
    pub base: BaseType,
    /// Whether the variable is constant between jumps.
    pub jumps: bool,
    /// The values; for a variable with labels, the number of the label of each value. NaN where there is no value.
    pub values: Vec<f64>,
    /// The labels of the values of a Boolean, an enumeration or a string: names, each with its number.
    pub labels: Vec<(f64, String)>,
    /// The exact values of strings, bytes or 64-bit integers; empty for other variables.
    exact: Vec<Option<Value>>,
}

impl<'a> Column<'a> {
    /// A variable of numbers, a Boolean or an enumeration.
    pub fn of_numbers(description: &Description, variable: &'a Variable, values: Vec<f64>) -> Self {
        let labels = match variable.base {
            BaseType::Boolean => vec![(0.0, "false".to_owned()), (1.0, "true".to_owned())],
            BaseType::Enumeration => {
                let items = description.items(variable).unwrap_or_default().iter();
                items.map(|item| (item.value as f64, item.name.clone())).collect()
            }
            _ => Vec::new(),
        };
        let is_held = variable.variability.is_some_and(|of| of != Variability::Continuous);
        Self {
            name: &variable.name,
            unit: variable.unit.as_deref().filter(|unit| *unit != "1").unwrap_or_default(),
            base: variable.base,
            jumps: !variable.base.is_float() || is_held,
            values,
            labels,
            exact: Vec::new(),
        }
    }

    /// Describes a variable whose values an `f64` cannot hold exactly: strings, bytes or 64-bit integers. For the
    /// plot, strings are numbered in the order of their first occurrence.
    pub fn of_values(variable: &'a Variable, exact: Vec<Option<Value>>) -> Self {
        let mut labels: Vec<(f64, String)> = Vec::new();
        let mut number = |value: &Option<Value>| match value {
            Some(Value::Integer(value)) => *value as f64,
            Some(Value::String(text)) => match labels.iter().find(|(_, known)| known == text) {
                Some((number, _)) => *number,
                None => {
                    labels.push((labels.len() as f64, text.clone()));
                    labels.len() as f64 - 1.0
                }
            },
            _ => f64::NAN,
        };
        let values = exact.iter().map(&mut number).collect();
        Self { name: &variable.name, unit: "", base: variable.base, jumps: true, values, labels, exact }
    }

    /// Adds the last value, if the model ended the simulation between two communication points.
    pub fn push(&mut self, value: f64) {
        self.values.push(value);
    }

    /// Returns the number of missing values at the end (NaN or `None`), because the run did not reach them.
    pub fn unreached(&self) -> usize {
        let is_missing = |index: &usize| match self.exact.get(*index) {
            Some(value) => value.is_none(),
            None => self.values[*index].is_nan(),
        };
        (0..self.values.len()).rev().take_while(is_missing).count()
    }

    /// Keeps only this number of values from the start.
    pub fn truncate(&mut self, length: usize) {
        self.values.truncate(length);
        self.exact.truncate(length);
    }

    fn label(&self, value: f64) -> Option<&str> {
        self.labels.iter().find(|(number, _)| *number == value).map(|(_, label)| label.as_str())
    }

    /// Returns a value as it is written into the table.
    fn written(&self, row: usize) -> String {
        match (self.exact.get(row), self.values[row]) {
            (Some(value), _) => value.as_ref().map_or_else(String::new, Value::to_string),
            (None, value) if value.is_nan() && !self.base.is_float() => String::new(),
            (None, value) => self.label(value).map_or_else(|| number(value), str::to_owned),
        }
    }

    /// Returns the range of the values, or the labels in the order of their first occurrence.
    pub fn summary(&self) -> String {
        const MOST: usize = 6;
        let finite = || self.values.iter().copied().filter(|value| value.is_finite());
        let [low, high] =
            [finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max)];
        if low > high {
            return if self.base == BaseType::Binary { "bytes" } else { "no finite values" }.to_owned();
        }
        if self.labels.is_empty() {
            let digits = |value: f64| if self.base.is_float() { rounded(value) } else { number(value) };
            let text = format!("from {} to {} {}", digits(low), digits(high), self.unit);
            return text.trim_end().to_owned();
        }
        let mut found: Vec<f64> = Vec::new();
        finite().for_each(|value| {
            if !found.contains(&value) {
                found.push(value)
            }
        });
        let label = |value: &f64| match self.label(*value) {
            Some(label) if self.base == BaseType::String => format!("{label:?}"),
            Some(label) => label.to_owned(),
            None => number(*value),
        };
        match &found[..] {
            [always] => format!("always {}", label(always)),
            [first, second] => format!("{} and {}", label(first), label(second)),
            many => {
                let mut labels: Vec<_> = many.iter().take(MOST).map(label).collect();
                if many.len() > MOST {
                    labels.push(format!("and {} more", many.len() - MOST));
                }
                labels.join(", ")
            }
        }
    }
}

/// Returns a number as it is written into the table: with all its digits, and with an exponent where it would have many zeros.
fn number(value: f64) -> String {
    match value.abs() {
        size if size != 0.0 && !(1e-5..1e16).contains(&size) && value.is_finite() => format!("{value:e}"),
        _ => value.to_string(),
    }
}

/// Returns a number with six significant digits.
fn rounded(value: f64) -> String {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    // Turns -0.0 into 0.0.
    number(rounded + 0.0)
}

/// Writes the table.
pub fn write_table(path: &Path, time: &[f64], columns: &[Column]) -> Result<()> {
    let mut writer = csv::Writer::from_path(path)?;
    writer.write_record(std::iter::once("time").chain(columns.iter().map(|column| column.name)))?;
    for (row, time) in time.iter().enumerate() {
        let values = columns.iter().map(|column| column.written(row));
        writer.write_record(std::iter::once(number(*time)).chain(values))?;
    }
    Ok(writer.flush()?)
}

#[cfg(test)]
mod tests {
    use super::{number, rounded};

    #[test]
    fn numbers_are_short_and_complete() {
        for (value, text) in [
            (0.1, "0.1"),
            (-2.0, "-2"),
            (1e-310, "1e-310"),
            (5e-324, "5e-324"),
            (-1e-7, "-1e-7"),
            (1e300, "1e300"),
            (123456.789, "123456.789"),
            (0.0, "0"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(number(value), text);
        }
        for (value, text) in [
            (1.0 / 3.0, "0.333333"),
            (-1e-20, "-1e-20"),
            (-0.0, "0"),
            (123456.789, "123457"),
            (2e7, "20000000"),
        ] {
            assert_eq!(rounded(value), text);
        }
    }
}

//! [`LookupTable`], a characteristic curve or a time series that a model reads from a file.

use crate::model::{Error, read_resource};
use crate::saved::{Saved, StateVisitor};
use std::path::Path;

/// Interpolates linearly between the points (`xs`, `ys`), where `xs` must be in ascending order. Returns the value at
/// `x`: the first or the last of `ys` if `x` is outside of `xs`, NaN if there are no points.
///
/// # Panics
/// May panic if `ys` is shorter than `xs`.
pub fn interpolate(xs: &[f64], ys: &[f64], x: f64) -> f64 {
    match xs.partition_point(|known| *known <= x) {
        _ if xs.is_empty() => f64::NAN,
        0 => ys[0],
        next if next == xs.len() => ys[next - 1],
        next => {
            let part = (x - xs[next - 1]) / (xs[next] - xs[next - 1]);
            ys[next - 1] + part * (ys[next] - ys[next - 1])
        }
    }
}

/// Points between which values are interpolated linearly, from a CSV file with two columns.
///
/// The first line of the file may contain the names of the columns. The values in the first column must rise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LookupTable {
    xs: Vec<f64>,
    ys: Vec<f64>,
}

impl LookupTable {
    /// Reads a file; [`Setup::resource`](crate::Setup::resource) returns the path of a file in the FMU.
    ///
    /// # Errors
    /// Fails if the file cannot be read or does not contain such a table. The message contains the path and, for a
    /// wrong number, the line and the column.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let error = |reason: &dyn std::fmt::Display| Error::new(format!("{}{reason}", path.display()));
        let bytes = read_resource(path).map_err(|reason| error(&format_args!(": {reason}")))?;
        let text = String::from_utf8(bytes).map_err(|reason| error(&format_args!(": {reason}")))?;
        Self::parse(&text).map_err(|reason| error(&reason))
    }

    fn parse(text: &str) -> Result<Self, String> {
        let mut table = Self::default();
        // Spreadsheet programs write a byte order mark at the beginning of a file.
        for (line, row) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
            let fields: Vec<&str> = row.split(',').map(str::trim).collect();
            let numbers: Vec<Option<f64>> = fields.iter().map(|field| field.parse().ok()).collect();
            if row.trim().is_empty() || line == 1 && numbers.iter().all(Option::is_none) {
                continue;
            }
            if fields.len() != 2 {
                return Err(format!(
                    ", line {line}: {} columns instead of 2, with a comma between them",
                    fields.len()
                ));
            }
            let number = |column: usize| {
                let number = numbers[column].filter(|number| number.is_finite());
                number.ok_or(format!(
                    ", line {line}, column {}: {:?} is not a number",
                    column + 1,
                    fields[column]
                ))
            };
            let (x, y) = (number(0)?, number(1)?);
            if let Some(last) = table.xs.last().filter(|last| **last >= x) {
                return Err(format!(", line {line}, column 1: {x} must be above the value before, {last}"));
            }
            table.xs.push(x);
            table.ys.push(y);
        }
        if table.xs.is_empty() { Err(" contains no numbers".to_owned()) } else { Ok(table) }
    }

    /// Returns the value at `x`, as [`interpolate`] does.
    pub fn at(&self, x: f64) -> f64 {
        interpolate(&self.xs, &self.ys, x)
    }

    /// Returns the values of the first column.
    pub fn xs(&self) -> &[f64] {
        &self.xs
    }
}

impl Saved for LookupTable {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        self.xs.visit(visitor);
        self.ys.visit(visitor);
        if self.xs.len() != self.ys.len() || !self.xs.is_sorted_by(|one, next| one < next) {
            visitor.invalid();
            *self = Self::default();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_interpolated_linearly() {
        let table = LookupTable::parse("\u{feff}speed, force\r\n-1,-2\r\n\r\n0, 0\r\n2,1e1\r\n").unwrap();
        assert_eq!(table.xs(), [-1.0, 0.0, 2.0]);
        let points =
            [(-9.0, -2.0), (-1.0, -2.0), (-0.5, -1.0), (0.0, 0.0), (0.5, 2.5), (2.0, 10.0), (9.0, 10.0)];
        for (x, y) in points {
            assert_eq!(table.at(x), y, "at {x}");
        }
        assert!(table.at(f64::NAN).is_finite());
        assert_eq!(LookupTable::parse("3,4").unwrap().at(0.0), 4.0);
    }

    #[test]
    fn errors_name_line_and_column() {
        for (text, reason) in [
            ("", " contains no numbers"),
            ("x,y\n", " contains no numbers"),
            ("x,y\n0,1\n1,l0\n", ", line 3, column 2: \"l0\" is not a number"),
            ("x,y\n\n,1\n", ", line 3, column 1: \"\" is not a number"),
            ("0,y\n", ", line 1, column 2: \"y\" is not a number"),
            ("0,inf\n", ", line 1, column 2: \"inf\" is not a number"),
            ("x;y\n0;1\n", ", line 2: 1 columns instead of 2, with a comma between them"),
            ("0,1,2\n", ", line 1: 3 columns instead of 2, with a comma between them"),
            ("0,1\n0,2\n", ", line 2, column 1: 0 must be above the value before, 0"),
        ] {
            assert_eq!(LookupTable::parse(text).unwrap_err(), reason, "{text:?}");
        }
        let error = LookupTable::read(Path::new("no/such.csv")).unwrap_err().to_string();
        assert!(error.starts_with("no/such.csv: "), "{error}");
    }
}

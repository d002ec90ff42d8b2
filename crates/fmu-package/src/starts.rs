//! Start values that are written into a compiled library.

use crate::table::{Start, Table};
use anyhow::{Context, Result, bail, ensure};
use fmi_abi::stamp::Stamp;
use fmi_abi::{Value, Variability};

/// Returns the index and the value of each start value in [`Builder::start`](crate::Builder::start). Values that equal the start values of
/// the compiled model are left out, so that they do not change the FMU.
///
/// # Errors
/// When there is no such variable, it has no start value, or the value is not one of its type.
pub(crate) fn indexed_starts(table: &Table, starts: &[(String, String)]) -> Result<Vec<(u32, f64)>> {
    let most = Stamp::CAPACITY;
    ensure!(starts.len() <= most, "there are {} start values; at most {most} can be changed", starts.len());
    let compiled = match table.starts.first() {
        Some((_, Start::Values { values, .. })) => &values[..],
        _ => &[],
    };
    let mut changed = Vec::new();
    for (name, text) in starts {
        let found = (0..).zip(&table.variables).find(|(_, variable)| variable.name == *name);
        let (index, variable) = found.with_context(|| format!("there is no variable {name}"))?;
        let is_settable = variable.has_start() && variable.variability != Variability::Constant;
        ensure!(is_settable, "{name} has no start value that can be changed");
        let value = Value::read(variable.base, text)
            .with_context(|| format!("{name} is {}, {text:?} is not such a value", variable.base))?;
        if compiled.get(index as usize) == Some(&Some(value.clone())) {
            continue;
        }
        let number = match value {
            Value::Real(value) => value,
            Value::Boolean(value) => f64::from(u8::from(value)),
            // Larger integers may not have an f64 of the same value.
            Value::Integer(value) if value.unsigned_abs() <= 1 << f64::MANTISSA_DIGITS => value as f64,
            _ => bail!("the start value of {name} cannot be changed without compiling the model again"),
        };
        changed.push((index, number));
    }
    Ok(changed)
}

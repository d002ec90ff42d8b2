//! Converts arguments of Python functions. Errors name the argument.

use crate::buffers::array_of;
use fmu_run::{Integration, Interface, System, Tolerance};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyString, PyTuple};
use std::path::PathBuf;

/// Returns the error for an invalid argument. The message quotes the beginning of its value.
pub fn wrong(name: &str, must: &str, value: &Bound<'_, PyAny>) -> PyErr {
    /// Maximum number of quoted characters.
    const MOST: usize = 60;
    let written = value.repr().map_or_else(|_| value.get_type().to_string(), |repr| repr.to_string());
    let written = written.split_whitespace().collect::<Vec<_>>().join(" ");
    let short: String = written.chars().take(MOST).collect();
    let dots = if short.len() < written.len() { "..." } else { "" };
    PyValueError::new_err(format!("{name} must be {must}, it is {short}{dots}"))
}

/// Returns an optional count, which must be at least 1.
pub fn count(name: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<Option<usize>> {
    let Some(value) = value else { return Ok(None) };
    let integer = value.py().import("operator")?.call_method1("index", (value,));
    let integer = integer.ok().filter(|_| !value.is_instance_of::<PyBool>());
    let integer = integer.ok_or_else(|| wrong(name, "an integer", value))?;
    if integer.lt(1)? {
        return Err(PyValueError::new_err(format!("{name} must be at least 1, it is {}", integer.str()?)));
    }
    // A count that does not fit in `usize` is replaced by a very large one.
    Ok(Some(integer.extract().unwrap_or(usize::MAX >> 1)))
}

/// Returns a number.
pub fn number(name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    if let Ok(number) = value.cast::<PyFloat>() {
        return Ok(number.value());
    }
    let is_number = !value.is_instance_of::<PyBool>() && !value.is_instance_of::<PyString>();
    value.extract().ok().filter(|_| is_number).ok_or_else(|| wrong(name, "a number", value))
}

/// Returns a tolerance: a number, None, or 'default' for the tolerance of the default experiment.
pub fn tolerance(value: &Bound<'_, PyAny>) -> PyResult<Tolerance> {
    if value.is_none() {
        return Ok(Tolerance::None);
    }
    if value.extract::<String>().is_ok_and(|text| text == "default") {
        return Ok(Tolerance::Default);
    }
    number("tolerance", value)
        .map(Tolerance::Value)
        .map_err(|_| wrong("tolerance", "a number, None or 'default'", value))
}

/// Returns an interface type. Its name may be written with an underscore or a hyphen.
pub fn interface(value: &Bound<'_, PyAny>) -> PyResult<Interface> {
    let name = value.extract::<String>().map(|name| name.replace('_', "-"));
    match name.as_deref() {
        Ok("co-simulation") => Ok(Interface::CoSimulation),
        Ok("model-exchange") => Ok(Interface::ModelExchange),
        _ => Err(wrong("interface", "'co-simulation' or 'model-exchange'", value)),
    }
}

/// Returns the settings of the integration in Model Exchange.
pub fn integration(
    solver: &Bound<'_, PyAny>,
    [rtol, atol, max_step]: [Option<&Bound<'_, PyAny>>; 3],
) -> PyResult<Integration> {
    let given = |name, value: Option<&Bound<'_, PyAny>>| value.map(|value| number(name, value)).transpose();
    Ok(Integration {
        solver: text("solver", solver)?.parse().map_err(PyValueError::new_err)?,
        rtol: given("rtol", rtol)?,
        atol: given("atol", atol)?,
        max_step: given("max_step", max_step)?,
    })
}

/// Converts a Boolean of Python or NumPy, or one of the integers 0 and 1.
pub fn flag(name: &str, value: &Bound<'_, PyAny>) -> PyResult<bool> {
    let integer = || value.cast::<PyInt>().ok()?.extract().ok().filter(|number: &u8| *number < 2);
    let found = value.extract().ok().or_else(|| integer().map(|number| number == 1));
    found.ok_or_else(|| wrong(name, "True or False", value))
}

/// Returns names: one str or a sequence of str.
pub fn names(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(vec![text.extract()?]);
    }
    let of = |value: &Bound<'_, PyAny>| -> PyResult<Vec<String>> {
        value.try_iter()?.map(|one| one?.cast::<PyString>().map_err(PyErr::from)?.extract()).collect()
    };
    of(value).map_err(|error| match error.is_instance_of::<PyTypeError>(value.py()) {
        true => wrong(name, "a str or a sequence of str", value),
        false => error,
    })
}

/// Returns the items of an optional dict with names as keys, or of another mapping.
pub fn items<'py>(
    name: &str,
    value: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<(String, Bound<'py, PyAny>)>> {
    let Some(value) = value else { return Ok(Vec::new()) };
    let must = "a dict of values by name";
    let pair = |(key, of): (Bound<'py, PyAny>, Bound<'py, PyAny>)| match key.cast::<PyString>() {
        Ok(key) => Ok((key.extract()?, of)),
        Err(_) => Err(wrong(&format!("a name in {name}"), "a str", &key)),
    };
    match value.cast::<PyDict>() {
        Ok(dict) => dict.iter().map(pair).collect(),
        Err(_) => {
            let items = value.call_method0("items").map_err(|_| wrong(name, must, value))?;
            let items = items.try_iter().map_err(|_| wrong(name, must, value))?;
            items.map(|item| pair(item?.extract().map_err(|_| wrong(name, must, value))?)).collect()
        }
    }
}

/// Fails if the argument is given and is not callable.
pub fn callable(name: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
    match value {
        Some(value) if !value.is_callable() => Err(wrong(name, "a function", value)),
        _ => Ok(()),
    }
}

/// Returns the value and the unit if the argument is a tuple (value, unit) whose value is not a str, otherwise `None`.
pub fn with_unit<'py>(value: &Bound<'py, PyAny>) -> Option<(Bound<'py, PyAny>, String)> {
    let pair = value.cast::<PyTuple>().ok().filter(|pair| pair.len() == 2)?;
    let (of, unit) = (pair.get_item(0).ok()?, pair.get_item(1).ok()?);
    let unit = unit.cast::<PyString>().ok()?.extract().ok()?;
    (!of.is_instance_of::<PyString>()).then_some((of, unit))
}

/// Converts (value, unit) to the unit of the variable, or of the elements of an array. Returns other values unchanged. A difference, for
/// example the derivative of a temperature, is converted without the offset of the unit.
pub fn in_own_unit<'py>(
    system: &System,
    name: &str,
    value: &Bound<'py, PyAny>,
    is_difference: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let Some((of, unit)) = with_unit(value) else { return Ok(value.clone()) };
    let (factor, offset) = display_unit(system, name, &unit)?;
    let numbers = array_of(name, &of)?;
    if is_difference { numbers.div(factor) } else { numbers.sub(offset)?.div(factor) }
}

/// Returns factor and offset of the conversion from the unit of a variable, or of the elements of an array, to another unit. Fails if the
/// elements have different units.
pub fn display_unit(system: &System, name: &str, unit: &str) -> PyResult<(f64, f64)> {
    let of = |name: &str| system.display_unit(name, unit).map_err(crate::python);
    let Some(array) = system.array(name) else { return of(name) };
    let mut all = array.names.iter().map(|element| of(element));
    let first = all.next().unwrap_or_else(|| of(name))?;
    for other in all {
        if other? != first {
            return Err(PyValueError::new_err(format!(
                "the elements of {name} have different units, so its values cannot be in {unit}; give each element"
            )));
        }
    }
    Ok(first)
}

/// Returns the path of a file.
pub fn path(name: &str, value: &Bound<'_, PyAny>) -> PyResult<PathBuf> {
    let decoded = value.py().import("os")?.call_method1("fsdecode", (value,));
    decoded.and_then(|path| path.extract()).map_err(|_| wrong(name, "a path", value))
}

/// Returns a string.
pub fn text(name: &str, value: &Bound<'_, PyAny>) -> PyResult<String> {
    value.cast::<PyString>().map_err(|_| wrong(name, "a str", value))?.extract()
}

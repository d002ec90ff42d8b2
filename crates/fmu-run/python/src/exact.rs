//! Values that float64 cannot represent: strings, bytes and 64-bit integers.

use crate::arguments::wrong;
use crate::buffers::{Numbers, shape};
use fmu_run::{BaseType, System, Value};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyByteArray, PyBytes, PyFloat, PyInt, PyList, PyString, PyTuple};

/// Values of a variable.
#[derive(Debug)]
pub struct Exact {
    pub values: Vec<Value>,
    /// Lengths of the nested sequences in which the values were given; empty for a single value.
    pub shape: Vec<usize>,
}

/// Values of a variable or an array: numbers, or values that float64 cannot represent.
pub enum Values {
    Numbers(Numbers),
    Exact(Exact),
}

impl Values {
    /// Returns the shape in which the values were given; empty for a single value.
    pub fn shape(&self) -> &[usize] {
        match self {
            Self::Numbers(numbers) => numbers.shape(),
            Self::Exact(exact) => &exact.shape,
        }
    }

    /// Returns the values of the element with this number, in an array of `count` elements: a series, or one value. A single value is the
    /// value of all elements.
    pub fn element(&self, number: usize, count: usize, is_series: bool) -> Self {
        fn every<T: Clone>(values: &[T], first: usize, step: usize) -> Vec<T> {
            values.iter().skip(first).step_by(step).cloned().collect()
        }
        match self {
            Self::Numbers(Numbers::One(value)) => Self::Numbers(Numbers::One(*value)),
            Self::Numbers(numbers) => {
                let own = every(numbers.values(), number, count);
                Self::Numbers(if is_series { Numbers::Row(own) } else { Numbers::One(own[0]) })
            }
            Self::Exact(Exact { values, shape }) => {
                let (first, step) = if shape.is_empty() { (0, 1) } else { (number, count) };
                let values = every(values, first, step);
                let shape = if is_series { vec![values.len()] } else { Vec::new() };
                Self::Exact(Exact { values, shape })
            }
        }
    }
}

/// Returns the type of a variable if float64 cannot represent all of its values.
pub fn exact_type(system: &System, name: &str) -> PyResult<Option<BaseType>> {
    system.exact_type(name).map_err(crate::python)
}

impl Exact {
    /// Reads a value or nested sequences of values.
    pub fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut found = Self { values: Vec::new(), shape: Vec::new() };
        found.add(name, given, 0)?;
        Ok(found)
    }

    /// Fails unless the values have one of these shapes.
    pub fn check(&self, name: &str, shapes: &[&[usize]]) -> PyResult<()> {
        if shapes.contains(&&*self.shape) {
            return Ok(());
        }
        let known = shapes.iter().map(|sizes| match sizes {
            [] => "one value".to_owned(),
            sizes => shape(sizes),
        });
        let known = known.collect::<Vec<_>>().join(" or ");
        Err(PyValueError::new_err(format!("{name} has the shape {}; it must be {known}", shape(&self.shape))))
    }

    /// Returns whether all values are strings.
    pub fn is_text(&self) -> bool {
        self.values.iter().all(|value| matches!(value, Value::String(_)))
    }

    /// Appends a value or a sequence, which is nested in `depth` sequences.
    fn add(&mut self, name: &str, given: &Bound<'_, PyAny>, depth: usize) -> PyResult<()> {
        if let Some(value) = value_of(name, given) {
            if depth != self.shape.len() && !self.values.is_empty() {
                return Err(ragged(name));
            }
            self.values.push(value?);
            return Ok(());
        }
        // Converts arrays of NumPy to lists.
        let list = given.call_method0("tolist").unwrap_or_else(|_| given.clone());
        if let Some(value) = value_of(name, &list) {
            self.values.push(value?);
            return Ok(());
        }
        if !list.is_instance_of::<PyList>() && !list.is_instance_of::<PyTuple>() {
            return Err(wrong(name, "a string, bytes, an integer or a sequence of them", given));
        }
        let length = list.len()?;
        match self.shape.get(depth) {
            None if self.values.is_empty() => self.shape.push(length),
            Some(known) if *known == length => {}
            _ => return Err(ragged(name)),
        }
        list.try_iter()?.try_for_each(|one| self.add(name, &one?, depth + 1))
    }
}

fn ragged(name: &str) -> PyErr {
    PyValueError::new_err(format!("{name}: the sequences have different lengths"))
}

/// Returns a single value; `None` for anything else.
fn value_of(name: &str, given: &Bound<'_, PyAny>) -> Option<PyResult<Value>> {
    if given.is_instance_of::<PyBool>() {
        return Some(given.extract().map(Value::Boolean));
    }
    if given.is_instance_of::<PyInt>() {
        let integer = given.extract().map(Value::Integer);
        return Some(integer.map_err(|_| wrong(name, "an integer of at most 64 bits", given)));
    }
    if given.is_instance_of::<PyFloat>() {
        return Some(given.extract().map(Value::Real));
    }
    if given.is_instance_of::<PyString>() {
        return Some(given.extract().map(Value::String));
    }
    if given.is_instance_of::<PyBytes>() || given.is_instance_of::<PyByteArray>() {
        return Some(given.extract().map(Value::Binary));
    }
    None
}

/// Converts a value to a Python object. Returns Python's None if there is no value.
fn object<'py>(py: Python<'py>, value: Option<&Value>) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        None => py.None().into_bound(py),
        Some(Value::Real(number)) => number.into_pyobject(py)?.into_any(),
        Some(Value::Boolean(boolean)) => boolean.into_pyobject(py)?.to_owned().into_any(),
        Some(Value::String(text)) => text.into_pyobject(py)?.into_any(),
        Some(Value::Binary(bytes)) => PyBytes::new(py, bytes).into_any(),
        Some(Value::Integer(number)) => match (i64::try_from(*number), u64::try_from(*number)) {
            (Ok(number), _) => number.into_pyobject(py)?.into_any(),
            (_, Ok(number)) => number.into_pyobject(py)?.into_any(),
            _ => number.to_string().into_pyobject(py)?.into_any(),
        },
    })
}

/// Returns a NumPy array of this shape. If the type is Int64 or UInt64 and all values exist, its dtype is int64 or uint64. Otherwise
/// it is an array of objects, with None where there is no value.
pub fn array<'py>(
    py: Python<'py>,
    base: BaseType,
    values: &[Option<&Value>],
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    let kind = match base {
        BaseType::Int64 if values.iter().all(Option::is_some) => "int64",
        BaseType::UInt64 if values.iter().all(Option::is_some) => "uint64",
        _ => "object",
    };
    let objects = values.iter().map(|value| object(py, *value)).collect::<PyResult<Vec<_>>>()?;
    let numpy = py.import("numpy")?;
    // Fills the array item by item, because NumPy would convert a list of strings or bytes to strings of fixed length.
    let array = numpy.call_method1("empty", (objects.len(), kind))?;
    for (index, object) in objects.into_iter().enumerate() {
        array.set_item(index, object)?;
    }
    array.call_method1("reshape", (PyTuple::new(py, shape)?,))
}

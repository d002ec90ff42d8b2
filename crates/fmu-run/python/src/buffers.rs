//! Reads and writes arrays of float64 in Python objects. While FMUs run without the GIL, other threads may write to arrays of the
//! caller, so these arrays are copied before and after.

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::{PyMemoryError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyFloat, PyTuple};

/// Numbers of an argument: a single number, a row, or an array with its shape.
pub enum Numbers {
    One(f64),
    Row(Vec<f64>),
    Array(Vec<f64>, Vec<usize>),
}

impl Numbers {
    /// Converts a number, an array, or an object that NumPy converts to an array. Errors name the argument.
    pub fn of(name: &str, values: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(number) = values.cast::<PyFloat>() {
            return Ok(Self::One(number.value()));
        }
        check_masks(name, values)?;
        let copy = |buffer: &PyBuffer<f64>| {
            let mut numbers = zeros(name, buffer.item_count())?;
            buffer.copy_to_slice(values.py(), &mut numbers)?;
            Ok(Self::Array(numbers, buffer.shape().to_vec()))
        };
        if let Some(buffer) = native(values) {
            return copy(&buffer);
        }
        let array = array_of(name, values)?;
        if array.getattr("ndim")?.extract::<usize>()? == 0 {
            return Ok(Self::One(array.extract()?));
        }
        copy(&PyBuffer::get(&array)?)
    }

    /// Returns the shape of an array; empty for a single number and a row.
    pub fn shape(&self) -> &[usize] {
        match self {
            Self::One(_) | Self::Row(_) => &[],
            Self::Array(_, shape) => shape,
        }
    }

    pub fn values(&self) -> &[f64] {
        match self {
            Self::One(value) => std::slice::from_ref(value),
            Self::Row(values) | Self::Array(values, _) => values,
        }
    }
}

/// Returns the buffer of an object whose values are float64 in the byte order of this machine.
fn native(values: &Bound<'_, PyAny>) -> Option<PyBuffer<f64>> {
    const OTHER: &[u8] = if cfg!(target_endian = "little") { b">!" } else { b"<" };
    // PyO3 also accepts the other byte order.
    let is_native = |buffer: &PyBuffer<f64>| {
        !buffer.format().to_bytes().first().is_some_and(|order| OTHER.contains(order))
    };
    PyBuffer::get(values).ok().filter(is_native)
}

/// Allocates zeros. If memory does not suffice, the error names the argument.
fn zeros(name: &str, count: usize) -> PyResult<Vec<f64>> {
    let mut zeros = Vec::new();
    zeros.try_reserve_exact(count).map_err(|_| {
        PyMemoryError::new_err(format!(
            "{name} has {count} values, for whose copy there is not enough memory"
        ))
    })?;
    zeros.resize(count, 0.0);
    Ok(zeros)
}

/// Fails for a masked array with masked values, because a conversion would return the values under the mask.
fn check_masks(name: &str, values: &Bound<'_, PyAny>) -> PyResult<()> {
    static NDARRAY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let py = values.py();
    let ndarray = NDARRAY.import(py, "numpy", "ndarray")?;
    // NumPy imports numpy.ma, which takes long, only when it is needed: for a subclass of its arrays.
    if !values.get_type().is(ndarray)
        && values.is_instance(ndarray)?
        && py.import("numpy.ma")?.call_method1("is_masked", (values,))?.is_truthy()?
    {
        return Err(PyValueError::new_err(format!(
            "{name} has masked values; replace them with its method filled"
        )));
    }
    Ok(())
}

/// Converts an argument to a NumPy array of float64. Errors name the argument.
pub fn array_of<'py>(name: &str, values: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    static ARRAY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let py = values.py();
    check_masks(name, values)?;
    let no_numbers = |why: &str| PyValueError::new_err(format!("{name}: the values are not numbers{why}"));
    let array = ARRAY.import(py, "numpy", "asarray")?.call1((values,));
    let array = array.map_err(|error| match error.is_instance_of::<PyValueError>(py) {
        true => no_numbers(&format!(" ({})", error.value(py))),
        false => error,
    })?;
    // Checks the type first, because NumPy would convert None to NaN and strings to numbers.
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if !"biuf".contains(&kind) {
        return Err(match array.getattr("ndim")?.extract::<usize>()? {
            0 => PyValueError::new_err(format!("{name}: {} is not a number", values.repr()?)),
            _ => no_numbers(""),
        });
    }
    let floats = array.call_method1("astype", ("float64",))?;
    // Floating-point numbers cannot represent all integers beyond 2^53.
    if "iu".contains(&kind) && array.getattr("size")?.is_truthy()? {
        const EXACT: i64 = 1 << f64::MANTISSA_DIGITS;
        let is_large = array.call_method0("max")?.gt(EXACT)? || array.call_method0("min")?.lt(-EXACT)?;
        // Python compares its integers and floating-point numbers exactly.
        let as_objects = |of: &Bound<'py, PyAny>| of.call_method1("astype", ("O",));
        let are_equal = || {
            py.import("numpy")?
                .call_method1("array_equal", (as_objects(&array)?, as_objects(&floats)?))?
                .is_truthy()
        };
        if is_large && !are_equal()? {
            return Err(PyValueError::new_err(format!(
                "{name} has integers that floating-point numbers do not have; set 64-bit integers by themselves"
            )));
        }
    }
    Ok(floats)
}

/// An array to which results are written: a new one, or one of the caller with a copy of its values.
pub struct Output(PyBuffer<f64>, Option<Vec<f64>>);

impl Output {
    /// Creates a NumPy array of this shape, or checks the array that the caller passes.
    pub fn of<'py>(
        py: Python<'py>,
        given: Option<Bound<'py, PyAny>>,
        shape: &[usize],
    ) -> PyResult<(Bound<'py, PyAny>, Self)> {
        let is_given = given.is_some();
        let array = match given {
            Some(array) => array,
            // Uses `zeros` of NumPy, because it asks the kernel for large pages.
            None => {
                static ZEROS: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
                ZEROS.import(py, "numpy", "zeros")?.call1((PyTuple::new(py, shape)?,))?
            }
        };
        let wrong = || {
            PyValueError::new_err(format!(
                "out must be a writable, contiguous array of float64, in the byte order of this machine, of the shape {}",
                self::shape(shape)
            ))
        };
        let buffer = native(&array).ok_or_else(wrong)?;
        if buffer.readonly() || !buffer.is_c_contiguous() || buffer.shape() != shape {
            return Err(wrong());
        }
        let mut copy = is_given.then(|| zeros("out", buffer.item_count())).transpose()?;
        copy.as_mut().map_or(Ok(()), |copy| buffer.copy_to_slice(py, copy))?;
        Ok((array, Self(buffer, copy)))
    }

    pub fn values(&mut self) -> &mut [f64] {
        match (&mut self.1, self.0.item_count()) {
            (Some(copy), _) => copy,
            (None, 0) => &mut [],
            // SAFETY: PyO3 has checked type, alignment and size, and `of` that the memory is writable and contiguous. No other
            // code has the new array before the call returns it.
            #[allow(unsafe_code)]
            (None, count) => unsafe { std::slice::from_raw_parts_mut(self.0.buf_ptr().cast(), count) },
        }
    }

    /// Writes the values to the array of the caller, if there is one.
    pub fn finish(self, py: Python) -> PyResult<()> {
        self.1.map_or(Ok(()), |copy| self.0.copy_from_slice(py, &copy))
    }
}

/// Formats a shape as NumPy does.
pub fn shape(sizes: &[usize]) -> String {
    match sizes {
        [one] => format!("({one},)"),
        _ => format!("({})", sizes.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

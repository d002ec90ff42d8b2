//! Reads and writes arrays of float64 in Python objects, without copies where possible.

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyFloat, PyTuple};

/// Numbers of an argument: a single number, a copied row, or an array that is read in place.
pub enum Numbers {
    One(f64),
    Row(Vec<f64>),
    Array(PyBuffer<f64>),
}

impl Numbers {
    /// Converts a number, an array, or an object that NumPy converts to an array. Errors name the argument.
    pub fn of(name: &str, values: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(number) = values.cast::<PyFloat>() {
            return Ok(Self::One(number.value()));
        }
        check_masks(name, values)?;
        if let Ok(buffer) = PyBuffer::get(values)
            && buffer.is_c_contiguous()
        {
            return Ok(Self::Array(buffer));
        }
        let array = array_of(name, values)?;
        if array.getattr("ndim")?.extract::<usize>()? == 0 {
            return Ok(Self::One(array.extract()?));
        }
        static CONTIGUOUS: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        let contiguous = CONTIGUOUS.import(values.py(), "numpy", "ascontiguousarray")?;
        Ok(Self::Array(PyBuffer::get(&contiguous.call1((array,))?)?))
    }

    /// Returns the shape of an array; empty for a single number and a copied row.
    pub fn shape(&self) -> &[usize] {
        match self {
            Self::One(_) | Self::Row(_) => &[],
            Self::Array(buffer) => buffer.shape(),
        }
    }

    pub fn values(&self) -> &[f64] {
        match self {
            Self::One(value) => std::slice::from_ref(value),
            Self::Row(values) => values,
            Self::Array(buffer) => read(buffer),
        }
    }
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
    if !"biuf".contains(&array.getattr("dtype")?.getattr("kind")?.extract::<String>()?) {
        return Err(match array.getattr("ndim")?.extract::<usize>()? {
            0 => PyValueError::new_err(format!("{name}: {} is not a number", values.repr()?)),
            _ => no_numbers(""),
        });
    }
    array.call_method1("astype", ("float64",))
}

/// Returns the numbers of an array. As with NumPy's own functions, no other thread may write to the array while the numbers are
/// used.
fn read(buffer: &PyBuffer<f64>) -> &[f64] {
    match buffer.item_count() {
        0 => &[],
        // SAFETY: PyO3 has checked type, alignment and size. The memory is contiguous (`Numbers::of`) and
        // stays valid while the buffer exists.
        #[allow(unsafe_code)]
        count => unsafe { std::slice::from_raw_parts(buffer.buf_ptr().cast(), count) },
    }
}

/// An array to which results are written.
pub struct Output(PyBuffer<f64>);

impl Output {
    /// Creates a NumPy array of this shape, or checks the array that the caller passes.
    pub fn of<'py>(
        py: Python<'py>,
        given: Option<Bound<'py, PyAny>>,
        shape: &[usize],
    ) -> PyResult<(Bound<'py, PyAny>, Self)> {
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
                "out must be a writable, contiguous array of float64 of the shape {}",
                self::shape(shape)
            ))
        };
        let buffer = PyBuffer::<f64>::get(&array).map_err(|_| wrong())?;
        if buffer.readonly() || !buffer.is_c_contiguous() || buffer.shape() != shape {
            return Err(wrong());
        }
        Ok((array, Self(buffer)))
    }

    /// Fails if the array shares memory with numbers that are read at the same time.
    pub fn check_disjoint(&self, read: &Numbers) -> PyResult<()> {
        let (own, other) = (self.0.buf_ptr().addr(), read.values().as_ptr_range());
        let is_disjoint = own + 8 * self.0.item_count() <= other.start.addr() || other.end.addr() <= own;
        let message = "out shares memory with the values that are set";
        if is_disjoint { Ok(()) } else { Err(PyValueError::new_err(message)) }
    }

    pub fn values(&mut self) -> &mut [f64] {
        match self.0.item_count() {
            0 => &mut [],
            // SAFETY: the conditions of `read` hold, and `Output::of` has checked that the array is writable.
            #[allow(unsafe_code)]
            count => unsafe { std::slice::from_raw_parts_mut(self.0.buf_ptr().cast(), count) },
        }
    }
}

/// Formats a shape as NumPy does.
pub fn shape(sizes: &[usize]) -> String {
    match sizes {
        [one] => format!("({one},)"),
        _ => format!("({})", sizes.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

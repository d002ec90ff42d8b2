//! `fmu_run.Instances`.

use crate::buffers::{Numbers, Room};
use crate::{FmuError, python};
use fmu_run::{Continuous, Fmu, Interface, Selection, Setup};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Instances of one FMU, side by side; made by `Fmu.instances`.
///
/// Every call does the same with all of them, in threads and without the GIL. Arrays are (n,) where one variable is named by a
/// text, (n, variables) where several are named by a sequence; values that are set may also be one number or one row for all.
/// Arrays are written in place if they are given as `out`.
///
/// An instance that the FMU refuses something drops out: `errors` says why, what is read of it is not a number, the others go
/// on; `reset` and `restore` bring it back. Where the last one drops out, FmuError is raised.
#[pyclass(frozen, module = "fmu_run")]
pub struct Instances {
    fmu: Arc<Fmu>,
    count: usize,
    held: Arc<Mutex<fmu_run::Instances>>,
    /// What names stand for that were given before, by the objects they were given as.
    known: Mutex<Vec<(Py<PyAny>, Arc<Named>)>>,
}

/// The variables that a call names, and whether by one text.
struct Named {
    selection: Selection,
    one: bool,
}

/// States that instances have saved; freed with this.
#[pyclass(frozen, module = "fmu_run")]
pub struct States {
    held: Arc<Mutex<fmu_run::Instances>>,
    states: Mutex<Option<fmu_run::States>>,
}

impl Drop for States {
    fn drop(&mut self) {
        if let Some(states) = lock(&self.states).take() {
            lock(&self.held).forget(states);
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Start values by name: numbers, arrays (n,), texts.
#[derive(Default)]
struct Start {
    numbers: Vec<(String, Numbers)>,
    texts: Vec<(String, String)>,
}

impl Start {
    fn of(given: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let mut start = Self::default();
        for (name, value) in given.into_iter().flatten() {
            let name = name.extract()?;
            match value.extract() {
                Ok(text) => start.texts.push((name, text)),
                Err(_) => start.numbers.push((name, Numbers::of(&value)?)),
            }
        }
        Ok(start)
    }

    fn numbers(&self) -> Vec<(&str, &[f64])> {
        self.numbers.iter().map(|(name, values)| (name.as_str(), values.values())).collect()
    }

    fn texts(&self) -> Vec<(&str, &str)> {
        self.texts.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect()
    }
}

/// Which instances: true in a sequence of n truth values.
type Given<'py> = Option<Bound<'py, PyAny>>;

#[pymethods]
impl Instances {
    #[new]
    #[allow(clippy::too_many_arguments, reason = "named where it is called")]
    fn new(
        py: Python,
        loaded: &crate::Loaded,
        count: usize,
        interface: &str,
        start: Option<Bound<'_, PyDict>>,
        start_time: f64,
        stop_time: Option<f64>,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let interface = match interface {
            "co-simulation" => Interface::CoSimulation,
            "model-exchange" => Interface::ModelExchange,
            other => {
                let why = format!("interface must be 'co-simulation' or 'model-exchange', not {other:?}");
                return Err(PyValueError::new_err(why));
            }
        };
        let (fmu, given) = (loaded.fmu()?, Start::of(start.as_ref())?);
        let (start, texts) = (given.numbers(), given.texts());
        let setup = Setup { interface, count, start, texts, start_time, stop_time, threads };
        let made = py.detach(|| fmu.instances(&setup)).map_err(python)?;
        Ok(Self { fmu, count, held: Arc::new(Mutex::new(made)), known: Mutex::default() })
    }

    fn __len__(&self) -> usize {
        self.count
    }

    fn __repr__(&self) -> String {
        let failed = lock(&self.held).errors().count();
        let failed = if failed == 0 { String::new() } else { format!(", {failed} dropped out") };
        format!("<Instances: {} of {}{failed}>", self.count, self.fmu.description().model_name)
    }

    /// dict[int, str]: those that have dropped out, and why, in the words of the FMU.
    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let errors = PyDict::new(py);
        for (place, why) in lock(&self.held).errors() {
            errors.set_item(place, why)?;
        }
        Ok(errors)
    }

    /// (n,): the time of each, s.
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (array, mut room) = Room::of(py, None, &[self.count])?;
        room.values().iter_mut().zip(lock(&self.held).times()).for_each(|(to, time)| *to = time);
        Ok(array)
    }

    /// (n,): when the next event of each is due, s; not a number where none is.
    #[getter]
    fn next_event_time<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.of_events(py, |event| event.next.unwrap_or(f64::NAN))
    }

    /// (n,): 1 where the last event has changed continuous states, else 0.
    #[getter]
    fn states_changed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.of_events(py, |event| f64::from(u8::from(event.states_changed)))
    }

    /// (n,): 1 where the FMU wants to end the simulation, else 0.
    #[getter]
    fn wants_to_end<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.of_events(py, |event| f64::from(u8::from(event.terminate)))
    }

    /// Set variables: a number or a row for all, or an array with one for each.
    ///
    /// Parameters
    /// ----------
    /// variables : str or sequence of str
    /// values : number, (n,) for a str; (variables,) or (n, variables) for a sequence
    /// mask : (n,) of bool, optional
    ///     Which instances; all if it is not given.
    #[pyo3(signature = (variables, values, mask=None))]
    fn set(
        &self,
        py: Python,
        variables: &Bound<'_, PyAny>,
        values: &Bound<'_, PyAny>,
        mask: Given,
    ) -> PyResult<()> {
        let (named, mask) = (self.named(variables)?, self.mask(mask)?);
        let values = self.fitting(&named, Numbers::of(values)?)?;
        self.with(py, |all| all.set(&named.selection, values.values(), mask.as_deref()))
    }

    /// Read variables: (n,) for a str, (n, variables) for a sequence; into `out` if it is given.
    #[pyo3(signature = (variables, out=None))]
    fn get<'py>(
        &self,
        py: Python<'py>,
        variables: &Bound<'py, PyAny>,
        out: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let named = self.named(variables)?;
        let (array, mut room) = self.room(py, &named, out)?;
        self.with(py, || (), |all| all.get(&named.selection, room.values()))?;
        Ok(array)
    }
}

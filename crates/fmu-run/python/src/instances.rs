//! The class `fmu_run.Instances`.

use crate::buffers::{Numbers, Output};
use crate::start::Start;
use crate::{FmuError, python};
use fmu_run::{Continuous, Error, Interface, Selection, Setup, System, process};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyDict, PyString, PyTuple};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::{Duration, Instant};

/// Instances of one FMU, run in parallel; made by `Fmu.instances`.
///
/// Every call acts on all of them, in threads and without the GIL. Arrays have the shape (n,) if one variable
/// is given as a str, and (n, variables) for a sequence of str. Values to set may also be one number or one
/// row for all. Arrays passed as `out` are written in place.
///
/// If a call fails for an instance, the instance drops out and the others continue. `errors` contains the
/// reason; values read from the instance are NaN. `reset` and `restore` make it usable again. If the last
/// instance drops out, the call raises FmuError with the reason. Later calls raise FmuError as well until an
/// instance is usable again.
#[pyclass(frozen, module = "fmu_run")]
pub struct Instances {
    system: System,
    count: usize,
    instances: Arc<Shared>,
    /// Cache of looked-up names, by the objects that named them.
    known: Mutex<Vec<(Py<PyAny>, Arc<Named>)>>,
}

/// Variables of a call, and whether a single str named them.
#[derive(Default)]
struct Named {
    selection: Selection,
    one: bool,
}

/// Saved states of instances; freed with this object.
#[pyclass(frozen, module = "fmu_run")]
pub struct States {
    instances: Arc<Shared>,
    states: Option<Arc<fmu_run::States>>,
}

impl Drop for States {
    fn drop(&mut self) {
        if let Some(states) = self.states.take().and_then(Arc::into_inner) {
            // In a forked process they may be out of reach.
            if let Ok(mut instances) = self.instances.lock() {
                instances.forget(states);
            }
        }
    }
}

/// Instances that Python threads share.
struct Shared {
    instances: Mutex<fmu_run::Instances>,
    /// Process that locked them last.
    process: AtomicU32,
}

impl Shared {
    fn of(instances: fmu_run::Instances) -> Arc<Self> {
        Arc::new(Self { instances: Mutex::new(instances), process: AtomicU32::new(process()) })
    }

    /// Waits until no other thread uses the instances. Fails if this is for ever, because a thread used them when
    /// this process was forked.
    fn lock(&self) -> PyResult<MutexGuard<'_, fmu_run::Instances>> {
        const BETWEEN_LOCK_AND_STORE: Duration = Duration::from_secs(1);
        let found = match self.instances.try_lock() {
            Ok(found) => found,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => {
                let begin = Instant::now();
                while self.process.load(Ordering::Acquire) != process() {
                    if begin.elapsed() > BETWEEN_LOCK_AND_STORE {
                        return Err(FmuError::new_err(
                            "another thread used these instances when this process was forked; make new instances after the fork",
                        ));
                    }
                    std::thread::sleep(Duration::from_millis(1));
                }
                lock(&self.instances)
            }
        };
        self.process.store(process(), Ordering::Release);
        Ok(found)
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Mask: a sequence of n Booleans, true for the selected instances.
type Optional<'py> = Option<Bound<'py, PyAny>>;

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
        let system = System::clone(&*loaded.model()?);
        let start = Start::of(&system, start.as_ref())?;
        let setup = Setup {
            interface,
            count,
            start: start.values(),
            start_time,
            stop_time,
            threads,
            ..Setup::default()
        };
        let made = py.detach(|| system.instances(&setup)).map_err(python)?;
        Ok(Self { system, count, instances: Shared::of(made), known: Mutex::default() })
    }

    fn __len__(&self) -> usize {
        self.count
    }

    fn __repr__(&self) -> PyResult<String> {
        let failed = self.instances.lock()?.errors().count();
        let failed = if failed == 0 { String::new() } else { format!(", {failed} dropped out") };
        Ok(format!("<Instances: {} of {}{failed}>", self.count, self.system.name()))
    }

    /// dict[int, str]: the instances that have dropped out, each with the reason from the FMU.
    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let errors = PyDict::new(py);
        // Calls no Python code while the lock is held: dropping a States object takes the lock, too.
        let found: Vec<_> =
            self.instances.lock()?.errors().map(|(index, why)| (index, why.to_owned())).collect();
        for (index, why) in found {
            errors.set_item(index, why)?;
        }
        Ok(errors)
    }

    /// (n,): the time of each instance, s.
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (array, mut output) = Output::of(py, None, &[self.count])?;
        output.values().iter_mut().zip(self.instances.lock()?.times()).for_each(|(to, time)| *to = time);
        Ok(array)
    }

    /// (n,): the time of the next event of each instance, s; NaN if there is none.
    #[getter]
    fn next_event_time<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.event_values(py, |event| event.next.unwrap_or(f64::NAN))
    }

    /// (n,): 1 if the last event of the instance has changed continuous states, else 0.
    #[getter]
    fn states_changed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.event_values(py, |event| f64::from(u8::from(event.states_changed)))
    }

    /// (n,): 1 if the instance requests the end of the simulation, else 0.
    #[getter]
    fn wants_to_end<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.event_values(py, |event| f64::from(u8::from(event.terminate)))
    }

    /// Set variables: a number or a row for all instances, or an array with a row for each.
    ///
    /// Parameters
    /// ----------
    /// variables : str or sequence of str
    /// values : number, (n,) for a str; number, (variables,) or (n, variables) for a sequence
    /// mask : (n,) of bool, optional
    ///     Selected instances; all by default.
    #[pyo3(signature = (variables, values, mask=None))]
    fn set(
        &self,
        py: Python,
        variables: &Bound<'_, PyAny>,
        values: &Bound<'_, PyAny>,
        mask: Optional,
    ) -> PyResult<()> {
        self.put(py, variables, values, mask, fmu_run::Instances::set)
    }

    /// Read variables: (n,) for a str, (n, variables) for a sequence; written to `out` if it is given.
    #[pyo3(signature = (variables, out=None))]
    fn get<'py>(
        &self,
        py: Python<'py>,
        variables: &Bound<'py, PyAny>,
        out: Optional<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let named = self.named(variables)?;
        self.read(py, named.columns(), out, |all, values| {
            all.get(&named.selection, values);
            Ok(())
        })
    }

    /// list[str | None]: the value of a string variable in each instance; None for an instance that has
    /// dropped out.
    fn texts(&self, py: Python, variable: &str) -> PyResult<Vec<Option<String>>> {
        self.attempt(py, |all| all.texts(variable))
    }

    /// Perform a step of Co-Simulation: by `size`, or to the time `to`, s.
    #[pyo3(signature = (size=None, *, to=None, mask=None))]
    fn step(&self, py: Python, size: Option<f64>, to: Option<f64>, mask: Optional) -> PyResult<()> {
        self.only(Interface::CoSimulation)?;
        let mask = self.mask(mask)?;
        match (size, to) {
            (Some(size), None) => self.attempt(py, |all| all.step(size, mask.as_deref())),
            (None, Some(to)) => self.attempt(py, |all| all.step_to(to, mask.as_deref())),
            _ => Err(PyValueError::new_err("give either the size of the step or the time to step to")),
        }
    }

    /// Set variables, perform a step and read other variables in one call: `set`, `step` and `get`.
    #[pyo3(signature = (set, values, size, get, out=None))]
    fn advance<'py>(
        &self,
        py: Python<'py>,
        set: &Bound<'py, PyAny>,
        values: &Bound<'py, PyAny>,
        size: f64,
        get: &Bound<'py, PyAny>,
        out: Optional<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.only(Interface::CoSimulation)?;
        let (set, get) = (self.named(set)?, self.named(get)?);
        let values = self.fitting(set.columns(), Numbers::of(values)?)?;
        let (array, mut output) = Output::of(py, out, &self.shape(get.columns()))?;
        output.check_disjoint(&values)?;
        self.attempt(py, |all| {
            all.advance((&set.selection, values.values()), size, (&get.selection, output.values()))
        })?;
        Ok(array)
    }

    /// Reset the instances to their start values and initialize them.
    ///
    /// Parameters
    /// ----------
    /// mask : (n,) of bool, optional
    ///     Selected instances; all by default.
    /// start : dict, optional
    ///     Start values by name that replace earlier ones: numbers, (n,), or strings.
    #[pyo3(signature = (mask=None, *, start=None))]
    fn reset(&self, py: Python, mask: Optional, start: Option<Bound<'_, PyDict>>) -> PyResult<()> {
        let (mask, start) = (self.mask(mask)?, Start::of(&self.system, start.as_ref())?);
        self.revive(py, |all| {
            all.start_from(&start.values())?;
            all.reset(mask.as_deref());
            Ok(())
        })
    }

    /// Save the state and the time of each instance.
    fn save(&self, py: Python) -> PyResult<States> {
        let states = self.attempt(py, fmu_run::Instances::save)?;
        Ok(States { instances: Arc::clone(&self.instances), states: Some(Arc::new(states)) })
    }

    /// Restore states that these instances have saved.
    #[pyo3(signature = (states, mask=None))]
    fn restore(&self, py: Python, states: &States, mask: Optional) -> PyResult<()> {
        let (mask, states) = (self.mask(mask)?, self.own(states)?);
        self.revive(py, |all| all.restore(&states, mask.as_deref()))
    }

    /// Return saved states as bytes, for use in another process: one for each instance, None for an instance
    /// without a state.
    fn serialize<'py>(&self, py: Python<'py>, states: &States) -> PyResult<Vec<Option<Bound<'py, PyBytes>>>> {
        let states = self.own(states)?;
        let found = self.attempt(py, |all| all.serialize(&states))?;
        Ok(found.into_iter().map(|bytes| bytes.map(|bytes| PyBytes::new(py, &bytes))).collect())
    }

    /// Read states from the bytes that `serialize` returned, here or in another process: one or None for each
    /// instance.
    fn deserialize(&self, py: Python, states: Vec<Option<PyBackedBytes>>) -> PyResult<States> {
        let read = py.detach(|| self.instances.lock()?.deserialize(&states).map_err(python))?;
        Ok(States { instances: Arc::clone(&self.instances), states: Some(Arc::new(read)) })
    }

    /// Compute directional derivatives of unknowns for a seed.
    ///
    /// Parameters
    /// ----------
    /// unknowns, knowns : str or sequence of str
    /// seed : number, (n,) for a str; number, (knowns,) or (n, knowns) for a sequence
    /// out : array, optional
    ///
    /// Returns
    /// -------
    /// (n,) for a str, (n, unknowns) for a sequence
    #[pyo3(signature = (unknowns, knowns, seed, out=None))]
    fn directional_derivative<'py>(
        &self,
        py: Python<'py>,
        unknowns: &Bound<'py, PyAny>,
        knowns: &Bound<'py, PyAny>,
        seed: &Bound<'py, PyAny>,
        out: Optional<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (unknowns, knowns) = (self.named(unknowns)?, self.named(knowns)?);
        let seed = self.fitting(knowns.columns(), Numbers::of(seed)?)?;
        let (array, mut output) = Output::of(py, out, &self.shape(unknowns.columns()))?;
        output.check_disjoint(&seed)?;
        self.attempt(py, |all| {
            let seed = (&knowns.selection, seed.values());
            all.directional_derivative(&unknowns.selection, seed, output.values())
        })?;
        Ok(array)
    }

    /// Co-Simulation, FMI 2.0: set time derivatives of inputs, of order 1, in the shapes of `set`.
    #[pyo3(signature = (variables, values, mask=None))]
    fn set_input_derivatives(
        &self,
        py: Python,
        variables: &Bound<'_, PyAny>,
        values: &Bound<'_, PyAny>,
        mask: Optional,
    ) -> PyResult<()> {
        self.only(Interface::CoSimulation)?;
        self.put(py, variables, values, mask, fmu_run::Instances::set_input_derivatives)
    }

    /// Co-Simulation: read time derivatives of outputs, of order 1, in the shapes of `get`.
    #[pyo3(signature = (variables, out=None))]
    fn get_output_derivatives<'py>(
        &self,
        py: Python<'py>,
        variables: &Bound<'py, PyAny>,
        out: Optional<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.only(Interface::CoSimulation)?;
        let named = self.named(variables)?;
        self.read(py, named.columns(), out, |all, values| {
            all.get_output_derivatives(&named.selection, values)
        })
    }

    /// Model Exchange: set the time, s: a number for all instances or (n,).
    #[pyo3(signature = (time, mask=None))]
    fn set_time(&self, py: Python, time: &Bound<'_, PyAny>, mask: Optional) -> PyResult<()> {
        self.only(Interface::ModelExchange)?;
        let (mask, time) = (self.mask(mask)?, self.fitting(None, Numbers::of(time)?)?);
        self.attempt(py, |all| all.set_time(time.values(), mask.as_deref()))
    }

    /// Model Exchange: set the continuous states, (states,) for all instances or (n, states).
    #[pyo3(signature = (states, mask=None))]
    fn set_continuous_states(&self, py: Python, states: &Bound<'_, PyAny>, mask: Optional) -> PyResult<()> {
        self.only(Interface::ModelExchange)?;
        let columns = Some(self.instances.lock()?.continuous(Continuous::States));
        let (mask, states) = (self.mask(mask)?, self.fitting(columns, Numbers::of(states)?)?);
        self.attempt(py, |all| {
            all.set_continuous_states(states.values(), mask.as_deref());
            Ok(())
        })
    }

    /// Model Exchange: read the continuous states, (n, states).
    #[pyo3(signature = (out=None))]
    fn get_continuous_states<'py>(&self, py: Python<'py>, out: Optional<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.continuous(py, Continuous::States, out)
    }

    /// Model Exchange: read the derivatives of the continuous states, (n, states).
    #[pyo3(signature = (out=None))]
    fn get_derivatives<'py>(&self, py: Python<'py>, out: Optional<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.continuous(py, Continuous::Derivatives, out)
    }

    /// Model Exchange: read the nominal values of the continuous states, (n, states).
    #[pyo3(signature = (out=None))]
    fn get_nominals<'py>(&self, py: Python<'py>, out: Optional<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.continuous(py, Continuous::Nominals, out)
    }

    /// Model Exchange: read the event indicators, (n, indicators).
    #[pyo3(signature = (out=None))]
    fn get_event_indicators<'py>(&self, py: Python<'py>, out: Optional<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.continuous(py, Continuous::EventIndicators, out)
    }

    /// Model Exchange: handle an event with all its iterations, and return to Continuous-Time Mode.
    /// `next_event_time`, `states_changed` and `wants_to_end` contain the results.
    ///
    /// Parameters
    /// ----------
    /// variables, values : optional
    ///     Values to set in Event Mode before the event, as for `set`. Discrete variables can be set only
    /// there.
    /// mask : (n,) of bool, optional
    ///     Selected instances; all by default.
    #[pyo3(signature = (variables=None, values=None, *, mask=None))]
    fn handle_events(
        &self,
        py: Python,
        variables: Optional,
        values: Optional,
        mask: Optional,
    ) -> PyResult<()> {
        self.only(Interface::ModelExchange)?;
        let mask = self.mask(mask)?;
        let (named, values) = match (&variables, &values) {
            (Some(variables), Some(values)) => {
                let named = self.named(variables)?;
                let values = self.fitting(named.columns(), Numbers::of(values)?)?;
                (named, Some(values))
            }
            (None, None) => (Arc::default(), None),
            _ => return Err(PyValueError::new_err("give variables and values, or neither")),
        };
        let values = values.as_ref().map_or(&[][..], Numbers::values);
        self.attempt(py, |all| all.handle_events((&named.selection, values), mask.as_deref()))
    }

    /// Model Exchange: report a completed step of the integrator.
    ///
    /// Returns
    /// -------
    /// (n, 2): 1 if an instance requests an event, and 1 if it requests the end of the simulation, else 0
    fn completed_integrator_step<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.only(Interface::ModelExchange)?;
        self.read(py, Some(2), None, |all, values| {
            all.completed_integrator_step(values);
            Ok(())
        })
    }
}

impl Instances {
    /// Looks up variables by name; results are cached by the identity of the Python object.
    fn named(&self, variables: &Bound<'_, PyAny>) -> PyResult<Arc<Named>> {
        /// Size of the cache.
        const MOST: usize = 64;
        let mut known = lock(&self.known);
        if let Some((_, named)) = known.iter().find(|(object, _)| object.is(variables)) {
            return Ok(Arc::clone(named));
        }
        let text = variables.cast::<PyString>();
        let names = match text {
            Ok(name) => vec![name.extract()?],
            Err(_) => variables.extract::<Vec<String>>()?,
        };
        let selection = self.system.select(&names).map_err(python)?;
        let named = Arc::new(Named { selection, one: text.is_ok() });
        // A list is mutable, so it is not cached.
        if text.is_ok() || variables.is_instance_of::<PyTuple>() {
            known.truncate(MOST - 1);
            known.insert(0, (variables.clone().unbind(), Arc::clone(&named)));
        }
        Ok(named)
    }

    fn mask(&self, given: Optional) -> PyResult<Option<Vec<bool>>> {
        let Some(given) = given else { return Ok(None) };
        let mask: Vec<bool> = match given.call_method0("tolist") {
            Ok(list) => list.extract()?,
            Err(_) => given.extract()?,
        };
        if mask.len() == self.count {
            return Ok(Some(mask));
        }
        let why = format!("the mask has {} Booleans for {} instances", mask.len(), self.count);
        Err(PyValueError::new_err(why))
    }

    /// Returns the shape of an array with a row of `columns` values, or a single value, for each instance.
    fn shape(&self, columns: Option<usize>) -> Vec<usize> {
        std::iter::once(self.count).chain(columns).collect()
    }

    /// Checks the shape of values: one for all, a row for all, or a row for each instance.
    fn fitting(&self, columns: Option<usize>, values: Numbers) -> PyResult<Numbers> {
        let (rows, length) = (self.shape(columns), columns.unwrap_or(1));
        match &values {
            Numbers::One(value) if length != 1 => Ok(Numbers::Row(vec![*value; length])),
            Numbers::One(_) => Ok(values),
            _ if values.shape() == rows => Ok(values),
            _ if columns.is_some() && values.shape() == [length] => Ok(values),
            _ => {
                let row = columns.map_or(String::new(), |columns| format!(", [{columns}]"));
                let why = format!(
                    "the values have the shape {:?}; it must be {rows:?}{row} or a number",
                    values.shape()
                );
                Err(PyValueError::new_err(why))
            }
        }
    }

    /// Fails if the instances are for another interface type, before the FMU would reject the call.
    fn only(&self, wanted: Interface) -> PyResult<()> {
        let why = match (wanted, self.instances.lock()?.interface()) {
            (wanted, interface) if wanted == interface => return Ok(()),
            (Interface::ModelExchange, _) => {
                "these instances are for Co-Simulation; this is for Model Exchange: instances(interface=\"model-exchange\")"
            }
            _ => {
                "these instances are for Model Exchange, which the caller integrates; only Co-Simulation has steps"
            }
        };
        Err(PyValueError::new_err(why))
    }

    /// Returns the states if they belong to these instances.
    fn own(&self, states: &States) -> PyResult<Arc<fmu_run::States>> {
        let own = states.states.clone().filter(|_| Arc::ptr_eq(&self.instances, &states.instances));
        own.ok_or_else(|| {
            PyValueError::new_err(
                "these states belong to other instances; serialize them there and deserialize them here",
            )
        })
    }

    /// Runs a call without the GIL; raises FmuError if no instance is left before or after it.
    fn attempt<T: Send>(
        &self,
        py: Python,
        body: impl FnOnce(&mut fmu_run::Instances) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        if let Some(why) = self.instances.lock()?.none_left() {
            let all = if self.count == 1 { "the instance has" } else { "all instances have" };
            let why = format!(
                "{all} dropped out before; reset() or restore() brings them back (instance 0: {why})"
            );
            return Err(FmuError::new_err(why));
        }
        self.revive(py, body)
    }

    /// Runs a call that may make instances usable again.
    fn revive<T: Send>(
        &self,
        py: Python,
        body: impl FnOnce(&mut fmu_run::Instances) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        let (result, none_left) = py.detach(|| {
            let mut all = self.instances.lock()?;
            let result = body(&mut all).map_err(python)?;
            PyResult::Ok((result, all.none_left().map(str::to_owned)))
        })?;
        none_left.map_or(Ok(result), |why| Err(FmuError::new_err(why)))
    }

    /// Sets values of variables: a row for each instance or one for all.
    fn put(
        &self,
        py: Python,
        variables: &Bound<'_, PyAny>,
        values: &Bound<'_, PyAny>,
        mask: Optional,
        body: fn(&mut fmu_run::Instances, &Selection, &[f64], fmu_run::Mask) -> Result<(), Error>,
    ) -> PyResult<()> {
        let (named, mask) = (self.named(variables)?, self.mask(mask)?);
        let values = self.fitting(named.columns(), Numbers::of(values)?)?;
        self.attempt(py, |all| body(all, &named.selection, values.values(), mask.as_deref()))
    }

    fn read<'py>(
        &self,
        py: Python<'py>,
        columns: Option<usize>,
        out: Optional<'py>,
        body: impl FnOnce(&mut fmu_run::Instances, &mut [f64]) -> Result<(), Error> + Send,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (array, mut output) = Output::of(py, out, &self.shape(columns))?;
        self.attempt(py, |all| body(all, output.values()))?;
        Ok(array)
    }

    fn continuous<'py>(
        &self,
        py: Python<'py>,
        what: Continuous,
        out: Optional<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.only(Interface::ModelExchange)?;
        let columns = self.instances.lock()?.continuous(what);
        self.read(py, Some(columns), out, |all, values| {
            all.get_continuous(what, values);
            Ok(())
        })
    }

    fn event_values<'py>(
        &self,
        py: Python<'py>,
        what: impl Fn(fmu_run::Event) -> f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (array, mut output) = Output::of(py, None, &[self.count])?;
        output
            .values()
            .iter_mut()
            .zip(self.instances.lock()?.events())
            .for_each(|(to, event)| *to = what(event));
        Ok(array)
    }
}

impl Named {
    /// Returns the number of columns of an array; None for a single str.
    fn columns(&self) -> Option<usize> {
        (!self.one).then(|| self.selection.len())
    }
}

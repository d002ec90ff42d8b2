//! The class `fmu_run.Instances`.

use crate::arguments::{self, wrong};
use crate::buffers::{Numbers, Output, shape};
use crate::exact::{self, Exact, exact_type};
use crate::log::Log;
use crate::start::Start;
use crate::{FmuError, python};
use fmu_run::{BaseType, Continuous, Error, Interface, Selection, Setup, System, process};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyDict, PyString, PyTuple};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::{Duration, Instant};

/// Instances of one FMU or system, which run in parallel. `Fmu.instances` and `System.instances` create them.
///
/// A call acts on all instances, or on those in its `mask`. The FMUs run without the GIL, in several threads if `threads` allows
/// it. Arrays of values have the shape (n,) if one variable is given as a str, and (n, variables) if a sequence of str is given. A
/// str that names a whole array adds the dimensions of the array to (n,). Values to set may also be one number or one row for all
/// instances. Arrays passed as `out` are written in place.
///
/// If a call fails for an instance, the instance drops out and all others continue. `errors` contains the reason, and values read
/// from this instance are NaN, or None for strings, bytes and single 64-bit integers. `reset` and `restore` make it usable
/// again. If the last instance drops out, the call raises FmuError with the reason, and so do later calls until an instance is
/// usable again.
#[pyclass(frozen, module = "fmu_run")]
pub struct Instances {
    system: System,
    interface: Interface,
    count: usize,
    instances: Arc<Shared>,
    /// Cache of variables, by the Python objects that contain their names.
    known: Mutex<Vec<(Py<PyAny>, Arc<Named>)>>,
    /// Receives the messages of the FMU.
    log: Option<Log>,
}

/// Variables of a call, found by name.
#[derive(Default)]
struct Named {
    selection: Selection,
    /// Shape of the values of an instance.
    row: Vec<usize>,
}

/// Saved states of instances. They are freed with this object.
#[pyclass(frozen, module = "fmu_run")]
pub struct States {
    instances: Arc<Shared>,
    states: Option<Arc<fmu_run::States>>,
}

impl Drop for States {
    fn drop(&mut self) {
        if let Some(states) = self.states.take().and_then(Arc::into_inner) {
            // In a forked process the lock may fail; then the states are not freed.
            if let Ok(mut instances) = self.instances.lock() {
                instances.forget(states);
            }
        }
    }
}

/// Instances that several Python threads may use.
struct Shared {
    instances: Mutex<fmu_run::Instances>,
    /// Number of the process that last locked the instances, from `process()`.
    process: AtomicU32,
}

impl Shared {
    fn of(instances: fmu_run::Instances) -> Arc<Self> {
        Arc::new(Self { instances: Mutex::new(instances), process: AtomicU32::new(process()) })
    }

    /// Waits until no other thread uses the instances. If another thread of the parent process used them during the fork, their
    /// lock is never released in this process, so this function fails.
    fn lock(&self) -> PyResult<MutexGuard<'_, fmu_run::Instances>> {
        /// Maximum time that a thread needs from locking the instances to storing the number of its process.
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

/// An optional argument.
type Optional<'py> = Option<Bound<'py, PyAny>>;

#[pymethods]
impl Instances {
    #[new]
    #[allow(clippy::too_many_arguments, reason = "named where it is called")]
    fn new(
        py: Python,
        loaded: &crate::Loaded,
        count: &Bound<'_, PyAny>,
        interface: &Bound<'_, PyAny>,
        start: Optional,
        start_time: &Bound<'_, PyAny>,
        stop_time: Optional,
        threads: Optional,
        tolerance: &Bound<'_, PyAny>,
        log: Optional,
    ) -> PyResult<Self> {
        let interface = arguments::interface(interface)?;
        let count = arguments::count("count", Some(count))?.unwrap_or(1);
        let threads = arguments::count("threads", threads.as_ref())?;
        let start_time = finite("start_time", start_time)?;
        let stop_time = stop_time.map(|time| finite("stop_time", &time)).transpose()?;
        let (system, start) = Start::configured(loaded.model()?.system(), start.as_ref())?;
        let log = Log::of(log.as_ref())?;
        let setup = Setup {
            interface,
            count,
            start: start.values(),
            start_time,
            stop_time,
            threads,
            tolerance: arguments::tolerance(tolerance)?,
            listening: log.is_some(),
        };
        let mut messages = Vec::new();
        let made = py.detach(|| system.instances_with(&setup, &mut messages));
        if let Some(log) = &log {
            log.pass(py, messages)?;
        }
        let instances = Shared::of(made.map_err(python)?);
        Ok(Self { system, interface, count, instances, known: Mutex::default(), log })
    }

    fn __len__(&self) -> usize {
        self.count
    }

    fn __repr__(&self) -> PyResult<String> {
        let failed = self.instances.lock()?.errors().count();
        let failed = if failed == 0 { String::new() } else { format!(", {failed} dropped out") };
        Ok(format!("<Instances: {} of {}{failed}>", self.count, self.system.name()))
    }

    /// dict[int, str]: the reason why an instance has dropped out, by its index.
    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let errors = PyDict::new(py);
        // Copies the errors, because no Python code may run while the lock is held: dropping a States object takes the lock, too.
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

    /// (n,): 1 if the last event of the instance has changed its continuous states, else 0.
    #[getter]
    fn states_changed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.event_values(py, |event| f64::from(u8::from(event.states_changed)))
    }

    /// (n,): 1 if the instance has requested the end of the simulation at its last event, else 0.
    #[getter]
    fn wants_to_end<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.event_values(py, |event| f64::from(u8::from(event.terminate)))
    }

    /// Set variables. The values are a number or a row for all instances, or an array with a row for each.
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
        if let Some((name, _)) = self.exact(variables)? {
            let (mask, values) = (self.mask(mask)?, Exact::of("values", values)?);
            values.check("values", &[&[], &[self.count]])?;
            return self.attempt(py, |all| all.set_values(&name, &values.values, mask.as_deref()));
        }
        self.put(py, variables, values, mask, fmu_run::Instances::set)
    }

    /// Read variables: (n,) for a str, (n, variables) for a sequence. The values are written to `out` if it is given. Without
    /// `out`, the result for a single Int64 or UInt64 variable is an array of int64 or uint64, and for a string or bytes an array
    /// of objects. If an instance has dropped out, all of these are arrays of objects, with None for this instance.
    #[pyo3(signature = (variables, out=None))]
    fn get<'py>(
        &self,
        py: Python<'py>,
        variables: &Bound<'py, PyAny>,
        out: Optional<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        if let (Some((name, base)), None) = (self.exact(variables)?, &out) {
            let values = self.attempt(py, |all| all.values(&name))?;
            let values: Vec<_> = values.iter().map(Option::as_ref).collect();
            return exact::array(py, base, &values, &[self.count]);
        }
        let named = self.named("variables", variables)?;
        self.read(py, &named.row, out, |all, values| {
            all.get(&named.selection, values);
            Ok(())
        })
    }

    /// list[str | None]: read a string variable of each instance; None for an instance that has dropped out.
    fn texts(&self, py: Python, variable: &Bound<'_, PyAny>) -> PyResult<Vec<Option<String>>> {
        let variable = arguments::text("variable", variable)?;
        self.attempt(py, |all| all.texts(&variable))
    }

    /// Perform a step of Co-Simulation of the given `size`, s, or to the time `to`, s.
    #[pyo3(signature = (size=None, *, to=None, mask=None))]
    fn step(&self, py: Python, size: Optional, to: Optional, mask: Optional) -> PyResult<()> {
        self.only(Interface::CoSimulation)?;
        let number = |name, value: Optional| value.map(|value| arguments::number(name, &value)).transpose();
        let (size, to) = (number("size", size)?, number("to", to)?);
        let mask = self.mask(mask)?;
        match (size, to) {
            (Some(size), None) => self.attempt(py, |all| all.step(size, mask.as_deref())),
            (None, Some(to)) => self.attempt(py, |all| all.step_to(to, mask.as_deref())),
            _ => Err(PyValueError::new_err("give either the size of the step or the time to step to")),
        }
    }

    /// Set variables, perform a step of `size`, s, and read other variables in one call, as `set`, `step` and `get` do.
    #[pyo3(signature = (set, values, size, get, out=None))]
    fn advance<'py>(
        &self,
        py: Python<'py>,
        set: &Bound<'py, PyAny>,
        values: &Bound<'py, PyAny>,
        size: &Bound<'py, PyAny>,
        get: &Bound<'py, PyAny>,
        out: Optional<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.only(Interface::CoSimulation)?;
        let size = arguments::number("size", size)?;
        let (set, get) = (self.named("set", set)?, self.named("get", get)?);
        let values = self.fitting(&set.row, "values", values)?;
        let (array, mut output) = Output::of(py, out, &self.shape(&get.row))?;
        self.attempt(py, |all| {
            all.advance((&set.selection, values.values()), size, (&get.selection, output.values()))
        })?;
        output.finish(py)?;
        Ok(array)
    }

    /// Reset the instances to their start values and initialize them.
    ///
    /// Parameters
    /// ----------
    /// mask : (n,) of bool, optional
    ///     Selected instances; all by default.
    /// start : dict, optional
    ///     Start values by name, which replace earlier ones, in the forms of `Fmu.instances`.
    #[pyo3(signature = (mask=None, *, start=None))]
    fn reset(&self, py: Python, mask: Optional, start: Optional) -> PyResult<()> {
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
    fn restore(&self, py: Python, states: &Bound<'_, PyAny>, mask: Optional) -> PyResult<()> {
        let (mask, states) = (self.mask(mask)?, self.own(states)?);
        self.revive(py, |all| all.restore(&states, mask.as_deref()))
    }

    /// Serialize saved states, for use in another process: a list with the bytes for each instance, or None for an instance that
    /// has no state or whose FMU returns an error.
    fn serialize<'py>(
        &self,
        py: Python<'py>,
        states: &Bound<'py, PyAny>,
    ) -> PyResult<Vec<Option<Bound<'py, PyBytes>>>> {
        let states = self.own(states)?;
        let found = self.attempt(py, |all| all.serialize(&states))?;
        Ok(found.into_iter().map(|bytes| bytes.map(|bytes| PyBytes::new(py, &bytes))).collect())
    }

    /// Create states from the bytes that `serialize` has returned, in this or another process: a sequence with the bytes or None for
    /// each instance.
    fn deserialize(&self, py: Python, states: &Bound<'_, PyAny>) -> PyResult<States> {
        let must = "a sequence of bytes or None, one for each instance";
        let states =
            states.extract::<Vec<Option<PyBackedBytes>>>().map_err(|_| wrong("states", must, states))?;
        let read = py.detach(|| self.instances.lock()?.deserialize(&states).map_err(python))?;
        Ok(States { instances: Arc::clone(&self.instances), states: Some(Arc::new(read)) })
    }

    /// Compute directional derivatives of unknowns for a seed, which has a value for each known. They are derivatives at this instant,
    /// at which the states are given. `Fmu.sensitivities` returns derivatives of trajectories, in which the states depend on the
    /// parameters, too.
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
        let (unknowns, knowns) = (self.named("unknowns", unknowns)?, self.named("knowns", knowns)?);
        let seed = self.fitting(&knowns.row, "seed", seed)?;
        let (array, mut output) = Output::of(py, out, &self.shape(&unknowns.row))?;
        self.attempt(py, |all| {
            let seed = (&knowns.selection, seed.values());
            all.directional_derivative(&unknowns.selection, seed, output.values())
        })?;
        output.finish(py)?;
        Ok(array)
    }

    /// Co-Simulation, FMI 2.0: set the first time derivatives of inputs, in the shapes of `set`.
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

    /// Co-Simulation: read the first time derivatives of outputs, in the shapes of `get`.
    #[pyo3(signature = (variables, out=None))]
    fn get_output_derivatives<'py>(
        &self,
        py: Python<'py>,
        variables: &Bound<'py, PyAny>,
        out: Optional<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.only(Interface::CoSimulation)?;
        let named = self.named("variables", variables)?;
        self.read(py, &named.row, out, |all, values| all.get_output_derivatives(&named.selection, values))
    }

    /// Model Exchange: set the time, s: one number for all instances, or (n,).
    #[pyo3(signature = (time, mask=None))]
    fn set_time(&self, py: Python, time: &Bound<'_, PyAny>, mask: Optional) -> PyResult<()> {
        self.only(Interface::ModelExchange)?;
        let (mask, time) = (self.mask(mask)?, self.fitting(&[], "time", time)?);
        self.attempt(py, |all| all.set_time(time.values(), mask.as_deref()))
    }

    /// Model Exchange: set the continuous states: (states,) for all instances, or (n, states).
    #[pyo3(signature = (states, mask=None))]
    fn set_continuous_states(&self, py: Python, states: &Bound<'_, PyAny>, mask: Optional) -> PyResult<()> {
        self.only(Interface::ModelExchange)?;
        let row = [self.instances.lock()?.continuous(Continuous::States)];
        let (mask, states) = (self.mask(mask)?, self.fitting(&row, "states", states)?);
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

    /// Model Exchange: enter Event Mode, iterate until the event is complete, and return to Continuous-Time Mode. `next_event_time`,
    /// `states_changed` and `wants_to_end` contain the results.
    ///
    /// Parameters
    /// ----------
    /// variables, values : optional
    ///     Numbers to set in Event Mode before the iterations, in the forms of `set`. Discrete inputs can be set only in Event Mode.
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
                let named = self.named("variables", variables)?;
                let values = self.fitting(&named.row, "values", values)?;
                (named, Some(values))
            }
            (None, None) => (Arc::default(), None),
            _ => return Err(PyValueError::new_err("give variables and values, or neither")),
        };
        let values = values.as_ref().map_or(&[][..], Numbers::values);
        self.attempt(py, |all| all.handle_events((&named.selection, values), mask.as_deref()))
    }

    /// Model Exchange: notify the FMU of a completed integrator step.
    ///
    /// Returns
    /// -------
    /// (n, 2): whether an instance requests an event, and whether it requests the end of the simulation, as 1 or 0; NaN if it has
    /// dropped out
    fn completed_integrator_step<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.only(Interface::ModelExchange)?;
        self.read(py, &[2], None, |all, values| {
            all.completed_integrator_step(values);
            Ok(())
        })
    }
}

impl Instances {
    /// Looks up the variables of an argument by name. The result for a str or a tuple is cached by the identity of the Python
    /// object.
    fn named(&self, argument: &str, variables: &Bound<'_, PyAny>) -> PyResult<Arc<Named>> {
        /// Maximum number of entries in the cache.
        const MOST: usize = 64;
        if let Some((_, named)) = lock(&self.known).iter().find(|(object, _)| object.is(variables)) {
            return Ok(Arc::clone(named));
        }
        let given = arguments::names(argument, variables)?;
        let elements = given.iter().flat_map(|name| match self.system.array(name) {
            None => std::slice::from_ref(name),
            Some(array) => &array.names,
        });
        let selection = self.system.select(&elements.collect::<Vec<_>>()).map_err(python)?;
        let is_one = variables.is_instance_of::<PyString>();
        let row = match &*given {
            [name] if is_one => self.system.array(name).map_or_else(Vec::new, |array| array.sizes.clone()),
            _ => vec![selection.len()],
        };
        let named = Arc::new(Named { selection, row });
        // Only str and tuple are cached, because a list may change later.
        if is_one || variables.is_instance_of::<PyTuple>() {
            let mut known = lock(&self.known);
            known.truncate(MOST - 1);
            known.insert(0, (variables.clone().unbind(), Arc::clone(&named)));
        }
        Ok(named)
    }

    fn mask(&self, given: Optional) -> PyResult<Option<Vec<bool>>> {
        let Some(given) = given else { return Ok(None) };
        let list = given.call_method0("tolist").unwrap_or_else(|_| given.clone());
        let must = "a sequence of Booleans, one for each instance";
        let mask: Vec<bool> = list.extract().map_err(|_| wrong("mask", must, &given))?;
        if mask.len() == self.count {
            return Ok(Some(mask));
        }
        let why = format!("mask has {} Booleans for {} instances", mask.len(), self.count);
        Err(PyValueError::new_err(why))
    }

    /// Returns the shape of an array with a row for each instance.
    fn shape(&self, row: &[usize]) -> Vec<usize> {
        [&[self.count], row].concat()
    }

    /// Reads the values of an argument: one number for all instances, one row for all, or a row for each. The error names the
    /// argument, its shape and the expected shape.
    fn fitting(&self, row: &[usize], argument: &str, values: &Bound<'_, PyAny>) -> PyResult<Numbers> {
        let (values, length) = (Numbers::of(argument, values)?, row.iter().product());
        let given = values.shape();
        match &values {
            Numbers::One(value) if length != 1 => Ok(Numbers::Row(vec![*value; length])),
            Numbers::One(_) => Ok(values),
            _ if given.first() == Some(&self.count) && given[1..] == *row => Ok(values),
            _ if !row.is_empty() && given == row => Ok(values),
            _ => {
                let of_one = if row.is_empty() { String::new() } else { format!(", {}", shape(row)) };
                Err(PyValueError::new_err(format!(
                    "{argument} has the shape {}; it must be {}{of_one} or a number",
                    shape(given),
                    shape(&self.shape(row))
                )))
            }
        }
    }

    /// Fails if the instances are for another interface type, because the message is clearer than an error of the FMU.
    fn only(&self, wanted: Interface) -> PyResult<()> {
        let why = match (wanted, self.interface) {
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

    /// Returns saved states. Fails if they belong to other instances.
    fn own(&self, states: &Bound<'_, PyAny>) -> PyResult<Arc<fmu_run::States>> {
        let states =
            states.cast::<States>().map_err(|_| wrong("states", "what save() returned", states))?.get();
        let own = states.states.clone().filter(|_| Arc::ptr_eq(&self.instances, &states.instances));
        own.ok_or_else(|| {
            PyValueError::new_err(
                "these states belong to other instances; serialize them there and deserialize them here",
            )
        })
    }

    /// Runs a call without the GIL. Raises FmuError if all instances have dropped out before the call or during it.
    fn attempt<T: Send>(
        &self,
        py: Python,
        body: impl FnOnce(&mut fmu_run::Instances) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        self.called(py, |all| match all.none_left() {
            None => body(all).map_err(python),
            Some(why) => {
                let gone = if all.len() == 1 { "the instance has" } else { "all instances have" };
                Err(FmuError::new_err(format!(
                    "{gone} dropped out before; reset() or restore() brings them back (instance 0: {why})"
                )))
            }
        })
    }

    /// Runs a call that may make instances usable again, without failing if all have dropped out before.
    fn revive<T: Send>(
        &self,
        py: Python,
        body: impl FnOnce(&mut fmu_run::Instances) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        self.called(py, |all| body(all).map_err(python))
    }

    /// Runs a call without the GIL and passes on its messages. Raises FmuError if no instance is usable after the call.
    fn called<T: Send>(
        &self,
        py: Python,
        body: impl FnOnce(&mut fmu_run::Instances) -> PyResult<T> + Send,
    ) -> PyResult<T> {
        let called = py.detach(|| {
            let mut all = self.instances.lock()?;
            let result = body(&mut all)?;
            PyResult::Ok((result, all.none_left().map(str::to_owned)))
        });
        self.pass_messages(py)?;
        let (result, none_left) = called?;
        none_left.map_or(Ok(result), |why| Err(FmuError::new_err(why)))
    }

    /// Passes on the messages of a call. The lock is not held meanwhile, so that the receiver may use the instances.
    fn pass_messages(&self, py: Python) -> PyResult<()> {
        let Some(log) = &self.log else { return Ok(()) };
        let messages = self.instances.lock()?.take_messages();
        log.pass(py, messages)
    }

    /// Returns name and type if the argument is the name of one variable whose values float64 cannot represent.
    fn exact(&self, variables: &Bound<'_, PyAny>) -> PyResult<Option<(String, BaseType)>> {
        let Ok(name) = variables.cast::<PyString>() else { return Ok(None) };
        // Only the names of numeric variables are cached.
        if lock(&self.known).iter().any(|(object, _)| object.is(variables)) {
            return Ok(None);
        }
        let name: String = name.extract()?;
        Ok(exact_type(&self.system, &name)?.map(|base| (name, base)))
    }

    /// Sets variables with the function `body`. The values are a row for each instance or one for all.
    fn put(
        &self,
        py: Python,
        variables: &Bound<'_, PyAny>,
        values: &Bound<'_, PyAny>,
        mask: Optional,
        body: fn(&mut fmu_run::Instances, &Selection, &[f64], fmu_run::Mask) -> Result<(), Error>,
    ) -> PyResult<()> {
        let (named, mask) = (self.named("variables", variables)?, self.mask(mask)?);
        let values = self.fitting(&named.row, "values", values)?;
        self.attempt(py, |all| body(all, &named.selection, values.values(), mask.as_deref()))
    }

    /// Fills a new array, or `out`, with a row for each instance.
    fn read<'py>(
        &self,
        py: Python<'py>,
        row: &[usize],
        out: Optional<'py>,
        body: impl FnOnce(&mut fmu_run::Instances, &mut [f64]) -> Result<(), Error> + Send,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (array, mut output) = Output::of(py, out, &self.shape(row))?;
        self.attempt(py, |all| body(all, output.values()))?;
        output.finish(py)?;
        Ok(array)
    }

    /// Reads a continuous quantity of Model Exchange.
    fn continuous<'py>(
        &self,
        py: Python<'py>,
        what: Continuous,
        out: Optional<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.only(Interface::ModelExchange)?;
        let row = [self.instances.lock()?.continuous(what)];
        self.read(py, &row, out, |all, values| {
            all.get_continuous(what, values);
            Ok(())
        })
    }

    /// Returns an array with a value of the last event of each instance.
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

fn finite(name: &str, time: &Bound<'_, PyAny>) -> PyResult<f64> {
    let found = arguments::number(name, time)?;
    if found.is_finite() { Ok(found) } else { Err(wrong(name, "a finite time", time)) }
}

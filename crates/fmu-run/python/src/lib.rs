//! The Rust part of the Python package `fmu_run`, which is the module `fmu_run._native`. The public interface is written in Python.

mod arguments;
mod buffers;
mod exact;
mod instances;
mod log;
mod signals;
mod start;

use buffers::{Numbers, Output};
use fmu_run::{
    Batch, Composition, Elements, Error, Finished, Fmu, Occurrence, Order, Planned, Size, System, Unit, Watch,
};
use log::Log;
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyMemoryError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyTuple};
use signals::Signals;
use start::Start;
use std::collections::{BTreeMap, HashSet};
use std::sync::{Arc, Mutex, PoisonError};

create_exception!(
    fmu_run,
    FmuError,
    PyException,
    "An FMU cannot be loaded or run, is closed, or has rejected a call."
);

/// An unpacked and loaded FMU or system; `None` after it was closed.
#[pyclass(frozen, module = "fmu_run._native")]
struct Loaded(Mutex<Option<Model>>);

#[derive(Clone)]
enum Model {
    Fmu(Fmu),
    System(System),
}

impl Model {
    fn system(&self) -> &System {
        match self {
            Self::Fmu(fmu) => fmu.system(),
            Self::System(system) => system,
        }
    }
}

/// FMI version, model name, token, pairs of a state and its derivative, names of floating-point outputs, whether each interface
/// type has directional derivatives, and attributes of units.
type About = (String, String, String, Pairs, Vec<String>, Vec<(&'static str, bool)>, Units);
/// Attributes of the base unit, by the name of the unit.
type Units = BTreeMap<String, Vec<(&'static str, String)>>;
type Pairs = Vec<(String, String)>;
/// Pairs of an output and a connected input, by stage.
type Stages = Vec<Pairs>;
/// Messages by index of the run.
type Messages = Vec<(usize, String)>;
/// An output: name; shape and element names of a whole array; its first column in trajectories, statistics and events, or, for values that
/// float64 cannot represent, the values, (runs, times, ...); whether it has values only while a clock is active.
type Column<'py> = (String, Bound<'py, PyTuple>, Vec<String>, Option<usize>, Option<Bound<'py, PyAny>>, bool);
/// Run, time, columns before and after, and names of the clocks that ticked.
type Event = (usize, f64, Vec<f64>, Vec<f64>, Vec<String>);
/// Stored times; outputs; trajectories, (runs, columns, times); names and values of statistics, (runs, columns, statistics); errors; notes;
/// start values; shapes and element names of the whole arrays among the start values; events; the exception that has stopped the runs.
type Results<'py> = (
    Bound<'py, PyAny>,
    Vec<Column<'py>>,
    Bound<'py, PyAny>,
    Vec<String>,
    Option<Bound<'py, PyAny>>,
    Messages,
    Messages,
    Bound<'py, PyDict>,
    Bound<'py, PyDict>,
    Vec<Event>,
    Option<PyErr>,
);

/// Attributes and start value of a variable, and both as Python objects.
type Shared<'a, 'py> = (&'a fmu_run::Attributes, Option<&'a Arc<str>>, [Bound<'py, PyAny>; 9]);

/// The variables of an FMU or system.
#[pyclass(frozen, module = "fmu_run._native")]
struct Variables(fmu_run::Variables);

#[pymethods]
impl Variables {
    /// Calls `make` with name, type, causality, variability, start value, unit, description, minimum, maximum and display unit of
    /// each variable, and returns a dict of the results by name. Because the elements of an array may be a million, they share all
    /// values except the name.
    fn dict<'py>(&self, py: Python<'py>, make: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        let mut last: Option<Shared<'_, 'py>> = None;
        for (name, variable) in self.0.iter() {
            let (of, start): (&fmu_run::Attributes, _) = (variable, variable.start.as_ref());
            let same_start = |other: &Option<&Arc<str>>| match (start, other) {
                (Some(one), Some(other)) => Arc::ptr_eq(one, other),
                (one, other) => one.is_none() && other.is_none(),
            };
            let shared = match last.take().filter(|last| std::ptr::eq(last.0, of) && same_start(&last.1)) {
                Some((.., shared)) => shared,
                None => {
                    let any = |text: Option<&str>| text.into_pyobject(py);
                    [
                        any(Some(&of.base.to_string()))?,
                        any(Some(&of.causality.to_string()))?,
                        any(of.variability.map(|of| of.to_string()).as_deref())?,
                        any(start.map(|start| &**start))?,
                        any(of.unit.as_deref())?,
                        any(Some(&of.description))?,
                        of.min.into_pyobject(py)?,
                        of.max.into_pyobject(py)?,
                        any(of.display_unit.as_deref())?,
                    ]
                }
            };
            let [a, b, c, d, e, f, g, h, i] = &shared;
            let name = PyString::new(py, &name);
            dict.set_item(&name, make.call1((&name, a, b, c, d, e, f, g, h, i))?)?;
            last = Some((of, start, shared));
        }
        Ok(dict)
    }
}

fn python(error: Error) -> PyErr {
    // `to_string` returns one line without control characters.
    let message = error.to_string();
    match error {
        Error::Fmu(_) => FmuError::new_err(message),
        Error::Request(_) => PyValueError::new_err(message),
        Error::Memory(_) => PyMemoryError::new_err(message),
        Error::Cancelled => PyRuntimeError::new_err("cancelled"),
    }
}

#[pymethods]
impl Loaded {
    /// Loads an FMU.
    #[new]
    fn new(py: Python, path: &Bound<'_, PyAny>, execution_tool: &Bound<'_, PyAny>) -> PyResult<Self> {
        let path = arguments::path("path", path)?;
        let execution_tool = arguments::flag("execution_tool", execution_tool)?;
        let open = if execution_tool { Fmu::open_with_execution_tool } else { Fmu::open };
        // SAFETY: the user passes a file that is an FMU and trusts its library like any extension module.
        #[allow(unsafe_code)]
        let fmu = py.detach(|| unsafe { open(&path) }).map_err(python)?;
        Ok(Self(Mutex::new(Some(Model::Fmu(fmu)))))
    }

    /// Loads a system from an SSP file.
    #[staticmethod]
    fn ssp(py: Python, path: &Bound<'_, PyAny>, order: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (path, order) = (arguments::path("source", path)?, order_of(order)?);
        // SAFETY: the user trusts the libraries, as in `new`.
        #[allow(unsafe_code)]
        let system = py.detach(|| unsafe { System::open(&path, order) }).map_err(python)?;
        Ok(Self(Mutex::new(Some(Model::System(system)))))
    }

    /// Connects FMUs. `components` are their names and FMUs, `connections` are pairs of an output and an input.
    #[staticmethod]
    fn connected(
        name: &str,
        components: Vec<(String, PyRef<'_, Self>)>,
        connections: Vec<(String, String)>,
        order: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let fmus = components.iter().map(|(name, loaded)| match loaded.model()? {
            Model::Fmu(fmu) => Ok((name.as_str(), fmu)),
            Model::System(_) => Err(PyValueError::new_err(format!(
                "component {name} is a system; only FMUs can be connected"
            ))),
        });
        let fmus = fmus.collect::<PyResult<Vec<_>>>()?;
        let composition = Composition {
            name,
            components: fmus.iter().map(|(name, fmu)| (*name, fmu)).collect(),
            connections: connections.iter().map(|(from, to)| (from.as_str(), to.as_str())).collect(),
            order: order_of(order)?,
        };
        let system = System::connect(&composition).map_err(python)?;
        Ok(Self(Mutex::new(Some(Model::System(system)))))
    }

    fn close(&self, py: Python) {
        let model = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        py.detach(|| {
            if let Some(model) = &model {
                model.system().release();
            }
            drop(model);
        });
    }

    fn is_closed(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).is_none()
    }

    /// Returns factor and offset of a conversion: value in `unit` = factor * value in the variable's unit + offset.
    fn display_unit(&self, name: &Bound<'_, PyAny>, unit: &Bound<'_, PyAny>) -> PyResult<(f64, f64)> {
        let (name, unit) = (arguments::text("name", name)?, arguments::text("unit", unit)?);
        arguments::display_unit(self.model()?.system(), &name, &unit)
    }

    fn about(&self) -> PyResult<About> {
        let Model::Fmu(fmu) = self.model()? else {
            return Err(PyValueError::new_err("a system has no model description"));
        };
        let about = fmu.description();
        let version = match about.standard {
            fmu_run::Standard::Fmi2 => "2.0",
            fmu_run::Standard::Fmi3 => "3.0",
        };
        let derivatives = about.elements(&about.derivatives);
        // Each state once, because its name may be long, and several derivatives may be declared for it.
        let mut states = HashSet::new();
        let derivatives = derivatives.filter_map(|of| {
            let state = of.derivative_of.filter(|state| states.insert(*state))?;
            Some((about.variables[state].name.clone(), of.name.clone()))
        });
        let outputs = about.elements(&about.outputs).filter(|of| of.base.is_float());
        let offers = [("co-simulation", &about.co_simulation), ("model-exchange", &about.model_exchange)];
        let offers =
            offers.into_iter().filter_map(|(name, of)| Some((name, of.as_ref()?.directional_derivatives)));
        let attributes = |unit: &Unit| unit.base.map_or(Vec::new(), |base| base.attributes());
        let units = about.units.iter().map(|(name, unit)| (name.clone(), attributes(unit)));
        Ok((
            version.to_owned(),
            about.model_name.clone(),
            about.token.clone(),
            derivatives.collect(),
            outputs.map(|of| of.name.clone()).collect(),
            offers.collect(),
            units.collect(),
        ))
    }

    /// Returns the name, the stages of the connections, the stop time of a system, and what was strange when it was opened.
    fn about_system(&self) -> PyResult<(String, Stages, Option<f64>, Vec<String>)> {
        let model = self.model()?;
        let system = model.system();
        let stages = system
            .stages()
            .into_iter()
            .map(|stage| stage.into_iter().map(|(from, to)| (from.to_owned(), to.to_owned())).collect());
        Ok((system.name().to_owned(), stages.collect(), system.stop_time(), system.warnings().to_vec()))
    }

    /// Returns the variables, which stay available after `close`.
    fn variables(&self) -> PyResult<Variables> {
        Ok(Variables(self.model()?.system().variables()))
    }

    /// Performs the runs, and meanwhile calls `progress(done, runs)`. After Ctrl-C, all runs stop after their current step.
    #[allow(clippy::too_many_arguments, reason = "named where it is called")]
    fn run<'py>(
        &self,
        py: Python<'py>,
        time: Bound<'py, PyAny>,
        outputs: Bound<'py, PyAny>,
        inputs: Option<Bound<'py, PyAny>>,
        input_derivatives: Option<Bound<'py, PyAny>>,
        start: Option<Bound<'py, PyAny>>,
        every: Option<Bound<'py, PyAny>>,
        measures: Bound<'py, PyAny>,
        threads: Option<Bound<'py, PyAny>>,
        read_before_set: Bound<'py, PyAny>,
        progress: Option<Bound<'py, PyAny>>,
        tolerance: Bound<'py, PyAny>,
        log: Option<Bound<'py, PyAny>>,
        interface: Option<Bound<'py, PyAny>>,
        solver: Bound<'py, PyAny>,
        tolerances: [Option<Bound<'py, PyAny>>; 3],
        events: Bound<'py, PyAny>,
        reuse: Bound<'py, PyAny>,
        clocks: Option<Bound<'py, PyAny>>,
        hold: Bound<'py, PyAny>,
    ) -> PyResult<Results<'py>> {
        let (model, start) = Start::configured(self.model()?.system(), start.as_ref())?;
        let log = Log::of(log.as_ref())?;
        let time = one_dimension("time", &time)?;
        let measures = arguments::names("measures", &measures)?;
        let outputs = arguments::names("outputs", &outputs)?;
        let given = |name, values: Option<&Bound<'py, PyAny>>, are_rates| {
            Signals::of(&model, &arguments::items(name, values)?, time.values().len(), are_rates)
        };
        let inputs = given("inputs", inputs.as_ref(), false)?;
        let input_derivatives = given("input_derivatives", input_derivatives.as_ref(), true)?;
        let clocks = arguments::items("clocks", clocks.as_ref())?;
        let ticks = clocks.iter().map(|(name, times)| Ok((name, one_dimension(name, times)?)));
        let ticks = ticks.collect::<PyResult<Vec<_>>>()?;
        let every = arguments::count("every", every.as_ref())?;
        arguments::callable("progress", progress.as_ref())?;
        let arrays = Arrays::of(&model, outputs.iter().map(String::as_str));
        let parsed = measures.iter().map(|name| name.parse()).collect::<Result<Vec<_>, String>>();
        let batch = Batch {
            time: time.values(),
            inputs: inputs.trajectories(),
            input_derivatives: input_derivatives.trajectories(),
            start: start.values(),
            outputs: arrays.elements(&outputs),
            every: every.or(measures.is_empty().then_some(1)),
            measures: parsed.map_err(PyValueError::new_err)?,
            threads: arguments::count("threads", threads.as_ref())?,
            read_before_set: arguments::flag("read_before_set", &read_before_set)?,
            reuse: arguments::flag("reuse", &reuse)?,
            tolerance: arguments::tolerance(&tolerance)?,
            interface: interface.as_ref().map(arguments::interface).transpose()?,
            integration: arguments::integration(&solver, tolerances.each_ref().map(Option::as_ref))?,
            events: arguments::flag("events", &events)?,
            clocks: ticks.iter().map(|(name, times)| (name.as_str(), times.values())).collect(),
            hold: arguments::flag("hold", &hold)?,
        };
        let planned = model.plan(&batch).map_err(python)?;
        let columns = arrays.columns(&outputs, planned.columns())?;
        let size = planned.size();
        if size.trajectories().is_none() || size.measures().is_none() {
            return Err(python(Error::too_much()));
        }
        let (times, mut kept_times) = Output::of(py, None, &[size.kept])?;
        let every = batch.every.unwrap_or(1);
        kept_times
            .values()
            .iter_mut()
            .zip(batch.time.iter().step_by(every))
            .for_each(|(to, time)| *to = *time);
        let array = |each: usize| Output::of(py, None, &[size.runs, size.outputs, each]);
        let (trajectories, mut kept) = array(size.kept)?;
        let mut measured = (!measures.is_empty()).then(|| array(size.measures)).transpose()?;
        let measured_values = measured.as_mut().map_or(&mut [][..], |(_, output)| output.values());
        let results = [kept.values(), measured_values];
        let (Finished { errors, notes, exact, events }, raised) =
            perform(py, &planned, results, progress.map(Bound::unbind), log)?;
        let columns =
            columns.iter().map(|of| of.with_values(py, size, &exact, &model)).collect::<PyResult<_>>()?;
        let measured = measured.map(|(array, _)| array);
        let (arrays, start) = (Arrays::of(&model, start.names()).dict(py)?, start.dict(py)?);
        let event = |of: Occurrence| (of.run, of.time, of.before, of.after, of.clocks);
        let events = events.into_iter().map(event).collect();
        Ok((times, columns, trajectories, measures, measured, errors, notes, start, arrays, events, raised))
    }
}

/// The columns of an output, which are consecutive.
struct Columns<'a> {
    name: &'a str,
    sizes: &'a [usize],
    elements: &'a [String],
    first: fmu_run::Column,
}

impl Columns<'_> {
    /// Returns the output with its values if float64 cannot represent them. `all` are the values of all such outputs.
    fn with_values<'py>(
        &self,
        py: Python<'py>,
        size: Size,
        all: &[Option<fmu_run::Value>],
        system: &System,
    ) -> PyResult<Column<'py>> {
        let (first, values) = match self.first {
            fmu_run::Column::Number(first) => (Some(first), None),
            fmu_run::Column::Exact(first, base) => {
                let [runs, kept] = [size.runs, size.kept];
                let indices = (0..runs).flat_map(|run| (0..kept).map(move |time| (run, time)));
                let values = indices.flat_map(|(run, time)| {
                    (first..first + self.elements.len())
                        .map(move |column| all[(run * size.exact + column) * kept + time].as_ref())
                });
                let shape = [&[runs, kept], self.sizes].concat();
                (None, Some(exact::array(py, base, &values.collect::<Vec<_>>(), &shape)?))
            }
        };
        let is_clocked = self.elements.first().is_some_and(|element| system.is_clocked(element));
        let (name, sizes) = (self.name.to_owned(), PyTuple::new(py, self.sizes)?);
        Ok((name, sizes, self.elements.to_vec(), first, values, is_clocked))
    }
}

/// The names that denote whole arrays, with the elements of the arrays.
#[derive(Default)]
struct Arrays<'a>(BTreeMap<&'a str, &'a Elements>);

impl<'a> Arrays<'a> {
    fn of(system: &'a System, names: impl Iterator<Item = &'a str>) -> Self {
        Self(names.filter_map(|name| Some((name, system.array(name)?))).collect())
    }

    /// Replaces the names of arrays by the names of their elements.
    fn elements(&self, names: &'a [String]) -> Vec<&'a str> {
        let elements = |name: &'a String| match self.0.get(name.as_str()) {
            None => std::slice::from_ref(name),
            Some(array) => &array.names,
        };
        names.iter().flat_map(elements).map(String::as_str).collect()
    }

    /// Assigns columns to outputs. `all` has a column for each variable, in the order of `elements`. Fails for an array whose elements
    /// have values of different types.
    fn columns<'n>(&'n self, names: &'n [String], all: &[fmu_run::Column]) -> PyResult<Vec<Columns<'n>>> {
        let mut rest = all;
        let columns = names.iter().map(|name| {
            let (sizes, elements) = match self.0.get(name.as_str()) {
                None => (&[][..], std::slice::from_ref(name)),
                Some(array) => (&*array.sizes, &*array.names),
            };
            let (own, after) = rest.split_at(elements.len());
            rest = after;
            let kind = |column: &fmu_run::Column| match column {
                fmu_run::Column::Number(_) => None,
                fmu_run::Column::Exact(_, base) => Some(*base),
            };
            if own.iter().any(|column| kind(column) != kind(&own[0])) {
                let why = format!(
                    "the elements of {name} have different types; request them by their names, such as {}",
                    elements[0]
                );
                return Err(PyValueError::new_err(why));
            }
            Ok(Columns { name, sizes, elements, first: own[0] })
        });
        columns.collect()
    }

    /// Returns a dict with the shape and the element names of each array.
    fn dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (name, array) in &self.0 {
            dict.set_item(*name, (PyTuple::new(py, &array.sizes)?, &array.names))?;
        }
        Ok(dict)
    }
}

fn one_dimension(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Numbers> {
    let numbers = Numbers::of(name, given)?;
    match numbers.shape().len() {
        1 => Ok(numbers),
        dimensions => {
            Err(PyValueError::new_err(format!("{name} must have one dimension, it has {dimensions}")))
        }
    }
}

impl Loaded {
    fn model(&self) -> PyResult<Model> {
        let model = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        model.ok_or_else(|| FmuError::new_err("the FMU is closed"))
    }
}

fn order_of(name: &Bound<'_, PyAny>) -> PyResult<Order> {
    match name.extract::<String>().as_deref() {
        Ok("dependencies") => Ok(Order::Dependencies),
        Ok("jacobi") => Ok(Order::Jacobi),
        _ => Err(arguments::wrong("order", "'dependencies' or 'jacobi'", name)),
    }
}

/// Performs the runs without the GIL. About ten times per second, this thread handles Python signals, passes on messages and calls
/// `progress`. If one of them raises an exception, the runs stop, and it is returned with the results.
fn perform(
    py: Python,
    planned: &Planned,
    [trajectories, measures]: [&mut [f64]; 2],
    progress: Option<Py<PyAny>>,
    log: Option<Log>,
) -> PyResult<(Finished, Option<PyErr>)> {
    let (raised, runs) = (Arc::new(Mutex::new(None)), planned.size().runs);
    let error = Arc::clone(&raised);
    let log = log.map(Arc::new);
    let receiver = log.clone();
    let mut watch = Watch::pulsing(move |watch| {
        let reported = Python::try_attach(|py| {
            py.check_signals()?;
            receiver.as_ref().map_or(Ok(()), |log| log.pass(py, watch.take_messages()))?;
            progress.as_ref().map_or(Ok(()), |progress| progress.call1(py, (watch.done(), runs)).map(drop))
        });
        match reported {
            Some(Ok(())) => {}
            // Python ends, and with it this daemon thread.
            None => watch.cancel(),
            Some(Err(reason)) => {
                watch.cancel();
                error.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(reason);
            }
        }
    });
    if log.is_some() {
        watch = watch.and_listening();
    }
    let result = py.detach(|| planned.run(&watch, trajectories, measures));
    let rest = log.map_or(Ok(()), |log| log.pass(py, watch.take_messages()));
    let raised = raised.lock().unwrap_or_else(PoisonError::into_inner).take();
    Ok((result.map_err(python)?, raised.or(rest.err())))
}

/// Converts an argument to a NumPy array of float64.
#[pyfunction]
fn numbers<'py>(name: &str, values: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    buffers::array_of(name, values)
}

/// The module `fmu_run._native`.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::instances::{Instances, States};
    #[pymodule_export]
    use super::{FmuError, Loaded, Variables, numbers};
}

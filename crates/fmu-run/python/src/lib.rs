//! The Rust part of the Python package `fmu_run`: the module `fmu_run._native`. `fmu_run/__init__.py`
//! contains the public interface.

mod buffers;
mod instances;
mod start;

use buffers::{Numbers, Output};
use fmu_run::{Batch, Composition, Error, Fmu, Order, Planned, System, Trajectory, Watch};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyMemoryError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use start::Start;
use std::collections::BTreeMap;
use std::ops::Deref;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

create_exception!(fmu_run, FmuError, PyException, "An FMU that cannot be loaded or run, or rejects a run.");

/// An unpacked and loaded FMU or system, until it is closed.
#[pyclass(frozen, module = "fmu_run._native")]
struct Loaded(Mutex<Option<Model>>);

#[derive(Clone)]
enum Model {
    Fmu(Fmu),
    System(System),
}

impl Deref for Model {
    type Target = System;

    fn deref(&self) -> &System {
        match self {
            Self::Fmu(fmu) => fmu,
            Self::System(system) => system,
        }
    }
}

/// Name, type, causality, variability, start value, unit, description, smallest and largest value, display
/// unit.
type Described = (String, String, String, Text, Text, Text, String, Option<f64>, Option<f64>, Text);
type Text = Option<String>;
/// FMI version, model name, token, derivative of each state, continuous outputs, interface types with and
/// without directional derivatives, attributes of units.
type About = (String, String, String, Pairs, Vec<String>, Vec<(&'static str, bool)>, BTreeMap<String, Pairs>);
type Pairs = Vec<(String, String)>;
/// Outputs and connected inputs, by stage.
type Stages = Vec<Pairs>;
/// Messages by run.
type Messages = Vec<(usize, String)>;
/// Trajectories and statistics, (runs, outputs, times or statistics) each, errors, notes and start values.
type Result5<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Messages, Messages, Bound<'py, PyDict>);

fn python(error: Error) -> PyErr {
    match error {
        Error::Fmu(message) => FmuError::new_err(message),
        Error::Request(message) => PyValueError::new_err(message),
        Error::Memory(message) => PyMemoryError::new_err(message),
        Error::Cancelled => PyRuntimeError::new_err("cancelled"),
    }
}

#[pymethods]
impl Loaded {
    /// Loads an FMU.
    #[new]
    fn new(py: Python, path: PathBuf, execution_tool: bool) -> PyResult<Self> {
        let open = if execution_tool { Fmu::open_with_execution_tool } else { Fmu::open };
        // SAFETY: the user passes a file that is an FMU and trusts its library like any extension module.
        #[allow(unsafe_code)]
        let fmu = py.detach(|| unsafe { open(&path) }).map_err(python)?;
        Ok(Self(Mutex::new(Some(Model::Fmu(fmu)))))
    }

    /// Loads a system from an SSP file.
    #[staticmethod]
    fn ssp(py: Python, path: PathBuf, order: &str) -> PyResult<Self> {
        let order = order_of(order)?;
        // SAFETY: the user trusts the libraries, as in `new`.
        #[allow(unsafe_code)]
        let system = py.detach(|| unsafe { System::open(&path, order) }).map_err(python)?;
        Ok(Self(Mutex::new(Some(Model::System(system)))))
    }

    /// Connects FMUs: components by name, connections from outputs to inputs.
    #[staticmethod]
    fn connected(
        name: &str,
        components: Vec<(String, PyRef<'_, Self>)>,
        connections: Vec<(String, String)>,
        order: &str,
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
                model.release();
            }
            drop(model);
        });
    }

    fn is_closed(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).is_none()
    }

    /// Returns factor and offset: value in the other unit = factor * value + offset.
    fn display_unit(&self, name: &str, unit: &str) -> PyResult<(f64, f64)> {
        self.model()?.display_unit(name, unit).map_err(python)
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
        let derivatives = derivatives.filter_map(|of| Some((of.derivative_of.clone()?, of.name.clone())));
        let outputs = about.elements(&about.outputs).filter(|of| of.base.is_float());
        let offers = [("co-simulation", &about.co_simulation), ("model-exchange", &about.model_exchange)];
        let offers =
            offers.into_iter().filter_map(|(name, of)| Some((name, of.as_ref()?.directional_derivatives)));
        Ok((
            version.to_owned(),
            about.model_name.clone(),
            about.token.clone(),
            derivatives.collect(),
            outputs.map(|of| of.name.clone()).collect(),
            offers.collect(),
            about.units.clone(),
        ))
    }

    /// Returns, for a system: name, stages of its connections, and stop time.
    fn about_system(&self) -> PyResult<(String, Stages, Option<f64>)> {
        let system = self.model()?;
        let stages = system
            .stages()
            .into_iter()
            .map(|stage| stage.into_iter().map(|(from, to)| (from.to_owned(), to.to_owned())).collect());
        Ok((system.name().to_owned(), stages.collect(), system.stop_time()))
    }

    fn variables(&self) -> PyResult<Vec<Described>> {
        let describe = |(name, variable): (String, &fmu_run::Variable)| {
            let fmu_run::Variable { base, causality, variability, start, unit, .. } = variable.clone();
            let fmu_run::Variable { description, min, max, display_unit, .. } = variable.clone();
            (name, base.to_string(), causality, variability, start, unit, description, min, max, display_unit)
        };
        Ok(self.model()?.variables().map(describe).collect())
    }

    /// Performs the runs. Ctrl-C ends all runs after their current steps. Calls progress(done, runs).
    #[allow(clippy::too_many_arguments, reason = "named where it is called")]
    fn run<'py>(
        &self,
        py: Python<'py>,
        time: Bound<'py, PyAny>,
        inputs: Vec<(String, Bound<'py, PyAny>)>,
        input_derivatives: Vec<(String, Bound<'py, PyAny>)>,
        start: Option<Bound<'py, PyDict>>,
        outputs: Vec<String>,
        every: Option<usize>,
        measures: Vec<String>,
        threads: Option<usize>,
        read_before_set: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Result5<'py>> {
        let model = self.model()?;
        let measures = measures.iter().map(|name| name.parse()).collect::<Result<Vec<_>, String>>();
        let time = Numbers::of(&time)?;
        let [inputs, input_derivatives] = [numbers(&inputs)?, numbers(&input_derivatives)?];
        let start = Start::of(&model, start.as_ref())?;
        let batch = Batch {
            time: time.values(),
            inputs: trajectories(&inputs),
            input_derivatives: trajectories(&input_derivatives),
            start: start.values(),
            outputs: outputs.iter().map(String::as_str).collect(),
            every,
            measures: measures.map_err(PyValueError::new_err)?,
            threads,
            read_before_set,
            ..Batch::default()
        };
        let planned = model.plan(&batch).map_err(python)?;
        let size = planned.size();
        if size.trajectories().is_none() || size.measures().is_none() {
            return Err(python(Error::too_much()));
        }
        let array = |each: usize| Output::of(py, None, &[size.runs, size.outputs, each]);
        let ((trajectories, mut kept), (measures, mut measured)) = (array(size.kept)?, array(size.measures)?);
        let results = [kept.values(), measured.values()];
        let [errors, notes] = carry_out(py, &planned, results, progress)?;
        Ok((trajectories, measures, errors, notes, start.dict(py)?))
    }
}

impl Loaded {
    fn model(&self) -> PyResult<Model> {
        let model = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        model.ok_or_else(|| FmuError::new_err("the FMU is closed"))
    }
}

fn order_of(name: &str) -> PyResult<Order> {
    match name {
        "dependencies" => Ok(Order::Dependencies),
        "jacobi" => Ok(Order::Jacobi),
        other => {
            Err(PyValueError::new_err(format!("order must be 'dependencies' or 'jacobi', not {other:?}")))
        }
    }
}

fn numbers(given: &[(String, Bound<'_, PyAny>)]) -> PyResult<Vec<(String, Numbers)>> {
    given.iter().map(|(name, values)| Ok((name.clone(), Numbers::of(values)?))).collect()
}

/// Converts numbers to constants, time series for all runs, or time series for each run.
fn trajectories(given: &[(String, Numbers)]) -> Vec<(&str, Trajectory<'_>)> {
    let trajectory = given.iter().map(|(name, values)| match values.shape() {
        [] => (name.as_str(), Trajectory::Constant(values.values()[0])),
        [_] => (name.as_str(), Trajectory::Shared(values.values())),
        _ => (name.as_str(), Trajectory::EachRun(values.values())),
    });
    trajectory.collect()
}

/// Performs the runs without the GIL. Between steps, this thread handles Python signals and calls progress.
fn carry_out(
    py: Python,
    planned: &Planned,
    [trajectories, measures]: [&mut [f64]; 2],
    progress: Option<Py<PyAny>>,
) -> PyResult<[Messages; 2]> {
    let (raised, runs) = (Arc::new(Mutex::new(None)), planned.size().runs);
    let error = Arc::clone(&raised);
    let watch = Watch::pulsing(move |watch| {
        let reported = Python::attach(|py| {
            py.check_signals()?;
            progress.as_ref().map_or(Ok(()), |progress| progress.call1(py, (watch.done(), runs)).map(drop))
        });
        if let Err(reason) = reported {
            watch.cancel();
            error.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(reason);
        }
    });
    let result = py.detach(|| planned.run(&watch, trajectories, measures));
    let raised = raised.lock().unwrap_or_else(PoisonError::into_inner).take();
    raised.map_or_else(|| result.map_err(python), Err)
}

/// The module `fmu_run._native`.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::instances::{Instances, States};
    #[pymodule_export]
    use super::{FmuError, Loaded};
}

//! The part of the Python package `fmu_run` that is written in Rust: `fmu_run._native`. What users see is in
//! `fmu_run/__init__.py`.

mod buffers;
mod instances;

use buffers::{Numbers, Room};
use fmu_run::{Batch, Course, Error, Fmu, Planned, Start, Watch};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

create_exception!(fmu_run, FmuError, PyException, "An FMU that cannot be loaded or run, or refuses a run.");

/// How often Ctrl-C is looked for and progress is told.
const LOOK: Duration = Duration::from_millis(100);

/// An FMU that is unpacked and loaded, until it is closed.
#[pyclass(frozen, name = "Fmu", module = "fmu_run._native")]
struct Loaded(Mutex<Option<Arc<Fmu>>>);

/// Name, type, causality, variability, start value, unit, description.
type Described = (String, String, String, Option<String>, Option<String>, Option<String>, String);
/// Texts by run.
type Told = Vec<(usize, String)>;
/// Courses and measures, (runs, outputs, times or measures) each, errors and notes.
type Result4<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Told, Told);

fn python(error: Error) -> PyErr {
    match error {
        Error::Fmu(message) => FmuError::new_err(message),
        Error::Request(message) => PyValueError::new_err(message),
        Error::Cancelled => PyRuntimeError::new_err("cancelled"),
    }
}

#[pymethods]
impl Loaded {
    #[new]
    fn new(py: Python, path: PathBuf, execution_tool: bool) -> PyResult<Self> {
        let open = if execution_tool { Fmu::open_with_execution_tool } else { Fmu::open };
        // SAFETY: the user names a file that is an FMU; its library is trusted as any extension module is.
        #[allow(unsafe_code)]
        let fmu = py.detach(|| unsafe { open(&path) }).map_err(python)?;
        Ok(Self(Mutex::new(Some(Arc::new(fmu)))))
    }

    fn close(&self, py: Python) {
        let fmu = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        py.detach(|| drop(fmu));
    }

    /// Edition of the standard, name of the model, token, whether there may be one instance only.
    fn about(&self) -> PyResult<(String, String, String, bool)> {
        let fmu = self.fmu()?;
        let about = fmu.description();
        let version = match about.standard {
            fmu_run::Standard::Fmi2 => "2.0",
            fmu_run::Standard::Fmi3 => "3.0",
        };
        let once = about.co_simulation.as_ref().is_some_and(|offer| offer.once_per_process);
        Ok((version.to_owned(), about.model_name.clone(), about.token.clone(), once))
    }

    fn variables(&self) -> PyResult<Vec<Described>> {
        let describe = |variable: &fmu_run::Variable| {
            let fmu_run::Variable { name, base, causality, variability, start, unit, description, .. } =
                variable.clone();
            (name, base.to_string(), causality, variability, start, unit, description)
        };
        Ok(self.fmu()?.description().variables.iter().map(describe).collect())
    }

    /// Sees to Ctrl-C, which ends the runs after those that are under way, and calls progress(done, runs).
    #[allow(clippy::too_many_arguments, reason = "named where it is called")]
    fn run<'py>(
        &self,
        py: Python<'py>,
        time: Bound<'py, PyAny>,
        inputs: Vec<(String, Bound<'py, PyAny>)>,
        input_derivatives: Vec<(String, Bound<'py, PyAny>)>,
        start: Vec<(String, Bound<'py, PyAny>)>,
        outputs: Vec<String>,
        every: Option<usize>,
        measures: Vec<String>,
        threads: Option<usize>,
        read_before_set: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Result4<'py>> {
        let fmu = self.fmu()?;
        let measures = measures.iter().map(|name| name.parse()).collect::<Result<Vec<_>, String>>();
        let time = Numbers::of(&time)?;
        let [inputs, input_derivatives] = [numbers(&inputs)?, numbers(&input_derivatives)?];
        let start = start_values(&start)?;
        let batch = Batch {
            time: time.values(),
            inputs: courses(&inputs),
            input_derivatives: courses(&input_derivatives),
            start: starts(&start),
            outputs: outputs.iter().map(String::as_str).collect(),
            every,
            measures: measures.map_err(PyValueError::new_err)?,
            threads,
            read_before_set,
        };
        let planned = fmu.plan(&batch).map_err(python)?;
        let size = planned.size();
        if size.courses().is_none() || size.measures().is_none() {
            return Err(python(Error::too_much()));
        }
        let array = |each: usize| Room::of(py, None, &[size.runs, size.outputs, each]);
        let ((courses, mut kept), (measures, mut measured)) = (array(size.kept)?, array(size.measures)?);
        let room = [kept.values(), measured.values()];
        let [errors, notes] = carry_out(py, &planned, room, progress.as_ref())?;
        Ok((courses, measures, errors, notes))
    }
}

impl Loaded {
    fn fmu(&self) -> PyResult<Arc<Fmu>> {
        let fmu = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        fmu.ok_or_else(|| FmuError::new_err("the FMU is closed"))
    }
}

fn numbers(given: &[(String, Bound<'_, PyAny>)]) -> PyResult<Vec<(String, Numbers)>> {
    given.iter().map(|(name, values)| Ok((name.clone(), Numbers::of(values)?))).collect()
}

/// Numbers that are always the same, courses that all runs share, or one for each run.
fn courses(given: &[(String, Numbers)]) -> Vec<(&str, Course<'_>)> {
    let course = given.iter().map(|(name, values)| match values.shape() {
        [] => (name.as_str(), Course::Constant(values.values()[0])),
        [_] => (name.as_str(), Course::Shared(values.values())),
        _ => (name.as_str(), Course::EachRun(values.values())),
    });
    course.collect()
}

/// A text or numbers.
enum StartValue {
    Text(String),
    Numbers(Numbers),
}

fn start_values(given: &[(String, Bound<'_, PyAny>)]) -> PyResult<Vec<(String, StartValue)>> {
    given
        .iter()
        .map(|(name, value)| {
            let value = match value.extract() {
                Ok(text) => StartValue::Text(text),
                Err(_) => StartValue::Numbers(Numbers::of(value)?),
            };
            Ok((name.clone(), value))
        })
        .collect()
}

fn starts(given: &[(String, StartValue)]) -> Vec<(&str, Start<'_>)> {
    let start = given.iter().map(|(name, value)| match value {
        StartValue::Text(text) => (name.as_str(), Start::Text(text)),
        StartValue::Numbers(values) if values.shape().is_empty() => {
            (name.as_str(), Start::Same(values.values()[0]))
        }
        StartValue::Numbers(values) => (name.as_str(), Start::EachRun(values.values())),
    });
    start.collect()
}

/// The runs, in other threads; this one listens to Python.
fn carry_out(
    py: Python,
    planned: &Planned,
    [courses, measures]: [&mut [f64]; 2],
    progress: Option<&Py<PyAny>>,
) -> PyResult<[Told; 2]> {
    let watch = Watch::default();
    let (sender, receiver) = channel();
    // Messages may be sent to one thread only.
    let receiver = Mutex::new(receiver);
    std::thread::scope(|scope| {
        scope.spawn(|| sender.send(planned.run(&watch, courses, measures)));
        let mut raised = None;
        loop {
            let waited =
                py.detach(|| receiver.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK));
            match waited {
                Ok(told) => return raised.map_or_else(|| told.map_err(python), Err),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(FmuError::new_err("the thread of the runs has panicked"));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            if raised.is_none() {
                let told = progress.map_or(Ok(()), |progress| {
                    progress.call1(py, (watch.done(), planned.size().runs)).map(drop)
                });
                if let Err(error) = py.check_signals().and(told) {
                    watch.cancel();
                    raised = Some(error);
                }
            }
        }
    })
}

/// `fmu_run._native`.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::instances::{Instances, States};
    #[pymodule_export]
    use super::{FmuError, Loaded};
}

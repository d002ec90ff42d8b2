//! The part of the Python package `fmu_run` that is written in Rust: `fmu_run._native`. What users see is in
//! `fmu_run/__init__.py`.

use fmu_run::{Batch, Course, Error, Fmu, Planned, Start, Watch};
use numpy::{PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
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

/// A number that is always the same, a course that all runs share, or one for each run.
#[derive(FromPyObject)]
enum Values<'py> {
    One(f64),
    Shared(PyReadonlyArray1<'py, f64>),
    EachRun(PyReadonlyArray2<'py, f64>),
}

/// A number, a text, or a number for each run.
#[derive(FromPyObject)]
enum StartValue<'py> {
    One(f64),
    Text(String),
    EachRun(PyReadonlyArray1<'py, f64>),
}

/// Name, type, causality, variability, start value, unit, description.
type Described = (String, String, String, Option<String>, Option<String>, Option<String>, String);
/// Texts by run.
type Told = Vec<(usize, String)>;
/// Courses and measures, (runs, outputs, times or measures) each, errors and notes.
type Result4<'py> = (Bound<'py, PyArray3<f64>>, Bound<'py, PyArray3<f64>>, Told, Told);

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
        time: PyReadonlyArray1<'py, f64>,
        inputs: Vec<(String, Values<'py>)>,
        input_derivatives: Vec<(String, Values<'py>)>,
        start: Vec<(String, StartValue<'py>)>,
        outputs: Vec<String>,
        every: Option<usize>,
        measures: Vec<String>,
        threads: Option<usize>,
        read_before_set: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Result4<'py>> {
        let fmu = self.fmu()?;
        let measures = measures.iter().map(|name| name.parse()).collect::<Result<Vec<_>, String>>();
        let batch = Batch {
            time: time.as_slice()?,
            inputs: courses(&inputs)?,
            input_derivatives: courses(&input_derivatives)?,
            start: starts(&start)?,
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
        // NumPy's memory, for which it asks the kernel for large pages.
        let numpy = py.import("numpy")?;
        let array = |each: usize| -> PyResult<Bound<'py, PyArray3<f64>>> {
            Ok(numpy.call_method1("zeros", ((size.runs, size.outputs, each),))?.cast_into()?)
        };
        let (courses, measures) = (array(size.kept)?, array(size.measures)?);
        let [errors, notes] = {
            let (mut courses, mut measures) = (courses.readwrite(), measures.readwrite());
            let room = [courses.as_slice_mut()?, measures.as_slice_mut()?];
            carry_out(py, &planned, room, progress.as_ref())?
        };
        Ok((courses, measures, errors, notes))
    }
}

impl Loaded {
    fn fmu(&self) -> PyResult<Arc<Fmu>> {
        let fmu = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        fmu.ok_or_else(|| FmuError::new_err("the FMU is closed"))
    }
}

fn courses<'a>(given: &'a [(String, Values)]) -> PyResult<Vec<(&'a str, Course<'a>)>> {
    given
        .iter()
        .map(|(name, values)| {
            let course = match values {
                Values::One(value) => Course::Constant(*value),
                Values::Shared(values) => Course::Shared(values.as_slice()?),
                Values::EachRun(values) => Course::EachRun(values.as_slice()?),
            };
            Ok((name.as_str(), course))
        })
        .collect()
}

fn starts<'a>(given: &'a [(String, StartValue)]) -> PyResult<Vec<(&'a str, Start<'a>)>> {
    given
        .iter()
        .map(|(name, value)| {
            let start = match value {
                StartValue::One(value) => Start::Same(*value),
                StartValue::Text(text) => Start::Text(text),
                StartValue::EachRun(values) => Start::EachRun(values.as_slice()?),
            };
            Ok((name.as_str(), start))
        })
        .collect()
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
    use super::{FmuError, Loaded};
}

//! Passes messages of the FMU to a Python function or a `logging.Logger`.

use crate::arguments::wrong;
use fmu_run::{Logged, Status};
use pyo3::prelude::*;

/// Receiver of messages.
pub struct Log(Receiver);

enum Receiver {
    /// A function that is called with index, status, category and message.
    Function(Py<PyAny>),
    Logger(Py<PyAny>),
}

impl Log {
    /// Converts the argument `log`.
    pub fn of(given: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Self>> {
        let Some(given) = given else { return Ok(None) };
        let logger = given.py().import("logging")?.getattr("Logger")?;
        if given.is_instance(&logger)? {
            return Ok(Some(Self(Receiver::Logger(given.clone().unbind()))));
        }
        if given.is_callable() {
            return Ok(Some(Self(Receiver::Function(given.clone().unbind()))));
        }
        Err(wrong("log", "a function or a logging.Logger", given))
    }

    /// Passes on messages, in their order.
    pub fn pass(&self, py: Python, messages: Vec<Logged>) -> PyResult<()> {
        messages.into_iter().try_for_each(|logged| self.pass_one(py, logged))
    }

    fn pass_one(&self, py: Python, logged: Logged) -> PyResult<()> {
        // Levels of the Python module `logging`.
        const INFO: u32 = 20;
        const WARNING: u32 = 30;
        const ERROR: u32 = 40;
        const CRITICAL: u32 = 50;
        let Logged { index, component, message, .. } = logged;
        let text = message.text.trim_end();
        let text = if component.is_empty() { text.to_owned() } else { format!("{component}: {text}") };
        let (level, status) = match message.status {
            Status::Ok => (INFO, "OK"),
            Status::Pending => (INFO, "Pending"),
            Status::Warning => (WARNING, "Warning"),
            Status::Discard => (WARNING, "Discard"),
            Status::Error => (ERROR, "Error"),
            Status::Fatal => (CRITICAL, "Fatal"),
        };
        let (category, index) = (message.category, index.into_pyobject(py)?);
        match &self.0 {
            Receiver::Function(function) => function.call1(py, (index, status, category, text)).map(drop),
            Receiver::Logger(logger) => {
                let format = "instance %s, %s: %s";
                logger.call_method1(py, "log", (level, format, index, category, text)).map(drop)
            }
        }
    }
}

//! Collects the messages of FMUs for callers that request all of them.

use crate::error::lock;
use fmi_abi::client::{LogListener, Message};
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// A message of an FMU.
#[derive(Clone, Debug, PartialEq)]
pub struct Logged {
    /// Index of the run or the instance. `None` if it is unknown, because several instances are alive and the FMU passes an unknown
    /// environment to the logger.
    pub index: Option<usize>,
    /// Name of the component in a system; empty for a single FMU, or if the instance is unknown.
    pub component: String,
    /// In a known run, the time of the last communication point or solver step before the message, s; otherwise `None`.
    pub time: Option<f64>,
    /// The message.
    pub message: Message,
}

/// Collects the messages of all instances of a system. Because all of them share one callback, each component of each instance is
/// identified by a number: index of the instance * number of components + index of the component.
#[derive(Debug)]
pub(crate) struct Feed {
    components: Vec<String>,
    /// Index and time, s, of the run that an instance performs, by the index of the instance.
    runs: Mutex<HashMap<usize, (usize, f64)>>,
    logged: Mutex<Vec<Logged>>,
}

impl Feed {
    /// Creates a collector for a system whose components have these names.
    pub fn of(components: Vec<String>) -> Arc<Self> {
        Arc::new(Self { components, runs: Mutex::default(), logged: Mutex::default() })
    }

    /// Records the run that an instance performs and its time, s. Later messages of the instance are labelled with both.
    pub fn at(&self, instance: usize, run: usize, time: f64) {
        lock(&self.runs).insert(instance, (run, time));
    }

    /// Returns the messages that were logged since the last call of this function.
    pub fn take(&self) -> Vec<Logged> {
        std::mem::take(&mut *lock(&self.logged))
    }
}

impl LogListener for Feed {
    fn on_message(&self, number: Option<usize>, message: &Message) {
        let count = self.components.len().max(1);
        let instance = number.map(|number| number / count);
        let run = instance.and_then(|instance| lock(&self.runs).get(&instance).copied());
        let component = number.and_then(|number| self.components.get(number % count));
        let logged = Logged {
            index: run.map(|(run, _)| run).or(instance),
            component: component.cloned().unwrap_or_default(),
            time: run.map(|(_, time)| time),
            message: message.clone(),
        };
        lock(&self.logged).push(logged);
    }
}

/// Logging settings of an instance.
#[derive(Clone, Debug, Default)]
pub(crate) struct Logging {
    /// Whether debug logging is on (`loggingOn`).
    pub on: bool,
    /// Receiver of all messages, and the index of the instance.
    pub feed: Option<(Arc<Feed>, usize)>,
}

impl Logging {
    /// Returns the listener for a component of the instance.
    pub fn listener(&self, component: usize) -> Option<(Arc<dyn LogListener>, usize)> {
        let (feed, instance) = self.feed.as_ref()?;
        let count = feed.components.len().max(1);
        Some((Arc::clone(feed) as Arc<dyn LogListener>, instance * count + component))
    }
}

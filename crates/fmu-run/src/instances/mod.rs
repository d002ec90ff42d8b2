//! Instances of an FMU that the caller controls with single calls (set, step, get, save, restore). Each call acts on all or on
//! selected instances, mostly in parallel.

mod derivatives;
mod entry;
mod exact;
mod model_exchange;
mod states;

pub use states::States;

use crate::description::Description;
use crate::error::{Error, request};
use crate::instance::{Experiment, Tolerance, check_equal_step};
use crate::messages::{Feed, Logged, Logging};
use crate::selection::Selection;
use crate::start::{Start, StartValues};
use crate::system::System;
use crate::system_instance::SystemInstance;
use crate::threads::Threads;
use entry::{Entry, Progress, each, empty, in_parts, rows};
use fmi_abi::client::{Event, Rejection};
use fmi_abi::{Interface, shown_number};
use std::sync::Arc;

/// Settings for new instances.
#[derive(Clone, Debug)]
pub struct Setup<'a> {
    /// Interface type: Co-Simulation or Model Exchange.
    pub interface: Interface,
    /// Number of instances.
    pub count: usize,
    /// Start values by variable.
    pub start: Vec<(&'a str, Start<'a>)>,
    /// Start time, s.
    pub start_time: f64,
    /// Stop time, s, if known; the FMU may reject steps beyond it.
    pub stop_time: Option<f64>,
    /// Relative tolerance for solvers inside the FMU.
    pub tolerance: Tolerance,
    /// Whether logging is on and all messages of the FMU are collected for [`Instances::take_messages`].
    pub listening: bool,
    /// Maximum number of threads; `None` means one for each processor.
    pub threads: Option<usize>,
}

impl Default for Setup<'_> {
    /// Returns settings for one instance for Co-Simulation that starts at 0 s.
    fn default() -> Self {
        Self {
            interface: Interface::CoSimulation,
            count: 1,
            start: Vec::new(),
            start_time: 0.0,
            stop_time: None,
            tolerance: Tolerance::Default,
            listening: false,
            threads: Some(1),
        }
    }
}

/// Instances of one FMU or system, each with its own time. A method acts on all of them, or on those in its [`Mask`]; most methods
/// use several threads. Arrays of values have one row for each instance, with one value for each variable; the rows follow each
/// other.
///
/// If a call of the FMU returns an error, the instance fails, and all others continue. [`errors`](Self::errors) contains the reason;
/// values read from a failed instance are NaN. [`reset`](Self::reset) and [`restore`](Self::restore) make it usable again.
#[derive(Debug)]
pub struct Instances {
    system: System,
    interface: Interface,
    all: Vec<Entry>,
    begin: Begin,
    /// Collects all messages, if the caller requests them.
    feed: Option<Arc<Feed>>,
    /// Threads in addition to the caller's.
    threads: Option<Threads>,
    /// Name of a model that needs steps of equal size, if there is one.
    fixed_step: Option<String>,
}

#[derive(Debug)]
/// Start values and experiment, for [`Instances::reset`].
struct Begin {
    start: StartValues<'static>,
    experiment: Experiment,
}

/// Instances on which a call acts: all, or those whose entry is true.
pub type Mask<'a> = Option<&'a [bool]>;

impl System {
    /// Creates instances, sets their start values and initializes them. Instances for Model Exchange have also handled the initial
    /// event and are in Continuous-Time Mode.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the settings do not fit the FMU, and [`Error::Memory`] if memory does not suffice. Returns
    /// [`Error::Fmu`] if the FMU does not support the interface type, if all instances fail, or if no threads can be created.
    pub fn instances(&self, setup: &Setup) -> Result<Instances, Error> {
        let (system, start) = self.configured(&setup.start)?;
        system.instances_of(setup, &start, setup.listening.then(|| self.feed()))
    }

    /// Creates instances as [`instances`](Self::instances) does. Appends the messages so far to `messages`, even if an error is
    /// returned.
    ///
    /// # Errors
    /// Same errors as [`instances`](Self::instances).
    pub fn instances_with(&self, setup: &Setup, messages: &mut Vec<Logged>) -> Result<Instances, Error> {
        let (system, start) = self.configured(&setup.start)?;
        let feed = setup.listening.then(|| self.feed());
        let made = system.instances_of(setup, &start, feed.clone());
        messages.extend(feed.iter().flat_map(|feed| feed.take()));
        made
    }

    /// Creates instances of this system, whose structural parameters are already set.
    fn instances_of(
        &self,
        setup: &Setup,
        given: &[(&str, Start)],
        feed: Option<Arc<Feed>>,
    ) -> Result<Instances, Error> {
        self.check_interface(setup.interface)?;
        self.check_unclocked()?;
        if setup.count == 0 {
            return request("count must be at least 1".to_owned());
        }
        if setup.count > 1 && self.once_per_process(setup.interface) {
            return request(format!(
                "{} can have only one instance per process (canBeInstantiatedOnlyOncePerProcess)",
                self.name()
            ));
        }
        setup.tolerance.check()?;
        let start = StartValues::of(self, &[])?;
        let Setup { start_time, stop_time, tolerance, .. } = *setup;
        let all = empty(setup.count, self.components().len())?;
        let threads = self.threads(setup.interface, setup.threads, setup.count)?;
        let mut instances = Instances {
            system: self.clone(),
            interface: setup.interface,
            all,
            begin: Begin { start, experiment: Experiment { start_time, stop_time, tolerance } },
            feed,
            threads: (threads > 1).then(|| Threads::new(threads - 1)).transpose()?,
            fixed_step: self.fixed_step().map(str::to_owned),
        };
        instances.start_from(given)?;
        instances.reset(None);
        match instances.none_left() {
            Some(why) => Err(Error::Fmu(why.to_owned())),
            None => Ok(instances),
        }
    }
}

impl Instances {
    /// Returns the number of instances.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Returns whether there are no instances.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Returns the interface type.
    pub fn interface(&self) -> Interface {
        self.interface
    }

    /// Returns the system to which the instances belong.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Returns the time of each instance, s.
    pub fn times(&self) -> impl Iterator<Item = f64> {
        self.all.iter().map(|one| one.progress.time)
    }

    /// Returns the indices of the failed instances, each with the reason.
    pub fn errors(&self) -> impl Iterator<Item = (usize, &str)> {
        self.all.iter().enumerate().filter_map(|(index, one)| Some((index, one.error.as_deref()?)))
    }

    /// Returns the error of the first instance if all instances have failed.
    pub fn none_left(&self) -> Option<&str> {
        let all = self.all.iter().all(|one| one.error.is_some());
        self.all.first().filter(|_| all).and_then(|one| one.error.as_deref())
    }

    /// Returns the result of the last event of each instance.
    pub fn events(&self) -> impl Iterator<Item = Event> {
        self.all.iter().map(|one| one.progress.event)
    }

    /// Replaces start values for the next [`reset`](Self::reset). Start values of other variables stay as they are.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if a variable is unknown or is a structural parameter, or if the values do not fit the variable
    /// or the number of instances.
    pub fn start_from(&mut self, start: &[(&str, Start)]) -> Result<(), Error> {
        for (name, values) in start {
            if self.system.is_structural(name) {
                return request(format!(
                    "{name} is a structural parameter; set it when the instances are created"
                ));
            }
            if let Some(count) = values.count()
                && count != self.len()
            {
                return request(format!("{name} has {count} start values for {} instances", self.len()));
            }
        }
        self.begin.start.put(StartValues::given(&self.system, start)?.into_owned());
        Ok(())
    }

    /// Resets the instances to their start values and initializes them.
    pub fn reset(&mut self, mask: Mask) {
        let (system, interface, begin, feed) = (&self.system, self.interface, &self.begin, &self.feed);
        let reset = |index: usize, one: &mut Entry| {
            one.error = None;
            one.progress = Progress { time: begin.experiment.start_time, ..Progress::default() };
            let feed = feed.as_ref().map(|feed| (Arc::clone(feed), index));
            let logging = Logging { on: feed.is_some(), feed };
            match SystemInstance::renewed(one.instance.take(), system, (interface, false), &logging) {
                Ok(instance) => {
                    let instance = one.instance.insert(instance);
                    match initialize(instance, begin, index, interface) {
                        Ok(event) => one.progress.event = event,
                        Err(rejection) => one.error = Some(rejection.to_string()),
                    }
                }
                Err((text, _)) => one.error = Some(text),
            }
        };
        each(&mut self.threads, &mut self.all, mask, reset);
    }

    /// Sets variables, from one row for all instances or a row for each.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if a variable is read-only, a structural parameter or connected to an output, or if an integer,
    /// an enumeration or a Boolean cannot have its value.
    ///
    /// # Panics
    /// Panics if the number of values is wrong.
    pub fn set(&mut self, variables: &Selection, values: &[f64], mask: Mask) -> Result<(), Error> {
        variables.check(values)?;
        let row = rows(values, variables.len(), self.len());
        self.alive(mask, |index, _, instance| instance.set(variables, row(index)));
        Ok(())
    }

    /// Reads variables into a row for each instance.
    ///
    /// # Panics
    /// Panics if the length of `values` is wrong.
    pub fn get(&mut self, variables: &Selection, values: &mut [f64]) {
        self.fill(variables.len(), values, |_, _, instance, row| instance.get(variables, row));
    }

    /// Performs Co-Simulation steps of this size, s.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the size is not above 0 and finite, or if it differs from the size of the first step and an FMU
    /// needs steps of equal size.
    pub fn step(&mut self, size: f64, mask: Mask) -> Result<(), Error> {
        check_size(size)?;
        self.check_equal_steps(|_| size, mask)?;
        self.alive(mask, |_, progress, instance| {
            progress.step(instance, size)?;
            progress.time += size;
            Ok(())
        });
        Ok(())
    }

    /// Performs Co-Simulation steps to this time, s.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the time is not finite, or not after the time of an instance that would make the step, or if the
    /// size of the step differs from the size of the first one and an FMU needs steps of equal size.
    pub fn step_to(&mut self, time: f64, mask: Mask) -> Result<(), Error> {
        let mut ahead = self.all.iter().enumerate().filter(|(index, one)| one.acts(*index, mask));
        if let Some((index, one)) = ahead.find(|(_, one)| !(time.is_finite() && time > one.progress.time)) {
            return request(format!(
                "to is {} s; it must be after the time of each instance, and instance {index} is at {} s",
                shown_number(time),
                shown_number(one.progress.time)
            ));
        }
        self.check_equal_steps(|progress| time - progress.time, mask)?;
        self.alive(mask, |_, progress, instance| {
            progress.step(instance, time - progress.time)?;
            progress.time = time;
            Ok(())
        });
        Ok(())
    }

    /// Sets variables, performs a step and reads other variables. Has the same effect as [`set`](Self::set), [`step`](Self::step) and
    /// [`get`](Self::get), but distributes the work to the threads only once.
    ///
    /// # Errors
    /// Same errors as [`set`](Self::set) and [`step`](Self::step).
    ///
    /// # Panics
    /// Panics if the number of values is wrong.
    pub fn advance(
        &mut self,
        (set, values): (&Selection, &[f64]),
        size: f64,
        (get, read): (&Selection, &mut [f64]),
    ) -> Result<(), Error> {
        set.check(values)?;
        check_size(size)?;
        self.check_equal_steps(|_| size, None)?;
        let inputs = rows(values, set.len(), self.len());
        self.fill(get.len(), read, |index, progress, instance, row| {
            instance.set(set, inputs(index))?;
            progress.step(instance, size)?;
            progress.time += size;
            instance.get(get, row)
        });
        Ok(())
    }

    /// If an FMU needs steps of equal size, fails if the next step would have another size than the first one. Otherwise records the
    /// size.
    fn check_equal_steps(&mut self, size: impl Fn(&Progress) -> f64, mask: Mask) -> Result<(), Error> {
        let Some(model) = &self.fixed_step else { return Ok(()) };
        let mut first_steps = Vec::new();
        for (index, one) in self.all.iter().enumerate().filter(|(index, one)| one.acts(*index, mask)) {
            let (size, progress) = (size(&one.progress), &one.progress);
            let first = progress.first_step.unwrap_or(size);
            check_equal_step(model, first, size, progress.time)?;
            first_steps.push((index, first));
        }
        for (index, first) in first_steps {
            self.all[index].progress.first_step = Some(first);
        }
        Ok(())
    }

    /// Returns the model description of a single FMU.
    fn description(&self) -> Option<&Description> {
        self.system.sole().map(|fmu| &*fmu.description)
    }

    /// Returns the messages that the FMU has logged since the last call of this function. There are none unless [`Setup::listening`] is
    /// set, because logging costs time.
    pub fn take_messages(&self) -> Vec<Logged> {
        self.feed.as_ref().map(|feed| feed.take()).unwrap_or_default()
    }

    /// Calls `body` for each instance in the mask that has not failed. If `body` returns an error, the instance has failed.
    fn alive(
        &mut self,
        mask: Mask,
        body: impl Fn(usize, &mut Progress, &mut SystemInstance) -> Result<(), Rejection> + Sync,
    ) {
        each(&mut self.threads, &mut self.all, mask, |index, one| {
            one.with(|progress, instance| body(index, progress, instance));
        });
    }

    /// Calls `body` to fill a row of values for each instance. The row of a failed instance is filled with NaN.
    fn fill(
        &mut self,
        length: usize,
        values: &mut [f64],
        body: impl Fn(usize, &mut Progress, &mut SystemInstance, &mut [f64]) -> Result<(), Rejection> + Sync,
    ) {
        assert_eq!(values.len(), length * self.all.len(), "a row of {length} values for each instance");
        let body = |index: usize, one: &mut Entry, row: &mut [f64]| {
            if !one.with(|progress, instance| body(index, progress, instance, row)) {
                row.fill(f64::NAN);
            }
        };
        in_parts(&mut self.threads, &mut self.all, length, values, body);
    }
}

fn check_size(size: f64) -> Result<(), Error> {
    if size.is_finite() && size > 0.0 {
        return Ok(());
    }
    request(format!("the size of a step is {} s; it must be above 0 and finite", shown_number(size)))
}

/// Sets start values and initializes an instance, so that it can perform its first step. Returns the result of the initial event in
/// Model Exchange, and the default in Co-Simulation.
fn initialize(
    instance: &mut SystemInstance,
    begin: &Begin,
    index: usize,
    interface: Interface,
) -> Result<Event, Rejection> {
    instance.begin(begin.experiment, &begin.start, index)?;
    instance.exit_initialization_mode()?;
    let mut event = Event::default();
    if interface == Interface::ModelExchange {
        event = instance.sole().event()?;
        instance.sole().enter_continuous_time_mode()?;
    }
    Ok(event)
}

//! Instances of an FMU, controlled call by call: set, step, get, save and restore, all instances in parallel.

use crate::description::Description;
use crate::error::{Error, request};
use crate::found::is_exact;
use crate::instance::{Experiment, Instance, Tolerance};
use crate::messages::{Feed, Logged, Logging};
use crate::running::{Running, Saved};
use crate::selection::{Selection, Target};
use crate::start::{Start, StartValues, exact};
use crate::system::System;
use crate::threads::Threads;
use fmi_abi::{BaseType, Interface, Value};
use fmi_client::{Continuous, Event, Rejection};
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
    /// Whether all messages of the FMU are collected, with its logging switched on; see [`Instances::take_messages`].
    pub listening: bool,
    /// Number of threads; `None` uses one thread for each processor.
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

/// Instances of one FMU, each with its own time. Every method acts on all of them, in several threads. Values
/// are stored in rows, one for each instance: instances times variables, the last index varies fastest.
///
/// If a call returns an error for an instance, the instance fails, and the others continue.
/// [`errors`](Self::errors) contains the reason; values read from a failed instance are NaN.
/// [`reset`](Self::reset) and [`restore`](Self::restore) make it usable again.
#[derive(Debug)]
pub struct Instances {
    system: System,
    interface: Interface,
    all: Vec<One>,
    begin: Begin,
    /// Collects all messages, if the caller wants them.
    feed: Option<Arc<Feed>>,
    /// Threads in addition to the caller's.
    threads: Option<Threads>,
}

#[derive(Debug)]
struct Begin {
    start: StartValues<'static>,
    experiment: Experiment,
}

#[derive(Debug)]
struct One {
    /// The instance; `None` if it could not be made again.
    instance: Option<Running>,
    /// Reason why the instance failed, if it did.
    error: Option<String>,
    own: Own,
}

/// Time and last event of an instance.
#[derive(Debug, Default)]
struct Own {
    time: f64,
    event: Event,
}

/// States that [`Instances`] have saved, one for each that had not failed. They are indices, not pointers, so
/// the states of other instances are harmless: they lead to no state or to another own state. Freeing
/// consumes the value, so freed states cannot be used.
///
/// ```compile_fail,E0382
/// fn restore_a_freed_state(instances: &mut fmu_run::Instances) {
///     let states = instances.save().unwrap();
///     instances.forget(states);
///     instances.restore(&states, None);
/// }
/// ```
#[derive(Debug, PartialEq)]
pub struct States(Vec<Option<(Saved, f64)>>);

/// Selection of the instances for a call: all, or those with true.
pub type Mask<'a> = Option<&'a [bool]>;

impl System {
    /// Makes instances, sets their start values and initializes them. Instances for Model Exchange have
    /// handled the events at the start and are in Continuous-Time Mode.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the settings do not fit the FMU. Returns [`Error::Fmu`] if the FMU does
    /// not support the interface type or makes no instances.
    pub fn instances(&self, setup: &Setup) -> Result<Instances, Error> {
        let (system, start) = self.configured(&setup.start)?;
        system.instances_of(setup, &start, setup.listening.then(|| self.feed()))
    }

    /// Makes instances as [`instances`](Self::instances) does, and returns the messages so far also if there is an error.
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

    /// Makes instances, whose structural parameters have their values.
    fn instances_of(
        &self,
        setup: &Setup,
        given: &[(&str, Start)],
        feed: Option<Arc<Feed>>,
    ) -> Result<Instances, Error> {
        self.check_interface(setup.interface)?;
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
        self.all.iter().map(|one| one.own.time)
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
        self.all.iter().map(|one| one.own.event)
    }

    /// Replaces start values for the next [`reset`](Self::reset); start values of other variables stay.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if a variable is unknown, or if the values do not fit it or the number of
    /// instances.
    pub fn start_from(&mut self, start: &[(&str, Start)]) -> Result<(), Error> {
        for (name, values) in start {
            if self.system.is_structural(name) {
                return request(format!(
                    "{name} is a structural parameter; give its value when the instances are made"
                ));
            }
            if let Some(count) = values.count()
                && count != 1
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
        let reset = |index: usize, one: &mut One| {
            one.error = None;
            (one.own.time, one.own.event) = (begin.experiment.start_time, Event::default());
            let feed = feed.as_ref().map(|feed| (Arc::clone(feed), index));
            let logging = Logging { on: feed.is_some(), feed };
            match Running::renewed(one.instance.take(), system, interface, &logging) {
                Ok(instance) => {
                    let instance = one.instance.insert(instance);
                    match initialize(instance, begin, index, interface) {
                        Ok(event) => one.own.event = event,
                        Err(rejection) => one.error = Some(rejection.to_string()),
                    }
                }
                Err((text, _)) => one.error = Some(text),
            }
        };
        each(&mut self.threads, &mut self.all, mask, reset);
    }

    /// Sets variables, from a row for each instance or from one row for all.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if a variable is read-only, an integer or a Boolean cannot have its value,
    /// or an output feeds a variable.
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
    /// Returns [`Error::Request`] if the size is not above 0 and finite.
    pub fn step(&mut self, size: f64, mask: Mask) -> Result<(), Error> {
        check_size(size)?;
        self.alive(mask, |_, own, instance| {
            instance.step(own.time, size)?;
            own.time += size;
            Ok(())
        });
        Ok(())
    }

    /// Performs Co-Simulation steps to this time, s.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the time is not finite, or not after the time of an instance.
    pub fn step_to(&mut self, time: f64, mask: Mask) -> Result<(), Error> {
        let steps = |index: usize, one: &One| one.error.is_none() && mask.is_none_or(|mask| mask[index]);
        let mut ahead = self.all.iter().enumerate().filter(|(index, one)| steps(*index, one));
        if let Some((index, one)) = ahead.find(|(_, one)| !(time.is_finite() && time > one.own.time)) {
            return request(format!(
                "to is {time} s; it must be after the time of each instance, and instance {index} is at {} s",
                one.own.time
            ));
        }
        self.alive(mask, |_, own, instance| {
            instance.step(own.time, time - own.time)?;
            own.time = time;
            Ok(())
        });
        Ok(())
    }

    /// Sets variables, performs a step and reads other variables. Equals [`set`](Self::set),
    /// [`step`](Self::step) and [`get`](Self::get), but starts the threads only once.
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
        let inputs = rows(values, set.len(), self.len());
        self.fill(get.len(), read, |index, own, instance, row| {
            instance.set(set, inputs(index))?;
            instance.step(own.time, size)?;
            own.time += size;
            instance.get(get, row)
        });
        Ok(())
    }

    /// Saves the state of each instance.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the FMU does not support it.
    pub fn save(&mut self) -> Result<States, Error> {
        let why = "cannot save its state (canGetAndSetFMUstate is not true)";
        self.system.check_offer(self.interface, |offer| offer.saves_states, why)?;
        let mut states = vec![None; self.len()];
        let indices = std::sync::Mutex::new(&mut states);
        self.alive(None, |index, own, instance| {
            let saved = (instance.save()?, own.time);
            indices.lock().unwrap_or_else(std::sync::PoisonError::into_inner)[index] = Some(saved);
            Ok(())
        });
        Ok(States(states))
    }

    /// Restores states that these instances have saved.
    ///
    /// # Errors
    /// Returns [`Error::Request`] and restores none if an instance was made again since, by a reset of an FMU that cannot be reset
    /// or of an instance that had failed.
    ///
    /// # Panics
    /// Panics if the number of states differs from the number of instances.
    pub fn restore(&mut self, states: &States, mask: Mask) -> Result<(), Error> {
        assert_eq!(states.0.len(), self.len(), "states of other instances");
        for (index, one) in
            self.all.iter().enumerate().filter(|(index, _)| mask.is_none_or(|mask| mask[*index]))
        {
            if let (Some((saved, _)), Some(instance)) = (states.0[index], &one.instance) {
                instance
                    .check_own(saved)
                    .map_err(|why| Error::Request(format!("instance {index}: {why}")))?;
            }
        }
        let back = |index: usize, one: &mut One| {
            let (Some((saved, time)), Some(instance)) = (states.0[index], &mut one.instance) else { return };
            match instance.restore(saved) {
                Ok(()) => (one.own.time, one.error) = (time, None),
                Err(rejection) => one.error = Some(rejection.to_string()),
            }
        };
        each(&mut self.threads, &mut self.all, mask, back);
        Ok(())
    }

    /// Frees saved states.
    pub fn forget(&mut self, states: States) {
        for (one, saved) in self.all.iter_mut().zip(states.0) {
            if let (Some((saved, _)), Some(instance)) = (saved, &mut one.instance) {
                _ = instance.forget(saved);
            }
        }
    }

    /// Serializes saved states to bytes, which another process can read. An entry is `None` if the instance
    /// had no state, or its FMU returned an error.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the FMU does not support it.
    pub fn serialize(&mut self, states: &States) -> Result<Vec<Option<Vec<u8>>>, Error> {
        let why = "cannot serialize its state (canSerializeFMUstate is not true)";
        self.system.check_offer(self.interface, |offer| offer.serializes_states, why)?;
        for (index, (one, saved)) in self.all.iter().zip(&states.0).enumerate() {
            if let (Some((saved, _)), Some(instance)) = (saved, &one.instance) {
                instance
                    .check_own(*saved)
                    .map_err(|why| Error::Request(format!("instance {index}: {why}")))?;
            }
        }
        let bytes = self.all.iter_mut().zip(&states.0).map(|(one, saved)| {
            let ((saved, time), instance) = (saved.as_ref()?, one.instance.as_mut()?);
            match instance.serialize(*saved) {
                Ok(bytes) => Some([&time.to_le_bytes()[..], &bytes].concat()),
                Err(rejection) => {
                    one.error = Some(rejection.to_string());
                    None
                }
            }
        });
        Ok(bytes.collect())
    }

    /// De-serializes states from [`serialize`](Self::serialize), one or `None` for each instance.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the number of states is wrong, and [`Error::Fmu`] if an instance rejects
    /// a state.
    pub fn deserialize(&mut self, bytes: &[Option<impl AsRef<[u8]>>]) -> Result<States, Error> {
        if bytes.len() != self.len() {
            return request(format!("there are {} states for {} instances", bytes.len(), self.len()));
        }
        let why = "cannot deserialize a state (canSerializeFMUstate is not true)";
        self.system.check_offer(self.interface, |offer| offer.serializes_states, why)?;
        let mut states = Vec::new();
        for (index, (one, bytes)) in self.all.iter_mut().zip(bytes).enumerate() {
            let Some(bytes) = bytes else {
                states.push(None);
                continue;
            };
            let Some((time, bytes)) = bytes.as_ref().split_first_chunk() else {
                return request(format!("the state of instance {index} is cut short"));
            };
            let instance = one.instance.as_mut();
            let read = instance.map(|instance| instance.deserialize(bytes)).transpose();
            let saved = read.map_err(|rejection| Error::Fmu(format!("instance {index}: {rejection}")))?;
            states.push(saved.map(|saved| (saved, f64::from_le_bytes(*time))));
        }
        Ok(States(states))
    }

    /// Computes the directional derivatives of unknowns, with a seed for each instance or one for all.
    ///
    /// # Errors
    /// Returns [`Error::Request`] unless all variables are Real, and each known is an input, a parameter or a
    /// continuous state.
    ///
    /// # Panics
    /// Panics if the number of values is wrong.
    pub fn directional_derivative(
        &mut self,
        unknowns: &Selection,
        (knowns, seed): (&Selection, &[f64]),
        values: &mut [f64],
    ) -> Result<(), Error> {
        let (unknown, known) = (self.real(unknowns)?, self.real(knowns)?);
        let why = "has no directional derivatives (providesDirectionalDerivative is not true)";
        self.system.check_offer(self.interface, |offer| offer.directional_derivatives, why)?;
        if let Some(name) =
            self.description().and_then(|of| knowns.names().iter().find(|name| !of.is_known(name)))
        {
            return request(format!(
                "{name} cannot be a known; expected an input, a parameter or a continuous state"
            ));
        }
        let seed = rows(seed, knowns.len(), self.len());
        self.fill(unknowns.len(), values, |index, _, instance, row| {
            instance.sole().directional_derivative(unknown, known, seed(index), row)
        });
        Ok(())
    }

    /// Sets time derivatives of inputs, of order 1, in Co-Simulation. Only FMI 2.0 supports them.
    ///
    /// # Errors
    /// Returns [`Error::Request`] unless all variables are Real inputs of an FMU that accepts input
    /// derivatives.
    ///
    /// # Panics
    /// Panics if the number of values is wrong.
    pub fn set_input_derivatives(
        &mut self,
        inputs: &Selection,
        values: &[f64],
        mask: Mask,
    ) -> Result<(), Error> {
        let (references, orders) = (self.real(inputs)?, vec![1; inputs.len()]);
        inputs.names().iter().try_for_each(|name| self.system.takes_input_derivative(name).map(drop))?;
        let row = rows(values, inputs.len(), self.len());
        self.alive(mask, |index, _, instance| {
            instance.sole().set_input_derivatives(references, &orders, row(index))
        });
        Ok(())
    }

    /// Reads time derivatives of outputs, of order 1, into a row for each instance, in Co-Simulation.
    ///
    /// # Errors
    /// Returns [`Error::Request`] unless all variables are Real.
    ///
    /// # Panics
    /// Panics if the length of `values` is wrong.
    pub fn get_output_derivatives(&mut self, outputs: &Selection, values: &mut [f64]) -> Result<(), Error> {
        let references = self.real(outputs)?;
        self.fill(outputs.len(), values, |_, _, instance, row| {
            instance.sole().get_output_derivatives(references, row)
        });
        Ok(())
    }

    /// Sets the time, s, of each instance or one time of all, in Model Exchange.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if a time is not finite.
    ///
    /// # Panics
    /// Panics if the number of times is wrong.
    pub fn set_time(&mut self, times: &[f64], mask: Mask) -> Result<(), Error> {
        if let Some(time) = times.iter().find(|time| !time.is_finite()) {
            return request(format!("time is {time}; it must be finite"));
        }
        let row = rows(times, 1, self.len());
        self.alive(mask, |index, own, instance| {
            own.time = row(index)[0];
            instance.sole().set_time(own.time)
        });
        Ok(())
    }

    /// Sets the continuous states from a row for each instance or one row for all, in Model Exchange.
    ///
    /// # Panics
    /// Panics if the number of values is wrong.
    pub fn set_continuous_states(&mut self, values: &[f64], mask: Mask) {
        let row = rows(values, self.continuous(Continuous::States), self.len());
        self.alive(mask, |index, _, instance| instance.sole().set_continuous_states(row(index)));
    }

    /// Reads states, derivatives, nominal values or event indicators into a row for each instance, in Model
    /// Exchange.
    ///
    /// # Panics
    /// Panics if the length of `values` is wrong.
    pub fn get_continuous(&mut self, what: Continuous, values: &mut [f64]) {
        self.fill(self.continuous(what), values, |_, _, instance, row| {
            instance.sole().get_continuous(what, row)
        });
    }

    /// Returns the number of values of this quantity.
    pub fn continuous(&self, what: Continuous) -> usize {
        self.description().map_or(0, |description| match what {
            Continuous::EventIndicators => description.event_indicators,
            _ => description.states,
        })
    }

    /// Handles an event with all its iterations and returns to Continuous-Time Mode, in Model Exchange.
    /// [`events`](Self::events) returns the results. In Event Mode, before the iterations, sets variables
    /// from a row for each instance or one row for all.
    ///
    /// # Errors
    /// Same errors as [`set`](Self::set).
    ///
    /// # Panics
    /// Panics if the number of values is wrong.
    pub fn handle_events(&mut self, (set, values): (&Selection, &[f64]), mask: Mask) -> Result<(), Error> {
        set.check(values)?;
        let row = rows(values, set.len(), self.len());
        self.alive(mask, |index, own, instance| {
            instance.sole().enter_event_mode()?;
            instance.set(set, row(index))?;
            own.event = instance.sole().event()?;
            instance.sole().enter_continuous_time_mode()
        });
        Ok(())
    }

    /// Reports a completed step of the integrator, in Model Exchange. Writes two values for each instance to
    /// `wanted`: whether it requests an event, and the end of the simulation.
    ///
    /// # Panics
    /// Panics if `wanted` does not have two values for each instance.
    pub fn completed_integrator_step(&mut self, wanted: &mut [f64]) {
        self.fill(2, wanted, |_, _, instance, row| {
            row.copy_from_slice(
                &instance.sole().completed_integrator_step()?.map(|wanted| f64::from(u8::from(wanted))),
            );
            Ok(())
        });
    }

    /// Returns the model description of a single FMU.
    fn description(&self) -> Option<&Description> {
        self.system.sole().map(|fmu| &*fmu.description)
    }

    /// Returns the value references of Real variables of a single FMU.
    fn real<'s>(&self, variables: &'s Selection) -> Result<&'s [u32], Error> {
        let why = "only Real variables have derivatives, of one FMU and not of a system";
        let references = self.system.sole().and_then(|_| variables.references());
        references.ok_or_else(|| Error::Request(why.to_owned()))
    }

    /// Returns the exact value of a variable of any type in each instance; `None` for a failed instance.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the variable is unknown.
    pub fn values(&mut self, name: &str) -> Result<Vec<Option<Value>>, Error> {
        let of = Target::of(self.system.find_first(name)?);
        let mut values = vec![None; self.len()];
        for (one, value) in self.all.iter_mut().zip(&mut values) {
            one.with(|_, instance| instance.get_value(of).map(|found| *value = Some(found)));
        }
        Ok(values)
    }

    /// Sets a string, bytes or an integer of 64 bits, to a value for each instance or to one for all.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the variable is read-only, or a value does not fit its type.
    ///
    /// # Panics
    /// Panics if the number of values is wrong.
    pub fn set_values(&mut self, name: &str, values: &[Value], mask: Mask) -> Result<(), Error> {
        assert!(values.len() == 1 || values.len() == self.len(), "a value for each instance or one");
        let mut targets = Vec::new();
        for found in self.system.find(name)? {
            found.check_settable(name)?;
            if !is_exact(found.variable.base) {
                return request(format!("{name} is {}; set it with set", found.variable.kind_in_words()));
            }
            let own = values.iter().map(|value| exact(found, name, value.clone()));
            targets.push((Target::of(found), own.collect::<Result<Vec<_>, _>>()?));
        }
        self.alive(mask, |index, _, instance| {
            let value = |values: &[Value]| values[if values.len() == 1 { 0 } else { index }].clone();
            targets.iter().try_for_each(|(target, values)| instance.set_value(*target, &value(values)))
        });
        Ok(())
    }

    /// Returns the value of a string variable in each instance; `None` for a failed instance.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the variable is unknown or not a string.
    pub fn texts(&mut self, name: &str) -> Result<Vec<Option<String>>, Error> {
        let found = self.system.find_first(name)?;
        if found.variable.base != BaseType::String {
            return request(format!("{name} is {}, not a string", found.variable.kind_in_words()));
        }
        let text = |value: Option<Value>| value.map(|value| value.to_string());
        Ok(self.values(name)?.into_iter().map(text).collect())
    }

    /// Removes and returns the messages of the FMU since the last call, if the instances [listen](Setup::listening).
    pub fn take_messages(&self) -> Vec<Logged> {
        self.feed.as_ref().map(|feed| feed.take()).unwrap_or_default()
    }

    /// Calls `body` for each instance that has not failed. An error makes the instance fail.
    fn alive(
        &mut self,
        mask: Mask,
        body: impl Fn(usize, &mut Own, &mut Running) -> Result<(), Rejection> + Sync,
    ) {
        each(&mut self.threads, &mut self.all, mask, |index, one| {
            one.with(|own, instance| body(index, own, instance));
        });
    }

    /// Fills a row of values for each instance, with NaN for a failed instance.
    fn fill(
        &mut self,
        length: usize,
        values: &mut [f64],
        body: impl Fn(usize, &mut Own, &mut Running, &mut [f64]) -> Result<(), Rejection> + Sync,
    ) {
        assert_eq!(values.len(), length * self.all.len(), "a row of {length} values for each instance");
        let body = |index: usize, one: &mut One, row: &mut [f64]| {
            if !one.with(|own, instance| body(index, own, instance, row)) {
                row.fill(f64::NAN);
            }
        };
        in_parts(&mut self.threads, &mut self.all, length, values, body);
    }
}

impl One {
    /// Calls `body` if the instance has not failed. Returns whether the instance is still usable.
    #[inline]
    fn with(&mut self, body: impl FnOnce(&mut Own, &mut Running) -> Result<(), Rejection>) -> bool {
        let Self { instance: Some(instance), error: error @ None, own } = self else { return false };
        if let Err(rejection) = body(own, instance) {
            *error = Some(format!("at {} s: {rejection}", own.time));
            return false;
        }
        true
    }
}

/// Allocates entries for the instances of a system, if there is enough memory for them and for their data.
fn empty(count: usize, components: usize) -> Result<Vec<One>, Error> {
    /// Minimum of further memory per component: allocations of its FMU and of its log.
    const COMPONENT: usize = 256;
    let too_many = || Error::Memory(format!("{count} instances need more memory than there is"));
    let mut all = Vec::new();
    all.try_reserve_exact(count).map_err(|_| too_many())?;
    let each = size_of::<Running>() + components * (size_of::<Instance>() + COMPONENT);
    let needed = count.checked_mul(each).ok_or_else(too_many)?;
    // Freed immediately; it only tests whether so much memory is available.
    Vec::<u8>::new().try_reserve_exact(needed).map_err(|_| too_many())?;
    all.resize_with(count, || One { instance: None, error: None, own: Own::default() });
    Ok(all)
}

fn check_size(size: f64) -> Result<(), Error> {
    if size.is_finite() && size > 0.0 {
        return Ok(());
    }
    request(format!("the size of a step is {size} s; it must be above 0 and finite"))
}

/// Initializes an instance: from the start values to the first step.
fn initialize(
    instance: &mut Running,
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

/// Calls `body` for each instance in the mask.
fn each(threads: &mut Option<Threads>, all: &mut [One], mask: Mask, body: impl Fn(usize, &mut One) + Sync) {
    if let Some(mask) = mask {
        assert_eq!(mask.len(), all.len(), "a Boolean for each instance");
    }
    in_parts(threads, all, 0, &mut [], |index, one, _| {
        if mask.is_none_or(|mask| mask[index]) {
            body(index, one);
        }
    });
}

/// Calls `body` for each instance and its row of `length` values. This thread and each thread of the pool get
/// a part of the instances.
fn in_parts(
    threads: &mut Option<Threads>,
    all: &mut [One],
    length: usize,
    values: &mut [f64],
    body: impl Fn(usize, &mut One, &mut [f64]) + Sync,
) {
    let work = |first: usize, all: &mut [One], values: &mut [f64]| {
        let mut rows = values.chunks_exact_mut(length.max(1));
        for (k, one) in all.iter_mut().enumerate() {
            body(first + k, one, rows.next().unwrap_or_default());
        }
    };
    if let Some(of_parent) = threads.take_if(|threads| !threads.are_here()) {
        // Without threads, this one does all the work.
        *threads = Threads::new(of_parent.count()).ok();
    }
    let Some(threads) = threads else { return work(0, all, values) };
    let part = all.len().div_ceil(threads.count() + 1);
    let (own, others) = all.split_at_mut(part);
    let (own_values, mut rest) = values.split_at_mut(part * length);
    let others = others.chunks_mut(part).enumerate().map(|(number, others)| {
        let (now, after) = std::mem::take(&mut rest).split_at_mut(others.len() * length);
        rest = after;
        let work = &work;
        move || work((number + 1) * part, others, now)
    });
    threads.share(|| work(0, own, own_values), others);
}

/// Returns the row of an instance, from a row for each instance or one row for all.
fn rows<'v>(values: &'v [f64], length: usize, instances: usize) -> impl Fn(usize) -> &'v [f64] {
    let each = values.len() == length * instances;
    assert!(
        each || values.len() == length,
        "{} values are not a row of {length} for one or {instances} instances",
        values.len()
    );
    move |index| &values[if each { index * length } else { 0 }..][..length]
}

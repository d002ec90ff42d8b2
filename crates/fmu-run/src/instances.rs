//! Instances of an FMU in the hand: set, stepped, read, put back, side by side.

use crate::description::Description;
use crate::error::{Error, request};
use crate::instance::{Continuous, Event, Instance, Saved};
use crate::refusal::Refusal;
use crate::running::Running;
use crate::selection::{Place, Selection};
use crate::start::{Start, StartValues};
use crate::system::System;
use fmi_abi::{BaseType, Interface};

/// How instances are made.
#[derive(Clone, Debug)]
pub struct Setup<'a> {
    /// Who integrates.
    pub interface: Interface,
    /// How many.
    pub count: usize,
    /// Start values.
    pub start: Vec<(&'a str, Start<'a>)>,
    /// When they begin, s.
    pub start_time: f64,
    /// When they will end, s, if that is known; the FMU may refuse to go further.
    pub stop_time: Option<f64>,
    /// How many threads; `None` takes as many as the machine has processors.
    pub threads: Option<usize>,
}

impl Default for Setup<'_> {
    /// One instance for Co-Simulation, from 0 s.
    fn default() -> Self {
        Self {
            interface: Interface::CoSimulation,
            count: 1,
            start: Vec::new(),
            start_time: 0.0,
            stop_time: None,
            threads: Some(1),
        }
    }
}

/// Instances of one FMU, each with its time. Every method does the same with all of them, in their threads; rows of values are
/// one after the other: instances times variables, the last fastest.
///
/// An instance that is refused something drops out: [`errors`](Self::errors) tells why, what is read of it is not a number,
/// the others go on. [`reset`](Self::reset) and [`restore`](Self::restore) bring it back.
#[derive(Debug)]
pub struct Instances {
    system: System,
    interface: Interface,
    all: Vec<One>,
    begin: Begin,
    pool: Option<rayon::ThreadPool>,
}

#[derive(Debug)]
struct Begin {
    start: StartValues<'static>,
    time: f64,
    stop_time: Option<f64>,
}

#[derive(Debug)]
struct One {
    /// None after it was lost for good.
    instance: Option<Running>,
    /// Why it dropped out.
    error: Option<String>,
    own: Own,
}

/// What is known of an instance.
#[derive(Debug, Default)]
struct Own {
    time: f64,
    event: Event,
}

/// States that [`Instances`] have saved, one for each that had not dropped out. They are places among
/// their own, not pointers: what is freed is given away, and those of others lead to none or to another state of one's own.
///
/// ```compile_fail,E0382
/// fn restore_what_is_freed(instances: &mut fmu_run::Instances) {
///     let states = instances.save().unwrap();
///     instances.forget(states);
///     instances.restore(&states, None);
/// }
/// ```
#[derive(Debug, PartialEq)]
pub struct States(Vec<Option<(Saved, f64)>>);

/// Which of the instances a call is for: all, or those that are true.
pub type Mask<'a> = Option<&'a [bool]>;

impl System {
    /// Makes instances, sets their start values and initializes them. Those for Model Exchange have been through the events at
    /// the begin and are in Continuous-Time Mode.
    ///
    /// # Errors
    /// [`Error::Request`] when what is asked for does not fit the FMU, [`Error::Fmu`] when it does not have this type of
    /// interface, or makes no instances.
    pub fn instances(&self, setup: &Setup) -> Result<Instances, Error> {
        self.check_interface(setup.interface)?;
        if setup.count == 0 {
            return request("count must be at least 1".to_owned());
        }
        if setup.count > 1 && self.once_per_process(setup.interface) {
            return request(format!(
                "{} can be there only once in a process (canBeInstantiatedOnlyOncePerProcess)",
                self.name()
            ));
        }
        let start = StartValues::of(self, &[])?;
        let all = empty(setup.count, self.parts().len())?;
        let threads = self.threads(setup.interface, setup.threads)?.min(setup.count);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads - 1);
        let pool = (threads > 1).then(|| pool.build()).transpose();
        let mut instances = Instances {
            system: self.clone(),
            interface: setup.interface,
            all,
            begin: Begin { start, time: setup.start_time, stop_time: setup.stop_time },
            pool: pool.map_err(|error| Error::Fmu(format!("no threads can be made: {error}")))?,
        };
        instances.start_from(&setup.start)?;
        instances.reset(None);
        match instances.none_left() {
            Some(why) => Err(Error::Fmu(why.to_owned())),
            None => Ok(instances),
        }
    }
}

impl Instances {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Who integrates.
    pub fn interface(&self) -> Interface {
        self.interface
    }

    /// What they are instances of.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// The time of each, s.
    pub fn times(&self) -> impl Iterator<Item = f64> {
        self.all.iter().map(|one| one.own.time)
    }

    /// Those that have dropped out, and why.
    pub fn errors(&self) -> impl Iterator<Item = (usize, &str)> {
        self.all.iter().enumerate().filter_map(|(place, one)| Some((place, one.error.as_deref()?)))
    }

    /// Why there is none left, if all have dropped out.
    pub fn none_left(&self) -> Option<&str> {
        let all = self.all.iter().all(|one| one.error.is_some());
        self.all.first().filter(|_| all).and_then(|one| one.error.as_deref())
    }

    /// What the last event of each did.
    pub fn events(&self) -> impl Iterator<Item = Event> {
        self.all.iter().map(|one| one.own.event)
    }

    /// New start values, for the next [`reset`](Self::reset), in place of those of the same variables.
    ///
    /// # Errors
    /// [`Error::Request`] when a variable is not there, or the values do not fit it or the number of instances.
    pub fn start_from(&mut self, start: &[(&str, Start)]) -> Result<(), Error> {
        for (name, values) in start {
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

    /// Back to the start values, initialized.
    pub fn reset(&mut self, mask: Mask) {
        let (system, interface, begin) = (&self.system, self.interface, &self.begin);
        let reset = |place: usize, one: &mut One| {
            one.error = None;
            (one.own.time, one.own.event) = (begin.time, Event::default());
            match Running::renewed(one.instance.take(), system, interface, false) {
                Ok(instance) => {
                    let instance = one.instance.insert(instance);
                    match initialize(instance, begin, place, interface) {
                        Ok(event) => one.own.event = event,
                        Err(refusal) => one.error = Some(refusal.to_string()),
                    }
                }
                Err((text, _)) => one.error = Some(text),
            }
        };
        each(self.pool.as_ref(), &mut self.all, mask, reset);
    }

    /// Sets variables, from a row for each instance or from one row for all.
    ///
    /// # Errors
    /// [`Error::Request`] when a variable is read-only, an integer or a Boolean cannot have its value, or an output feeds one of
    /// them.
    ///
    /// # Panics
    /// When there are other than so many values.
    pub fn set(&mut self, variables: &Selection, values: &[f64], mask: Mask) -> Result<(), Error> {
        variables.check(values)?;
        let rows = rows(variables.len(), values.len(), self.len());
        self.alive(mask, |place, _, instance| instance.set(variables, rows.of(values, place)));
        Ok(())
    }

    /// Reads variables into a row for each instance.
    ///
    /// # Panics
    /// When there is room for another number of values.
    pub fn get(&mut self, variables: &Selection, values: &mut [f64]) {
        self.fill(variables.len(), values, |instance, row| instance.get(variables, row));
    }

    /// Steps of Co-Simulation of this size, s.
    ///
    /// # Errors
    /// [`Error::Request`] when the size is not above 0 and finite.
    pub fn step(&mut self, size: f64, mask: Mask) -> Result<(), Error> {
        check_size(size)?;
        self.alive(mask, |_, own, instance| {
            instance.step(own.time, size)?;
            own.time += size;
            Ok(())
        });
        Ok(())
    }

    /// Steps of Co-Simulation to this time, s.
    ///
    /// # Errors
    /// [`Error::Request`] when the time is not finite, or not after the time of an instance.
    pub fn step_to(&mut self, time: f64, mask: Mask) -> Result<(), Error> {
        let steps = |place: usize, one: &One| one.error.is_none() && mask.is_none_or(|mask| mask[place]);
        let mut ahead = self.all.iter().enumerate().filter(|(place, one)| steps(*place, one));
        if let Some((place, one)) = ahead.find(|(_, one)| !(time.is_finite() && time > one.own.time)) {
            return request(format!(
                "to is {time} s; it must be after the time of each instance, and instance {place} is at {} s",
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

    /// Sets variables, steps and reads others: [`set`](Self::set), [`step`](Self::step) and [`get`](Self::get) in one go of the
    /// threads.
    ///
    /// # Errors
    /// As [`set`](Self::set) and [`step`](Self::step).
    ///
    /// # Panics
    /// As they do.
    pub fn advance(
        &mut self,
        (set, values): (&Selection, &[f64]),
        size: f64,
        (get, read): (&Selection, &mut [f64]),
    ) -> Result<(), Error> {
        set.check(values)?;
        check_size(size)?;
        let rows = rows(set.len(), values.len(), self.len());
        self.fill_by_place(get.len(), read, |place, own, instance, row| {
            instance.set(set, rows.of(values, place))?;
            instance.step(own.time, size)?;
            own.time += size;
            instance.get(get, row)
        });
        Ok(())
    }

    /// Saves the state of each.
    ///
    /// # Errors
    /// [`Error::Request`] when the FMU does not offer it.
    pub fn save(&mut self) -> Result<States, Error> {
        let why = "cannot save its state (canGetAndSetFMUstate is not true)";
        self.system.check_offer(self.interface, |offer| offer.saves_states, why)?;
        let mut states = vec![None; self.len()];
        let places = std::sync::Mutex::new(&mut states);
        self.alive(None, |place, own, instance| {
            let saved = (instance.save()?, own.time);
            places.lock().unwrap_or_else(std::sync::PoisonError::into_inner)[place] = Some(saved);
            Ok(())
        });
        Ok(States(states))
    }

    /// Back to states that they have saved.
    ///
    /// # Panics
    /// When the states are of another number of instances.
    pub fn restore(&mut self, states: &States, mask: Mask) {
        assert_eq!(states.0.len(), self.len(), "states of other instances");
        let back = |place: usize, one: &mut One| {
            let (Some((saved, time)), Some(instance)) = (states.0[place], &mut one.instance) else { return };
            match instance.restore(saved) {
                Ok(()) => (one.own.time, one.error) = (time, None),
                Err(refusal) => one.error = Some(refusal.to_string()),
            }
        };
        each(self.pool.as_ref(), &mut self.all, mask, back);
    }

    /// Frees states.
    pub fn forget(&mut self, states: States) {
        for (one, saved) in self.all.iter_mut().zip(states.0) {
            if let (Some((saved, _)), Some(instance)) = (saved, &mut one.instance) {
                _ = instance.forget(saved);
            }
        }
    }

    /// Saved states as bytes, which another process can read; `None` if an instance had none, or its FMU refuses.
    ///
    /// # Errors
    /// [`Error::Request`] when the FMU does not offer it.
    pub fn serialize(&mut self, states: &States) -> Result<Vec<Option<Vec<u8>>>, Error> {
        let why = "cannot serialize its state (canSerializeFMUstate is not true)";
        self.system.check_offer(self.interface, |offer| offer.serializes_states, why)?;
        let bytes = self.all.iter_mut().zip(&states.0).map(|(one, saved)| {
            let ((saved, time), instance) = (saved.as_ref()?, one.instance.as_mut()?);
            match instance.serialize(*saved) {
                Ok(bytes) => Some([&time.to_le_bytes()[..], &bytes].concat()),
                Err(refusal) => {
                    one.error = Some(refusal.to_string());
                    None
                }
            }
        });
        Ok(bytes.collect())
    }

    /// States that were [serialized](Self::serialize), one for each instance, or none.
    ///
    /// # Errors
    /// [`Error::Request`] when there are other than so many, [`Error::Fmu`] when an instance refuses one.
    pub fn deserialize(&mut self, bytes: &[Option<impl AsRef<[u8]>>]) -> Result<States, Error> {
        if bytes.len() != self.len() {
            return request(format!("there are {} states for {} instances", bytes.len(), self.len()));
        }
        let why = "cannot deserialize a state (canSerializeFMUstate is not true)";
        self.system.check_offer(self.interface, |offer| offer.serializes_states, why)?;
        let mut states = Vec::new();
        for (place, (one, bytes)) in self.all.iter_mut().zip(bytes).enumerate() {
            let Some(bytes) = bytes else {
                states.push(None);
                continue;
            };
            let Some((time, bytes)) = bytes.as_ref().split_first_chunk() else {
                return request(format!("the state of instance {place} is cut short"));
            };
            let instance = one.instance.as_mut();
            let read = instance.map(|instance| instance.deserialize(bytes)).transpose();
            let saved = read.map_err(|refusal| Error::Fmu(format!("instance {place}: {refusal}")))?;
            states.push(saved.map(|saved| (saved, f64::from_le_bytes(*time))));
        }
        Ok(States(states))
    }

    /// The derivatives of unknowns in the direction of a seed: a row of the knowns for each instance, or one for all.
    ///
    /// # Errors
    /// [`Error::Request`] unless all variables are Real, and each known is an input, a parameter or a continuous state.
    ///
    /// # Panics
    /// As [`set`](Self::set) and [`get`](Self::get).
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
        let rows = rows(knowns.len(), seed.len(), self.len());
        self.fill_by_place(unknowns.len(), values, |place, _, instance, row| {
            instance.sole().directional_derivative(unknown, known, rows.of(seed, place), row)
        });
        Ok(())
    }

    /// In Co-Simulation: time derivatives of inputs, of order 1, which only FMI 2.0 has.
    ///
    /// # Errors
    /// [`Error::Request`] unless all variables are Real inputs of an FMU that takes input derivatives.
    ///
    /// # Panics
    /// As [`set`](Self::set).
    pub fn set_input_derivatives(
        &mut self,
        inputs: &Selection,
        values: &[f64],
        mask: Mask,
    ) -> Result<(), Error> {
        let (references, orders) = (self.real(inputs)?, vec![1; inputs.len()]);
        inputs.names().iter().try_for_each(|name| self.system.takes_input_derivative(name).map(drop))?;
        let rows = rows(inputs.len(), values.len(), self.len());
        self.alive(mask, |place, _, instance| {
            instance.sole().set_input_derivatives(references, &orders, rows.of(values, place))
        });
        Ok(())
    }

    /// In Co-Simulation: time derivatives of outputs, of order 1, into a row for each instance.
    ///
    /// # Errors
    /// [`Error::Request`] unless all variables are Real.
    ///
    /// # Panics
    /// As [`get`](Self::get).
    pub fn get_output_derivatives(&mut self, outputs: &Selection, values: &mut [f64]) -> Result<(), Error> {
        let (references, orders) = (self.real(outputs)?, vec![1; outputs.len()]);
        self.fill(outputs.len(), values, |instance, row| {
            instance.sole().get_output_derivatives(references, &orders, row)
        });
        Ok(())
    }

    /// In Model Exchange: the time, s, one for each or for all.
    ///
    /// # Errors
    /// [`Error::Request`] when a time is not finite.
    ///
    /// # Panics
    /// When there are other than so many values.
    pub fn set_time(&mut self, times: &[f64], mask: Mask) -> Result<(), Error> {
        if let Some(time) = times.iter().find(|time| !time.is_finite()) {
            return request(format!("time is {time}; it must be finite"));
        }
        let rows = rows(1, times.len(), self.len());
        self.alive(mask, |place, own, instance| {
            own.time = rows.of(times, place)[0];
            instance.sole().set_time(own.time)
        });
        Ok(())
    }

    /// In Model Exchange: the continuous states, a row for each or for all.
    ///
    /// # Panics
    /// When there are other than so many values.
    pub fn set_continuous_states(&mut self, values: &[f64], mask: Mask) {
        let rows =
            rows(self.description().map_or(0, |description| description.states), values.len(), self.len());
        self.alive(mask, |place, _, instance| instance.sole().set_continuous_states(rows.of(values, place)));
    }

    /// In Model Exchange: states, their derivatives or nominal values, or event indicators, a row for each.
    ///
    /// # Panics
    /// When there is room for another number of values.
    pub fn get_continuous(&mut self, what: Continuous, values: &mut [f64]) {
        self.fill(self.continuous(what), values, |instance, row| instance.sole().get_continuous(what, row));
    }

    /// How many there are of these.
    pub fn continuous(&self, what: Continuous) -> usize {
        self.description().map_or(0, |description| match what {
            Continuous::EventIndicators => description.event_indicators,
            _ => description.states,
        })
    }

    /// In Model Exchange: an event, with all its rounds, and back to Continuous-Time Mode. [`events`](Self::events) tells what
    /// it did. In Event Mode, before its rounds, variables are set from a row for each or for all.
    ///
    /// # Errors
    /// As [`set`](Self::set).
    ///
    /// # Panics
    /// As [`set`](Self::set).
    pub fn handle_events(&mut self, (set, values): (&Selection, &[f64]), mask: Mask) -> Result<(), Error> {
        set.check(values)?;
        let rows = rows(set.len(), values.len(), self.len());
        self.alive(mask, |place, own, instance| {
            instance.sole().enter_event_mode()?;
            instance.set(set, rows.of(values, place))?;
            own.event = instance.sole().event()?;
            instance.sole().enter_continuous_time_mode()
        });
        Ok(())
    }

    /// In Model Exchange: a step of the integrator is complete. Whether each wants an event and the end, one after the other,
    /// into `wanted`.
    ///
    /// # Panics
    /// When there is no room for two values of each.
    pub fn completed_integrator_step(&mut self, wanted: &mut [f64]) {
        self.fill(2, wanted, |instance, row| {
            row.copy_from_slice(
                &instance.sole().completed_integrator_step()?.map(|wanted| f64::from(u8::from(wanted))),
            );
            Ok(())
        });
    }

    /// Of the one FMU.
    fn description(&self) -> Option<&Description> {
        self.system.sole().map(|fmu| &fmu.description)
    }

    /// The value references of Real variables of the one FMU.
    fn real<'s>(&self, variables: &'s Selection) -> Result<&'s [u32], Error> {
        let why = "only Real variables have derivatives, of one FMU and not of a system";
        let references = self.system.sole().and_then(|_| variables.references());
        references.ok_or_else(|| Error::Request(why.to_owned()))
    }

    /// The text of a variable in each; none of those that have dropped out.
    ///
    /// # Errors
    /// [`Error::Request`] when the variable is not there or no text.
    pub fn texts(&mut self, name: &str) -> Result<Vec<Option<String>>, Error> {
        let found = self.system.find_first(name)?;
        if found.of.base != BaseType::String {
            return request(format!("{name} is {}, no text", found.of.what()));
        }
        let place = Place::of(found);
        let mut texts = vec![None; self.len()];
        for (one, text) in self.all.iter_mut().zip(&mut texts) {
            one.with(|_, instance| instance.get_text(place).map(|found| *text = Some(found)));
        }
        Ok(texts)
    }

    /// With those that have not dropped out; a refusal is why one does.
    fn alive(
        &mut self,
        mask: Mask,
        body: impl Fn(usize, &mut Own, &mut Running) -> Result<(), Refusal> + Sync,
    ) {
        each(self.pool.as_ref(), &mut self.all, mask, |place, one| {
            one.with(|own, instance| body(place, own, instance));
        });
    }

    fn fill(
        &mut self,
        length: usize,
        values: &mut [f64],
        body: impl Fn(&mut Running, &mut [f64]) -> Result<(), Refusal> + Sync,
    ) {
        self.fill_by_place(length, values, |_, _, instance, row| body(instance, row));
    }

    /// A row of values of each; not a number of those that have dropped out.
    fn fill_by_place(
        &mut self,
        length: usize,
        values: &mut [f64],
        body: impl Fn(usize, &mut Own, &mut Running, &mut [f64]) -> Result<(), Refusal> + Sync,
    ) {
        assert_eq!(values.len(), length * self.all.len(), "a row of {length} values for each instance");
        let body = |place: usize, one: &mut One, row: &mut [f64]| {
            if !one.with(|own, instance| body(place, own, instance, row)) {
                row.fill(f64::NAN);
            }
        };
        in_parts(self.pool.as_ref(), &mut self.all, length, values, body);
    }
}

impl One {
    /// Whether it has not dropped out, and does not by this.
    #[inline]
    fn with(&mut self, body: impl FnOnce(&mut Own, &mut Running) -> Result<(), Refusal>) -> bool {
        let Self { instance: Some(instance), error: error @ None, own } = self else { return false };
        if let Err(refusal) = body(own, instance) {
            *error = Some(format!("at {} s: {refusal}", own.time));
            return false;
        }
        true
    }
}

/// Room for so many instances of a system with so many components, if there is memory for them and for what they point to.
fn empty(count: usize, parts: usize) -> Result<Vec<One>, Error> {
    /// At least what a component of an instance takes besides: the allocations of its FMU and of its log.
    const COMPONENT: usize = 256;
    let too_many = || Error::Memory(format!("{count} instances need more memory than there is"));
    let mut all = Vec::new();
    all.try_reserve_exact(count).map_err(|_| too_many())?;
    let each = size_of::<Running>() + parts * (size_of::<Instance>() + COMPONENT);
    let needed = count.checked_mul(each).ok_or_else(too_many)?;
    // Freed at once; what it shows is that the system would give so much.
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

/// From the start values to the first step.
fn initialize(
    instance: &mut Running,
    begin: &Begin,
    place: usize,
    interface: Interface,
) -> Result<Event, Refusal> {
    instance.begin(begin.time, begin.stop_time, &begin.start, place)?;
    instance.exit_initialization_mode()?;
    let mut event = Event::default();
    if interface == Interface::ModelExchange {
        event = instance.sole().event()?;
        instance.sole().enter_continuous_time_mode()?;
    }
    Ok(event)
}

/// Each of those that the mask has.
fn each(
    pool: Option<&rayon::ThreadPool>,
    all: &mut [One],
    mask: Mask,
    body: impl Fn(usize, &mut One) + Sync,
) {
    if let Some(mask) = mask {
        assert_eq!(mask.len(), all.len(), "a truth value for each instance");
    }
    in_parts(pool, all, 0, &mut [], |place, one, _| {
        if mask.is_none_or(|mask| mask[place]) {
            body(place, one);
        }
    });
}

/// Each with its row of so many values, in as many parts as there are threads: one here, one in each thread of the pool.
fn in_parts(
    pool: Option<&rayon::ThreadPool>,
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
    let Some(pool) = pool else { return work(0, all, values) };
    let part = all.len().div_ceil(pool.current_num_threads() + 1);
    // What waits in another thread needs time to wake; this one is awake.
    pool.in_place_scope(|scope| {
        let (own, others) = all.split_at_mut(part);
        let (own_values, other_values) = values.split_at_mut(part * length);
        let mut rest = other_values;
        for (number, others) in others.chunks_mut(part).enumerate() {
            let (now, after) = std::mem::take(&mut rest).split_at_mut(others.len() * length);
            rest = after;
            let work = &work;
            scope.spawn(move |_| work((number + 1) * part, others, now));
        }
        work(0, own, own_values);
    });
}

/// A row for each instance, or one for all.
#[derive(Clone, Copy)]
struct Rows {
    length: usize,
    step: usize,
}

fn rows(length: usize, values: usize, instances: usize) -> Rows {
    let each = values == length * instances;
    assert!(
        each || values == length,
        "{values} values are no row of {length} for one or {instances} instances"
    );
    Rows { length, step: if each { length } else { 0 } }
}

impl Rows {
    #[inline]
    fn of(self, values: &[f64], place: usize) -> &[f64] {
        &values[place * self.step..place * self.step + self.length]
    }
}

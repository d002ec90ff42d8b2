//! Checks with random histories that calls which failed or were undone do not change any later result of an instance.
//!
//! A history is a random sequence of calls, many of which fail. It also saves, restores and serializes states, resets the
//! instance, and continues in a copy. The *path* contains the calls that led to the current state: a call that failed is
//! not added, a restored state restores its path, and a reset empties the path. A fresh instance that makes only the calls
//! of the path must return the same bits from every getter, also after further calls.

use crate::checks::{inputs, outputs};
use crate::either::Version;
use crate::serialized::{MODE, fnv1a, time};
use crate::{Arguments, Either, Importer, Random, fmi3};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::{self, *};
use fmu_export::{Attributes, BaseType, Causality, Exported, Setup, Standard, Status, Value, Variable};
use std::ffi::{CStr, CString};
use std::marker::PhantomData;
use std::ptr::null_mut;

/// Number of seeds for each interface type, each with one history in FMI 2.0 and two in FMI 3.0; fewer under Miri, which is
/// slow.
const HISTORIES: u64 = if cfg!(miri) { 1 } else { 6 };
/// Number of calls in a history.
const CALLS: usize = 60;
/// Number of further calls when an instance is compared with a fresh one.
const FOLLOWING: usize = 6;

/// A call that changes an instance.
#[derive(Clone, Debug, PartialEq)]
enum Call {
    Real(u32, f64),
    Integer(u32, i32),
    Item(u32, i32),
    Boolean(u32, u8),
    String(u32, CString),
    Rate(u32, f64),
    SetUp(f64),
    EnterInitialization(f64),
    ExitInitialization,
    Step(f64),
    EnterStepMode,
    EnterEventMode,
    Update,
    EnterContinuousTime,
    Advance(f64),
    States(Vec<f64>),
    StepCompleted,
    Terminate,
}

/// Arguments of each instantiation, the start values of the model, and whether histories continue in copies.
struct Context<'a> {
    arguments: Arguments<'a>,
    starts: Vec<Option<Value>>,
    with_copies: bool,
}

/// Calls, each with its status.
type Path = Vec<(Call, Status)>;

/// A saved state, and the path to it.
struct Saved {
    handle: usize,
    path: Path,
}

/// An instance with the path to its state.
struct Tracked<F, M> {
    fmu: F,
    path: Path,
    saved: Vec<Saved>,
    model: PhantomData<fn() -> M>,
}

/// Everything that an importer can read, as statuses and bits, and the serialized state.
type Readings = (Vec<(Status, u64)>, Option<Vec<u8>>);

impl<F: Either, M: Exported> Tracked<F, M> {
    fn new(context: &Context) -> Self {
        let fmu = F::make::<M>(&context.arguments).expect("an instance");
        Self { fmu, path: Vec::new(), saved: Vec::new(), model: PhantomData }
    }

    /// Returns the mode; `None` if the state cannot be serialized because a number in it is not finite.
    fn mode(&self) -> Option<Mode> {
        let bytes = self.serialized()?;
        let number = i64::from_le_bytes(bytes[MODE].try_into().expect("8 bytes"));
        Some(Mode::from_number(number).expect("a mode"))
    }

    fn serialized(&self) -> Option<Vec<u8>> {
        let mut state = null_mut();
        self.fmu.ok(self.fmu.get_state(&mut state));
        let mut size = 0;
        self.fmu.ok(self.fmu.state_size(state, &mut size));
        let mut bytes = vec![0; size];
        let status = self.fmu.serialize_into(state, bytes.as_mut_ptr(), size);
        self.fmu.forget(state);
        (status == Status::Ok).then_some(bytes)
    }

    fn set(&self, call: &Call) -> Status {
        match call {
            Call::Real(index, value) => self.fmu.try_set(&[*index], &[*value]),
            Call::Integer(index, value) => self.fmu.set_integer(*index, *value),
            Call::Item(index, value) => self.fmu.set_item(*index, *value),
            Call::Boolean(index, value) => self.fmu.set_boolean(*index, *value),
            Call::String(index, value) => self.fmu.set_string(*index, value.as_ptr()),
            other => unreachable!("{other:?} sets no value"),
        }
    }

    fn make(&self, call: &Call) -> Status {
        let now = || self.serialized().map_or(0.0, |bytes| time(&bytes));
        let status = |failed: Option<Status>| failed.unwrap_or(Status::Ok);
        match call {
            Call::Rate(index, value) => match self.fmu.version() {
                Version::Fmi2(fmu) => fmu.fmi2SetRealInputDerivatives(index, 1, &1, value),
                Version::Fmi3(_) => Status::Error,
            },
            Call::SetUp(start) => match self.fmu.version() {
                Version::Fmi2(fmu) => fmu.fmi2SetupExperiment(0, 0.0, *start, 0, 0.0),
                Version::Fmi3(_) => Status::Error,
            },
            // FMI 2.0 sets the start time with a separate function, see `SetUp`.
            Call::EnterInitialization(start) => match self.fmu.version() {
                Version::Fmi2(fmu) => fmu.fmi2EnterInitializationMode(),
                Version::Fmi3(fmu) => fmu.fmi3EnterInitializationMode(0, 0.0, *start, 0, 0.0),
            },
            Call::ExitInitialization => self.fmu.exit_initialization_mode(),
            Call::Step(size) => self.fmu.try_step(now(), *size),
            Call::EnterStepMode => match self.fmu.version() {
                Version::Fmi2(_) => Status::Error,
                Version::Fmi3(fmu) => fmu.fmi3EnterStepMode(),
            },
            Call::EnterEventMode => self.fmu.enter_event_mode(),
            Call::Update => status(self.fmu.try_update().err()),
            Call::EnterContinuousTime => self.fmu.enter_continuous_time_mode(),
            Call::Advance(duration) => self.fmu.set_time(now() + duration),
            Call::States(states) => self.fmu.set_states(states.as_ptr(), states.len()),
            Call::StepCompleted => status(self.fmu.try_completed_step().err()),
            Call::Terminate => self.fmu.terminate(),
            set => self.set(set),
        }
    }

    /// Makes a call, and adds it to the path if it succeeds. Asserts that a call that fails changes nothing.
    fn attempt(&mut self, random: &mut Random, call: Call, context: &Context) -> Status {
        let (mode, before) = (self.mode(), self.serialized());
        let status = self.make(&call);
        // In FMI 2.0, a step that ends early returns fmi2Discard, and it changes the state.
        let ended_early = status == Status::Discard && F::standard() == Standard::Fmi2;
        match status {
            Status::Fatal => panic!("{call:?} is fatal: {:?}", self.fmu.take_log()),
            Status::Ok => self.path.push((call, status)),
            _ if ended_early => self.path.push((call, status)),
            _ => {
                assert!(self.serialized() == before, "{call:?} failed and changed the state");
                if matches!(mode, Some(Instantiated | Initialization)) {
                    self.set_again(random, &call, context);
                }
            }
        }
        self.fmu.take_log();
        status
    }

    /// Sets a valid start value after a rejected one, because an instance remembers that a start value was rejected.
    fn set_again(&mut self, random: &mut Random, rejected: &Call, context: &Context) {
        let (Call::Real(index, _)
        | Call::Integer(index, _)
        | Call::Item(index, _)
        | Call::Boolean(index, _)
        | Call::String(index, _)) = *rejected
        else {
            return;
        };
        for _ in 0..20 {
            let valid = value::<M>(random, index, 0.0, context);
            if let Some(call) = valid
                && self.set(&call) == Status::Ok
            {
                self.path.push((call, Status::Ok));
                return;
            }
        }
        self.reset();
    }

    fn reset(&mut self) {
        self.fmu.ok(self.fmu.reset());
        self.path.clear();
    }

    /// Saves the state, sometimes over an earlier saved state.
    fn save(&mut self, random: &mut Random) {
        let reused = if random.chance(0.3) { self.saved.pop().map(|saved| saved.handle) } else { None };
        let mut state = std::ptr::without_provenance_mut(reused.unwrap_or(0));
        self.fmu.ok(self.fmu.get_state(&mut state));
        self.saved.push(Saved { handle: state.addr(), path: self.path.clone() });
    }

    /// Restores one of the saved states if there are any, and sometimes frees it.
    fn restore(&mut self, random: &mut Random) {
        if self.saved.is_empty() {
            return;
        }
        let index = random.below(self.saved.len());
        let Saved { handle, path } = &self.saved[index];
        self.fmu.ok(self.fmu.set_state(std::ptr::without_provenance_mut(*handle)));
        self.path.clone_from(path);
        if random.chance(0.3) {
            let Saved { handle, .. } = self.saved.swap_remove(index);
            self.fmu.forget(std::ptr::without_provenance_mut(handle));
        }
    }

    /// Returns an instance that continues from the serialized state of this one, or a fresh one if the state cannot be
    /// serialized.
    fn copy(&self, context: &Context) -> Self {
        let mut copy = Self { path: self.path.clone(), ..Self::new(context) };
        if let Some(bytes) = self.serialized() {
            copy.fmu.restore(&bytes);
        } else {
            copy.path.clear();
        }
        copy
    }

    /// Returns a fresh instance after the calls of the path. Asserts that their statuses are the same.
    fn replay_path(&self, context: &Context) -> Self {
        let fresh = Self { path: self.path.clone(), ..Self::new(context) };
        for (call, status) in &self.path {
            assert_eq!(fresh.make(call), *status, "{call:?} of {:?}\n{:?}", self.path, fresh.fmu.take_log());
        }
        fresh
    }

    /// Reads all values, the partial derivatives of outputs with respect to inputs, and the serialized state.
    fn readings(&self) -> Readings {
        let values = (0..).zip(M::TABLE).map(|(index, variable)| {
            let (mut real, mut integer, mut boolean, mut string) = (0.0, 0, 0, c"".as_ptr());
            let fmu = &self.fmu;
            match variable.base() {
                BaseType::Real => (fmu.try_get(&[index], std::slice::from_mut(&mut real)), real.to_bits()),
                BaseType::Integer => (fmu.get_integer(index, &mut integer), integer as u64),
                BaseType::Enumeration => (fmu.get_item(index, &mut integer), integer as u64),
                BaseType::Boolean => (fmu.get_boolean(index, &mut boolean), boolean.into()),
                BaseType::String => {
                    let status = fmu.get_string(index, &mut string);
                    // SAFETY: the FMU's string is valid until the next call.
                    let hash = fnv1a(unsafe { CStr::from_ptr(string) }.to_bytes());
                    (status, u64::from_le_bytes(hash))
                }
                _ => (Status::Ok, 0),
            }
        });
        let derivatives = inputs::<M>().into_iter().flat_map(|known| {
            outputs::<M>().into_iter().map(move |unknown| {
                let mut partial = 0.0;
                let status = self.fmu.try_directional(
                    &[unknown],
                    &[known],
                    &[1.0],
                    std::slice::from_mut(&mut partial),
                );
                (status, partial.to_bits())
            })
        });
        let all = values.chain(derivatives);
        let readings =
            all.map(|(status, bits)| (status, if status == Status::Ok { bits } else { 0 })).collect();
        let readings = (readings, self.serialized());
        self.fmu.take_log();
        readings
    }

    /// Compares this instance with a fresh one after the calls of the path, now and after the same further calls. Restores
    /// the current state afterwards.
    fn compare(&mut self, random: &mut Random, context: &Context) {
        let fresh = self.replay_path(context);
        let label = || format!("{} after {:?}", M::INFO.name, self.path);
        assert_eq!(self.readings(), fresh.readings(), "{}", label());
        let path = self.path.clone();
        let mut state = null_mut();
        self.fmu.ok(self.fmu.get_state(&mut state));
        for _ in 0..FOLLOWING {
            let Some(call) = call::<M>(random, self.mode(), context) else { continue };
            let both = [self.make(&call), fresh.make(&call)];
            assert_eq!(both[0], both[1], "{call:?} of {path:?}: {:?}", self.fmu.take_log());
            assert_eq!(self.readings(), fresh.readings(), "{call:?} of {path:?}");
            fresh.fmu.take_log();
        }
        self.fmu.ok(self.fmu.set_state(state));
        self.fmu.forget(state);
        self.fmu.take_log();
    }
}

/// Draws a call that sets a variable to a value near its start value or, with the probability `extreme`, to an extreme or
/// invalid one. Returns `None` if the variable has no start value or [`Call`] has no setter for its type.
fn value<M: Exported>(random: &mut Random, index: u32, extreme: f64, context: &Context) -> Option<Call> {
    let variable = &M::TABLE[index as usize];
    let extreme = random.chance(extreme);
    Some(match (&variable.variable_type().attributes, context.starts[index as usize].clone()?) {
        (Attributes::Real { .. }, Value::Real(start)) if variable.base() == BaseType::Real => {
            let near =
                if start == 0.0 { random.between(-1.0, 1.0) } else { start * random.between(0.8, 1.25) };
            let far = [f64::NAN, f64::INFINITY, 1e300, -1e300, -start - 1.0, 1e9][random.below(6)];
            Call::Real(index, if extreme { far } else { near })
        }
        (Attributes::Integer { .. }, Value::Integer(start)) if variable.base() == BaseType::Integer => {
            let near = i32::try_from(start).ok()?.saturating_add(random.below(6) as i32);
            Call::Integer(index, if extreme { [i32::MIN, -1, i32::MAX][random.below(3)] } else { near })
        }
        (Attributes::Enumeration(items), _) => {
            let item = items[random.below(items.len())].value;
            Call::Item(index, if extreme { i32::MAX } else { item })
        }
        (Attributes::Boolean, _) => Call::Boolean(index, u8::from(random.chance(0.5))),
        (Attributes::String, Value::String(start)) => {
            let string = if random.chance(0.5) { start } else { format!("{start}{}", random.below(10)) };
            Call::String(index, CString::new(string).ok()?)
        }
        _ => return None,
    })
}

/// Draws a call that is usually allowed in this mode. Returns `None` if there is none, or if the mode is `None`.
fn call<M: Exported>(random: &mut Random, mode: Option<Mode>, context: &Context) -> Option<Call> {
    let some_of = |random: &mut Random, wanted: &dyn Fn(&Variable<M>) -> bool| {
        let all = crate::checks::indices::<M>(wanted);
        (!all.is_empty()).then(|| all[random.below(all.len())])
    };
    let is_input = |variable: &Variable<M>| variable.causality() == Causality::Input;
    let is_parameter = |variable: &Variable<M>| variable.causality() == Causality::Parameter;
    let settable = |variable: &Variable<M>| variable.has_start() || is_input(variable);
    if random.chance(0.1) {
        let index = some_of(random, &|_| true)?;
        return value::<M>(random, index, 0.5, context);
    }
    let near = M::INFO.default_experiment.step_size;
    match mode? {
        Instantiated | Initialization if random.chance(0.6) => {
            let index = some_of(random, &settable)?;
            value::<M>(random, index, 0.1, context)
        }
        Instantiated if random.chance(0.5) => Some(Call::SetUp([0.0, 0.0, 2.5, f64::NAN][random.below(4)])),
        Instantiated => Some(Call::EnterInitialization([0.0, 0.0, 2.5, f64::NAN][random.below(4)])),
        Initialization => Some(Call::ExitInitialization),
        StepComplete | Event | ContinuousTime if random.chance(0.35) => {
            let index = some_of(random, &is_input)?;
            value::<M>(random, index, 0.05, context)
        }
        StepComplete | Event | ContinuousTime if random.chance(0.15) => {
            let index = some_of(random, &is_parameter)?;
            value::<M>(random, index, 0.1, context)
        }
        StepComplete if M::INPUT_DERIVATIVES && random.chance(0.1) => {
            Some(Call::Rate(some_of(random, &is_input)?, random.between(-1.0, 1.0)))
        }
        StepComplete if random.chance(0.1) => Some(Call::EnterEventMode),
        StepComplete if random.chance(0.01) => Some(Call::Terminate),
        StepComplete => {
            let sizes = [1.0, 1.0, 1.0, 0.5, 2.0, 3.7, random.between(0.1, 30.0), 1e3, 1e300, -1.0, f64::NAN];
            Some(Call::Step(near * sizes[random.below(sizes.len())]))
        }
        Event => {
            Some([Call::Update, Call::EnterStepMode, Call::EnterContinuousTime][random.below(3)].clone())
        }
        ContinuousTime => Some(match random.below(4) {
            0 => Call::EnterEventMode,
            1 => Call::Advance(near * random.between(0.0, 20.0)),
            2 => Call::StepCompleted,
            _ => {
                let mut states: Vec<f64> = M::STATES.iter().map(|_| random.between(-1.0, 1.0)).collect();
                if random.chance(0.1) {
                    states.push(f64::NAN);
                }
                Call::States(states)
            }
        }),
        _ => None,
    }
}

/// Restores states that were saved with different parameters, in random order, and makes a step of the same size after each.
/// If a model did not discard values that it has stored for the other parameters, it would use them in this step.
fn parameters_in_turn<F: Either, M: Exported>(random: &mut Random, context: &Context) {
    let near = M::INFO.default_experiment.step_size;
    let mut tracked = Tracked::<F, M>::new(context);
    for _ in 0..2 {
        tracked.reset();
        for index in crate::checks::indices::<M>(|variable| variable.causality() == Causality::Parameter) {
            if let Some(call) = value::<M>(random, index, 0.0, context) {
                tracked.attempt(random, call, context);
            }
        }
        for call in [Call::EnterInitialization(0.0), Call::ExitInitialization] {
            tracked.attempt(random, call, context);
        }
        for _ in 0..8 {
            let call = match tracked.mode() {
                Some(Event) => call::<M>(random, Some(Event), context),
                Some(ContinuousTime) => Some(Call::Advance(near)),
                _ => Some(Call::Step(near)),
            };
            if let Some(call) = call {
                tracked.attempt(random, call, context);
            }
        }
        tracked.save(random);
    }
    for _ in 0..4 {
        tracked.restore(random);
        if tracked.mode() == Some(StepComplete) {
            tracked.attempt(random, Call::Step(near), context);
        }
        tracked.compare(random, context);
    }
}

/// Runs one random history with the calls that this seed determines.
fn history<F: Either, M: Exported>(seed: u64, context: &Context) {
    let mut random = Random::mixed(seed);
    parameters_in_turn::<F, M>(&mut random, context);
    let mut all = vec![Tracked::<F, M>::new(context)];
    for _ in 0..CALLS {
        let (number, count) = (random.below(all.len()), all.len());
        let tracked = &mut all[number];
        match random.below(100) {
            0..=3 => tracked.save(&mut random),
            4..=9 => tracked.restore(&mut random),
            10 => tracked.reset(),
            11..=13 if context.with_copies => *tracked = tracked.copy(context),
            14..=15 if context.with_copies && count < 3 => {
                let copy = tracked.copy(context);
                all.push(copy);
            }
            16..=20 => _ = tracked.readings(),
            21..=24 => tracked.compare(&mut random, context),
            _ => {
                if let Some(call) = call::<M>(&mut random, tracked.mode(), context) {
                    tracked.attempt(&mut random, call, context);
                } else if random.chance(0.5) {
                    tracked.restore(&mut random);
                } else {
                    tracked.reset();
                }
            }
        }
    }
    all.iter_mut().for_each(|tracked| tracked.compare(&mut random, context));
}

/// Random histories of a model in both FMI versions and all its interface types.
#[derive(Clone, Debug)]
pub struct Histories<'a> {
    /// Location of the resources, if the model reads files.
    pub resource_location: Option<&'a CStr>,
    /// Whether a history may continue in another instance, from a serialized state. Set it to false if the model counts
    /// the steps that do not use its `step_fast`, because the first step after a copy is one of them.
    pub with_copies: bool,
}

impl Default for Histories<'_> {
    fn default() -> Self {
        Self { resource_location: None, with_copies: true }
    }
}

impl Histories<'_> {
    /// Checks the histories of a model.
    ///
    /// # Panics
    /// Panics if an instance differs from a fresh one.
    pub fn check<M: Exported>(&self) {
        let offered =
            [(CoSimulation, M::CO_SIMULATION.is_some()), (ModelExchange, M::MODEL_EXCHANGE.is_some())];
        for (interface, _) in offered.into_iter().filter(|(_, is_offered)| *is_offered) {
            let location = self.resource_location.map(|location| location.to_string_lossy().into_owned());
            let setup = Setup { resource_location: location, ..Setup::new(interface) };
            let model = M::new(&setup).expect("a model");
            let context = |arguments| Context {
                arguments: Arguments { resource_location: self.resource_location, ..arguments },
                starts: M::TABLE.iter().map(|variable| variable.value(&model)).collect(),
                with_copies: self.with_copies,
            };
            let plain = context(Arguments::new::<M>(interface));
            let with_events = context(Arguments::with_events::<M>(interface));
            for seed in 0..HISTORIES {
                history::<Importer, M>(seed, &plain);
                history::<fmi3::Importer, M>(seed, &plain);
                history::<fmi3::Importer, M>(seed, &with_events);
            }
        }
    }
}

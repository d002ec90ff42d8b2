//! A fault-injecting importer for both FMI versions: it decodes bytes into calls on several instances, and
//! checks every result.
//!
//! After every call, the importer checks that the status is valid, and that the serialized state is unchanged if the call
//! was rejected or only reads. Values must be valid, nothing may be written after the end of an array, and messages must
//! be clean. Sometimes the importer restores the last saved state of an instance, in the same or in another instance,
//! and repeats all calls after the save. All results and the final state must then be bit-identical.
//!
//! The bytes come from [`random_bytes`] or from a fuzzer.

mod arguments;
mod call;
mod standards;

use crate::serialized::{fnv1a, sealed, time};
use crate::{Arguments, Importer, Message, Random};
use arbitrary::{Result, Unstructured};
pub use arguments::bases_of;
use arguments::{CallArguments, wrong_length};
pub use call::element_size;
use call::{Call, CallResult, has_handles};
use fmu_export::{Exported, Interface, Standard, Status};
pub use standards::Caller;
use std::collections::BTreeMap;
use std::ffi::{CString, c_void};
use std::marker::PhantomData;
use std::ptr::{null, null_mut};
use std::time::{Duration, Instant};

/// Number of calls of each function by status: OK, discarded, rejected.
pub type Tally = BTreeMap<&'static str, [u64; 3]>;

/// Decodes the bytes into calls, makes these calls and counts them.
///
/// # Panics
/// Panics at the first violated guarantee.
pub fn run<F: Caller, M: Exported>(bytes: &[u8], tally: &mut Tally) {
    session::<F, M>(&F::make::<M>, bytes, tally, None);
}

/// Makes the calls with these functions of a model in FMI 2.0. Returns strings with results and messages: one for each
/// instantiation, each call of a randomly chosen function, and each use of a saved state.
///
/// # Panics
/// Panics at the first violated guarantee.
pub fn record<M: Exported>(functions: crate::Functions, bytes: &[u8]) -> Vec<String> {
    let mut record = Vec::new();
    let make = |arguments: &Arguments| Importer::instantiate(functions, arguments);
    session::<Importer, M>(&make, bytes, &mut Tally::new(), Some(&mut record));
    record
}

fn session<F: Caller, M: Exported>(
    make: &dyn Fn(&Arguments) -> std::result::Result<F, Vec<Message>>,
    bytes: &[u8],
    tally: &mut Tally,
    record: Option<&mut Vec<String>>,
) {
    let mut session = Session::<F, M> {
        make,
        record,
        instances: [const { None }; 3],
        states: [[null_mut(); 3]; 3],
        contents: Default::default(),
        saved: Vec::new(),
        variables: arguments::Variables::new::<M>(F::standard()),
        tally,
        model: PhantomData,
    };
    let mut u = Unstructured::new(bytes);
    while !u.is_empty() && session.act(&mut u).is_ok() {}
    session.end();
}

/// Type of [`run`] for an FMI version and a model.
pub type RunBytes = fn(&[u8], &mut Tally);

/// Runs a sequence of calls of every model with seeds 0, 1, ... for 3 seconds, or for as many as the environment variable
/// `ROBUSTNESS_SECONDS` sets. Runs at least `at_least` seeds, so that checks of the counts do not depend on the speed of
/// the machine. Prints and returns the counts.
///
/// # Panics
/// Panics if a sequence violates a guarantee, or if `ROBUSTNESS_SECONDS` is not a number.
pub fn run_seeds(at_least: u64, models: &[(&str, RunBytes)]) -> Tally {
    let seconds = std::env::var("ROBUSTNESS_SECONDS").map_or(3, |value| value.parse().expect("a number"));
    let end = Instant::now() + Duration::from_secs(seconds);
    let mut tally = Tally::new();
    let mut seed = 0;
    while seed < at_least || Instant::now() < end {
        for (model, session) in models {
            println!("{model}, seed {seed}"); // needed to reproduce a failure
            session(&random_bytes(seed, 1 << 16), &mut tally);
        }
        seed += 1;
    }
    let calls: u64 = tally.values().flatten().sum();
    println!("{calls} calls in {seed} sequences of each model; OK, discarded, rejected:");
    for (function, counts) in &tally {
        println!("{function:40}{counts:9?}");
    }
    tally
}

/// Returns pseudorandom bytes that are the same in every run.
pub fn random_bytes(seed: u64, count: usize) -> Vec<u8> {
    let mut random = Random::mixed(seed);
    (0..count.div_ceil(8)).flat_map(|_| random.bits().to_le_bytes()).take(count).collect()
}

struct Session<'a, F, M> {
    make: &'a dyn Fn(&Arguments) -> std::result::Result<F, Vec<Message>>,
    record: Option<&'a mut Vec<String>>,
    instances: [Option<Slot<F>>; 3],
    /// Saved states of each instance.
    states: [[*mut c_void; 3]; 3],
    /// The bytes of these states; empty for a de-serialized state, whose bytes are not recorded.
    contents: [[Vec<u8>; 3]; 3],
    /// The last serialized state, possibly damaged.
    saved: Vec<u8>,
    variables: arguments::Variables,
    tally: &'a mut Tally,
    model: PhantomData<M>,
}

/// An instance, its last saved state, and the calls since then.
struct Slot<F> {
    fmu: F,
    arguments: Arguments<'static>,
    saved: Vec<u8>,
    since: Vec<(Call, CallResult)>,
}

/// Maximum number of calls that are stored for a replay.
const MEMORY: usize = 40;

impl<F: Caller, M: Exported> Session<'_, F, M> {
    fn count(&mut self, function: &'static str, status: Status) {
        let column = match status {
            Status::Ok => 0,
            Status::Discard => 1,
            _ => 2,
        };
        self.tally.entry(function).or_default()[column] += 1;
    }

    fn record(&mut self, line: impl FnOnce() -> String) {
        if let Some(record) = &mut self.record {
            record.push(line());
        }
    }

    /// Frees an instance and its saved states.
    fn free(&mut self, index: usize) {
        self.instances[index] = None;
        self.states[index] = [null_mut(); 3];
    }

    /// Decodes and performs the next action: one call, or several calls that belong together. Fails at the end of the bytes.
    fn act(&mut self, u: &mut Unstructured) -> Result<()> {
        let index = u.int_in_range(0..=self.instances.len() - 1)?;
        let kind = u.int_in_range(0..=63_u8)?;
        if self.instances[index].is_none() || kind == 0 {
            return self.instantiate(index, u);
        }
        match kind {
            1 => self.free(index),
            2 => self.without_instance(u)?,
            3..=5 => self.initialize(index),
            6..=8 => self.replay(index, u.arbitrary()?),
            9..=14 => self.handle(index, u)?,
            15..=47 => {
                let steps = self.instances[index].as_ref().is_some_and(|slot| slot.arguments.fmu_type == 1);
                self.call(index, u.choose(if steps { F::STEPS } else { F::INTEGRATION })?, u)?;
            }
            _ => {
                let function = *u.choose(&callable::<F>())?;
                // These functions end a simulation, so they are rare.
                if !function.ends_with("Reset") && !function.ends_with("Terminate") || u.ratio(1, 8)? {
                    self.call(index, function, u)?;
                }
            }
        }
        Ok(())
    }

    /// Frees the instance at this index and instantiates the model again.
    fn instantiate(&mut self, index: usize, u: &mut Unstructured) -> Result<()> {
        self.free(index);
        self.count(F::FREE, Status::Ok);
        let both = M::CO_SIMULATION.is_some() && M::MODEL_EXCHANGE.is_some();
        let any = *u.choose(&[Interface::CoSimulation, Interface::ModelExchange])?;
        let offered =
            if M::CO_SIMULATION.is_some() { Interface::CoSimulation } else { Interface::ModelExchange };
        let interface = if both || u.ratio(1, 16)? { any } else { offered };
        let mut arguments = Arguments::new::<M>(interface);
        if F::standard() == Standard::Fmi3 {
            let has_events = M::CO_SIMULATION.is_some_and(|offer| offer.has_event_mode());
            arguments.early_return_allowed = u.int_in_range(0..=1)?;
            arguments.event_mode_used = (has_events && u.arbitrary()?).into();
        }
        if u.ratio(1, 8)? {
            let strings =
                [None, Some(c""), Some(c" \t"), Some(c"%s%n#r1#"), Some(c"instance"), Some(c"\xff")];
            if F::standard() == Standard::Fmi2 {
                arguments.fmu_type = u.arbitrary()?;
            } else {
                arguments.event_mode_used = u.int_in_range(0..=2)?;
                arguments.required_intermediate_variables = if u.ratio(1, 8)? { &[0] } else { &[] };
            }
            if u.ratio(1, 2)? {
                arguments.guid = u.choose(&strings)?.map(CString::from);
            }
            arguments.resource_location = *u.choose(&strings)?;
            arguments.callbacks = u.arbitrary()?;
            // All instances with a valid name have the same name. A model may put it into its state, and then a copy in
            // an instance with another name would not be equal.
            arguments.instance_name = match *u.choose(&strings)? {
                Some(name) if !name.to_bytes().trim_ascii().is_empty() => Some(c"instance"),
                rejected => rejected,
            };
        }
        (arguments.logging_on, arguments.visible) = (u.int_in_range(0..=2)?, u.arbitrary()?);
        arguments.environment = u.ratio(7, 8)?;
        let result = (self.make)(&arguments);
        let function = F::INSTANTIATE[usize::from(arguments.fmu_type == 0)];
        self.count(function, if result.is_ok() { Status::Ok } else { Status::Error });
        let log = result.as_ref().map_or_else(Clone::clone, F::take_log);
        self.record(|| format!("{function} {log:?}"));
        check_messages(log);
        if let Ok(fmu) = result {
            let saved = fmu.bytes();
            self.instances[index] = Some(Slot { fmu, arguments, saved, since: Vec::new() });
            if u.ratio(7, 8)? {
                self.initialize(index);
            }
        }
        Ok(())
    }

    /// Makes a call with NULL as the instance, which must be rejected without a crash.
    fn without_instance(&mut self, u: &mut Unstructured) -> Result<()> {
        let fmu = F::null_instance::<M>();
        for function in fmu.check_version() {
            self.count(function, Status::Ok);
        }
        let function = *u.choose(&callable::<F>())?;
        let arguments = CallArguments::decode(u, function, 0.0, &self.variables)?;
        let call = Call { function, arguments };
        assert_eq!(call.run(&fmu).status, Status::Error, "{function} without an instance");
        self.count(function, Status::Error);
        Ok(())
    }

    /// Makes the calls that reset and initialize an instance, because random calls are rarely in this order.
    fn initialize(&mut self, index: usize) {
        let Some(slot) = &mut self.instances[index] else { return };
        // All arguments are 0, so no stop time is defined.
        let begin = |function: &&'static str| (*function, slot.fmu.call_with_zeros(function));
        let statuses: Vec<_> = F::BEGINNING.iter().map(begin).collect();
        slot.start_over();
        for (function, status) in statuses {
            self.count(function, status);
        }
    }

    fn call(&mut self, index: usize, function: &'static str, u: &mut Unstructured) -> Result<()> {
        let Some(slot) = &mut self.instances[index] else { return Ok(()) };
        let before = slot.fmu.bytes();
        let arguments = CallArguments::decode(u, function, time(&before), &self.variables)?;
        let call = Call { function, arguments };
        slot.fmu.take_log();
        let result = call.run(&slot.fmu);
        let messages = slot.fmu.take_log();
        if let Some(record) = &mut self.record {
            // Compiled C sources have less memory, so they reject a wrong length for another reason.
            let messages = if call.arguments.has_wrong_length() { &[] } else { &*messages };
            record.push(format!("{:x?} {function} {result:?} {messages:?}", fnv1a(&before)));
        }
        check_messages(messages);
        let is_no_op = function.ends_with("CompletedIntegratorStep")
            && M::MODEL_EXCHANGE.is_none_or(|offer| !offer.step_completed);
        assert!(!is_no_op || result.values.iter().all(|flag| *flag == 0), "{result:?}");
        if is_no_op || call.must_not_change(result.status) {
            assert_eq!(before, slot.fmu.bytes(), "changed by a call that returned {result:?}: {call:?}");
        }
        let status = result.status;
        slot.since.push((call, result));
        if slot.since.len() == MEMORY {
            self.replay(index, false);
        }
        self.count(function, status);
        Ok(())
    }

    /// Restores the last saved state, in this instance or in another one, and repeats the calls after it. Asserts that the
    /// results and the final state are the same.
    fn replay(&mut self, index: usize, elsewhere: bool) {
        let Some(slot) = &mut self.instances[index] else { return };
        let end = slot.fmu.bytes();
        let other =
            elsewhere.then(|| (self.make)(&slot.arguments).expect("an equal instance must be possible"));
        let fmu = other.as_ref().unwrap_or(&slot.fmu);
        fmu.restore(&slot.saved);
        for (call, result) in &slot.since {
            assert_eq!(call.run(fmu), *result, "a different result from the same state: {call:?}");
        }
        assert_eq!(fmu.bytes(), end, "a different final state from the same state");
        let calls: Vec<_> = slot.since.iter().map(|(call, result)| (call.function, result.status)).collect();
        slot.start_over();
        for (function, status) in calls {
            self.count(function, status);
        }
    }

    /// Calls one of the six functions of saved states, sometimes with a state of another instance.
    fn handle(&mut self, index: usize, u: &mut Unstructured) -> Result<()> {
        let which = u.int_in_range(0..=self.states.len() - 1)?;
        let owner = if u.ratio(1, 8)? && !self.states[which][which].is_null() { which } else { index };
        let Some(slot) = &mut self.instances[index] else { return Ok(()) };
        let (fmu, state) = (&slot.fmu, &mut self.states[owner][which]);
        let before = fmu.bytes();
        fmu.take_log();
        let foreign = owner != index;
        let [get, set, free, size_of, serialize, deserialize] = F::HANDLES;
        let wrong_length = wrong_length(u)?;
        let (function, status) = match u.int_in_range(0..=7_u8)? {
            0 | 1 => (get, fmu.get_state(pointer_to(state, u)?)),
            2 | 3 => (set, fmu.set_state(*state)),
            4 => (free, fmu.free_state(pointer_to(state, u)?)),
            5 => {
                let mut size = 0;
                (size_of, fmu.state_size(*state, pointer_to(&mut size, u)?))
            }
            6 => {
                let mut size = 0;
                if u.ratio(1, 8)? || fmu.state_size(*state, &mut size) != Status::Ok {
                    size = u.int_in_range(0..=1000)?;
                }
                fmu.take_log();
                let mut bytes = vec![0; size];
                let pointer = if u.ratio(1, 16)? { null_mut() } else { bytes.as_mut_ptr() };
                let status = fmu.serialize_into(*state, pointer, wrong_length.unwrap_or(size));
                if status == Status::Ok {
                    let content = &self.contents[index][which];
                    assert!(content.is_empty() || *content == bytes, "another state is serialized");
                    self.saved = bytes;
                }
                (serialize, status)
            }
            _ => {
                damage(&mut self.saved, u)?;
                // Only intact bytes show their true length.
                let (bytes, length) = match wrong_length {
                    Some(length) => (&before, length),
                    None => (&self.saved, self.saved.len()),
                };
                let pointer = if u.ratio(1, 16)? { null() } else { bytes.as_ptr() };
                let old = *state;
                let status = fmu.deserialize(pointer, length, pointer_to(state, u)?);
                assert!(status == Status::Ok || *state == old, "a handle changed by a rejected call");
                assert!(status != Status::Ok || wrong_length.is_none(), "a wrong length is accepted");
                (deserialize, status)
            }
        };
        let messages = fmu.take_log();
        if let Some(record) = &mut self.record {
            let messages = if wrong_length.is_some() { &[] } else { &*messages };
            record.push(format!("{:x?} {function} {status:?} {messages:?}", fnv1a(&self.saved)));
        }
        check_messages(messages);
        assert!([Status::Ok, Status::Error].contains(&status), "{function} returns {status:?}");
        // Freeing through a NULL pointer is not an error.
        let rejected = status == Status::Error || function == free;
        assert!(!foreign || rejected && !state.is_null(), "{function} accepts a state of another instance");
        let content = &mut self.contents[index][which];
        if function == set && status == Status::Ok {
            assert!(content.is_empty() || *content == fmu.bytes(), "another state is restored");
            slot.start_over();
        } else {
            assert_eq!(before, fmu.bytes(), "changed by {function}, which returned {status:?}");
            match status {
                Status::Ok if function == get => *content = before,
                Status::Ok if function == deserialize => content.clear(),
                _ => {}
            }
        }
        self.count(function, status);
        Ok(())
    }

    /// Replays the remaining calls, then frees all instances.
    fn end(mut self) {
        for index in 0..self.instances.len() {
            self.replay(index, index % 2 == 0);
            self.free(index);
        }
    }
}

impl<F: Caller> Slot<F> {
    /// Starts a new record of calls at the current state.
    ///
    /// The state is restored immediately, because an instance remembers rejected start values, but its saved state does
    /// not contain them.
    fn start_over(&mut self) {
        self.saved = self.fmu.bytes();
        self.fmu.restore(&self.saved);
        self.since.clear();
    }
}

/// Returns the functions that have no handle of a saved state as an argument.
fn callable<F: Caller>() -> Vec<&'static str> {
    F::functions().iter().copied().filter(|name| !has_handles(name)).collect()
}

/// Returns a pointer to the value, or sometimes NULL or a misaligned pointer, which the FMU must not dereference.
fn pointer_to<T>(value: &mut T, u: &mut Unstructured) -> Result<*mut T> {
    Ok(match u.int_in_range(0..=15_u8)? {
        0 => null_mut(),
        1 => (&raw mut *value).wrapping_byte_add(1),
        _ => value,
    })
}

/// In half of the calls, changes or cuts off some bytes of a serialized state. Mostly updates the checksum, too, so that it
/// does not reveal the damage.
fn damage(bytes: &mut Vec<u8>, u: &mut Unstructured) -> Result<()> {
    if u.ratio(1, 2)? || bytes.len() < 16 {
        return Ok(());
    }
    for _ in 0..u.int_in_range(0..=4)? {
        let at = u.int_in_range(0..=bytes.len() - 1)?;
        bytes[at] = u.arbitrary()?;
    }
    if u.ratio(1, 8)? {
        bytes.truncate(u.int_in_range(8..=bytes.len())?);
    }
    if u.ratio(3, 4)? {
        *bytes = sealed(std::mem::take(bytes));
    }
    Ok(())
}

/// Checks that messages are clean, that at most one is more severe than a warning, and that none is fatal.
fn check_messages(messages: Vec<Message>) {
    let rejections =
        messages.iter().filter(|message| ![Status::Ok, Status::Warning].contains(&message.status));
    assert!(rejections.count() <= 1, "{messages:#?}");
    for message in messages {
        message.assert_clean();
        assert!(message.status != Status::Fatal, "{message:?}");
    }
}

//! A careless importer: bytes become calls, on several instances at once, and every answer is checked.
//!
//! After every call: the status is one that the standard has; a call that is refused, or only reads, has left the state
//! as it was, byte for byte; every value is a finite number, a truth or a text; nothing is written behind an array;
//! messages are clean. From time to time an instance's calls since its last saved state are made again, from that
//! state, in the same or another instance: every answer and the final state must have the same bits.
//!
//! The bytes come from [`random_bytes`] or from a fuzzer.

mod arguments;
mod call;
pub mod fmi3;

use crate::library::functions_of;
use crate::serialized::{fnv1a, sealed, time};
use crate::{Arguments, Functions, Importer};
use arbitrary::{Result, Unstructured};
use arguments::CallArguments;
use call::{Answer, Call, functions};
use fmu_export::fmi2::types::*;
use fmu_export::{Category, Exported, Interface};
use std::collections::BTreeMap;
use std::ffi::CString;
use std::marker::PhantomData;
use std::ptr::{null, null_mut};
use std::time::{Duration, Instant};

/// How often each function was called, by status: OK, discarded, refused.
pub type Tally = BTreeMap<&'static str, [u64; 3]>;

/// Makes the calls that the bytes stand for and counts them.
///
/// # Panics
/// At the first broken promise.
pub fn run<M: Exported>(bytes: &[u8], tally: &mut Tally) {
    session::<M>(functions_of::<M>(), bytes, tally, None);
}

/// Makes the calls on these functions of a model, and tells what was answered and logged, call by call.
///
/// # Panics
/// At the first broken promise.
pub fn record<M: Exported>(functions: Functions, bytes: &[u8]) -> Vec<String> {
    let mut record = Vec::new();
    session::<M>(functions, bytes, &mut Tally::new(), Some(&mut record));
    record
}

fn session<M: Exported>(
    functions: Functions,
    bytes: &[u8],
    tally: &mut Tally,
    record: Option<&mut Vec<String>>,
) {
    let mut session = Session::<M> {
        functions,
        record,
        instances: [const { None }; 3],
        states: [[null_mut(); 3]; 3],
        saved: Vec::new(),
        variables: arguments::Variables::of::<M>(|place| place),
        tally,
        model: PhantomData,
    };
    let mut u = Unstructured::new(bytes);
    while !u.is_empty() {
        if session.act(&mut u).is_err() {
            break;
        }
    }
    session.end();
}

/// One sequence of calls, made from bytes: [`run`] or [`fmi3::run`] of a model.
pub type RunBytes = fn(&[u8], &mut Tally);

/// Sequences of every model from seeds 0, 1, ... for some seconds, `ROBUSTNESS_SECONDS` if that is set, and of at least
/// some seeds, so that what is checked of the counts does not depend on the machine. Prints the counts.
///
/// # Panics
/// When a sequence breaks a promise, or `ROBUSTNESS_SECONDS` is no number.
pub fn run_seeds(at_least: u64, models: &[(&str, RunBytes)]) -> Tally {
    let seconds = std::env::var("ROBUSTNESS_SECONDS").map_or(3, |text| text.parse().expect("a number"));
    let end = Instant::now() + Duration::from_secs(seconds);
    let mut tally = Tally::new();
    let mut seed = 0;
    while seed < at_least || Instant::now() < end {
        for (model, session) in models {
            println!("{model}, seed {seed}"); // for who looks into a failure
            session(&random_bytes(seed, 1 << 16), &mut tally);
        }
        seed += 1;
    }
    let calls: u64 = tally.values().flatten().sum();
    println!("{calls} calls in {seed} sequences of each model; OK, discarded, refused:");
    for (function, counts) in &tally {
        println!("{function:40}{counts:9?}");
    }
    tally
}

/// Bytes that look random and are the same in every run (splitmix64).
pub fn random_bytes(seed: u64, count: usize) -> Vec<u8> {
    const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
    let mix = |z: u64| {
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    // A begin of its own for each seed: from a multiple of the step the same bytes would come, only later.
    let begin = mix(seed ^ STEP);
    (1..=count.div_ceil(8) as u64)
        .flat_map(|n| mix(begin.wrapping_add(n.wrapping_mul(STEP))).to_le_bytes())
        .take(count)
        .collect()
}

struct Session<'a, M> {
    functions: Functions,
    record: Option<&'a mut Vec<String>>,
    instances: [Option<Slot>; 3],
    /// Saved states of each instance.
    states: [[fmi2FMUstate; 3]; 3],
    /// A serialized state, intact or not.
    saved: Vec<u8>,
    variables: arguments::Variables,
    tally: &'a mut Tally,
    model: PhantomData<M>,
}

/// An instance, where it was last saved, and what was done since.
struct Slot {
    fmu: Importer,
    made_of: Arguments<'static>,
    saved: Vec<u8>,
    since: Vec<(Call, Answer)>,
}

/// Calls that are remembered for a replay.
const MEMORY: usize = 40;

/// What importers call most, by interface type.
const STEPS: [&str; 10] = [
    "fmi2DoStep",
    "fmi2DoStep",
    "fmi2DoStep",
    "fmi2SetReal",
    "fmi2SetInteger",
    "fmi2SetBoolean",
    "fmi2SetString",
    "fmi2GetReal",
    "fmi2SetRealInputDerivatives",
    "fmi2GetRealOutputDerivatives",
];
const INTEGRATION: [&str; 10] = [
    "fmi2SetTime",
    "fmi2SetContinuousStates",
    "fmi2SetReal",
    "fmi2GetReal",
    "fmi2GetDerivatives",
    "fmi2GetEventIndicators",
    "fmi2CompletedIntegratorStep",
    "fmi2EnterEventMode",
    "fmi2NewDiscreteStates",
    "fmi2EnterContinuousTimeMode",
];

/// One of the interface types that the model offers.
fn offered<M: Exported>() -> Interface {
    if M::CO_SIMULATION.is_some() { Interface::CoSimulation } else { Interface::ModelExchange }
}

impl<M: Exported> Session<'_, M> {
    fn count(&mut self, function: &'static str, status: Status) {
        let column = match status {
            Status::Ok => 0,
            Status::Discard => 1,
            _ => 2,
        };
        self.tally.entry(function).or_default()[column] += 1;
    }

    fn record(&mut self, what: impl FnOnce() -> String) {
        if let Some(record) = &mut self.record {
            record.push(what());
        }
    }

    /// Frees an instance, and with it what it has saved.
    fn free(&mut self, index: usize) {
        self.instances[index] = None;
        self.states[index] = [null_mut(); 3];
    }

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
                let steps = self.instances[index].as_ref().is_some_and(|slot| slot.made_of.fmu_type == 1);
                self.call(index, u.choose(if steps { &STEPS } else { &INTEGRATION })?, u)?;
            }
            _ => {
                let all: Vec<_> = functions().collect();
                let function = *u.choose(&all)?;
                // They end a simulation: rarely.
                if !["fmi2Reset", "fmi2Terminate"].contains(&function) || u.ratio(1, 8)? {
                    self.call(index, function, u)?;
                }
            }
        }
        Ok(())
    }

    /// `fmi2Instantiate` in place of an instance, which is freed before.
    fn instantiate(&mut self, index: usize, u: &mut Unstructured) -> Result<()> {
        self.free(index);
        self.tally.entry("fmi2FreeInstance").or_default()[0] += 1;
        let both = M::CO_SIMULATION.is_some() && M::MODEL_EXCHANGE.is_some();
        let any = *u.choose(&[Interface::CoSimulation, Interface::ModelExchange])?;
        let interface = if both || u.ratio(1, 16)? { any } else { offered::<M>() };
        let mut made_of = Arguments::of::<M>(interface);
        if u.ratio(1, 8)? {
            let texts = [None, Some(c""), Some(c" \t"), Some(c"%s%n#r1#"), Some(c"instance"), Some(c"\xff")];
            made_of.fmu_type = u.arbitrary()?;
            if u.ratio(1, 2)? {
                made_of.guid = u.choose(&texts)?.map(CString::from);
            }
            made_of.resource_location = *u.choose(&texts)?;
            made_of.callbacks = u.arbitrary()?;
            // What is no UTF-8 comes back to the logger as it is; the one of this importer reads text.
            made_of.logger = false;
            made_of.instance_name = *u.choose(&texts)?;
        }
        (made_of.logging_on, made_of.visible) = (u.arbitrary()?, u.arbitrary()?);
        made_of.environment = u.ratio(7, 8)?;
        let made = Importer::instantiate(self.functions, &made_of);
        self.record(|| {
            format!("fmi2Instantiate {:?}", made.as_ref().map_or_else(Clone::clone, Importer::take_log))
        });
        self.count("fmi2Instantiate", if made.is_ok() { Status::Ok } else { Status::Error });
        if let Ok(fmu) = made {
            let saved = fmu.bytes();
            self.instances[index] = Some(Slot { fmu, made_of, saved, since: Vec::new() });
            if u.ratio(7, 8)? {
                self.initialize(index);
            }
        }
        Ok(())
    }

    /// What needs no instance, and what must survive that there is none.
    fn without_instance(&mut self, u: &mut Unstructured) -> Result<()> {
        let nothing = Importer::null(self.functions);
        assert_eq!(nothing.version_and_platform(), [c"2.0", c"default"]);
        self.count("fmi2GetVersion", Status::Ok);
        self.count("fmi2GetTypesPlatform", Status::Ok);
        let all: Vec<_> = functions().collect();
        let function = *u.choose(&all)?;
        let arguments = CallArguments::decode(u, function, 0.0, &self.variables)?;
        let call = Call { function, arguments };
        assert_eq!(call.run(&nothing).status, Status::Error, "{function} without an instance");
        self.count(function, Status::Error);
        Ok(())
    }

    /// The calls that random ones seldom make in this order.
    fn initialize(&mut self, index: usize) {
        let Some(slot) = &mut self.instances[index] else { return };
        let fmu = &slot.fmu;
        let statuses = [
            ("fmi2Reset", fmu.fmi2Reset()),
            ("fmi2SetupExperiment", fmu.fmi2SetupExperiment(0, 0.0, 0.0, 0, 0.0)),
            ("fmi2EnterInitializationMode", fmu.fmi2EnterInitializationMode()),
            ("fmi2ExitInitializationMode", fmu.fmi2ExitInitializationMode()),
        ];
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
        let answer = call.run(&slot.fmu);
        let messages = slot.fmu.take_log();
        if let Some(record) = &mut self.record {
            record.push(format!("{:x?} {function} {answer:?} {messages:?}", fnv1a(&before)));
        }
        check_messages(messages);
        let unasked = function == "fmi2CompletedIntegratorStep"
            && M::MODEL_EXCHANGE.is_none_or(|offer| !offer.step_completed);
        assert!(!unasked || answer.values.iter().all(|flag| *flag == 0), "{answer:?}");
        if unasked || call.must_not_change(answer.status) {
            assert_eq!(before, slot.fmu.bytes(), "changed by a call that answered {answer:?}: {call:?}");
        }
        let status = answer.status;
        slot.since.push((call, answer));
        if slot.since.len() == MEMORY {
            self.replay(index, false);
        }
        self.count(function, status);
        Ok(())
    }

    /// Makes the calls since the last saved state again, in this instance or in a new one.
    fn replay(&mut self, index: usize, elsewhere: bool) {
        let Some(slot) = &mut self.instances[index] else { return };
        let end = slot.fmu.bytes();
        let other = elsewhere
            .then(|| Importer::instantiate(self.functions, &slot.made_of).expect("it was made before"));
        let fmu = other.as_ref().unwrap_or(&slot.fmu);
        fmu.restore(&slot.saved);
        for (call, answer) in &slot.since {
            let again = call.run(fmu);
            assert_eq!(again, *answer, "another answer from the same state: {call:?}");
        }
        assert_eq!(fmu.bytes(), end, "another end from the same state");
        let made: Vec<_> = slot.since.iter().map(|(call, answer)| (call.function, answer.status)).collect();
        slot.start_over();
        for (function, status) in made {
            self.count(function, status);
        }
    }

    /// The six functions of saved states, at times on those of another instance.
    fn handle(&mut self, index: usize, u: &mut Unstructured) -> Result<()> {
        let which = u.int_in_range(0..=self.states.len() - 1)?;
        let owner = if u.ratio(1, 8)? && !self.states[which][which].is_null() { which } else { index };
        let Some(slot) = &mut self.instances[index] else { return Ok(()) };
        let fmu = &slot.fmu;
        let before = fmu.bytes();
        fmu.take_log();
        let state = &mut self.states[owner][which];
        let foreign = owner != index;
        let (function, status) = match u.int_in_range(0..=7_u8)? {
            0 | 1 => ("fmi2GetFMUstate", fmu.fmi2GetFMUstate(place(state, u)?)),
            2 | 3 => ("fmi2SetFMUstate", fmu.fmi2SetFMUstate(*state)),
            4 => ("fmi2FreeFMUstate", fmu.fmi2FreeFMUstate(place(state, u)?)),
            5 => {
                let mut size = 0;
                ("fmi2SerializedFMUstateSize", fmu.fmi2SerializedFMUstateSize(*state, place(&mut size, u)?))
            }
            6 => {
                let mut size = 0;
                if u.ratio(1, 8)? || fmu.fmi2SerializedFMUstateSize(*state, &mut size) != Status::Ok {
                    size = u.int_in_range(0..=1000)?;
                }
                fmu.take_log();
                let mut bytes = vec![0; size];
                let pointer = if u.ratio(1, 16)? { null_mut() } else { bytes.as_mut_ptr().cast() };
                let status = fmu.fmi2SerializeFMUstate(*state, pointer, size);
                if status == Status::Ok {
                    self.saved = bytes;
                }
                ("fmi2SerializeFMUstate", status)
            }
            _ => {
                damage(&mut self.saved, u)?;
                let pointer = if u.ratio(1, 16)? { null() } else { self.saved.as_ptr().cast() };
                let old = *state;
                let status = fmu.fmi2DeSerializeFMUstate(pointer, self.saved.len(), place(state, u)?);
                assert!(status == Status::Ok || *state == old, "a handle changed by a refused call");
                ("fmi2DeSerializeFMUstate", status)
            }
        };
        let messages = fmu.take_log();
        if let Some(record) = &mut self.record {
            record.push(format!("{:x?} {function} {status:?} {messages:?}", fnv1a(&self.saved)));
        }
        check_messages(messages);
        assert!([Status::Ok, Status::Error].contains(&status), "{function} answers {status:?}");
        // Nowhere to free one is no error.
        let refused = status == Status::Error || function == "fmi2FreeFMUstate";
        assert!(!foreign || refused && !state.is_null(), "{function} takes another instance's state");
        if function == "fmi2SetFMUstate" && status == Status::Ok {
            slot.start_over();
        } else {
            assert_eq!(before, fmu.bytes(), "changed by {function}, which answered {status:?}");
        }
        self.count(function, status);
        Ok(())
    }

    /// Replays what is left, then frees everything: instances with their states.
    fn end(mut self) {
        for index in 0..self.instances.len() {
            self.replay(index, index % 2 == 0);
            self.free(index);
        }
    }
}

impl Slot {
    /// Remembers calls from here on.
    ///
    /// From a state that is restored: start values that were refused are no part of it.
    fn start_over(&mut self) {
        self.saved = self.fmu.bytes();
        self.fmu.restore(&self.saved);
        self.since.clear();
    }
}

/// The pointer to pass for one value; at times NULL or misaligned, which the FMU never follows.
fn place<T>(value: &mut T, u: &mut Unstructured) -> Result<*mut T> {
    Ok(match u.int_in_range(0..=15_u8)? {
        0 => null_mut(),
        1 => (&raw mut *value).wrapping_byte_add(1),
        _ => value,
    })
}

/// Bytes that were no serialized state, or not quite; with a checksum that fits, at times.
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

/// Messages that every importer shows as they are, and one at most about what is refused.
fn check_messages(messages: Vec<crate::Message>) {
    let refusals = messages.iter().filter(|message| ![Status::Ok, Status::Warning].contains(&message.status));
    assert!(refusals.count() <= 1, "{messages:#?}");
    for message in messages {
        assert!(!message.text.contains(['%', '#', '\n']) && !message.text.is_empty(), "{message:?}");
        let known = Category::ALL.map(|category| category.name().to_str().expect("ASCII"));
        assert!(known.contains(&message.category.as_str()), "{message:?}");
        assert!(message.status != Status::Fatal, "{message:?}");
    }
}

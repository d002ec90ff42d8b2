//! A careless importer: bytes become calls, on several instances at once, and every answer is checked.
//!
//! After every call: the status is one that the standard has; a call that is refused, or only reads, has
//! left the state as it was, byte for byte; every value is a finite number; messages are clean. From time
//! to time an instance's calls since its last saved state are made again, from that state, in the same or
//! another instance: every answer and the final state must have the same bits.

use crate::arguments::{Answer, Arguments};
use crate::calls::{Call, functions};
use crate::serialized::{TIME, sealed};
use crate::support::{self, Fmu, Status, version_and_platform};
use arbitrary::{Result, Unstructured};
use fmi2_export::types::*;
use fmi2_export::{Category, Interface};
use std::collections::BTreeMap;
use std::ptr::{null, null_mut};

/// How often each function was called, by status: OK, discarded, refused.
pub type Tally = BTreeMap<&'static str, [u64; 3]>;

/// Makes the calls that the bytes stand for and counts them. Panics at the first broken promise.
pub fn run(bytes: &[u8], tally: &mut Tally) {
    let mut session =
        Session { instances: [const { None }; 3], states: [null_mut(); 3], saved: Vec::new(), tally };
    let mut u = Unstructured::new(bytes);
    while !u.is_empty() {
        if session.act(&mut u).is_err() {
            break;
        }
    }
    session.end();
}

struct Session<'a> {
    instances: [Option<Slot>; 3],
    /// Saved states of any instance.
    states: [fmi2FMUstate; 3],
    /// A serialized state, intact or not.
    saved: Vec<u8>,
    tally: &'a mut Tally,
}

/// An instance, where it was last saved, and what was done since.
struct Slot {
    fmu: Fmu,
    interface: Interface,
    saved: Vec<u8>,
    since: Vec<(Call, Answer)>,
}

/// Calls that are remembered for a replay.
const MEMORY: usize = 40;

/// What importers call most, by interface type.
const STEPS: [&str; 8] = [
    "fmi2DoStep",
    "fmi2DoStep",
    "fmi2DoStep",
    "fmi2SetReal",
    "fmi2SetReal",
    "fmi2GetReal",
    "fmi2SetRealInputDerivatives",
    "fmi2GetRealOutputDerivatives",
];
const INTEGRATION: [&str; 9] = [
    "fmi2SetTime",
    "fmi2SetContinuousStates",
    "fmi2SetReal",
    "fmi2GetReal",
    "fmi2GetDerivatives",
    "fmi2CompletedIntegratorStep",
    "fmi2EnterEventMode",
    "fmi2NewDiscreteStates",
    "fmi2EnterContinuousTimeMode",
];

impl Session<'_> {
    fn count(&mut self, function: &'static str, status: Status) {
        let column = match status {
            Status::Ok => 0,
            Status::Discard => 1,
            _ => 2,
        };
        self.tally.entry(function).or_default()[column] += 1;
    }

    fn act(&mut self, u: &mut Unstructured) -> Result<()> {
        let index = u.int_in_range(0..=self.instances.len() - 1)?;
        let kind = u.int_in_range(0..=63_u8)?;
        if self.instances[index].is_none() || kind == 0 {
            return self.instantiate(index, u);
        }
        match kind {
            1 => self.instances[index] = None,
            2 => self.without_instance(u)?,
            3..=5 => self.initialize(index),
            6..=8 => self.replay(index, u.arbitrary()?),
            9..=14 => self.handle(index, u)?,
            15..=47 => {
                let interface = self.instances[index].as_ref().map(|slot| slot.interface);
                let usual: &[_] =
                    if interface == Some(Interface::CoSimulation) { &STEPS } else { &INTEGRATION };
                self.call(index, u.choose(usual)?, u)?;
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
        self.instances[index] = None;
        self.tally.entry("fmi2FreeInstance").or_default()[0] += 1;
        let interface = *u.choose(&[Interface::CoSimulation, Interface::ModelExchange])?;
        let mut arguments = support::Arguments::new(interface);
        if u.ratio(1, 8)? {
            let texts = [None, Some(c""), Some(c" \t"), Some(c"%s%n#r1#"), Some(crate::GUID), Some(c"\xff")];
            arguments.fmu_type = u.arbitrary()?;
            arguments.guid = *u.choose(&texts)?;
            arguments.resource_location = *u.choose(&texts)?;
            arguments.callbacks = u.arbitrary()?;
            // What is no UTF-8 comes back to the logger as it is; the one of these tests reads text.
            arguments.logger = false;
            arguments.instance_name = *u.choose(&texts)?;
        }
        (arguments.logging_on, arguments.visible) = (u.arbitrary()?, u.arbitrary()?);
        arguments.environment = u.ratio(7, 8)?;
        let made = Fmu::instantiate(&arguments);
        self.count("fmi2Instantiate", if made.is_ok() { Status::Ok } else { Status::Error });
        if let Ok(fmu) = made {
            let interface =
                if arguments.fmu_type == 1 { Interface::CoSimulation } else { Interface::ModelExchange };
            let saved = fmu.bytes();
            self.instances[index] = Some(Slot { fmu, interface, saved, since: Vec::new() });
            if u.ratio(7, 8)? {
                self.initialize(index);
            }
        }
        Ok(())
    }

    /// What needs no instance, and what must survive that there is none.
    fn without_instance(&mut self, u: &mut Unstructured) -> Result<()> {
        assert_eq!(version_and_platform(), [c"2.0", c"default"]);
        self.count("fmi2GetVersion", Status::Ok);
        self.count("fmi2GetTypesPlatform", Status::Ok);
        let all: Vec<_> = functions().collect();
        let function = *u.choose(&all)?;
        let call = Call { function, arguments: Arguments::decode(u, function, 0.0)? };
        assert_eq!(call.run(&Fmu::null()).status, Status::Error, "{function} without an instance");
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
        let time = f64::from_le_bytes(before[TIME].try_into().expect("8 bytes"));
        let call = Call { function, arguments: Arguments::decode(u, function, time)? };
        slot.fmu.take_log();
        let answer = call.run(&slot.fmu);
        check_log(&slot.fmu);
        if call.must_not_change(answer.status) {
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
        let other = elsewhere.then(|| Fmu::new(slot.interface));
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

    /// The six functions of saved states. States go from any instance to any other.
    fn handle(&mut self, index: usize, u: &mut Unstructured) -> Result<()> {
        let which = u.int_in_range(0..=self.states.len() - 1)?;
        let Some(slot) = &mut self.instances[index] else { return Ok(()) };
        let fmu = &slot.fmu;
        let before = fmu.bytes();
        fmu.take_log();
        let state = &mut self.states[which];
        let (function, status) = match u.int_in_range(0..=7_u8)? {
            0 | 1 => ("fmi2GetFMUstate", fmu.fmi2GetFMUstate(place(state, u)?)),
            2 | 3 => ("fmi2SetFMUstate", fmu.fmi2SetFMUstate(*state)),
            4 => ("fmi2FreeFMUstate", fmu.fmi2FreeFMUstate(place(state, u)?)),
            5 => {
                let mut size = 0;
                ("fmi2SerializedFMUstateSize", fmu.fmi2SerializedFMUstateSize(*state, place(&mut size, u)?))
            }
            6 => {
                let size = if u.ratio(7, 8)? { before.len() } else { u.int_in_range(0..=1000)? };
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
        check_log(fmu);
        assert!([Status::Ok, Status::Error].contains(&status), "{function} answers {status:?}");
        if function == "fmi2SetFMUstate" && status == Status::Ok {
            slot.start_over();
        } else {
            assert_eq!(before, fmu.bytes(), "changed by {function}, which answered {status:?}");
        }
        self.count(function, status);
        Ok(())
    }

    /// Replays what is left, then frees everything, states after their instances too.
    fn end(mut self) {
        for index in 0..self.instances.len() {
            self.replay(index, index % 2 == 0);
            self.instances[index] = None;
        }
        let stranger = Fmu::new(Interface::ModelExchange);
        for state in self.states {
            stranger.forget(state);
        }
    }
}

impl Slot {
    /// Remembers calls from here on.
    fn start_over(&mut self) {
        self.saved = self.fmu.bytes();
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

/// Messages that every importer shows as they are.
fn check_log(fmu: &Fmu) {
    let messages = fmu.take_log();
    assert!(messages.len() <= 1, "{messages:#?}");
    for message in messages {
        assert!(!message.text.contains(['%', '#', '\n']) && !message.text.is_empty(), "{message:?}");
        let known = Category::ALL.map(|category| category.name().to_str().expect("ASCII"));
        assert!(known.contains(&message.category.as_str()), "{message:?}");
        assert!(message.status != Status::Fatal, "{message:?}");
    }
}

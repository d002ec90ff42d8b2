//! The careless importer of FMI 3.0: the same promises, and the same arguments where a function has its like in FMI 2.0.

use super::arguments::{CallArguments, Variables};
use super::{Tally, check_messages, damage, offered, place};
use crate::fmi3::{Arguments, FUNCTIONS, Importer};
use crate::serialized::time;
use arbitrary::{Result, Unstructured};
use fmu_export::fmi3::{reference, types::*};
use fmu_export::{Exported, Interface};
use std::ffi::{CStr, CString};
use std::marker::PhantomData;
use std::ptr::{null, null_mut};
use std::slice::from_mut;

/// Makes the calls that the bytes stand for and counts them.
///
/// # Panics
/// At the first broken promise.
pub fn run<M: Exported>(bytes: &[u8], tally: &mut Tally) {
    let mut session = Session::<M> {
        instances: [const { None }; 2],
        states: [[null_mut(); 2]; 2],
        saved: Vec::new(),
        variables: Variables::of::<M>(reference),
        tally,
        model: PhantomData,
    };
    let mut u = Unstructured::new(bytes);
    while !u.is_empty() && session.act(&mut u).is_ok() {}
    session.end();
}

struct Session<'a, M> {
    instances: [Option<Slot>; 2],
    /// Saved states of each instance.
    states: [[fmi3FMUState; 2]; 2],
    saved: Vec<u8>,
    variables: Variables,
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

#[derive(Clone, Debug)]
struct Call {
    function: &'static str,
    arguments: CallArguments,
}

/// What a call answered, as bits.
#[derive(Clone, Debug, PartialEq)]
struct Answer {
    status: Status,
    values: Vec<u64>,
}

/// What is in an array of texts before the FMU writes.
static UNTOUCHED_TEXT: &CStr = c"untouched";

/// Calls that are remembered for a replay.
const MEMORY: usize = 40;

/// What importers call most, by interface type.
const STEPS: [&str; 8] = [
    "fmi3DoStep",
    "fmi3DoStep",
    "fmi3DoStep",
    "fmi3SetFloat64",
    "fmi3GetFloat64",
    "fmi3EnterEventMode",
    "fmi3UpdateDiscreteStates",
    "fmi3EnterStepMode",
];
const INTEGRATION: [&str; 9] = [
    "fmi3SetTime",
    "fmi3SetContinuousStates",
    "fmi3SetFloat64",
    "fmi3GetFloat64",
    "fmi3GetContinuousStateDerivatives",
    "fmi3CompletedIntegratorStep",
    "fmi3EnterEventMode",
    "fmi3UpdateDiscreteStates",
    "fmi3EnterContinuousTimeMode",
];

/// The function of FMI 2.0 with arguments like these.
fn like(function: &str) -> &str {
    match function {
        "fmi3GetFloat64" => "fmi2GetReal",
        "fmi3SetFloat64" => "fmi2SetReal",
        "fmi3DoStep" => "fmi2DoStep",
        "fmi3GetOutputDerivatives" => "fmi2GetRealOutputDerivatives",
        "fmi3GetDirectionalDerivative" | "fmi3GetAdjointDerivative" => "fmi2GetDirectionalDerivative",
        "fmi3GetContinuousStateDerivatives" => "fmi2GetDerivatives",
        "fmi3GetEventIndicators" => "fmi2GetEventIndicators",
        name => name,
    }
}

/// The functions of saved states have handles besides arguments: the session calls them.
fn has_handles(function: &str) -> bool {
    function.contains("FMUState")
}

impl Call {
    /// Whether the state must be the same after this answer.
    fn must_not_change(&self, status: Status) -> bool {
        status != Status::Ok || self.function.starts_with("fmi3Get")
    }

    /// Calls the function. Panics if it answers what it must not.
    fn run(&self, fmu: &Importer) -> Answer {
        let (a, mut values) = (&self.arguments, Vec::new());
        let (vr, n) = (a.pointer(0, &a.vr), a.count(a.vr.len()));
        // At times another number of values.
        let m = if a.kind == 3 { n.saturating_add(1) } else { n };
        let room = a.vr.len() + 2;
        let truth = |flag: fmi3Boolean| {
            assert!(flag <= 1, "{flag} is no truth value: {self:?}");
            u64::from(flag)
        };
        macro_rules! get {
            ($get:ident, $untouched:expr, $bits:expr) => {{
                let mut out = vec![$untouched; room];
                let status = fmu.$get(vr, n, a.output(1, &mut out), m);
                assert!(out[a.vr.len()..].iter().all(|value| *value == $untouched), "{self:?}");
                if status == Status::Ok {
                    values.extend(out[..a.vr.len()].iter().map($bits));
                }
                status
            }};
        }
        macro_rules! set {
            ($set:ident, $source:ident, $convert:expr) => {{
                let mut source: Vec<_> = a.$source.iter().map($convert).collect();
                source.resize(room, source.first().copied().unwrap_or_default());
                fmu.$set(vr, n, a.pointer(1, &source), m)
            }};
        }
        macro_rules! real {
            ($call:ident) => {{
                let mut out = vec![f64::INFINITY; room];
                let status = fmu.$call(a.output(1, &mut out), n);
                assert!(out[a.vr.len()..].iter().all(|value| *value == f64::INFINITY), "{self:?}");
                if status == Status::Ok {
                    values.extend(out[..a.vr.len()].iter().map(|value| finite(*value)));
                }
                status
            }};
        }
        let [first, second, third] = a.numbers;
        let status = match self.function {
            "fmi3SetDebugLogging" => {
                fmu.fmi3SetDebugLogging(a.flags[0] as u8, n, a.pointer(0, &a.categories))
            }
            "fmi3EnterInitializationMode" => fmu.fmi3EnterInitializationMode(
                (a.flags[0] == 3).into(),
                third,
                first,
                (a.flags[1] == 3).into(),
                first + 1e4,
            ),
            "fmi3GetFloat32" => get!(fmi3GetFloat32, f32::INFINITY, |value| u64::from(value.to_bits())),
            "fmi3GetFloat64" => get!(fmi3GetFloat64, f64::INFINITY, |value| finite(*value)),
            "fmi3GetInt8" => get!(fmi3GetInt8, 77, |value| *value as u64),
            "fmi3GetUInt8" => get!(fmi3GetUInt8, 77, |value| u64::from(*value)),
            "fmi3GetInt16" => get!(fmi3GetInt16, 77, |value| *value as u64),
            "fmi3GetUInt16" => get!(fmi3GetUInt16, 77, |value| u64::from(*value)),
            "fmi3GetInt32" => get!(fmi3GetInt32, 77, |value| *value as u64),
            "fmi3GetUInt32" => get!(fmi3GetUInt32, 77, |value| u64::from(*value)),
            "fmi3GetInt64" => get!(fmi3GetInt64, 77, |value| *value as u64),
            "fmi3GetUInt64" => get!(fmi3GetUInt64, 77, |value| *value),
            "fmi3GetBoolean" => get!(fmi3GetBoolean, 77, |value| truth(*value)),
            "fmi3GetString" => get!(fmi3GetString, UNTOUCHED_TEXT.as_ptr(), |text: &fmi3String| {
                assert!(!text.is_null() && *text != UNTOUCHED_TEXT.as_ptr());
                // SAFETY: not NULL; a string of the FMU's, valid until the next call.
                let bytes = unsafe { CStr::from_ptr(*text) }.to_bytes();
                u64::from_le_bytes(crate::serialized::fnv1a(bytes))
            }),
            "fmi3GetBinary" => {
                let (mut sizes, mut out) = (vec![usize::MAX; room], vec![null(); room]);
                let status = fmu.fmi3GetBinary(vr, n, a.output(2, &mut sizes), a.output(1, &mut out), m);
                let written = if status == Status::Ok { a.vr.len() } else { 0 };
                assert!(sizes[written..].iter().all(|size| *size == usize::MAX), "{self:?}");
                for (size, bytes) in sizes[..written].iter().zip(&out) {
                    // SAFETY: as many bytes of the FMU's, valid until the next call.
                    let bytes = unsafe { std::slice::from_raw_parts(*bytes, *size) };
                    values.push(u64::from_le_bytes(crate::serialized::fnv1a(bytes)));
                }
                status
            }
            "fmi3SetFloat32" => set!(fmi3SetFloat32, reals, |value| *value as f32),
            "fmi3SetFloat64" => set!(fmi3SetFloat64, reals, |value| *value),
            "fmi3SetInt8" => set!(fmi3SetInt8, integers, |value| *value as i8),
            "fmi3SetUInt8" => set!(fmi3SetUInt8, integers, |value| *value as u8),
            "fmi3SetInt16" => set!(fmi3SetInt16, integers, |value| *value as i16),
            "fmi3SetUInt16" => set!(fmi3SetUInt16, integers, |value| *value as u16),
            "fmi3SetInt32" => set!(fmi3SetInt32, integers, |value| *value),
            "fmi3SetUInt32" => set!(fmi3SetUInt32, integers, |value| *value as u32),
            "fmi3SetInt64" => set!(fmi3SetInt64, integers, |value| i64::from(*value)),
            "fmi3SetUInt64" => set!(fmi3SetUInt64, integers, |value| *value as u64),
            "fmi3SetBoolean" => set!(fmi3SetBoolean, integers, |value| *value as u8),
            "fmi3SetString" => {
                let mut texts = a.texts.clone();
                texts.resize(room, null());
                fmu.fmi3SetString(vr, n, a.pointer(1, &texts), m)
            }
            "fmi3SetBinary" => {
                // Some are longer than any variable here allows.
                const LONGEST: usize = 24;
                let mut bytes: Vec<u8> = a.reals.iter().flat_map(|value| value.to_le_bytes()).collect();
                bytes.resize(bytes.len() + LONGEST, 7);
                let sizes = (0..room).map(|at| a.integers.get(at).map_or(0, |n| *n as usize % (LONGEST + 1)));
                let sizes: Vec<_> = sizes.collect();
                let binaries = vec![bytes.as_ptr(); room];
                fmu.fmi3SetBinary(vr, n, a.pointer(2, &sizes), a.pointer(1, &binaries), m)
            }
            "fmi3GetNumberOfVariableDependencies" => {
                let mut count = 0;
                let status = fmu.fmi3GetNumberOfVariableDependencies(
                    a.vr.first().copied().unwrap_or(u32::MAX),
                    &mut count,
                );
                values.push(count as u64);
                status
            }
            "fmi3GetVariableDependencies" => {
                let (mut own, mut kinds, mut known, mut other) = ([9], [0], [0], [9]);
                let (own, known) = (a.output(0, &mut own), a.output(1, &mut known));
                let (other, kinds) = (a.output(2, &mut other), a.output(3, &mut kinds));
                fmu.fmi3GetVariableDependencies(
                    a.vr.first().copied().unwrap_or(u32::MAX),
                    own,
                    known,
                    other,
                    kinds,
                    1,
                )
            }
            "fmi3GetDirectionalDerivative" | "fmi3GetAdjointDerivative" => {
                let forward = self.function == "fmi3GetDirectionalDerivative";
                let (wanted, seeds) = if forward { (n, a.known.len()) } else { (a.known.len(), n) };
                let mut out = vec![f64::INFINITY; wanted.min(room + a.known.len()) + 1];
                let (seed, known) = (a.pointer(2, &a.reals), a.pointer(3, &a.known));
                let call = if forward {
                    Importer::fmi3GetDirectionalDerivative
                } else {
                    Importer::fmi3GetAdjointDerivative
                };
                let status =
                    call(fmu, vr, n, known, a.known.len(), seed, seeds, a.output(1, &mut out), wanted);
                if status == Status::Ok {
                    values.extend(out[..wanted].iter().map(|value| finite(*value)));
                }
                status
            }
            "fmi3UpdateDiscreteStates" => {
                let (mut flags, mut next) = ([2; 5], f64::NAN);
                let [x, y, z, v, w] = flags.each_mut().map(from_mut);
                let (x, w, next_time) = (a.output(0, x), a.output(1, w), a.output(2, from_mut(&mut next)));
                let (y, z, v) = (y.as_mut_ptr(), z.as_mut_ptr(), v.as_mut_ptr());
                let status = fmu.fmi3UpdateDiscreteStates(x, y, z, v, w, next_time);
                if status == Status::Ok {
                    values.extend(flags.map(truth));
                    values.push(finite(next));
                }
                status
            }
            "fmi3CompletedIntegratorStep" => {
                let (mut event, mut terminate) = (2, 2);
                let (to_event, to_terminate) =
                    (a.output(0, from_mut(&mut event)), a.output(1, from_mut(&mut terminate)));
                let status = fmu.fmi3CompletedIntegratorStep(1, to_event, to_terminate);
                if status == Status::Ok {
                    values.extend([event, terminate].map(truth));
                }
                status
            }
            "fmi3SetTime" => fmu.fmi3SetTime(first),
            "fmi3SetContinuousStates" => fmu.fmi3SetContinuousStates(a.pointer(0, &a.reals), n),
            "fmi3GetContinuousStateDerivatives" => real!(fmi3GetContinuousStateDerivatives),
            "fmi3GetEventIndicators" => real!(fmi3GetEventIndicators),
            "fmi3GetContinuousStates" => real!(fmi3GetContinuousStates),
            "fmi3GetNominalsOfContinuousStates" => real!(fmi3GetNominalsOfContinuousStates),
            "fmi3GetOutputDerivatives" => {
                let mut out = vec![f64::INFINITY; room];
                let orders = a.pointer(2, &a.orders);
                let status = fmu.fmi3GetOutputDerivatives(vr, n, orders, a.output(1, &mut out), m);
                if status == Status::Ok {
                    values.extend(out[..a.vr.len()].iter().map(|value| finite(*value)));
                }
                status
            }
            "fmi3DoStep" => {
                let (mut event, mut terminate, mut early, mut end) = (2, 2, 2, f64::NAN);
                let (to_event, to_terminate) =
                    (a.output(0, from_mut(&mut event)), a.output(1, from_mut(&mut terminate)));
                let (to_early, to_end) = (a.output(2, from_mut(&mut early)), a.output(3, from_mut(&mut end)));
                let status = fmu.fmi3DoStep(first, second, 1, to_event, to_terminate, to_early, to_end);
                if status == Status::Ok {
                    values.extend([event, terminate, early].map(truth));
                    values.push(finite(end));
                    assert!(second > 0.0 && end >= first && end <= first + second, "{end}: {self:?}");
                    assert!(early == 0 || end < first + second, "not early: {self:?}");
                }
                status
            }
            "fmi3GetNumberOfEventIndicators" => {
                count(a, &mut values, |n| fmu.fmi3GetNumberOfEventIndicators(n))
            }
            "fmi3GetNumberOfContinuousStates" => {
                count(a, &mut values, |n| fmu.fmi3GetNumberOfContinuousStates(n))
            }
            name => fmu.call_with_zeros(name),
        };
        let discards = self.function == "fmi3DoStep" && status == Status::Discard;
        assert!(discards || [Status::Ok, Status::Error].contains(&status), "{status:?}: {self:?}");
        Answer { status, values }
    }
}

fn count(a: &CallArguments, values: &mut Vec<u64>, call: impl FnOnce(*mut usize) -> Status) -> Status {
    let mut number = usize::MAX;
    let status = call(a.output(0, from_mut(&mut number)));
    values.push(number as u64);
    status
}

fn finite(value: f64) -> u64 {
    assert!(value.is_finite(), "{value} is no number to answer");
    value.to_bits()
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

    fn act(&mut self, u: &mut Unstructured) -> Result<()> {
        let index = u.int_in_range(0..=self.instances.len() - 1)?;
        let kind = u.int_in_range(0..=63_u8)?;
        let Some(slot) = &self.instances[index] else { return self.instantiate(index, u) };
        let steps = slot.made_of.interface == Interface::CoSimulation;
        match kind {
            0 => self.instantiate(index, u)?,
            1..=4 => self.initialize(index),
            5..=7 => self.replay(index, u.arbitrary()?),
            8..=13 => self.handle(index, u)?,
            14..=42 => {
                let function = if steps { *u.choose(&STEPS)? } else { *u.choose(&INTEGRATION)? };
                self.call(index, function, u)?;
            }
            _ => {
                let function = *u.choose(FUNCTIONS)?;
                let ends = ["fmi3Reset", "fmi3Terminate"].contains(&function);
                if !has_handles(function) && (!ends || u.ratio(1, 8)?) {
                    self.call(index, function, u)?;
                }
            }
        }
        Ok(())
    }

    /// Frees an instance, and with it what it has saved.
    fn free(&mut self, index: usize) {
        self.instances[index] = None;
        self.states[index] = [null_mut(); 2];
    }

    fn instantiate(&mut self, index: usize, u: &mut Unstructured) -> Result<()> {
        self.free(index);
        let both = M::CO_SIMULATION.is_some() && M::MODEL_EXCHANGE.is_some();
        let any = *u.choose(&[Interface::CoSimulation, Interface::ModelExchange])?;
        let mut made_of = Arguments::of::<M>(if both { any } else { offered::<M>() });
        let has_events = M::CO_SIMULATION.is_some_and(|offer| offer.has_event_mode());
        made_of.logging_on = u.int_in_range(0..=2)?;
        made_of.early_return_allowed = u.int_in_range(0..=1)?;
        made_of.event_mode_used = (has_events && u.arbitrary()?).into();
        if u.ratio(1, 8)? {
            let texts = [None, Some(c""), Some(c" \t"), Some(c"%s%n#r1#"), Some(c"instance"), Some(c"\xff")];
            made_of.interface = any;
            made_of.event_mode_used = u.int_in_range(0..=2)?;
            if u.ratio(1, 2)? {
                made_of.instantiation_token = u.choose(&texts)?.map(CString::from);
            }
            // None that is accepted differs: a model may show its name, which comes along with the states of others.
            made_of.instance_name = match *u.choose(&texts)? {
                Some(name) if !name.to_bytes().trim_ascii().is_empty() => Some(c"instance"),
                refused => refused,
            };
            made_of.resource_path = *u.choose(&texts)?;
            made_of.required_intermediate_variables = if u.ratio(1, 8)? { &[0] } else { &[] };
        }
        let made = Importer::instantiate(fmu_export::fmi3::functions::<M>(), &made_of);
        let function = match made_of.interface {
            Interface::ModelExchange => "fmi3InstantiateModelExchange",
            Interface::CoSimulation => "fmi3InstantiateCoSimulation",
        };
        self.count(function, if made.is_ok() { Status::Ok } else { Status::Error });
        match made {
            Ok(fmu) => {
                let saved = fmu.bytes();
                self.instances[index] = Some(Slot { fmu, made_of, saved, since: Vec::new() });
                if u.ratio(7, 8)? {
                    self.initialize(index);
                }
            }
            Err(log) => check_messages(log),
        }
        Ok(())
    }

    /// The calls that random ones seldom make in this order.
    fn initialize(&mut self, index: usize) {
        let Some(slot) = &mut self.instances[index] else { return };
        let statuses = [
            ("fmi3Reset", slot.fmu.fmi3Reset()),
            ("fmi3EnterInitializationMode", slot.fmu.fmi3EnterInitializationMode(0, 0.0, 0.0, 0, 0.0)),
            ("fmi3ExitInitializationMode", slot.fmu.fmi3ExitInitializationMode()),
        ];
        slot.start_over();
        for (function, status) in statuses {
            self.count(function, status);
        }
    }

    fn call(&mut self, index: usize, function: &'static str, u: &mut Unstructured) -> Result<()> {
        let Some(slot) = &mut self.instances[index] else { return Ok(()) };
        let before = slot.fmu.bytes();
        let arguments = CallArguments::decode(u, like(function), time(&before), &self.variables)?;
        let call = Call { function, arguments };
        slot.fmu.take_log();
        let answer = call.run(&slot.fmu);
        let log = slot.fmu.take_log();
        if call.must_not_change(answer.status) {
            assert_eq!(before, slot.fmu.bytes(), "changed by a call that answered {answer:?}: {call:?}");
        }
        check_messages(log);
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
        let other = elsewhere.then(|| Importer::with::<M>(&slot.made_of));
        let fmu = other.as_ref().unwrap_or(&slot.fmu);
        fmu.restore(&slot.saved);
        for (call, answer) in &slot.since {
            assert_eq!(call.run(fmu), *answer, "another answer from the same state: {call:?}");
        }
        assert_eq!(fmu.bytes(), end, "another end from the same state");
        slot.start_over();
    }

    /// The six functions of saved states, at times on those of another instance.
    fn handle(&mut self, index: usize, u: &mut Unstructured) -> Result<()> {
        let which = u.int_in_range(0..=self.states.len() - 1)?;
        let owner = if u.ratio(1, 8)? && !self.states[which][which].is_null() { which } else { index };
        let Some(slot) = &mut self.instances[index] else { return Ok(()) };
        let (fmu, state) = (&slot.fmu, &mut self.states[owner][which]);
        let foreign = owner != index;
        let before = fmu.bytes();
        fmu.take_log();
        let (function, status) = match u.int_in_range(0..=6_u8)? {
            0 | 1 => ("fmi3GetFMUState", fmu.fmi3GetFMUState(place(state, u)?)),
            2 => ("fmi3SetFMUState", fmu.fmi3SetFMUState(*state)),
            3 => ("fmi3FreeFMUState", fmu.fmi3FreeFMUState(place(state, u)?)),
            4 => {
                let mut size = 0;
                ("fmi3SerializedFMUStateSize", fmu.fmi3SerializedFMUStateSize(*state, place(&mut size, u)?))
            }
            5 => {
                let mut bytes = before.clone();
                if u.ratio(1, 4)? {
                    bytes.resize(u.int_in_range(0..=1000)?, 0);
                }
                let pointer = if u.ratio(1, 16)? { null_mut() } else { bytes.as_mut_ptr() };
                let status = fmu.fmi3SerializeFMUState(*state, pointer, bytes.len());
                if status == Status::Ok {
                    self.saved = bytes;
                }
                ("fmi3SerializeFMUState", status)
            }
            _ => {
                damage(&mut self.saved, u)?;
                let old = *state;
                let bytes = if u.ratio(1, 16)? { null() } else { self.saved.as_ptr() };
                let size = self.saved.len();
                let status = fmu.fmi3DeserializeFMUState(bytes, size, place(state, u)?);
                assert!(status == Status::Ok || *state == old, "a handle changed by a refused call");
                ("fmi3DeserializeFMUState", status)
            }
        };
        check_messages(fmu.take_log());
        assert!([Status::Ok, Status::Error].contains(&status), "{function} answers {status:?}");
        // Nowhere to free one is no error.
        let refused = status == Status::Error || function == "fmi3FreeFMUState";
        assert!(!foreign || refused && !state.is_null(), "{function} takes another instance's state");
        if function == "fmi3SetFMUState" && status == Status::Ok {
            slot.start_over();
        } else {
            assert_eq!(before, fmu.bytes(), "changed by {function}, which answered {status:?}");
        }
        self.count(function, status);
        Ok(())
    }

    /// Replays what is left, then frees everything, instances with their states.
    fn end(mut self) {
        for index in 0..self.instances.len() {
            self.replay(index, index % 2 == 0);
            self.free(index);
        }
        // What must survive that there is no instance.
        for (function, status) in Importer::null(fmu_export::fmi3::functions::<M>()).call_all() {
            assert_eq!(status, Status::Error, "{function} without an instance");
            self.count(function, status);
        }
    }
}

impl Slot {
    /// Remembers calls from here on.
    fn start_over(&mut self) {
        self.saved = self.fmu.bytes();
        self.fmu.restore(&self.saved);
        self.since.clear();
    }
}

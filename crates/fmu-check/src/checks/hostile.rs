//! Calls that importers should not make, but some do. A crash or a hang is fragile if the standard does not forbid it.

use super::refusals::unknown_reference;
use crate::call_sequence::{Arg, CallSequence, End, Kind, NOBODY, Step};
use crate::checker::Checker;
use crate::description::{kind_of, type_name};
use crate::finding::Judge;
use crate::values::Value;
use crate::writer::{Trajectory, Writer, readable};
use fmi_abi::calls::{Signature, signatures};
use fmi_abi::{Interface, Mode};
use std::sync::Arc;

/// Crashes after which further sequences would only repeat what is known.
const CRASHES: usize = 40;
/// Hangs after which it is not worth while to wait for more.
const HANGS: usize = 2;

/// Plays sequences until `CRASHES` of them have crashed or `HANGS` have hung.
fn all(
    checker: &Checker,
    name: &str,
    sequences: impl IntoIterator<Item = CallSequence>,
) -> anyhow::Result<()> {
    let nothing: Judge = Arc::new(|_| None);
    let (mut crashes, mut hangs) = (0, 0);
    for sequence in sequences {
        match checker.judge(name, sequence, Arc::clone(&nothing))?.end {
            End::Hang(_) => hangs += 1,
            End::Done => {}
            _ => crashes += 1,
        }
        if crashes >= CRASHES || hangs >= HANGS {
            break;
        }
    }
    Ok(())
}

/// NULL for the instance that is to be freed, which is allowed.
pub fn free_null(checker: &Checker) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    writer.forbidden = true;
    writer.add(Step::Free(NOBODY));
    let nothing: Judge = Arc::new(|_| None);
    checker.judge("life_cycle.free-null", writer.sequence, nothing)?;
    Ok(())
}

/// Passes NULL as the instance, NULL for arrays, unknown references, and sizes that do not fit.
pub fn calls(checker: &Checker) -> anyhow::Result<()> {
    let standard = checker.description.standard;
    for trajectory in &checker.trajectories {
        let (mut of_null, mut nulls) = (Vec::new(), Vec::new());
        for signature in signatures(standard) {
            let name = &signature.rule.name[4..];
            let mode = MODES
                .into_iter()
                .rev()
                .find(|mode| signature.rule.standard.contain(standard, trajectory.interface, *mode));
            let Some(mode) = mode else { continue };
            if name.to_lowercase().contains("fmustate") && !checker.saves(trajectory.interface) {
                continue;
            }
            let mut writer = checker.writer();
            writer.forbidden(
                None,
                name,
                signature.arguments.iter().map(|argument| harmless(argument.of)).collect(),
            );
            of_null.push(writer.sequence);
            let pointers = signature.arguments.iter().filter(|argument| argument.of.starts_with('*')).count();
            for null in 0..pointers {
                let mut writer = checker.writer();
                to_mode(&mut writer, trajectory, mode);
                writer.forbidden(Some(0), name, with_null(checker, signature, null));
                nulls.push(writer.sequence);
            }
        }
        all(checker, "hostile.null-instance", of_null)?;
        all(checker, "hostile.null", nulls)?;
        references(checker, trajectory)?;
        sizes(checker, trajectory)?;
    }
    Ok(())
}

/// The modes in which functions are called.
const MODES: [Mode; 5] =
    [Mode::Instantiated, Mode::Initialization, Mode::StepComplete, Mode::Event, Mode::ContinuousTime];

/// An argument of a type: zero, or NULL.
fn harmless(of: &str) -> Arg {
    match of {
        "usize" | "fmi2ValueReference" | "fmi3ValueReference" => Arg::Whole(0),
        of if of.starts_with('*')
            || of.contains("state")
            || of.contains("State")
            || of.contains("String") =>
        {
            Arg::Null
        }
        of if of.contains("Real") || of.contains("Float64") => Arg::real(0.0),
        _ => Arg::Whole(0),
    }
}

/// The arguments of a call for one value, in which one array is NULL.
fn with_null(checker: &Checker, signature: &Signature, null: usize) -> Vec<Arg> {
    let standard = checker.description.standard;
    let name = &signature.rule.name[4..];
    let mut at = 0;
    let args = signature.arguments.iter().map(|argument| {
        if argument.of == "usize" {
            return Arg::Whole(1);
        }
        if !argument.of.starts_with('*') {
            return if argument.of.contains("FMU") { Arg::Null } else { harmless(argument.of) };
        }
        at += 1;
        match argument.pointee() {
            _ if at - 1 == null => Arg::Null,
            Some(("ValueReference", true)) => {
                let of_type = checker.description.variables.iter().find(|variable| {
                    variable.size == Some(1)
                        && variable.base.is_some_and(|base| name.ends_with(type_name(standard, base)))
                });
                let reference = of_type.map_or(0, |variable| u64::from(variable.reference));
                Arg::In(Kind::U32, vec![reference])
            }
            Some((_, true)) => Arg::In(Kind::F64, vec![0]),
            _ => Arg::Out(Kind::F64, 4),
        }
    });
    args.collect()
}

fn to_mode(writer: &mut Writer, trajectory: &Trajectory, mode: Mode) {
    match mode {
        Mode::Instantiated => {
            writer.make(0, trajectory.interface);
        }
        Mode::Initialization => {
            writer.make(0, trajectory.interface);
            writer.enter(0);
        }
        Mode::Event => {
            writer.make(0, trajectory.interface);
            writer.enter(0);
            writer.call(0, "ExitInitializationMode", vec![]);
        }
        _ => {
            writer.begin(0, trajectory);
        }
    }
}

/// The types of FMI 2.0 and FMI 3.0 in the names of getters and setters, and their types in C.
const FMI2_TYPES: &[(&str, Kind)] =
    &[("Real", Kind::F64), ("Integer", Kind::I32), ("Boolean", Kind::I32), ("String", Kind::Pointer)];
const FMI3_TYPES: &[(&str, Kind)] = &[
    ("Float64", Kind::F64),
    ("Float32", Kind::F32),
    ("Int8", Kind::I8),
    ("UInt8", Kind::U8),
    ("Int16", Kind::I16),
    ("UInt16", Kind::U16),
    ("Int32", Kind::I32),
    ("UInt32", Kind::U32),
    ("Int64", Kind::I64),
    ("UInt64", Kind::U64),
    ("Boolean", Kind::U8),
    ("String", Kind::Pointer),
];

/// Passes references that no variable has to all getters and setters.
fn references(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let fmi3 = checker.fmi3();
    let types = if fmi3 { FMI3_TYPES } else { FMI2_TYPES };
    let mut wrong = Vec::new();
    for reference in [unknown_reference(checker), u64::from(u32::MAX), 1 << 31, 1 << 20] {
        if description.variables.iter().any(|variable| u64::from(variable.reference) == reference) {
            continue;
        }
        for (name, kind) in types {
            for get in [true, false] {
                let mut writer = checker.writer();
                writer.begin(0, trajectory);
                let values = match (get, kind) {
                    (true, _) => Arg::Out(*kind, 1),
                    (false, Kind::Pointer) => Arg::Texts(vec![Some(b"text".to_vec())]),
                    (false, _) => Arg::In(*kind, vec![0]),
                };
                let mut args = vec![Arg::In(Kind::U32, vec![reference]), Arg::Whole(1), values];
                if fmi3 {
                    args.push(Arg::Whole(1));
                }
                writer.forbidden(Some(0), &format!("{}{name}", if get { "Get" } else { "Set" }), args);
                wrong.push(writer.sequence);
            }
        }
    }
    all(checker, "hostile.references", wrong)
}

/// Passes sizes that do not fit: for arrays of FMI 3.0, and in Model Exchange for the vectors of states.
fn sizes(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let fmi3 = checker.fmi3();
    let mut sizes = Vec::new();
    for index in readable(description) {
        let variable = &description.variables[index];
        let (Some(base), Some(size)) = (variable.base, variable.size) else { continue };
        let (name, kind) = (type_name(description.standard, base), kind_of(description.standard, base));
        if !fmi3 || kind == Kind::Pointer || sizes.len() > 60 {
            continue;
        }
        for count in [0, size - 1, size + 1] {
            for get in [true, false] {
                let mut writer = checker.writer();
                to_mode(&mut writer, trajectory, Mode::Initialization);
                let values = if get { Arg::Out(kind, count) } else { Arg::In(kind, vec![0; count]) };
                let reference = Arg::In(Kind::U32, vec![u64::from(variable.reference)]);
                let args = vec![reference, Arg::Whole(1), values, Arg::Whole(count as i64)];
                writer.forbidden(Some(0), &format!("{}{name}", if get { "Get" } else { "Set" }), args);
                sizes.push(writer.sequence);
            }
        }
    }
    if trajectory.interface == Interface::ModelExchange {
        let states = description.states_count().unwrap_or(0);
        for (function, right, get) in [
            ("GetContinuousStates", states, true),
            ("GetNominalsOfContinuousStates", states, true),
            ("SetContinuousStates", states, false),
            (if fmi3 { "GetContinuousStateDerivatives" } else { "GetDerivatives" }, states, true),
            ("GetEventIndicators", description.event_indicators.unwrap_or(0), true),
        ] {
            for count in [right.saturating_sub(1), right + 1] {
                if count == right {
                    continue;
                }
                let mut writer = checker.writer();
                writer.begin(0, trajectory);
                let values =
                    if get { Arg::Out(Kind::F64, count) } else { Arg::In(Kind::F64, vec![0; count]) };
                writer.forbidden(Some(0), function, vec![values, Arg::Whole(count as i64)]);
                sizes.push(writer.sequence);
            }
        }
    }
    all(checker, "hostile.sizes", sizes)
}

/// Extreme values of a type that is not floating-point. A large count asks for much memory, which the machine may not have.
fn extreme_values(name: &str, kind: Kind, size: usize) -> Vec<Value> {
    let numbers = |numbers: &[f64]| -> Vec<Value> {
        numbers.iter().map(|number| Value::Numbers(vec![*number; size])).collect()
    };
    match kind {
        Kind::Pointer if name == "String" => {
            [&b""[..], b"%s%n%s%n%s%n", b"\xff\xfe no UTF-8", &[b'x'; 100_000]]
                .map(|text| Value::Texts(vec![text.to_vec(); size]))
                .to_vec()
        }
        Kind::Pointer => {
            vec![Value::Texts(vec![Vec::new(); size]), Value::Texts(vec![vec![7; 100_000]; size])]
        }
        kind if kind.is_float() => Vec::new(),
        Kind::I8 | Kind::U8 => numbers(&[0.0, 127.0]),
        Kind::I16 | Kind::U16 => numbers(&[0.0, 32767.0]),
        Kind::U32 | Kind::U64 | Kind::Size => numbers(&[0.0, 4294967295.0]),
        _ => numbers(&[0.0, -1.0, 2147483647.0, -2147483648.0]),
    }
}

/// Sets NaN, infinite, extreme and malformed values of parameters and inputs.
pub fn values(checker: &Checker) -> anyhow::Result<()> {
    let description = &checker.description;
    for trajectory in &checker.trajectories {
        let mut sequences = Vec::new();
        let settable: Vec<usize> = readable(description)
            .into_iter()
            .filter(|index| {
                let variable = &description.variables[*index];
                !variable.clocked
                    && (variable.causality == "input"
                        || variable.initial == "exact"
                            && variable.variability != "constant"
                            && variable.causality != "structuralParameter")
            })
            .collect();
        let play = |writer: &mut Writer, inputs: &[(usize, Value)], parameters: &[(usize, Value)]| {
            writer.make(0, trajectory.interface);
            writer.enter(0);
            writer.forbidden = true;
            writer.set(0, parameters);
            writer.set(0, inputs);
            writer.leave(0, trajectory);
            for point in trajectory.points.iter().take(3) {
                let point = crate::writer::Point { inputs: inputs.to_vec(), ..point.clone() };
                writer.point(0, trajectory, &point);
                writer.ask(0, trajectory.interface);
            }
            writer.free(0);
            writer.forbidden = false;
        };
        for number in [f64::NAN, f64::INFINITY, 1e308, -1e308, 5e-324, 0.0, -1.0, 1e9] {
            for input in [true, false] {
                let these = |want: bool| -> Vec<(usize, Value)> {
                    let variables = settable.iter().map(|index| (*index, &description.variables[*index]));
                    let chosen = variables.filter(|(_, variable)| {
                        variable.is_float() && (variable.causality == "input") == want && want == input
                    });
                    let values = |size: Option<usize>| Value::Numbers(vec![number; size.unwrap_or(1)]);
                    chosen.map(|(index, variable)| (index, values(variable.size))).collect()
                };
                let (inputs, parameters) = (these(true), these(false));
                if inputs.is_empty() && parameters.is_empty() {
                    continue;
                }
                let mut writer = checker.writer();
                play(&mut writer, &inputs, &parameters);
                sequences.push(writer.sequence);
            }
        }
        for (index, base) in
            settable.iter().filter_map(|index| Some((*index, description.variables[*index].base?)))
        {
            let size = description.variables[index].size.unwrap_or(1);
            let kind = kind_of(description.standard, base);
            let tries = extreme_values(type_name(description.standard, base), kind, size);
            for value in tries {
                let of = vec![(index, value)];
                let mut writer = checker.writer();
                let input = description.variables[index].causality == "input"
                    && trajectory.interface == Interface::CoSimulation;
                if input {
                    play(&mut writer, &of, &[])
                } else {
                    play(&mut writer, &[], &of)
                }
                sequences.push(writer.sequence);
            }
        }
        sequences.truncate(120);
        all(checker, "hostile.values", sequences)?;
    }
    Ok(())
}

/// Times and steps that are none, too great or too small.
pub fn times(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in &checker.trajectories {
        let mut sequences = Vec::new();
        let start = checker.description.start_time;
        let size = trajectory.points.first().map_or(1e-3, |point| point.size).max(1e-9);
        for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308, 1e12 * size, -size, 0.0, 5e-324] {
            let mut writer = checker.writer();
            writer.begin(0, trajectory);
            writer.forbidden = true;
            match trajectory.interface {
                Interface::CoSimulation => {
                    writer.step(0, start, number);
                }
                Interface::ModelExchange => {
                    writer.call(0, "SetTime", vec![Arg::real(number)]);
                    writer.ask(0, trajectory.interface);
                    writer.call(0, "EnterEventMode", vec![]);
                    writer.update(0, 1);
                }
            }
            writer.read(0);
            writer.free(0);
            sequences.push(writer.sequence);
            let mut writer = checker.writer();
            writer.make(0, trajectory.interface);
            writer.forbidden = true;
            writer.enter_with(0, None, number, None);
            writer.leave(0, trajectory);
            if trajectory.interface == Interface::CoSimulation {
                writer.step(0, number, size);
            }
            writer.read(0);
            writer.free(0);
            sequences.push(writer.sequence);
        }
        all(checker, "hostile.times", sequences)?;
    }
    Ok(())
}

/// Bytes that are no state, and some that almost are.
pub fn bytes(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in
        checker.trajectories.iter().filter(|trajectory| checker.serializes(trajectory.interface))
    {
        let mut writer = checker.writer();
        writer.begin(0, trajectory);
        writer.save(0, 0);
        let [_, saved] = writer.serialize(0, 0);
        let run = checker.play(&writer.sequence)?;
        let Some(crate::call_sequence::Written::Numbers(_, bytes)) = run.written(saved) else { continue };
        let mut tries: Vec<Vec<u64>> =
            vec![Vec::new(), vec![0; 8], vec![0; bytes.len()], vec![255; bytes.len()]];
        tries.push(bytes[..bytes.len() / 2].to_vec());
        tries.push([bytes.clone(), bytes.clone()].concat());
        let mut random = checker.seed | 1;
        for _ in 0..20 {
            let mut damaged = bytes.clone();
            for _ in 0..3 {
                random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                if !damaged.is_empty() {
                    let at = (random >> 33) as usize % damaged.len();
                    damaged[at] = random >> 20 & 0xff;
                }
            }
            tries.push(damaged);
        }
        let name = if checker.fmi3() { "DeserializeFMUState" } else { "DeSerializeFMUstate" };
        let set = if checker.fmi3() { "SetFMUState" } else { "SetFMUstate" };
        let sequences: Vec<CallSequence> = tries
            .into_iter()
            .map(|bytes| {
                let mut writer = checker.writer();
                writer.begin(0, trajectory);
                writer.forbidden = true;
                let count = bytes.len() as i64;
                writer.call(0, name, vec![Arg::In(Kind::U8, bytes), Arg::Whole(count), Arg::StateOut(1)]);
                writer.call(0, set, vec![Arg::State(1)]);
                writer.ask(0, trajectory.interface);
                if trajectory.interface == Interface::CoSimulation
                    && let Some(point) = trajectory.points.first()
                {
                    writer.step(0, point.time, point.size);
                }
                writer.free(0);
                writer.sequence
            })
            .collect();
        all(checker, "hostile.bytes", sequences)?;
    }
    Ok(())
}

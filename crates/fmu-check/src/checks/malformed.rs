//! Writes malformed calls, which a faulty importer may make. A crash or a hang is a finding with the severity fragile.

use super::rejections::unknown_reference;
use crate::call_sequence::{Arg, CallSequence, End, Kind, Values};
use crate::checker::Checker;
use crate::description::{kind_of, type_name};
use crate::writer::{Part, Point, Trajectory, Writer, access};
use fmi_abi::calls::{Random, Signature, signatures};
use fmi_abi::{BaseType, Causality, Mode};

/// Number of crashes after which no further call sequence of a rule is executed.
const CRASHES: usize = 40;
/// Number of hangs after which no further call sequence of a rule is executed.
const HANGS: usize = 2;

/// Call sequences for one rule.
type Sequences = anyhow::Result<Vec<CallSequence>>;

/// Executes call sequences, until `CRASHES` of them have crashed or ended the process, or `HANGS` have hung.
pub fn all(checker: &Checker, name: &str, sequences: Vec<CallSequence>) -> anyhow::Result<()> {
    let (mut crashes, mut hangs) = (0, 0);
    for sequence in sequences {
        match checker.evaluate(name, sequence, |_| None)?.end {
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

/// Returns a call sequence of allowed parts (`legal`), then the calls that `write` adds, which are marked as forbidden.
fn after(
    checker: &Checker,
    trajectory: &Trajectory,
    legal: &[Part],
    write: impl FnOnce(&mut Writer),
) -> CallSequence {
    let mut writer = checker.writer(trajectory);
    writer.write(0, legal);
    writer.forbidden = true;
    write(&mut writer);
    writer.sequence
}

/// Returns, for each function that the interface type and the capabilities of the FMU allow, its signature, its name without
/// prefix, and the parts that lead to the first of `MODES` in which it is allowed.
fn callable(
    checker: &Checker,
    trajectory: &Trajectory,
) -> impl Iterator<Item = (&'static Signature, &'static str, &'static [Part])> {
    const MODES: [(Mode, &[Part]); 5] = [
        (Mode::ContinuousTime, &[Part::Begin]),
        (Mode::Event, &[Part::Make, Part::Enter, Part::Call("ExitInitializationMode")]),
        (Mode::StepComplete, &[Part::Begin]),
        (Mode::Initialization, &[Part::Make, Part::Enter]),
        (Mode::Instantiated, &[Part::Make]),
    ];
    let (standard, interface) = (checker.description.standard, trajectory.interface);
    let saves = checker.saves(interface);
    signatures(standard).iter().filter_map(move |signature| {
        let allowed = |(mode, _): &&(Mode, _)| signature.rule.standard.contains(standard, interface, *mode);
        let (_, parts) = MODES.iter().find(allowed)?;
        let name = &signature.rule.name[4..];
        (saves || !name.to_lowercase().contains("fmustate")).then_some((signature, name, *parts))
    })
}

/// Passes NULL as the instance, and zero or NULL as every other argument.
pub fn null_instances(checker: &Checker, trajectory: &Trajectory) -> Sequences {
    let sequences = callable(checker, trajectory).map(|(signature, name, _)| {
        let args = signature.arguments.iter().map(|argument| zero_or_null(argument.of)).collect();
        after(checker, trajectory, &[], |writer| {
            writer.forbidden(None, name, args);
        })
    });
    Ok(sequences.collect())
}

/// Passes NULL for each array of a call, one array in each call sequence.
pub fn nulls(checker: &Checker, trajectory: &Trajectory) -> Sequences {
    let sequences = callable(checker, trajectory).flat_map(|(signature, name, parts)| {
        let arrays = signature.arguments.iter().filter(|argument| argument.of.starts_with('*')).count();
        (0..arrays).map(move |null| {
            let args = with_null(checker, signature, null);
            after(checker, trajectory, parts, |writer| {
                writer.call(0, name, args);
            })
        })
    });
    Ok(sequences.collect())
}

/// Returns zero or NULL as an argument of this type.
fn zero_or_null(name: &str) -> Arg {
    match name.trim_start_matches("fmi2").trim_start_matches("fmi3") {
        "Real" | "Float64" => Arg::real(0.0),
        name if name.starts_with('*') || name.to_lowercase().contains("state") || name == "String" => {
            Arg::Null
        }
        _ => Arg::Integer(0),
    }
}

/// Returns the arguments of a call that reads or sets one value, with NULL for the array at the index `null`.
fn with_null(checker: &Checker, signature: &Signature, null: usize) -> Vec<Arg> {
    let standard = checker.description.standard;
    let name = &signature.rule.name[4..];
    let mut array = 0;
    let args = signature.arguments.iter().map(|argument| {
        if argument.of == "usize" {
            return Arg::Integer(1);
        }
        if !argument.of.starts_with('*') {
            return if argument.of.contains("FMU") { Arg::Null } else { zero_or_null(argument.of) };
        }
        array += 1;
        match argument.pointee() {
            _ if array - 1 == null => Arg::Null,
            Some(("ValueReference", true)) => {
                let variable = checker.description.variables.iter().find(|variable| {
                    variable.size == Some(1)
                        && variable.base.is_some_and(|base| name.ends_with(type_name(standard, base)))
                });
                let reference = variable.map_or(0, |variable| u64::from(variable.reference));
                Arg::In(Kind::U32, vec![reference])
            }
            Some((_, true)) => Arg::In(Kind::F64, vec![0]),
            _ => Arg::Out(Kind::F64, 4),
        }
    });
    args.collect()
}

/// Calls all getters and setters, except the getter and the setter of Binary, with value references that belong to no variable.
pub fn references(checker: &Checker, trajectory: &Trajectory) -> Sequences {
    let description = &checker.description;
    let standard = description.standard;
    let mut types: Vec<(&str, Kind)> =
        BaseType::ALL.iter().map(|base| (type_name(standard, *base), kind_of(standard, *base))).collect();
    types.retain(|(name, _)| *name != "Binary");
    types.sort_unstable_by_key(|(name, _)| *name);
    types.dedup();
    let mut sequences = Vec::new();
    for reference in [unknown_reference(checker), u64::from(u32::MAX), 1 << 31, 1 << 20] {
        if description.variables.iter().any(|variable| u64::from(variable.reference) == reference) {
            continue;
        }
        for (name, kind) in &types {
            for get in [true, false] {
                let values = match (get, kind) {
                    (true, _) => Arg::Out(*kind, 1),
                    (false, Kind::Pointer) => Arg::Strings(vec![Some(b"text".to_vec())]),
                    (false, _) => Arg::In(*kind, vec![0]),
                };
                sequences.push(after(checker, trajectory, &[Part::Begin], |writer| {
                    let args = access(standard, vec![reference], [values], 1);
                    writer.call(0, &format!("{}{name}", if get { "Get" } else { "Set" }), args);
                }));
            }
        }
    }
    Ok(sequences)
}

/// Passes wrong array sizes: in FMI 3.0 for the values of variables, and in Model Exchange for the vectors of states, derivatives, nominal
/// values and event indicators.
pub fn sizes(checker: &Checker, trajectory: &Trajectory) -> Sequences {
    let description = &checker.description;
    let mut sequences = Vec::new();
    let values = |get: bool, kind: Kind, count: usize| match get {
        true => Arg::Out(kind, count),
        false => Arg::In(kind, vec![0; count]),
    };
    for index in checker.readable.iter().filter(|_| checker.fmi3()) {
        let variable = &description.variables[*index];
        let (Some(base), Some(size)) = (variable.base, variable.size) else { continue };
        let (name, kind) = (type_name(description.standard, base), kind_of(description.standard, base));
        if kind == Kind::Pointer || sequences.len() > 60 {
            continue;
        }
        for count in [0, size - 1, size + 1] {
            for (verb, get) in [("Get", true), ("Set", false)] {
                sequences.push(after(checker, trajectory, &[Part::Make, Part::Enter], |writer| {
                    let reference = vec![u64::from(variable.reference)];
                    let args = access(description.standard, reference, [values(get, kind, count)], count);
                    writer.call(0, &format!("{verb}{name}"), args);
                }));
            }
        }
    }
    let states = description.states_count();
    let vectors = [
        ("GetContinuousStates", states),
        ("GetNominalsOfContinuousStates", states),
        ("SetContinuousStates", states),
        (checker.writer(trajectory).derivatives_name(), states),
        ("GetEventIndicators", description.indicators_count()),
    ];
    for (function, size) in vectors.into_iter().filter(|_| !trajectory.is_stepped()) {
        for count in [size.checked_sub(1), Some(size + 1)].into_iter().flatten() {
            let args =
                vec![values(function.starts_with("Get"), Kind::F64, count), Arg::Integer(count as i64)];
            sequences.push(after(checker, trajectory, &[Part::Begin], |writer| {
                writer.call(0, function, args);
            }));
        }
    }
    Ok(sequences)
}

/// Returns extreme values of a type that is not floating-point. Unsigned 64-bit values stay below 2^32, because an FMU may allocate as many
/// elements.
fn extreme_values(name: &str, kind: Kind, size: usize) -> Vec<Values> {
    let numbers: &[f64] = match kind {
        Kind::Pointer => {
            let long = vec![b'x'; 100_000];
            let texts: &[&[u8]] = match name {
                "String" => &[b"", b"%s%n%s%n%s%n", b"\xff\xfe no UTF-8", &long],
                _ => &[b"", &long],
            };
            return texts.iter().map(|text| Values::strings(text, size)).collect();
        }
        kind if kind.is_float() => &[],
        Kind::I8 | Kind::U8 => &[0.0, 127.0],
        Kind::I16 | Kind::U16 => &[0.0, 32767.0],
        Kind::U32 | Kind::U64 | Kind::Size => &[0.0, 4294967295.0],
        _ => &[0.0, -1.0, 2147483647.0, -2147483648.0],
    };
    numbers.iter().map(|number| Values::new(kind, vec![*number; size])).collect()
}

/// Sets inputs and variables with `initial` = `exact` to NaN and to infinite, extreme and malformed values.
pub fn values(checker: &Checker, trajectory: &Trajectory) -> Sequences {
    let (description, mut sequences) = (&checker.description, Vec::new());
    let mut settable = checker.readable.clone();
    settable.retain(|index| {
        let variable = &description.variables[*index];
        !variable.clocked && variable.is_settable() && variable.causality != Causality::StructuralParameter
    });
    let is_input = |index: usize| description.variables[index].causality == Causality::Input;
    let size = |index: usize| description.variables[index].size.unwrap_or(1);
    // Adds a call sequence that sets the values in Initialization Mode and, if `at_points` is true, at the first three points.
    let mut add = |values: Vec<(usize, Values)>, at_points: bool| {
        sequences.push(after(checker, trajectory, &[Part::Make, Part::Enter], |writer| {
            writer.set(0, &values);
            writer.leave(0);
            for point in trajectory.points.iter().take(3) {
                let inputs = if at_points { values.clone() } else { Vec::new() };
                writer.point(0, &Point { inputs, ..point.clone() });
                writer.read_all(0);
            }
            writer.free(0);
        }));
    };
    for number in [f64::NAN, f64::INFINITY, 1e308, -1e308, 5e-324, 0.0, -1.0, 1e9] {
        for input in [true, false] {
            let chosen = settable.iter().copied();
            let chosen =
                chosen.filter(|index| description.variables[*index].is_float() && is_input(*index) == input);
            let values: Vec<_> = chosen
                .map(|index| (index, Values::new(description.kind(index), vec![number; size(index)])))
                .collect();
            if !values.is_empty() {
                add(values, input);
            }
        }
    }
    for index in settable {
        let Some(base) = description.variables[index].base else { continue };
        let (name, kind) = (type_name(description.standard, base), kind_of(description.standard, base));
        for value in extreme_values(name, kind, size(index)) {
            add(vec![(index, value)], is_input(index) && trajectory.is_stepped());
        }
    }
    sequences.truncate(120);
    Ok(sequences)
}

/// Passes NaN, infinite, negative, zero, tiny and huge numbers as step size or time, and as start time.
pub fn times(checker: &Checker, trajectory: &Trajectory) -> Sequences {
    let start = checker.description.start_time;
    let size = trajectory.points.first().map_or(1e-3, |point| point.size).max(1e-9);
    let mut sequences = Vec::new();
    // An importer that confuses milliseconds and seconds requests a step of 2e3 s.
    let numbers = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308, 1e12 * size, -size, 0.0, 5e-324, 2e3];
    for number in numbers {
        sequences.push(after(checker, trajectory, &[Part::Begin], |writer| {
            if trajectory.is_stepped() {
                writer.step(0, start, number);
            } else {
                writer.call(0, "SetTime", vec![Arg::real(number)]);
                writer.write(0, &[Part::ReadAll, Part::Call("EnterEventMode"), Part::Update]);
            }
            writer.write(0, &[Part::Read, Part::Free]);
        }));
        sequences.push(after(checker, trajectory, &[Part::Make], |writer| {
            writer.enter_with(0, None, number, None);
            writer.leave(0);
            if trajectory.is_stepped() {
                writer.step(0, number, size);
            }
            writer.write(0, &[Part::Read, Part::Free]);
        }));
    }
    Ok(sequences)
}

/// Passes malformed bytes as a serialized state: no bytes, bytes that are all equal, and a state that is truncated, repeated or
/// damaged.
pub fn bytes(checker: &Checker, trajectory: &Trajectory) -> Sequences {
    let mut writer = checker.writer(trajectory);
    writer.write(0, &[Part::Begin, Part::Save(0)]);
    let [_, saved] = writer.serialize(0, 0);
    let run = checker.execute(&writer.sequence)?;
    let Some(Values::Numbers(_, bytes)) = run.written(saved) else { return Ok(Vec::new()) };
    let mut malformed: Vec<Vec<u64>> = vec![
        Vec::new(),
        vec![0; 8],
        vec![0; bytes.len()],
        vec![255; bytes.len()],
        bytes[..bytes.len() / 2].to_vec(),
        [bytes.clone(), bytes.clone()].concat(),
    ];
    let mut random = Random::mixed(checker.seed);
    for _ in 0..20 {
        let mut damaged = bytes.clone();
        for _ in 0..if damaged.is_empty() { 0 } else { 3 } {
            let at = random.below(damaged.len());
            damaged[at] = random.below(256) as u64;
        }
        malformed.push(damaged);
    }
    let sequence = |bytes: Vec<u64>| {
        after(checker, trajectory, &[Part::Begin], |writer| {
            let count = Arg::Integer(bytes.len() as i64);
            let args = vec![Arg::In(Kind::U8, bytes), count, Arg::StateOut(1)];
            writer.call(0, "DeserializeFMUState", args);
            writer.write(0, &[Part::Restore(1), Part::ReadAll]);
            if let Some(point) = trajectory.points.first().filter(|_| trajectory.is_stepped()) {
                writer.step(0, point.time, point.size);
            }
            writer.free(0);
        })
    };
    Ok(malformed.into_iter().map(sequence).collect())
}

//! Checks that invalid calls are rejected and that a rejected call changes nothing.

use crate::call_sequence::{Arg, Kind, Run};
use crate::checker::Checker;
use crate::description::{Variable, kind_of, type_name};
use crate::finding::status_name;
use crate::values::{near, other_values};
use crate::writer::{Calls, Part, Point, Read, Trajectory, Writer, access, difference, step_args};
use fmi_abi::Interface;
use std::sync::Arc;

/// Invalid call: the function, its arguments, a description, and the rule that the FMU breaks if it accepts the call.
type Attack = (String, Vec<Arg>, String, Option<&'static str>);

const TOLERATED: Option<&str> = Some("rejections.tolerated");
const ACCEPTED: Option<&str> = Some("rejections.accepted");

fn attack(function: &str, args: Vec<Arg>, what: &str, rule: Option<&'static str>) -> Attack {
    (function.to_owned(), args, what.to_owned(), rule)
}

/// Returns a value reference that no variable has.
pub fn unknown_reference(checker: &Checker) -> u64 {
    let used: Vec<u32> = checker.description.variables.iter().map(|variable| variable.reference).collect();
    let greatest = used.iter().copied().max().unwrap_or(0);
    u64::from(
        greatest.checked_add(1000).unwrap_or_else(|| (0..).find(|free| !used.contains(free)).unwrap_or(0)),
    )
}

/// Returns the arguments of a setter.
fn set(checker: &Checker, references: Vec<u64>, kind: Kind, bits: Vec<u64>) -> Vec<Arg> {
    let total = bits.len();
    access(checker.description.standard, references, [Arg::In(kind, bits)], total)
}

/// Returns calls that set variables that cannot be set, separately or together with an input.
fn variable_attacks(checker: &Checker, interface: Interface) -> Vec<Attack> {
    let description = &checker.description;
    let unknown = unknown_reference(checker);
    let (mut attacks, mut observed, mut inputs_tried) = (Vec::new(), Vec::new(), 0);
    for index in &checker.readable {
        let variable = &description.variables[*index];
        let (Some(base), Some(1)) = (variable.base, variable.size) else { continue };
        let (name, kind) = (type_name(description.standard, base), kind_of(description.standard, base));
        if kind == Kind::Pointer {
            continue;
        }
        let (function, reference) = (format!("Set{name}"), u64::from(variable.reference));
        let start = variable.starts().first().copied().unwrap_or(0.0);
        let other = kind.bits(match kind.is_float() {
            true => near(variable, start, 1.0 / 32.0),
            false => 1.0 - start.clamp(0.0, 1.0),
        });
        let stepped = interface == Interface::CoSimulation;
        let is = |causality: &str, variability: &str| {
            variable.causality == causality && variable.variability == variability
        };
        let input = variable.causality == "input"
            && !variable.clocked
            && (stepped || variable.variability == "continuous");
        let mut once = |group: &'static str| {
            !observed.contains(&group) && {
                observed.push(group);
                true
            }
        };
        if (input || is("parameter", "tunable") && stepped) && once(name) {
            let what = format!("a value for {} and one for a reference that no variable has", variable.name);
            let args = set(checker, vec![reference, unknown], kind, vec![other; 2]);
            attacks.push((function.clone(), args, what, None));
        }
        if input && kind.is_float() && inputs_tried < 3 {
            inputs_tried += 1;
            attacks.extend(input_attacks(checker, variable, &function, kind, other));
        }
        let (group, rule, what) = if variable.variability == "constant" {
            ("constant", Some("rejections.constant"), format!("a value for the constant {}", variable.name))
        } else if variable.causality == "output" && variable.initial == "calculated" {
            ("output", TOLERATED, format!("a value for the output {}", variable.name))
        } else if is("parameter", "fixed") {
            let what = format!("a value for the fixed parameter {} after the initialization", variable.name);
            let group = match name {
                "Real" | "Float64" => "fixed",
                "Integer" | "Int32" => "fixed integer",
                _ => "fixed other",
            };
            (group, TOLERATED, what)
        } else {
            continue;
        };
        if once(group) {
            let first = input_of(checker, kind).filter(|_| group != "constant");
            let references: Vec<u64> = first.into_iter().chain([reference]).collect();
            let bits = vec![other; references.len()];
            attacks.push((function, set(checker, references, kind, bits), what, rule));
        }
    }
    attacks
}

/// Returns calls that set one input to a valid value and another input to NaN or a value beyond its maximum.
fn input_attacks(
    checker: &Checker,
    variable: &Variable,
    function: &str,
    kind: Kind,
    other: u64,
) -> Vec<Attack> {
    let reference = u64::from(variable.reference);
    let another = checker.description.variables.iter().find(|other| {
        other.causality == "input"
            && other.base == variable.base
            && other.reference != variable.reference
            && other.size == Some(1)
    });
    let second = another.map_or(reference, |other| u64::from(other.reference));
    let beyond = variable.max.map(|max| ([second, reference], max + 1.0 + max.abs(), "beyond its max"));
    let values = [([reference, second], f64::NAN, "and NaN for a second")].into_iter().chain(beyond);
    let invalid = |(references, number, what): ([u64; 2], f64, &str)| {
        let args = set(checker, references.to_vec(), kind, vec![other, kind.bits(number)]);
        attack(function, args, &format!("a value for {} {what}", variable.name), None)
    };
    values.map(invalid).collect()
}

/// Returns calls with unknown value references, calls that only another mode allows, and a malformed serialized state.
fn call_attacks(checker: &Checker, interface: Interface, time: f64) -> Vec<Attack> {
    let (unknown, fmi3) = (unknown_reference(checker), checker.fmi3());
    let (get_float, set_float) = if fmi3 { ("GetFloat64", "SetFloat64") } else { ("GetReal", "SetReal") };
    let get = access(checker.description.standard, vec![unknown], [Arg::Out(Kind::F64, 1)], 1);
    let set = set(checker, vec![unknown], Kind::F64, vec![0]);
    let experiment =
        vec![Arg::Integer(0), Arg::real(0.0), Arg::real(time + 7.0), Arg::Integer(0), Arg::real(0.0)];
    let (experiment, nothing) = if fmi3 { (vec![], experiment) } else { (experiment, vec![]) };
    let (exit, enter) = ("ExitInitializationMode", "EnterInitializationMode");
    let mut attacks = vec![
        attack(get_float, get, "the value of a reference that no variable has", ACCEPTED),
        attack(set_float, set, "a value for a reference that no variable has", ACCEPTED),
        attack(exit, vec![], "leaving Initialization Mode, which it is not in", TOLERATED),
        attack(enter, nothing, "entering Initialization Mode during the simulation", TOLERATED),
    ];
    if !fmi3 {
        let what = "another experiment during the simulation";
        attacks.push(attack("SetupExperiment", experiment, what, TOLERATED));
    }
    if checker.serializes(interface) {
        let bytes = Arg::In(Kind::U8, (0..64).map(|byte| byte * 37 % 256).collect());
        let bytes = vec![bytes, Arg::Integer(64), Arg::StateOut(90)];
        attacks.push(attack("DeserializeFMUState", bytes, "bytes that are not a state", TOLERATED));
    }
    attacks
}

/// Returns steps with invalid times or sizes, and invalid derivatives of inputs.
fn step_attacks(checker: &Checker, time: f64, size: f64) -> Vec<Attack> {
    let step = |(time, size, what): (f64, f64, &str)| {
        attack("DoStep", step_args(checker.description.standard, time, size), what, TOLERATED)
    };
    let steps = [
        (time, 0.0, "a step of no size"),
        (time, -size, "a step back"),
        (time, f64::NAN, "a step of NaN"),
        (time + 10.0 * size, size, "a step from a time that is not reached yet"),
        (f64::NAN, size, "a step from NaN"),
    ];
    let input = input_of(checker, Kind::F64)
        .filter(|_| !checker.fmi3() && checker.can(Interface::CoSimulation, &["canInterpolateInputs"]));
    let derivatives = input.into_iter().flat_map(|input| {
        [
            (
                unknown_reference(checker),
                1,
                "a derivative of an input and of a reference that no variable has",
            ),
            (input, 0, "a derivative of order 1 and one of order 0"),
        ]
        .map(|(second, order, what)| {
            let args = vec![
                Arg::In(Kind::U32, vec![input, second]),
                Arg::Integer(2),
                Arg::In(Kind::I32, vec![1, order]),
                Arg::In(Kind::F64, vec![3_f64.to_bits(); 2]),
            ];
            attack("SetRealInputDerivatives", args, what, None)
        })
    });
    steps.map(step).into_iter().chain(derivatives).collect()
}

/// Returns calls of Model Exchange with invalid times and states.
fn integration_attacks(states: &[f64]) -> Vec<Attack> {
    let mode = "entering Continuous-Time Mode, which it is in";
    let mut attacks = vec![
        attack("SetTime", vec![Arg::real(f64::NAN)], "a time of NaN", None),
        attack("EnterContinuousTimeMode", vec![], mode, TOLERATED),
    ];
    if let Some(last) = states.len().checked_sub(1) {
        let other: Vec<u64> = states.iter().map(|state| (state + 0.125).to_bits()).collect();
        let bad = [&other[..last], &[f64::NAN.to_bits()]].concat();
        let more = [other, vec![0]].concat();
        for (states, what, rule) in
            [(more, "one state too many", TOLERATED), (bad, "states one of which is NaN", None)]
        {
            let count = Arg::Integer(states.len() as i64);
            attacks.push(attack("SetContinuousStates", vec![Arg::In(Kind::F64, states), count], what, rule));
        }
    }
    attacks
}

/// Returns an input of this type. A call that is not atomic sets it before it reaches the invalid value.
fn input_of(checker: &Checker, kind: Kind) -> Option<u64> {
    let input = checker.description.variables.iter().find(|variable| {
        variable.causality == "input"
            && variable.size == Some(1)
            && !variable.clocked
            && variable.variability != "discrete"
            && variable.base.is_some_and(|base| kind_of(checker.description.standard, base) == kind)
    });
    input.map(|variable| u64::from(variable.reference))
}

/// Writes a simulation with or without an attack in its middle. Returns the number of the attack, the reads after it, and the
/// calls and reads of the remaining points.
fn write_simulation(
    writer: &mut Writer,
    instance: usize,
    attack: Option<&Attack>,
) -> (Option<u32>, Vec<Read>, Calls) {
    let trajectory = writer.trajectory;
    let to = trajectory.points.len() / 2;
    writer.write(instance, &[Part::Begin, Part::Points(to)]);
    let attack = attack.map(|(function, args, ..)| writer.forbidden(Some(instance), function, args.clone()));
    let at_once = writer.read_all(instance);
    let mut later = Calls::default();
    for (number, point) in trajectory.points[to..].iter().enumerate() {
        // The first two steps set no inputs, so that a value that the attack has set takes effect.
        let inputs = if number < 2 { Vec::new() } else { point.inputs.clone() };
        later.ids.extend(writer.point(instance, &Point { inputs, ..point.clone() }));
        later.reads.extend(writer.read_all(instance));
    }
    writer.free(instance);
    (attack, at_once, later)
}

/// Checks attacks in the middle of a simulation, and a value for an input after Terminate.
pub fn change_nothing(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let interface = trajectory.interface;
    let to = trajectory.points.len() / 2;
    let Some(here) = trajectory.points.get(to) else { return Ok(()) };
    let before = trajectory.points[..to].last();
    let mut attacks = variable_attacks(checker, interface);
    if trajectory.is_stepped() {
        attacks.extend(call_attacks(checker, interface, here.time));
        attacks.extend(step_attacks(checker, here.time, here.size));
    } else {
        attacks.extend(call_attacks(checker, interface, before.unwrap_or(here).time));
        attacks.extend(integration_attacks(before.map_or(&[], |point| &point.states)));
    }
    attacks.into_iter().try_for_each(|attack| attacked(checker, trajectory, attack))?;
    after_end(checker, trajectory)
}

/// Checks that an input is not set after Terminate, where neither FMI version allows it.
fn after_end(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let is_input = |index: &&usize| {
        let variable = &description.variables[**index];
        variable.causality == "input" && !variable.clocked && !variable.start.is_empty()
    };
    let input = checker.readable.iter().find(is_input);
    let Some((index, value)) = input.and_then(|index| Some((*index, other_values(description, *index)?)))
    else {
        return Ok(());
    };
    let mut writer = checker.writer(trajectory);
    writer.write(0, &[Part::Begin, Part::Points(2), Part::Call("Terminate")]);
    writer.forbidden = true;
    let ids = writer.set(0, &[(index, value)]);
    let name = description.variables[index].name.clone();
    checker.check("rejections.tolerated", writer.sequence, move |run| {
        let accepted = ids.iter().all(|id| run.succeeds(*id));
        accepted.then(|| format!("a value for the input {name} is accepted after Terminate"))
    })
}

/// Checks that an attack is rejected and that the simulation continues as without it.
fn attacked(checker: &Checker, trajectory: &Trajectory, attack: Attack) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let (_, single_at_once, single) = write_simulation(&mut writer, 0, None);
    let (Some(id), at_once, later) = write_simulation(&mut writer, 1, Some(&attack)) else { return Ok(()) };
    let (function, _, what, accepted) = attack;
    let call = format!("{function} with {what} returns");
    let named = call.clone();
    let description = checker.description.clone();
    let changed = Arc::new(move |run: &Run, rejected: i32| -> Option<String> {
        let status = run.status(id).filter(|status| *status == rejected)?;
        // After Error, an instance may reject all calls.
        let rejects = |reads: &[Read]| !reads.iter().all(|read| run.succeeds(read.id));
        if rejects(&at_once) {
            return None;
        }
        let ends = rejects(&later.reads) || !later.ids.iter().all(|id| run.succeeds(*id));
        let at_once = difference(&description, run, &single_at_once, &at_once, 0.0);
        let later = || difference(&description, run, &single.reads, &later.reads, 0.0).filter(|_| !ends);
        let [variable, was, is] = at_once.or_else(later)?;
        Some(format!("{named} {}, and {variable} is {is} after it instead of {was}", status_name(status)))
    });
    // In FMI 2.0, a discarded step may have advanced the time.
    let discarded = match checker.fmi3() {
        true => Some("rejections.discarded"),
        false => Some("rejections.changed").filter(|_| function != "DoStep"),
    };
    let error = Arc::clone(&changed);
    let run = checker.evaluate("rejections.changed", writer.sequence.clone(), move |run| error(run, 3))?;
    if let Some(rule) = discarded {
        checker.record(rule, &run, &writer.sequence, move |run| changed(run, 2));
    }
    if let Some(rule) = accepted {
        checker.record(rule, &run, &writer.sequence, move |run| {
            let status = run.status(id).filter(|_| run.succeeds(id))?;
            Some(format!("{call} {}", status_name(status)))
        });
    }
    Ok(())
}

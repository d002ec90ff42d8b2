//! Checks that invalid calls are rejected, and that a rejected call changes nothing.

use crate::call_sequence::{Arg, Kind, Run};
use crate::checker::Checker;
use crate::description::{Variable, kind_of, type_name};
use crate::finding::status_name;
use crate::values::{near, other_values};
use crate::writer::{Calls, Part, Point, Read, Trajectory, Writer, access, difference, step_args};
use fmi_abi::{Causality, Initial, Interface, Variability};
use std::sync::Arc;

/// Call that an FMU should reject. A rejected call must change nothing.
struct InvalidCall {
    function: String,
    args: Vec<Arg>,
    /// Description of the arguments or of the call in messages.
    what: String,
    /// Rule that the FMU breaks if it accepts the call; `None` if it may accept the call.
    rule: Option<&'static str>,
}

/// Rule for impossible requests.
const TOLERATED: Option<&str> = Some("rejections.tolerated");
/// Rule for unknown value references.
const ACCEPTED: Option<&str> = Some("rejections.accepted");

fn invalid_call(function: &str, args: Vec<Arg>, what: &str, rule: Option<&'static str>) -> InvalidCall {
    InvalidCall { function: function.to_owned(), args, what: what.to_owned(), rule }
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

/// Returns calls that set variables that cannot be set, calls that set an input or tunable parameter together with an unknown
/// reference, and calls that set an input together with an invalid value.
fn variable_calls(checker: &Checker, interface: Interface) -> Vec<InvalidCall> {
    let description = &checker.description;
    let unknown = unknown_reference(checker);
    let (mut calls, mut groups, mut inputs_tried) = (Vec::new(), Vec::new(), 0);
    // Of each group of similar variables, only the first is tried.
    let mut is_first = |group: &'static str| {
        let is_new = !groups.contains(&group);
        if is_new {
            groups.push(group);
        }
        is_new
    };
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
        let is_input = variable.causality == Causality::Input
            && !variable.clocked
            && (stepped || variable.variability == Variability::Continuous);
        let is_tunable_parameter = variable.causality == Causality::Parameter
            && variable.variability == Variability::Tunable
            && stepped;
        if (is_input || is_tunable_parameter) && is_first(name) {
            let what = format!("a value for {} and one for a reference that no variable has", variable.name);
            let args = set(checker, vec![reference, unknown], kind, vec![other; 2]);
            calls.push(invalid_call(&function, args, &what, None));
        }
        if is_input && kind.is_float() && inputs_tried < 3 {
            inputs_tried += 1;
            calls.extend(input_calls(checker, variable, &function, kind, other));
        }
        let Some((group, rule, what)) = not_settable(variable, name) else { continue };
        if is_first(group) {
            let input = input_of(checker, kind).filter(|_| group != "constant");
            let references: Vec<u64> = input.into_iter().chain([reference]).collect();
            let bits = vec![other; references.len()];
            calls.push(invalid_call(&function, set(checker, references, kind, bits), &what, rule));
        }
    }
    calls
}

/// If a variable cannot be set after the initialization, returns the group of similar variables, the rule that the FMU breaks if it accepts
/// a value, and a description.
fn not_settable(
    variable: &Variable,
    type_name: &str,
) -> Option<(&'static str, Option<&'static str>, String)> {
    let name = &variable.name;
    if variable.variability == Variability::Constant {
        Some(("constant", Some("rejections.constant"), format!("a value for the constant {name}")))
    } else if variable.causality == Causality::Output && variable.initial == Some(Initial::Calculated) {
        Some(("output", TOLERATED, format!("a value for the output {name}")))
    } else if variable.causality == Causality::Parameter && variable.variability == Variability::Fixed {
        let group = match type_name {
            "Real" | "Float64" => "fixed",
            "Integer" | "Int32" => "fixed integer",
            _ => "fixed other",
        };
        Some((group, TOLERATED, format!("a value for the fixed parameter {name} after the initialization")))
    } else {
        None
    }
}

/// Returns calls that set two inputs, the first to a valid value and the second to NaN or beyond its maximum. If there is only
/// one input of this type, the calls set it twice.
fn input_calls(
    checker: &Checker,
    variable: &Variable,
    function: &str,
    kind: Kind,
    other: u64,
) -> Vec<InvalidCall> {
    let reference = u64::from(variable.reference);
    let another = checker.description.variables.iter().find(|other| {
        other.causality == Causality::Input
            && other.base == variable.base
            && other.reference != variable.reference
            && other.size == Some(1)
    });
    let second = another.map_or(reference, |other| u64::from(other.reference));
    let beyond = variable.max().map(|max| ([second, reference], max + 1.0 + max.abs(), "beyond its max"));
    let values = [([reference, second], f64::NAN, "and NaN for a second")].into_iter().chain(beyond);
    let invalid = |(references, number, what): ([u64; 2], f64, &str)| {
        let args = set(checker, references.to_vec(), kind, vec![other, kind.bits(number)]);
        invalid_call(function, args, &format!("a value for {} {what}", variable.name), None)
    };
    values.map(invalid).collect()
}

/// Returns calls with unknown value references, calls that are allowed only in other modes, and a malformed serialized state.
fn forbidden_calls(checker: &Checker, interface: Interface, time: f64) -> Vec<InvalidCall> {
    let (unknown, fmi3) = (unknown_reference(checker), checker.fmi3());
    let (get_float, set_float) = if fmi3 { ("GetFloat64", "SetFloat64") } else { ("GetReal", "SetReal") };
    let get = access(checker.description.standard, vec![unknown], [Arg::Out(Kind::F64, 1)], 1);
    let set = set(checker, vec![unknown], Kind::F64, vec![0]);
    let experiment =
        vec![Arg::Integer(0), Arg::real(0.0), Arg::real(time + 7.0), Arg::Integer(0), Arg::real(0.0)];
    let (experiment, nothing) = if fmi3 { (vec![], experiment) } else { (experiment, vec![]) };
    let (exit, enter) = ("ExitInitializationMode", "EnterInitializationMode");
    let mut calls = vec![
        invalid_call(get_float, get, "the value of a reference that no variable has", ACCEPTED),
        invalid_call(set_float, set, "a value for a reference that no variable has", ACCEPTED),
        invalid_call(exit, vec![], "leaving Initialization Mode, which it is not in", TOLERATED),
        invalid_call(enter, nothing, "entering Initialization Mode during the simulation", TOLERATED),
    ];
    if !fmi3 {
        let what = "another experiment during the simulation";
        calls.push(invalid_call("SetupExperiment", experiment, what, TOLERATED));
    }
    if checker.serializes(interface) {
        let bytes = Arg::In(Kind::U8, (0..64).map(|byte| byte * 37 % 256).collect());
        let bytes = vec![bytes, Arg::Integer(64), Arg::StateOut(90)];
        calls.push(invalid_call("DeserializeFMUState", bytes, "bytes that are not a state", TOLERATED));
    }
    calls
}

/// Returns steps with invalid times or sizes, and invalid derivatives of inputs.
fn step_calls(checker: &Checker, time: f64, size: f64) -> Vec<InvalidCall> {
    let step = |(time, size, what): (f64, f64, &str)| {
        invalid_call("DoStep", step_args(checker.description.standard, time, size), what, TOLERATED)
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
            invalid_call("SetRealInputDerivatives", args, what, None)
        })
    });
    steps.map(step).into_iter().chain(derivatives).collect()
}

/// Returns calls of Model Exchange with an invalid time or invalid states, and a call that enters Continuous-Time Mode again.
fn integration_calls(states: &[f64]) -> Vec<InvalidCall> {
    let mode = "entering Continuous-Time Mode, which it is in";
    let mut calls = vec![
        invalid_call("SetTime", vec![Arg::real(f64::NAN)], "a time of NaN", None),
        invalid_call("EnterContinuousTimeMode", vec![], mode, TOLERATED),
    ];
    if let Some(last) = states.len().checked_sub(1) {
        let other: Vec<u64> = states.iter().map(|state| (state + 0.125).to_bits()).collect();
        let bad = [&other[..last], &[f64::NAN.to_bits()]].concat();
        let more = [other, vec![0]].concat();
        for (states, what, rule) in
            [(more, "one state too many", TOLERATED), (bad, "states one of which is NaN", None)]
        {
            let count = Arg::Integer(states.len() as i64);
            calls.push(invalid_call(
                "SetContinuousStates",
                vec![Arg::In(Kind::F64, states), count],
                what,
                rule,
            ));
        }
    }
    calls
}

/// Returns the reference of an input of this type. An invalid call lists it first, so an FMU that does not set values atomically sets the
/// input before it reaches the invalid value.
fn input_of(checker: &Checker, kind: Kind) -> Option<u64> {
    let input = checker.description.variables.iter().find(|variable| {
        variable.causality == Causality::Input
            && variable.size == Some(1)
            && !variable.clocked
            && variable.variability != Variability::Discrete
            && variable.base.is_some_and(|base| kind_of(checker.description.standard, base) == kind)
    });
    input.map(|variable| u64::from(variable.reference))
}

/// Writes a simulation, with the invalid call in its middle if there is one. Returns the number of this call, the reads directly after it,
/// and the calls and reads of the remaining points.
fn write_simulation(
    writer: &mut Writer,
    instance: usize,
    invalid: Option<&InvalidCall>,
) -> (Option<u32>, Vec<Read>, Calls) {
    let trajectory = writer.trajectory;
    let middle = trajectory.points.len() / 2;
    writer.write(instance, &[Part::Begin, Part::Points(middle)]);
    let id = invalid.map(|call| writer.forbidden(Some(instance), &call.function, call.args.clone()));
    let directly_after = writer.read_all(instance);
    let mut later = Calls::default();
    for (number, point) in trajectory.points[middle..].iter().enumerate() {
        // The first two points set no inputs, because these would replace a value that the invalid call may have set.
        let inputs = if number < 2 { Vec::new() } else { point.inputs.clone() };
        later.ids.extend(writer.point(instance, &Point { inputs, ..point.clone() }));
        later.reads.extend(writer.read_all(instance));
    }
    writer.free(instance);
    (id, directly_after, later)
}

/// Checks invalid calls in the middle of a simulation, and a value for an input after Terminate.
pub fn change_nothing(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let interface = trajectory.interface;
    let middle = trajectory.points.len() / 2;
    let Some(here) = trajectory.points.get(middle) else { return Ok(()) };
    let before = trajectory.points[..middle].last();
    let mut calls = variable_calls(checker, interface);
    if trajectory.is_stepped() {
        calls.extend(forbidden_calls(checker, interface, here.time));
        calls.extend(step_calls(checker, here.time, here.size));
    } else {
        calls.extend(forbidden_calls(checker, interface, before.unwrap_or(here).time));
        calls.extend(integration_calls(before.map_or(&[], |point| &point.states)));
    }
    calls.into_iter().try_for_each(|call| check_invalid_call(checker, trajectory, call))?;
    after_end(checker, trajectory)
}

/// Checks that an FMU rejects a value for an input after Terminate, because neither FMI version allows setters there.
fn after_end(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let is_input = |index: &&usize| {
        let variable = &description.variables[**index];
        variable.causality == Causality::Input && !variable.clocked && !variable.start.is_empty()
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

/// Checks that an invalid call is rejected, unless it may be accepted, and that the simulation continues after the rejection as
/// if the call had not been made.
fn check_invalid_call(
    checker: &Checker,
    trajectory: &Trajectory,
    invalid: InvalidCall,
) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let (_, reads_without, without) = write_simulation(&mut writer, 0, None);
    let (Some(id), reads, later) = write_simulation(&mut writer, 1, Some(&invalid)) else { return Ok(()) };
    let InvalidCall { function, what, rule: accepted, .. } = invalid;
    let call = format!("{function} with {what} returns");
    let same_call = call.clone();
    let description = checker.description.clone();
    let changed = Arc::new(move |run: &Run, rejected: i32| -> Option<String> {
        let status = run.status(id).filter(|status| *status == rejected)?;
        // An instance that has returned Error may reject all later calls.
        let fail = |reads: &[Read]| !reads.iter().all(|read| run.succeeds(read.id));
        if fail(&reads) {
            return None;
        }
        let later_fail = fail(&later.reads) || !later.ids.iter().all(|id| run.succeeds(*id));
        let directly_after = difference(&description, run, &reads_without, &reads, 0.0);
        let later =
            || difference(&description, run, &without.reads, &later.reads, 0.0).filter(|_| !later_fail);
        let [variable, was, is] = directly_after.or_else(later)?;
        Some(format!("{same_call} {}, and {variable} is {is} after it instead of {was}", status_name(status)))
    });
    // In FMI 2.0, a discarded step may have advanced the time.
    let rule_for_discard = match checker.fmi3() {
        true => Some("rejections.discarded"),
        false => Some("rejections.changed").filter(|_| function != "DoStep"),
    };
    let changed_by_error = Arc::clone(&changed);
    let run = checker
        .evaluate("rejections.changed", writer.sequence.clone(), move |run| changed_by_error(run, 3))?;
    if let Some(rule) = rule_for_discard {
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

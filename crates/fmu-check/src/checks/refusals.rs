//! A rejected call changes nothing.

use crate::call_sequence::{Arg, Kind, Run};
use crate::checker::Checker;
use crate::description::{Variable, kind_of, type_name};
use crate::finding::{Judge, status_name};
use crate::values::near;
use crate::writer::{Point, Read, Trajectory, Writer, difference, readable};
use fmi_abi::Interface;
use std::sync::Arc;

/// A call that ought to be rejected.
struct Attack {
    function: String,
    args: Vec<Arg>,
    what: String,
    /// The rule that is broken if it is not.
    accepted: Option<&'static str>,
}

impl Attack {
    fn new(function: &str, args: Vec<Arg>, what: &str, accepted: Option<&'static str>) -> Self {
        Self { function: function.to_owned(), args, what: what.to_owned(), accepted }
    }
}

const TOLERATED: Option<&str> = Some("refusals.tolerated");

/// A value reference that no variable has.
pub fn unknown_reference(checker: &Checker) -> u64 {
    let used: Vec<u32> = checker.description.variables.iter().map(|variable| variable.reference).collect();
    let most = used.iter().copied().max().unwrap_or(0);
    u64::from(most.checked_add(1000).unwrap_or_else(|| (0..).find(|free| !used.contains(free)).unwrap_or(0)))
}

/// Values for a call that sets some.
fn set(checker: &Checker, references: Vec<u64>, kind: Kind, bits: Vec<u64>) -> Vec<Arg> {
    let (count, total) = (references.len() as i64, bits.len() as i64);
    let mut args = vec![Arg::In(Kind::U32, references), Arg::Whole(count), Arg::In(kind, bits)];
    args.extend(checker.fmi3().then_some(Arg::Whole(total)));
    args
}

/// Values of variables that cannot be set, or together with one that cannot.
fn of_variables(checker: &Checker, interface: Interface) -> Vec<Attack> {
    let description = &checker.description;
    let unknown = unknown_reference(checker);
    let (mut attacks, mut observed, mut inputs_tried) = (Vec::new(), Vec::new(), 0);
    for index in readable(description) {
        let variable = &description.variables[index];
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
        let input = variable.causality == "input"
            && !variable.clocked
            && (interface == Interface::CoSimulation || variable.variability == "continuous");
        let tunable = variable.causality == "parameter"
            && variable.variability == "tunable"
            && interface == Interface::CoSimulation;
        if (input || tunable) && !observed.contains(&name) {
            observed.push(name);
            let what = format!("a value for {} and one for a reference that no variable has", variable.name);
            let args = set(checker, vec![reference, unknown], kind, vec![other; 2]);
            attacks.push(Attack::new(&function, args, &what, None));
        }
        if input && kind.is_float() && inputs_tried < 3 {
            inputs_tried += 1;
            attacks.extend(of_input(checker, variable, &function, kind, other));
        }
        let fixed = variable.causality == "parameter" && variable.variability == "fixed";
        let (once, rule, what) = if variable.variability == "constant" {
            ("constant", "refusals.constant", format!("a value for the constant {}", variable.name))
        } else if variable.causality == "output" && variable.initial == "calculated" {
            ("output", "refusals.tolerated", format!("a value for the output {}", variable.name))
        } else if fixed {
            let what = format!("a value for the fixed parameter {} after the initialization", variable.name);
            (name_of_fixed(name), "refusals.tolerated", what)
        } else {
            continue;
        };
        if !observed.contains(&once) {
            observed.push(once);
            let first = input_of(checker, kind).filter(|_| once != "constant");
            let references: Vec<u64> = first.into_iter().chain([reference]).collect();
            let bits = vec![other; references.len()];
            attacks.push(Attack::new(&function, set(checker, references, kind, bits), &what, Some(rule)));
        }
    }
    attacks
}

/// Values that an input cannot have, together with one that it can.
fn of_input(checker: &Checker, variable: &Variable, function: &str, kind: Kind, other: u64) -> Vec<Attack> {
    let reference = u64::from(variable.reference);
    let another = checker.description.variables.iter().find(|other| {
        other.causality == "input"
            && other.base == variable.base
            && other.reference != variable.reference
            && other.size == Some(1)
    });
    let second = another.map_or(reference, |other| u64::from(other.reference));
    let nan = set(checker, vec![reference, second], kind, vec![other, kind.bits(f64::NAN)]);
    let what = format!("a value for {} and NaN for a second", variable.name);
    let mut attacks = vec![Attack::new(function, nan, &what, None)];
    if let Some(max) = variable.max {
        let bits = vec![other, kind.bits(max + 1.0 + max.abs())];
        let what = format!("a value for {} beyond its max", variable.name);
        attacks.push(Attack::new(function, set(checker, vec![second, reference], kind, bits), &what, None));
    }
    attacks
}

/// Unknown references, calls of other modes, and bytes that are no state.
fn of_calls(checker: &Checker, interface: Interface, time: f64) -> Vec<Attack> {
    let (unknown, fmi3) = (unknown_reference(checker), checker.fmi3());
    let float = if fmi3 { "Float64" } else { "Real" };
    let mut get = vec![Arg::In(Kind::U32, vec![unknown]), Arg::Whole(1), Arg::Out(Kind::F64, 1)];
    get.extend(fmi3.then_some(Arg::Whole(1)));
    let set = set(checker, vec![unknown], Kind::F64, vec![0]);
    let experiment =
        vec![Arg::Whole(0), Arg::real(0.0), Arg::real(time + 7.0), Arg::Whole(0), Arg::real(0.0)];
    let (experiment, nothing) = if fmi3 { (vec![], experiment) } else { (experiment, vec![]) };
    let (enter, exit) = ("EnterInitializationMode", "ExitInitializationMode");
    let accepted = Some("refusals.accepted");
    let mut attacks = vec![
        Attack::new(&format!("Get{float}"), get, "the value of a reference that no variable has", accepted),
        Attack::new(&format!("Set{float}"), set, "a value for a reference that no variable has", accepted),
        Attack::new(exit, vec![], "leaving Initialization Mode, which it is not in", TOLERATED),
        Attack::new(enter, nothing, "entering Initialization Mode amid the simulation", TOLERATED),
    ];
    if !fmi3 {
        let what = "another experiment amid the simulation";
        attacks.push(Attack::new("SetupExperiment", experiment, what, TOLERATED));
    }
    if checker.serializes(interface) {
        let name = if fmi3 { "DeserializeFMUState" } else { "DeSerializeFMUstate" };
        let bytes = Arg::In(Kind::U8, (0..64).map(|byte| byte * 37 % 256).collect());
        let args = vec![bytes, Arg::Whole(64), Arg::StateOut(90)];
        attacks.push(Attack::new(name, args, "bytes that are no state", TOLERATED));
    }
    attacks
}

/// Steps that are impossible, and derivatives of inputs that are none.
fn of_steps(checker: &Checker, time: f64, size: f64) -> Vec<Attack> {
    let mut attacks: Vec<Attack> = [
        (time, 0.0, "a step of no size"),
        (time, -size, "a step back"),
        (time, f64::NAN, "a step of NaN"),
        (time + 10.0 * size, size, "a step from a time that is not reached yet"),
        (f64::NAN, size, "a step from NaN"),
    ]
    .into_iter()
    .map(|(time, size, what)| {
        let mut args = vec![Arg::real(time), Arg::real(size), Arg::Whole(0)];
        if checker.fmi3() {
            args.extend([(); 3].map(|()| Arg::Out(Kind::U8, 1)));
            args.push(Arg::Out(Kind::F64, 1));
        }
        Attack::new("DoStep", args, what, TOLERATED)
    })
    .collect();
    let input = input_of(checker, Kind::F64)
        .filter(|_| !checker.fmi3() && checker.can(Interface::CoSimulation, &["canInterpolateInputs"]));
    if let Some(input) = input {
        let unknown = unknown_reference(checker);
        for (references, orders, what) in [
            ([input, unknown], [1, 1], "a derivative of an input and of a reference that no variable has"),
            ([input, input], [1, 0], "a derivative of order 1 and one of order 0"),
        ] {
            let args = vec![
                Arg::In(Kind::U32, references.to_vec()),
                Arg::Whole(2),
                Arg::In(Kind::I32, orders.to_vec()),
                Arg::In(Kind::F64, vec![3_f64.to_bits(); 2]),
            ];
            attacks.push(Attack::new("SetRealInputDerivatives", args, what, None));
        }
    }
    attacks
}

/// Times and states that are impossible in Model Exchange.
fn of_integration(states: &[f64]) -> Vec<Attack> {
    let mode = "entering Continuous-Time Mode, which it is in";
    let mut attacks = vec![
        Attack::new("SetTime", vec![Arg::real(f64::NAN)], "a time of NaN", None),
        Attack::new("EnterContinuousTimeMode", vec![], mode, TOLERATED),
    ];
    if !states.is_empty() {
        let other: Vec<u64> = states.iter().map(|state| (state + 0.125).to_bits()).collect();
        let mut bad = other.clone();
        if let Some(last) = bad.last_mut() {
            *last = f64::NAN.to_bits();
        }
        let more = [other, vec![0]].concat();
        for (states, what, rule) in
            [(more, "one state too many", TOLERATED), (bad, "states one of which is NaN", None)]
        {
            let count = Arg::Whole(states.len() as i64);
            let args = vec![Arg::In(Kind::F64, states), count];
            attacks.push(Attack::new("SetContinuousStates", args, what, rule));
        }
    }
    attacks
}

fn name_of_fixed(name: &'static str) -> &'static str {
    match name {
        "Real" | "Float64" => "fixed",
        "Integer" | "Int32" => "fixed whole",
        _ => "fixed other",
    }
}

/// An input of this type, which a call changes before it comes to the value that it cannot set.
fn input_of(checker: &Checker, kind: Kind) -> Option<u64> {
    let of = checker.description.variables.iter().find(|variable| {
        variable.causality == "input"
            && variable.size == Some(1)
            && !variable.clocked
            && variable.variability != "discrete"
            && variable.base.is_some_and(|base| kind_of(checker.description.standard, base) == kind)
    });
    of.map(|variable| u64::from(variable.reference))
}

/// The numbers of what was read at once and later, and of the calls.
#[derive(Default)]
struct Played {
    at_once: Vec<Read>,
    later: Vec<Read>,
    calls: Vec<u32>,
    attack: Option<u32>,
}

/// A trajectory, with an attack or without.
fn play(writer: &mut Writer, of: usize, trajectory: &Trajectory, attack: Option<&Attack>) -> Played {
    let mut played = Played::default();
    let to = trajectory.points.len() / 2;
    writer.begin(of, trajectory);
    for point in &trajectory.points[..to] {
        writer.point(of, trajectory, point);
    }
    played.attack = attack.map(|attack| writer.forbidden(Some(of), &attack.function, attack.args.clone()));
    played.at_once = writer.ask(of, trajectory.interface);
    for (number, point) in trajectory.points[to..].iter().enumerate() {
        // A value that was set has most effect where no other is set.
        let inputs = if number < 2 { Vec::new() } else { point.inputs.clone() };
        played.calls.extend(writer.point(of, trajectory, &Point { inputs, ..point.clone() }));
        played.later.extend(writer.ask(of, trajectory.interface));
    }
    writer.free(of);
    played
}

/// Each attack amid a trajectory; the simulation continues as it does without the attack.
pub fn change_nothing(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in &checker.trajectories {
        let interface = trajectory.interface;
        let to = trajectory.points.len() / 2;
        let Some(here) = trajectory.points.get(to) else { continue };
        let before = trajectory.points[..to].last();
        let mut attacks = of_variables(checker, interface);
        match interface {
            Interface::CoSimulation => {
                attacks.extend(of_calls(checker, interface, here.time));
                attacks.extend(of_steps(checker, here.time, here.size));
            }
            Interface::ModelExchange => {
                attacks.extend(of_calls(checker, interface, before.unwrap_or(here).time));
                attacks.extend(of_integration(before.map_or(&[], |point| &point.states)));
            }
        }
        for attack in attacks {
            attacked(checker, trajectory, attack)?;
        }
    }
    Ok(())
}

/// An attack is rejected and changes nothing.
fn attacked(checker: &Checker, trajectory: &Trajectory, attack: Attack) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    let alone = play(&mut writer, 0, trajectory, None);
    let beside = play(&mut writer, 1, trajectory, Some(&attack));
    let Some(id) = beside.attack else { return Ok(()) };
    let Attack { function, what, accepted, .. } = attack;
    let call = format!("{function} with {what} returns");
    let named = call.clone();
    let description = checker.description.clone();
    let changed = Arc::new(move |run: &Run, rejected: i32| -> Option<String> {
        let status = run.status(id).filter(|status| *status == rejected)?;
        // After an error an instance may reject everything.
        let rejects =
            |reads: &[Read]| reads.iter().any(|read| run.status(read.id).is_none_or(|status| status > 1));
        if rejects(&beside.at_once) {
            return None;
        }
        let fails = |id: &u32| run.status(*id).is_none_or(|status| status > 1);
        let ends = rejects(&beside.later) || beside.calls.iter().any(fails);
        let (variable, was, is) =
            difference(&description, run, &alone.at_once, &beside.at_once).or_else(|| {
                if ends { None } else { difference(&description, run, &alone.later, &beside.later) }
            })?;
        Some(format!("{named} {}, and {variable} is {is} after it instead of {was}", status_name(status)))
    });
    // In FMI 2.0 a step that is discarded may have gone part of the way.
    let discarded = match checker.fmi3() {
        true => Some("refusals.discarded"),
        false => Some("refusals.changed").filter(|_| function != "DoStep"),
    };
    let error = Arc::clone(&changed);
    let run =
        checker.judge("refusals.changed", writer.sequence.clone(), Arc::new(move |run| error(run, 3)))?;
    if let Some(rule) = discarded {
        checker.keep(rule, &run, &writer.sequence, Arc::new(move |run| changed(run, 2)));
    }
    if let Some(rule) = accepted {
        let judge: Judge = Arc::new(move |run| {
            let status = run.status(id).filter(|status| *status <= 1)?;
            Some(format!("{call} {}", status_name(status)))
        });
        checker.keep(rule, &run, &writer.sequence, judge);
    }
    Ok(())
}

//! A refused call changes nothing.

use crate::checker::{Checker, Claim};
use crate::description::kind_of;
use crate::finding::{Grade, Judge};
use crate::script::{Arg, Kind};
use crate::writer::{Read, difference, readable, status_name};
use fmi_abi::Interface;
use std::sync::Arc;

/// A call that ought to be refused.
struct Attack {
    function: String,
    args: Vec<Arg>,
    what: String,
    /// How bad it is if it is not.
    accepted: Option<Grade>,
}

/// A value reference that no variable has.
pub fn unknown_reference(checker: &Checker) -> u64 {
    let used: Vec<u32> = checker.description.variables.iter().map(|variable| variable.reference).collect();
    let most = used.iter().copied().max().unwrap_or(0);
    u64::from(most.checked_add(1000).unwrap_or_else(|| (0..).find(|free| !used.contains(free)).unwrap_or(0)))
}

fn attacks(checker: &Checker, interface: Interface, time: f64, size: f64, states: &[f64]) -> Vec<Attack> {
    let description = &checker.description;
    let mut attacks = Vec::new();
    let unknown = unknown_reference(checker);
    let fmi3 = checker.fmi3();
    let mut add = |function: &str, args: Vec<Arg>, what: String, accepted: Option<Grade>| {
        attacks.push(Attack { function: function.to_owned(), args, what, accepted });
    };
    let set = |references: Vec<u64>, kind: Kind, bits: Vec<u64>| {
        let (count, total) = (references.len() as i64, bits.len() as i64);
        let mut args = vec![Arg::In(Kind::U32, references), Arg::Whole(count), Arg::In(kind, bits)];
        if fmi3 {
            args.push(Arg::Whole(total));
        }
        args
    };
    let mut seen: Vec<&str> = Vec::new();
    let mut inputs_tried = 0;
    for place in readable(description) {
        let variable = &description.variables[place];
        let (Some(base), Some(1)) = (variable.base, variable.size) else { continue };
        let (name, kind) =
            (crate::description::type_name(description.standard, base), kind_of(description.standard, base));
        if kind == Kind::Pointer {
            continue;
        }
        let reference = u64::from(variable.reference);
        let start = variable.starts().first().copied().unwrap_or(0.0);
        let other = kind.bits(if kind.is_float() {
            crate::checker::near(variable, start, 1.0 / 32.0)
        } else {
            1.0 - start.clamp(0.0, 1.0)
        });
        let input = variable.causality == "input"
            && !variable.clocked
            && (interface == Interface::CoSimulation || variable.variability == "continuous");
        let tunable = variable.causality == "parameter"
            && variable.variability == "tunable"
            && interface == Interface::CoSimulation;
        if (input || tunable) && !seen.contains(&name) {
            seen.push(name);
            add(
                &format!("Set{name}"),
                set(vec![reference, unknown], kind, vec![other, other]),
                format!("a value for {} and one for a reference that no variable has", variable.name),
                None,
            );
        }
        if input && kind.is_float() && inputs_tried < 3 {
            inputs_tried += 1;
            let nan = kind.bits(f64::NAN);
            let another = description.variables.iter().find(|other| {
                other.causality == "input"
                    && other.base == variable.base
                    && other.reference != variable.reference
                    && other.size == Some(1)
            });
            let second = another.map_or(reference, |other| u64::from(other.reference));
            add(
                &format!("Set{name}"),
                set(vec![reference, second], kind, vec![other, nan]),
                format!("a value for {} and NaN for a second", variable.name),
                None,
            );
            if let Some(max) = variable.max {
                add(
                    &format!("Set{name}"),
                    set(vec![second, reference], kind, vec![other, kind.bits(max + 1.0 + max.abs())]),
                    format!("a value for {} beyond its max", variable.name),
                    None,
                );
            }
        }
        if variable.variability == "constant" && !seen.contains(&"constant") {
            seen.push("constant");
            add(
                &format!("Set{name}"),
                set(vec![reference], kind, vec![other]),
                format!("a value for the constant {}", variable.name),
                Some(if fmi3 { Grade::Violation } else { Grade::Fragile }),
            );
        }
        let is_fixed = variable.causality == "parameter" && variable.variability == "fixed";
        let (once, what) = if variable.causality == "output" && variable.initial == "calculated" {
            ("output", format!("a value for the output {}", variable.name))
        } else if is_fixed {
            let what = format!("a value for the fixed parameter {} after the initialization", variable.name);
            (name_of_fixed(name), what)
        } else {
            continue;
        };
        if !seen.contains(&once) {
            seen.push(once);
            let first = input_of(checker, kind);
            let references: Vec<u64> = first.into_iter().chain([reference]).collect();
            let bits = vec![other; references.len()];
            add(&format!("Set{name}"), set(references, kind, bits), what, Some(Grade::Note));
        }
    }
    let float = if fmi3 { "Float64" } else { "Real" };
    let get = |references: Vec<u64>| {
        let count = references.len();
        let mut args =
            vec![Arg::In(Kind::U32, references), Arg::Whole(count as i64), Arg::Out(Kind::F64, count)];
        if fmi3 {
            args.push(Arg::Whole(count as i64));
        }
        args
    };
    add(
        &format!("Get{float}"),
        get(vec![unknown]),
        "the value of a reference that no variable has".to_owned(),
        Some(Grade::Fragile),
    );
    add(
        &format!("Set{float}"),
        set(vec![unknown], Kind::F64, vec![0]),
        "a value for a reference that no variable has".to_owned(),
        Some(Grade::Fragile),
    );
    add(
        "ExitInitializationMode",
        vec![],
        "leaving Initialization Mode, which it is not in".to_owned(),
        Some(Grade::Note),
    );
    let experiment =
        vec![Arg::Whole(0), Arg::real(0.0), Arg::real(time + 7.0), Arg::Whole(0), Arg::real(0.0)];
    if fmi3 {
        add(
            "EnterInitializationMode",
            experiment,
            "entering Initialization Mode amid the simulation".to_owned(),
            Some(Grade::Note),
        );
    } else {
        add(
            "SetupExperiment",
            experiment,
            "another experiment amid the simulation".to_owned(),
            Some(Grade::Note),
        );
        add(
            "EnterInitializationMode",
            vec![],
            "entering Initialization Mode amid the simulation".to_owned(),
            Some(Grade::Note),
        );
    }
    let step = |time: f64, size: f64| {
        let mut args = vec![Arg::real(time), Arg::real(size), Arg::Whole(0)];
        if fmi3 {
            let flag = || Arg::Out(Kind::U8, 1);
            args.extend([flag(), flag(), flag(), Arg::Out(Kind::F64, 1)]);
        }
        args
    };
    match interface {
        Interface::CoSimulation => {
            for (time, size, what) in [
                (time, 0.0, "a step of no size"),
                (time, -size, "a step back"),
                (time, f64::NAN, "a step of NaN"),
                (time + 10.0 * size, size, "a step from a time that is not reached yet"),
                (f64::NAN, size, "a step from NaN"),
            ] {
                add("DoStep", step(time, size), what.to_owned(), Some(Grade::Note));
            }
            if !fmi3
                && checker.can(interface, &["canInterpolateInputs"])
                && let Some(input) = input_of(checker, Kind::F64)
            {
                for (references, orders, what) in [
                    (
                        vec![input, unknown],
                        vec![1, 1],
                        "a derivative of an input and of a reference that no variable has",
                    ),
                    (vec![input, input], vec![1, 0], "a derivative of order 1 and one of order 0"),
                ] {
                    let args = vec![
                        Arg::In(Kind::U32, references),
                        Arg::Whole(2),
                        Arg::In(Kind::I32, orders),
                        Arg::In(Kind::F64, vec![3_f64.to_bits(); 2]),
                    ];
                    add("SetRealInputDerivatives", args, what.to_owned(), None);
                }
            }
        }
        Interface::ModelExchange => {
            add("SetTime", vec![Arg::real(f64::NAN)], "a time of NaN".to_owned(), None);
            if !states.is_empty() {
                let other: Vec<u64> = states.iter().map(|state| (state + 0.125).to_bits()).collect();
                let mut more = other.clone();
                more.push(0);
                let mut bad = other;
                if let Some(last) = bad.last_mut() {
                    *last = f64::NAN.to_bits();
                }
                let count = bad.len() as i64;
                add(
                    "SetContinuousStates",
                    vec![Arg::In(Kind::F64, more), Arg::Whole(count + 1)],
                    "one state too many".to_owned(),
                    Some(Grade::Note),
                );
                add(
                    "SetContinuousStates",
                    vec![Arg::In(Kind::F64, bad), Arg::Whole(count)],
                    "states one of which is NaN".to_owned(),
                    None,
                );
            }
            add(
                "EnterContinuousTimeMode",
                vec![],
                "entering Continuous-Time Mode, which it is in".to_owned(),
                Some(Grade::Note),
            );
        }
    }
    let null = |of_fmi2: &str, of_fmi3: &str| if fmi3 { of_fmi3.to_owned() } else { of_fmi2.to_owned() };
    if checker.serializes(interface) {
        let bytes = Arg::In(Kind::U8, (0..64).map(|byte| byte * 37 % 256).collect());
        add(
            &null("DeSerializeFMUstate", "DeserializeFMUState"),
            vec![bytes, Arg::Whole(64), Arg::StateOut(90)],
            "bytes that are no state".to_owned(),
            Some(Grade::Note),
        );
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

/// An input of this type, which a call changes before it comes to what it cannot do.
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

/// Each attack amid a course; what follows is what follows without it.
pub fn change_nothing(checker: &Checker) -> anyhow::Result<()> {
    for course in &checker.courses {
        let to = course.points.len() / 2;
        let Some(here) = course.points.get(to) else { continue };
        let states: Vec<f64> =
            course.points[..to].last().map(|point| point.states.clone()).unwrap_or_default();
        let time = if course.interface == Interface::CoSimulation {
            here.time
        } else {
            course.points[to.max(1) - 1].time
        };
        for attack in attacks(checker, course.interface, time, here.size, &states) {
            let mut writer = checker.writer();
            let play = |writer: &mut crate::writer::Writer,
                        of: usize,
                        attacked: bool|
             -> (Vec<Read>, Vec<Read>, Option<u32>, Vec<u32>) {
                writer.begin(of, course);
                for point in &course.points[..to] {
                    writer.point(of, course, point);
                }
                let id = attacked.then(|| writer.forbidden(Some(of), &attack.function, attack.args.clone()));
                let at_once = writer.ask(of, course.interface);
                let (mut later, mut calls) = (Vec::new(), Vec::new());
                for (number, point) in course.points[to..].iter().enumerate() {
                    // What was set shows most where nothing sets it anew.
                    let point = crate::writer::Point {
                        inputs: if number < 2 { Vec::new() } else { point.inputs.clone() },
                        ..point.clone()
                    };
                    calls.extend(writer.point(of, course, &point));
                    later.extend(writer.ask(of, course.interface));
                }
                writer.free(of);
                (at_once, later, id, calls)
            };
            let (at_once, later, _, _) = play(&mut writer, 0, false);
            let (attacked_at_once, attacked_later, id, calls) = play(&mut writer, 1, true);
            let id = id.unwrap_or_default();
            let (description, name, what) =
                (checker.description.clone(), attack.function.clone(), attack.what.clone());
            let (stepped, fmi3) = (attack.function == "DoStep", checker.fmi3());
            let changed = move |run: &crate::script::Run| -> Option<(i32, String)> {
                let status = run.status(id).filter(|status| (2..=3).contains(status))?;
                if stepped && !fmi3 && status == 2 {
                    return None;
                }
                // After an error an instance may refuse everything.
                let refuses = |reads: &[Read]| {
                    reads.iter().any(|read| run.status(read.id).is_none_or(|status| status > 1))
                };
                if refuses(&attacked_at_once) {
                    return None;
                }
                let gone_on = if refuses(&attacked_later)
                    || calls.iter().any(|id| run.status(*id).is_none_or(|status| status > 1))
                {
                    None
                } else {
                    difference(&description, run, &later, &attacked_later)
                };
                let (variable, was, is) =
                    difference(&description, run, &at_once, &attacked_at_once).or(gone_on)?;
                Some((
                    status,
                    format!(
                        "{name} with {what} answers {}, and {variable} is {is} after it, not {was}",
                        status_name(status)
                    ),
                ))
            };
            let section = checker.section("2.1.3", "2.2.4");
            let claim = Claim::new(
                "refusals.changed",
                Grade::Fragile,
                section,
                "A call that is refused leaves the instance as it was: importers try again with other values.",
            );
            let judged = changed.clone();
            let judge: Judge = Arc::new(move |run| Some(judged(run)?.1));
            let run = checker.judge(&claim, writer.script.clone(), Arc::clone(&judge))?;
            if fmi3 && changed(&run).is_some_and(|(status, _)| status == 2) {
                let claim = Claim {
                    grade: Grade::Violation,
                    promise: "After Discard the FMU is in the same state as before the call.".to_owned(),
                    ..claim
                };
                checker.add(claim.finding(judge(&run).unwrap_or_default(), writer.script.clone(), judge));
            }
            if let Some(grade) = attack.accepted {
                let (function, what) = (attack.function.clone(), attack.what.clone());
                let judge: Judge = Arc::new(move |run| {
                    let status = run.status(id).filter(|status| *status <= 1)?;
                    Some(format!("{function} with {what} answers {}", status_name(status)))
                });
                if let Some(seen) = judge(&run) {
                    let name = match grade {
                        Grade::Violation => "refusals.constant",
                        Grade::Fragile => "refusals.accepted",
                        Grade::Note => "refusals.tolerated",
                    };
                    let promise = "What cannot be done is refused, so that a fault of the importer is seen.";
                    checker.add(Claim::new(name, grade, section, promise).finding(
                        seen,
                        writer.script,
                        judge,
                    ));
                }
            }
        }
    }
    Ok(())
}

//! Call sequences as text.

use crate::call_sequence::{
    Action, Arg, CallSequence, End, Integration, Make, NULL_INSTANCE, Numbered, Outcome, Run, Values,
    action_of,
};
use crate::description::{Description, type_name};
use crate::evidence::{Evidence, Expected, Measure};
use crate::finding::{ending, status_name};
use fmi_abi::calls::signature;
use fmi_abi::{Standard, shown_to};
use std::fmt::Write as _;

/// Maximum number of elements of an array in a line.
const ELEMENTS: usize = 8;

/// Maximum number of characters of a string in a line.
const CHARACTERS: usize = 60;

/// Writes call sequences as text, in which value references have the names of their variables.
pub struct Printed<'a> {
    pub description: &'a Description,
    /// Run whose results follow the calls, if there is one.
    pub run: Option<&'a Run>,
}

impl Printed<'_> {
    /// Returns the lines of a sequence in which copies are folded. Each call begins with its number.
    pub fn lines(&self, sequence: &CallSequence) -> Vec<String> {
        let mut lines = Vec::new();
        self.block(sequence, 0, &mut lines);
        lines
    }

    fn block(&self, sequence: &[Numbered], depth: usize, lines: &mut Vec<String>) {
        for numbered in sequence {
            let indent = "    ".repeat(depth);
            let mut heading = |text: String| lines.push(format!("      {indent}{text}"));
            match &numbered.action {
                Action::Repeat(times, actions) => {
                    heading(format!("repeat {times} times, or until the time for repetitions is over:"));
                    self.block(actions, depth + 1, lines);
                }
                Action::Copies(times, stride, actions) => {
                    heading(format!("repeat {times} times, with numbers that increase by {stride}:"));
                    // The results belong to one copy only.
                    Printed { run: None, ..*self }.block(actions, depth + 1, lines);
                }
                Action::Parallel(sequences) => {
                    for (number, sequence) in sequences.iter().enumerate() {
                        lines.push(format!("      {indent}on thread {}, at the same time:", number + 1));
                        self.block(sequence, depth + 1, lines);
                    }
                }
                action => {
                    let result = self.run.map_or(String::new(), |run| result(run, numbered, sequence));
                    lines.push(format!("{:5} {indent}{}{result}", numbered.id, self.action(action)));
                }
            }
        }
    }

    fn prefix(&self) -> &'static str {
        if self.description.standard == Standard::Fmi3 { "fmi3" } else { "fmi2" }
    }

    /// Returns an action that contains no other actions.
    fn action(&self, action: &Action) -> String {
        match action {
            Action::Make(index, make) => format!("{} = {}", instance(Some(*index)), self.make(make)),
            Action::Free(index) => format!("{}FreeInstance({})", self.prefix(), instance(Some(*index))),
            Action::Call { instance: of, function, args } => {
                let args = args.iter().enumerate().map(|(index, arg)| self.argument(function, index, arg));
                let all: Vec<String> = std::iter::once(instance(*of)).chain(args).collect();
                format!("{function}({})", all.join(", "))
            }
            Action::Version(name) => format!("{name}()"),
            Action::Integrate(index, Integration { begin, end, steps, euler, .. }) => {
                let method = if *euler { "Euler's method" } else { "the classical Runge-Kutta method" };
                format!(
                    "integrate {} from {begin:?} to {end:?} by {method} in {steps} steps, and handle its events",
                    instance(Some(*index))
                )
            }
            Action::Measure => "measure memory, threads, open files and settings of the process".to_owned(),
            Action::FreshProcess => {
                "continue in a new process, which gets only the serialized states".to_owned()
            }
            Action::Elsewhere(name) => format!("use the FMU through the directory {name:?}"),
            Action::Environment => {
                "use another working directory, home directory, language and time zone".to_owned()
            }
            Action::Unload => "unload the library".to_owned(),
            Action::Quit => "exit(0)".to_owned(),
            Action::Repeat(..) | Action::Parallel(_) | Action::Copies(..) => String::new(),
        }
    }

    fn make(&self, make: &Make) -> String {
        let text = |text: &str| string(Some(text.as_bytes()));
        let (name, token) = (text(&make.name), text(&make.token));
        let (visible, logging) = (u8::from(make.visible), u8::from(make.logging));
        match (self.prefix(), make.co_simulation) {
            ("fmi2", co_simulation) => {
                let interface = if co_simulation { "fmi2CoSimulation" } else { "fmi2ModelExchange" };
                format!(
                    "fmi2Instantiate({name}, {interface}, {token}, resources, callbacks, {visible}, {logging})"
                )
            }
            (_, false) => format!(
                "fmi3InstantiateModelExchange({name}, {token}, resources, {visible}, {logging}, environment, logger)"
            ),
            (_, true) => format!(
                "fmi3InstantiateCoSimulation({name}, {token}, resources, {visible}, {logging}, {}, {}, NULL, 0, environment, \
                 logger, NULL)",
                u8::from(make.event_mode),
                u8::from(make.early_return)
            ),
        }
    }

    /// Returns the argument of a function at an index.
    fn argument(&self, function: &str, index: usize, arg: &Arg) -> String {
        match arg {
            Arg::Real(bits) => format!("{:?}", f64::from_bits(*bits)),
            Arg::Integer(number) => number.to_string(),
            Arg::Null => "NULL".to_owned(),
            Arg::In(kind, bits) => {
                let argument = signature(function).and_then(|signature| signature.arguments.get(index));
                let refers = argument.is_some_and(|argument| argument.of.ends_with("ValueReference"));
                let element = |bits: &u64| match refers {
                    true => self.reference(function, *bits),
                    false => kind.show(*bits),
                };
                list(bits.iter().map(element))
            }
            Arg::Strings(texts) => list(texts.iter().map(|text| string(text.as_deref()))),
            Arg::Blobs(blobs) => list(blobs.iter().map(|blob| string(Some(blob)))),
            Arg::Out(_, count) => format!("out[{count}]"),
            Arg::State(slot) => format!("state{slot}"),
            Arg::StateOut(slot) => format!("&state{slot}"),
            Arg::Saved(slot) | Arg::SavedOut(slot) => format!("bytes{slot}"),
            Arg::SavedSize(slot) => format!("size{slot}"),
            Arg::SizeOut(slot) => format!("&size{slot}"),
        }
    }

    /// Returns a value reference with the name of its variable. In FMI 2.0, variables of different types may have the same
    /// reference, so the name of the function decides.
    fn reference(&self, function: &str, reference: u64) -> String {
        let standard = self.description.standard;
        let of_type = |base| function.ends_with(type_name(standard, base));
        let all = self.description.variables.iter();
        let mut same = all.filter(|variable| u64::from(variable.reference) == reference);
        let first = same.clone().next();
        let variable = same.find(|variable| variable.base.is_some_and(of_type)).or(first);
        variable.map_or(reference.to_string(), |variable| {
            format!("{reference} \"{}\"", shown_to(&variable.name, CHARACTERS))
        })
    }
}

/// Returns the name of an instance.
fn instance(index: Option<usize>) -> String {
    match index {
        None | Some(NULL_INSTANCE) => "NULL".to_owned(),
        Some(0) => "c".to_owned(),
        Some(index) => format!("c{index}"),
    }
}

/// Returns a string in quotes; bytes that are not UTF-8 are replaced.
fn string(bytes: Option<&[u8]>) -> String {
    bytes.map_or("NULL".to_owned(), |bytes| {
        format!("{:?}", shown_to(&String::from_utf8_lossy(bytes), CHARACTERS))
    })
}

/// Returns the first elements in braces.
fn list(elements: impl ExactSizeIterator<Item = String>) -> String {
    let more = elements.len().saturating_sub(ELEMENTS);
    let mut text = elements.take(ELEMENTS).collect::<Vec<_>>().join(", ");
    if more > 0 {
        let _ = write!(text, ", and {more} more");
    }
    format!("{{{text}}}")
}

fn values(values: &Values) -> String {
    match values {
        Values::Numbers(kind, bits) => list(bits.iter().map(|bits| kind.show(*bits))),
        Values::Strings(texts) => list(texts.iter().map(|text| string(text.as_deref()))),
    }
}

/// Returns the result of an action, with an arrow before it.
fn result(run: &Run, numbered: &Numbered, sequence: &[Numbered]) -> String {
    let Some(outcome) = run.outcome(numbered.id) else {
        let ends = run.at == Some(numbered.id);
        let how = ending(run, &sequence.to_vec()).filter(|_| ends);
        return format!(" -> {}", how.as_deref().unwrap_or("not executed"));
    };
    let result = outcome_text(numbered, outcome);
    if result.is_empty() { result } else { format!(" -> {result}") }
}

fn outcome_text(numbered: &Numbered, outcome: &Outcome) -> String {
    let mut parts = Vec::new();
    match (&numbered.action, outcome.status) {
        _ if outcome.missing => parts.push("not in the library".to_owned()),
        (Action::Make(..), Some(0)) => parts.push("NULL".to_owned()),
        (Action::Call { .. } | Action::Integrate(..), Some(status)) => parts.push(status_name(status)),
        (Action::Call { .. }, None) => parts.push("not executed, because there is no instance".to_owned()),
        (Action::Version(_), _) => parts.push(string(outcome.text.as_deref())),
        _ => {}
    }
    match (&numbered.action, &outcome.written[..]) {
        (Action::Call { function, .. }, [Values::Numbers(_, words)])
            if function == "fmi2NewDiscreteStates" =>
        {
            parts.extend(event_info(words));
        }
        (_, written) => parts.extend(written.iter().map(values)),
    }
    parts.extend(outcome.damage.iter().map(|damage| format!("writes {damage}")));
    parts.extend(outcome.log.iter().map(|message| format!("logs {}", string(message.text.as_deref()))));
    parts.join(", ")
}

/// Returns the fields of fmi2EventInfo: five flags of 32 bits, padding, and the time of the next event.
fn event_info(words: &[u64]) -> Option<String> {
    let [first, second, third, time] = *words else { return None };
    let flags = [first as u32, (first >> 32) as u32, second as u32, (second >> 32) as u32, third as u32];
    let fields = flags.iter().map(u32::to_string).chain([format!("{:?}", f64::from_bits(time))]);
    Some(format!("{{{}}}", fields.collect::<Vec<_>>().join(", ")))
}

/// Returns the results that together show a finding, a line for each. If there is a run, adds the values that differ.
pub fn expectation(evidence: &Evidence, sequence: &CallSequence, run: Option<&Run>) -> Vec<String> {
    let one = |text: &str| vec![text.to_owned()];
    match evidence {
        Evidence::Unknown => Vec::new(),
        Evidence::End(end, name) => {
            let name = name.as_deref().unwrap_or("the end of the process");
            vec![match end {
                End::Crash(_) => format!("{name} crashes"),
                End::Hang(_) => format!("{name} does not return in time"),
                End::Exit(_) => format!("{name} ends the process"),
                End::Unloadable(_) => "the library cannot be loaded".to_owned(),
                End::Flood(_) => format!("{name} leads to too many processes"),
                End::Done => "all calls return".to_owned(),
            }]
        }
        Evidence::Orphans => one("a process is alive after the last call"),
        Evidence::Printed => one("something is printed"),
        Evidence::Damage => one("a call writes outside of its arrays for results"),
        Evidence::Strays => one("a message has an environment pointer that no instance has received"),
        Evidence::Threads => {
            one("a read on a thread has another result than the same read before the threads")
        }
        Evidence::Same(calls, pairs) => {
            let pair = |[one, other]: &[u32; 2]| {
                let values = run.and_then(|run| different(run.outcome(*one)?, run.outcome(*other)?));
                let values = values.map_or(String::new(), |[one, other]| format!(": {one} and {other}"));
                format!("calls {one} and {other} return different values{values}")
            };
            let action = |call: &Expected| action_of(sequence, call.id).map(|numbered| &numbered.action);
            let makes = |call: &&Expected| matches!(action(call), Some(Action::Make(..)));
            let is_plain = |call: &&Expected| {
                !makes(call) && **call == Expected { id: call.id, status: Some(0), ..Expected::default() }
            };
            let (plain, others): (Vec<&Expected>, Vec<_>) = calls.iter().partition(is_plain);
            let others = others.into_iter().map(|call| expected(call, makes(&call)));
            let plain = match &plain[..] {
                [] => None,
                [one] => Some(format!("call {} returns OK", one.id)),
                more => Some(format!("each of these calls returns OK: {}", numbers(more))),
            };
            plain.into_iter().chain(others).chain(pairs.iter().map(pair)).collect()
        }
        Evidence::Grown(measure, first, last) => {
            let what = match measure {
                Measure::Memory => "there is more memory",
                Measure::Threads => "there are more threads",
                Measure::Files => "there are more open files",
                Measure::Settings | Measure::AllSettings => "there are other settings",
            };
            vec![format!("{what} in measurement {last} than in measurement {first}")]
        }
    }
}

/// Returns the first values in which the results of two calls differ.
fn different(one: &Outcome, other: &Outcome) -> Option<[String; 2]> {
    one.written.iter().zip(&other.written).find_map(|(one, other)| {
        let index = one.differ(other)?;
        Some([one.show(index), other.show(index)])
    })
}

/// Returns the numbers of calls.
fn numbers(calls: &[&Expected]) -> String {
    calls.iter().map(|call| call.id.to_string()).collect::<Vec<_>>().join(", ")
}

/// Returns the expected results of a call; `makes` states whether it is an instantiation.
fn expected(call: &Expected, makes: bool) -> String {
    let mut parts = vec![match call.status {
        _ if call.missing => "is not in the library".to_owned(),
        Some(0) if makes => "returns NULL".to_owned(),
        Some(_) if makes => "returns an instance".to_owned(),
        Some(status) => format!("returns {}", status_name(status)),
        None => "is executed".to_owned(),
    }];
    parts.extend(call.written.iter().map(|arrays| {
        let arrays: Vec<String> = arrays.iter().map(values).collect();
        format!("writes {}", arrays.join(", "))
    }));
    parts.extend(call.text.iter().map(|text| format!("returns {}", string(Some(text)))));
    parts.extend(call.log.iter().map(|log| match log.last() {
        None => "logs nothing".to_owned(),
        Some(last) => format!("logs {}", string(last.text.as_deref())),
    }));
    if call.varies {
        parts.push("has other results in another run".to_owned());
    }
    format!("call {} {}", call.id, parts.join(", "))
}

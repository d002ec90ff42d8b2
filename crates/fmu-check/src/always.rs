//! Rules that hold for every run, about writes to arrays, statuses, strings, logged messages and processes that are left.

use crate::call_sequence::{Action, CallSequence, Message, Numbered, Run, Values, action_name, all_actions};
use crate::description::Description;
use crate::finding::{Criterion, Finding, SharedCriterion, status_name};
use crate::rules;
use crate::writer::LONG_NAME;
use fmi_abi::Standard;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// Name of a rule, and the criterion that describes the violation in a run.
type Broken = (&'static str, SharedCriterion);

fn rule(name: &'static str, criterion: impl Criterion) -> Broken {
    (name, Arc::new(criterion))
}

/// Returns the violations of these rules in a run whose last action has returned: all violations of the rules for arrays, and the
/// first violation of each other rule.
pub fn findings(description: &Description, sequence: &CallSequence, run: &Run) -> Vec<Finding> {
    let all = all_actions(sequence);
    let mut broken: Vec<Broken> = processes(&all, run).into_iter().collect();
    for numbered in &all {
        if let Some(outcome) = run.outcome(numbered.id) {
            broken.extend(rules_of_call(numbered));
            broken.extend(messages(description, numbered.id).filter(|_| !outcome.log.is_empty()));
            broken.extend(silence(sequence, numbered));
            broken.extend(environment(numbered).filter(|_| !outcome.strays.is_empty()));
        }
    }
    let mut names = HashSet::new();
    let found = broken.into_iter().filter_map(|(name, criterion)| {
        let observed = criterion(run)?;
        let finding = rules::broken(description.standard, name, observed);
        Some(finding.shown_by(sequence.clone(), criterion))
    });
    found.filter(|finding| names.insert(finding.name.clone()) || finding.topic() == "arrays").collect()
}

/// Returns the rule that no process is alive after all instances were freed; `None` if the run left no process, or if the
/// sequence does not free all instances.
fn processes(all: &[&Numbered], run: &Run) -> Option<Broken> {
    if run.orphans.is_empty() {
        return None;
    }
    let pairs = lives(all)?;
    Some(rule("resources.processes", move |run| {
        let (count, first) = (run.orphans.len(), run.orphans.first()?);
        let freed = |(make, free): &(u32, u32)| run.outcome(*make).is_none() || run.outcome(*free).is_some();
        let processes = if count == 1 { "process is" } else { "processes are" };
        pairs.iter().all(freed).then(|| {
            format!("{count} {processes} alive after all instances were freed; the first is called {first:?}")
        })
    }))
}

/// Returns the number of each instantiation and of the call that frees its instance; `None` if an instance is not freed.
fn lives(all: &[&Numbered]) -> Option<Vec<(u32, u32)>> {
    let mut alive = HashMap::new();
    let mut pairs = Vec::new();
    for numbered in all {
        match &numbered.action {
            Action::Make(index, _) if alive.insert(*index, numbered.id).is_some() => return None,
            Action::Free(index) => pairs.extend(alive.remove(index).map(|make| (make, numbered.id))),
            _ => {}
        }
    }
    alive.is_empty().then_some(pairs)
}

/// Returns the rules for the arrays, the status and the strings of a call.
fn rules_of_call(numbered: &Numbered) -> Vec<Broken> {
    let (id, name) = (numbered.id, action_name(&numbered.action));
    let arrays = [("arrays.const", true), ("arrays.written-beyond", false)].map(|(of, constant)| {
        let name = name.clone();
        rule(of, move |run| {
            let damage =
                run.outcome(id)?.damage.iter().find(|damage| damage.contains("const") == constant)?;
            Some(format!("{name} writes {damage}"))
        })
    });
    let mut broken = Vec::from(arrays);
    let Action::Call { function, .. } = &numbered.action else { return broken };
    let max_status = if function == "fmi2DoStep" { 5 } else { 4 };
    broken.push(rule("functions.status", move |run| {
        let status = run.status(id).filter(|status| !(0..=max_status).contains(status))?;
        Some(format!("{name} returns {status}"))
    }));
    if function.ends_with("GetString") && !numbered.forbidden {
        broken.push(rule("start_values.utf8", move |run| {
            let Values::Strings(texts) = run.written(id)? else { return None };
            let bad = texts.iter().flatten().find(|text| std::str::from_utf8(text).is_err())?;
            Some(format!("the string {:?} is not UTF-8", String::from_utf8_lossy(bad)))
        }));
    }
    broken
}

fn show(text: &[u8]) -> String {
    format!("{:?}", String::from_utf8_lossy(text))
}

/// Conversions of printf. In FMI 3.0 a message is not a format, so a conversion in it is a mistake.
const CONVERSIONS: [&str; 14] =
    ["%s", "%d", "%i", "%u", "%g", "%f", "%e", "%x", "%lf", "%ld", "%lu", "%zu", "%.", "%p"];

/// Tests a message of an FMU with these log categories; returns a description of the error.
type MessageTest = fn(&Message, &[String], Standard) -> Option<String>;
/// Rules for messages, each with its test.
const MESSAGE_TESTS: [(&str, MessageTest); 4] = [
    ("logs.category", |message, categories, _| {
        let Some(category) = &message.category else {
            let why = "its category is NULL, and the model description has categories";
            return (!categories.is_empty()).then(|| why.to_owned());
        };
        let why = match categories {
            [] => ", and the model description has none",
            known if known.iter().any(|known| known.as_bytes() == category.as_slice()) => return None,
            _ => ", which is not in the model description",
        };
        Some(format!("its category is {}{why}", show(category)))
    }),
    ("logs.utf8", |message, _, _| match &message.text {
        None => Some("the message is NULL".to_owned()),
        Some(text) if std::str::from_utf8(text).is_err() => Some(format!("{} is not UTF-8", show(text))),
        Some(_) => None,
    }),
    ("logs.status", |message, _, _| {
        (!(0..=5).contains(&message.status)).then(|| format!("its status is {}", message.status))
    }),
    // In FMI 2.0, a message is a format of printf, so conversions are allowed.
    ("logs.format", |message, _, standard| {
        let text = message.text.as_deref().filter(|_| standard == Standard::Fmi3)?;
        let text = String::from_utf8_lossy(text).replace(LONG_NAME, "");
        let found = CONVERSIONS.iter().find(|conversion| text.contains(**conversion))?;
        Some(format!("it contains {found}"))
    }),
];

/// Returns the rules for the messages that a call logs.
fn messages(description: &Description, id: u32) -> impl Iterator<Item = Broken> {
    MESSAGE_TESTS.into_iter().map(move |(name, test)| {
        let categories = description.log_categories.iter().map(|of| of.name.clone()).collect::<Vec<_>>();
        let standard = description.standard;
        rule(name, move |run| {
            run.outcome(id)?.log.iter().find_map(|message| {
                let text = show(message.text.as_deref().unwrap_or_default());
                Some(format!("message {text}: {}", test(message, &categories, standard)?))
            })
        })
    })
}

/// Returns the rule that messages are logged with the environment pointer of the importer.
fn environment(numbered: &Numbered) -> Option<Broken> {
    let (id, name) = (numbered.id, action_name(&numbered.action));
    Some(rule("logs.environment", move |run| {
        let message = run.outcome(id)?.strays.first()?;
        let text = show(message.text.as_deref().unwrap_or_default());
        Some(format!("{name} logs {text} with an environment pointer that no instance has received"))
    }))
}

/// Returns the rule that a failed call logs a message; `None` if the sequence changes the logging or an action instantiates without
/// logging, and for actions that need not log a message.
fn silence(sequence: &CallSequence, numbered: &Numbered) -> Option<Broken> {
    let off = sequence.iter().any(|numbered| {
        matches!(&numbered.action, Action::Make(_, make) if !make.logging)
            || matches!(&numbered.action, Action::Call { function, .. } if function.ends_with("SetDebugLogging"))
    });
    // Section 4.2.3 of FMI 2.0.5: the FMU returns Discard if it does not provide a status, which is not a failure.
    let asks_status = |function: &str| function.starts_with("fmi2Get") && function.ends_with("Status");
    if off
        || !matches!(&numbered.action, Action::Call { instance: Some(_), function, .. } if !asks_status(function))
    {
        return None;
    }
    let (id, name) = (numbered.id, action_name(&numbered.action));
    Some(rule("logs.silent", move |run| {
        let outcome = run.outcome(id)?;
        let status = outcome.status.filter(|status| (2..=4).contains(status))?;
        (outcome.log.is_empty() && outcome.strays.is_empty())
            .then(|| format!("{name} returns {} without a message", status_name(status)))
    }))
}

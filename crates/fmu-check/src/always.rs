//! Rules that hold for every run: nothing is written where it does not belong, statuses are those of the standard, messages
//! are such that importers can show them.

use crate::call_sequence::{CallSequence, Message, Numbered, Run, Step, Written};
use crate::description::Description;
use crate::finding::{Finding, Judge, status_name, step_name};
use crate::rules::claim;
use fmi_abi::Standard;
use std::collections::HashMap;
use std::sync::Arc;

/// A rule for a call, with what is wrong in a run.
type Broken = (&'static str, Judge);

/// The findings in a run that came to its end.
pub fn findings(description: &Description, sequence: &CallSequence, run: &Run) -> Vec<Finding> {
    let mut all = Vec::new();
    walk(sequence, &mut all);
    let mut broken: Vec<Broken> = processes(&all, run).into_iter().collect();
    for numbered in &all {
        if run.of(numbered.id).is_some() {
            broken.extend(call(numbered));
            broken.extend(messages(description, numbered.id));
            broken.extend(silence(sequence, numbered));
        }
    }
    let found = broken.into_iter().filter_map(|(name, judge)| {
        let observed = judge(run)?;
        Some(claim(description.standard, name).finding(observed, sequence.clone(), judge))
    });
    let mut names: Vec<String> = Vec::new();
    found
        .filter(|finding| {
            let new = !names.contains(&finding.name);
            names.push(finding.name.clone());
            new || finding.topic() == "arrays"
        })
        .collect()
}

fn walk<'s>(sequence: &'s [Numbered], all: &mut Vec<&'s Numbered>) {
    for numbered in sequence {
        all.push(numbered);
        match &numbered.step {
            Step::Repeat(_, steps) => walk(steps, all),
            Step::Parallel(sequences) => sequences.iter().for_each(|sequence| walk(sequence, all)),
            _ => {}
        }
    }
}

/// Processes that were left by a sequence that has freed all instances.
fn processes(all: &[&Numbered], run: &Run) -> Option<Broken> {
    if run.left.is_empty() {
        return None;
    }
    let pairs = lives(all)?;
    let judge: Judge = Arc::new(move |run| {
        let (count, first) = (run.left.len(), run.left.first()?);
        let freed = |(make, free): &(u32, u32)| run.of(*make).is_none() || run.of(*free).is_some();
        let processes = if count == 1 { "process is" } else { "processes are" };
        pairs.iter().all(freed).then(|| {
            format!("{count} {processes} left after all instances were freed; the first is called {first:?}")
        })
    });
    Some(("resources.processes", judge))
}

/// The instantiations of a sequence, each with the call that frees the instance; none if an instance is not freed.
fn lives(all: &[&Numbered]) -> Option<Vec<(u32, u32)>> {
    let mut alive = HashMap::new();
    let mut pairs = Vec::new();
    for numbered in all {
        match &numbered.step {
            Step::Make(index, _) if alive.insert(*index, numbered.id).is_some() => return None,
            Step::Free(index) => pairs.extend(alive.remove(index).map(|make| (make, numbered.id))),
            _ => {}
        }
    }
    alive.is_empty().then_some(pairs)
}

/// Values that a call wrote, and its status.
fn call(numbered: &Numbered) -> Vec<Broken> {
    let (id, name) = (numbered.id, step_name(&numbered.step));
    let mut broken: Vec<Broken> = Vec::new();
    for (rule, constant) in [("arrays.const", true), ("arrays.written-beyond", false)] {
        let name = name.clone();
        let judge: Judge = Arc::new(move |run| {
            let damage = run.of(id)?.damage.iter().find(|damage| damage.contains("const") == constant)?;
            Some(format!("{name} writes {damage}"))
        });
        broken.push((rule, judge));
    }
    if let Step::Call { function, .. } = &numbered.step {
        let most = if function == "fmi2DoStep" { 5 } else { 4 };
        let status: Judge = Arc::new(move |run| {
            let status = run.status(id).filter(|status| !(0..=most).contains(status))?;
            Some(format!("{name} returns {status}"))
        });
        broken.push(("functions.status", status));
        if function.ends_with("GetString") && !numbered.forbidden {
            let utf8: Judge = Arc::new(move |run| match run.written(id)? {
                Written::Texts(texts) => {
                    let bad = texts.iter().flatten().find(|text| std::str::from_utf8(text).is_err())?;
                    Some(format!("the string {:?} is not UTF-8", String::from_utf8_lossy(bad)))
                }
                Written::Numbers(..) => None,
            });
            broken.push(("start_values.utf8", utf8));
        }
    }
    broken
}

/// The messages of a call.
fn messages(description: &Description, id: u32) -> Vec<Broken> {
    type Test = Box<dyn Fn(&Message) -> Option<String> + Send + Sync>;
    let show = |text: &[u8]| format!("{:?}", String::from_utf8_lossy(text));
    let (categories, fmi3) = (description.log_categories.clone(), description.standard == Standard::Fmi3);
    let category: Test = Box::new(move |message| match &message.category {
        None if categories.is_empty() => None,
        None => Some("its category is NULL, and the model description has categories".to_owned()),
        Some(category) if categories.iter().any(|known| known.as_bytes() == category.as_slice()) => None,
        Some(category) if categories.is_empty() => {
            Some(format!("its category is {}, and the model description has none", show(category)))
        }
        Some(category) => {
            Some(format!("its category is {}, which is not in the model description", show(category)))
        }
    });
    let text: Test = Box::new(move |message| match &message.text {
        None => Some("the message is NULL".to_owned()),
        Some(text) if std::str::from_utf8(text).is_err() => Some(format!("{} is not UTF-8", show(text))),
        Some(_) => None,
    });
    let status: Test = Box::new(|message| {
        (!(0..=5).contains(&message.status)).then(|| format!("its status is {}", message.status))
    });
    // In FMI 2.0 a message is a format of printf, and its arguments follow.
    let format: Test = Box::new(move |message| {
        let text = String::from_utf8_lossy(message.text.as_deref().filter(|_| fmi3)?).into_owned();
        let conversions =
            ["%s", "%d", "%i", "%u", "%g", "%f", "%e", "%x", "%lf", "%ld", "%lu", "%zu", "%.", "%p"];
        let found = conversions.iter().find(|conversion| text.contains(**conversion))?;
        Some(format!("it contains {found}"))
    });
    let tests =
        [("logs.category", category), ("logs.text", text), ("logs.status", status), ("logs.format", format)];
    let judged = tests.into_iter().map(|(name, test)| {
        let judge: Judge = Arc::new(move |run| {
            run.of(id)?.log.iter().find_map(|message| {
                let text = String::from_utf8_lossy(message.text.as_deref().unwrap_or_default()).into_owned();
                Some(format!("message {text:?}: {}", test(message)?))
            })
        });
        (name, judge)
    });
    judged.collect()
}

/// A call that fails without a message, where logging is on.
fn silence(sequence: &CallSequence, numbered: &Numbered) -> Option<Broken> {
    let off = sequence.iter().any(|numbered| {
        matches!(&numbered.step, Step::Make(_, make) if !make.logging)
            || matches!(&numbered.step, Step::Call { function, .. } if function.ends_with("SetDebugLogging"))
    });
    if off || !matches!(&numbered.step, Step::Call { of: Some(_), .. }) {
        return None;
    }
    let (id, name) = (numbered.id, step_name(&numbered.step));
    let judge: Judge = Arc::new(move |run| {
        let outcome = run.of(id)?;
        let status = outcome.status.filter(|status| (2..=4).contains(status))?;
        outcome.log.is_empty().then(|| format!("{name} returns {} without a message", status_name(status)))
    });
    Some(("logs.silent", judge))
}

//! Shortens the call sequence of a finding.

use crate::call_sequence::{Action, CallSequence, Numbered, all_actions};
use crate::description::Description;
use crate::legal::first_illegal;
use std::collections::{HashMap, HashSet};

/// Returns the numbers of the actions, in groups. The actions of a group are only removed together, for example the calls of an
/// event.
fn units(sequence: &[Numbered]) -> Vec<Vec<u32>> {
    let (mut units, mut open, mut before) = (Vec::<Vec<u32>>::new(), false, "");
    for numbered in sequence {
        let name = match &numbered.action {
            Action::Call { function, .. } => function.get(4..).unwrap_or_default(),
            _ => "",
        };
        let belongs = match name {
            "NewDiscreteStates" | "UpdateDiscreteStates" => open,
            "EnterContinuousTimeMode" | "EnterStepMode" => std::mem::take(&mut open),
            "EnterInitializationMode" => before == "SetupExperiment",
            "SerializeFMUstate" | "SerializeFMUState" => before.starts_with("SerializedFMU"),
            _ => false,
        };
        open |= ["EnterEventMode", "ExitInitializationMode"].contains(&name);
        before = name;
        match units.last_mut() {
            Some(unit) if belongs => unit.push(numbered.id),
            _ => units.push(vec![numbered.id]),
        }
    }
    units
}

/// Returns the function and the arguments of a call, or the arguments of an integration, without the instance. Returns `None` for
/// calls that only read and for other actions.
fn content(action: &Action) -> Option<String> {
    match action {
        Action::Call { function, args, .. } => {
            let reads = function[4..].starts_with("Get") && !function.to_lowercase().ends_with("fmustate");
            (!reads).then(|| format!("{function} {args:?}"))
        }
        Action::Integrate(_, how) => Some(format!("{how:?}")),
        Action::Repeat(..) | Action::Parallel(_) | Action::Measure | Action::Version(_) => None,
        Action::Make(..) | Action::Free(_) | Action::FreshProcess => None,
        Action::Elsewhere(_) | Action::Environment | Action::Unload | Action::Quit | Action::Copies(..) => {
            None
        }
    }
}

/// Returns the sequence without the actions with these numbers, some of which may be actions of its threads.
fn without(sequence: &[Numbered], ids: &HashSet<u32>) -> CallSequence {
    let kept = sequence.iter().filter(|numbered| !ids.contains(&numbered.id)).cloned();
    kept.map(|mut numbered| {
        if let Action::Parallel(sequences) = &mut numbered.action {
            sequences.iter_mut().for_each(|sequence| *sequence = without(sequence, ids));
        }
        numbered
    })
    .collect()
}

/// Joins the units that have the same calls, because these calls may belong to compared simulations, whose results would differ
/// if only one of them lacked a call.
fn together(sequence: &CallSequence, units: Vec<Vec<u32>>) -> Vec<Vec<u32>> {
    let contents: HashMap<u32, String> = all_actions(sequence)
        .into_iter()
        .filter_map(|numbered| Some((numbered.id, content(&numbered.action)?)))
        .collect();
    let (mut groups, mut known) = (Vec::<Vec<u32>>::new(), HashMap::<Vec<&String>, usize>::new());
    for unit in units {
        let key: Vec<&String> = unit.iter().filter_map(|id| contents.get(id)).collect();
        match known.get(&key).filter(|_| !key.is_empty()) {
            Some(index) => groups[*index].extend(unit),
            None => {
                known.insert(key, groups.len());
                groups.push(unit);
            }
        }
    }
    groups
}

/// Returns the shortest sequence found that still satisfies `reproduces` and, if the standard allows the original sequence, is
/// allowed, too. Calls of `pinned` functions are not removed; if `pinned` is not empty, neither are the actions `FreshProcess`,
/// `Elsewhere` and `Environment`. If `compared` is set, corresponding calls of compared simulations are removed together. The search ends when
/// `reproduces` returns `None`.
pub fn shrink(
    description: &Description,
    sequence: &CallSequence,
    pinned: &[&str],
    compared: bool,
    mut reproduces: impl FnMut(&CallSequence) -> Option<bool>,
) -> CallSequence {
    let legal = first_illegal(description, sequence).is_none();
    let mut best = sequence.clone();
    let threads = sequence.iter().flat_map(|numbered| match &numbered.action {
        Action::Parallel(sequences) => sequences.iter().flat_map(|sequence| units(sequence)).collect(),
        _ => Vec::new(),
    });
    let all: Vec<Vec<u32>> = units(sequence).into_iter().chain(threads).collect();
    let mut units = if compared { together(sequence, all) } else { all };
    let stays = |action: &Action| match action {
        Action::Call { function, .. } => pinned.iter().any(|name| function[4..].eq_ignore_ascii_case(name)),
        Action::FreshProcess | Action::Elsewhere(_) | Action::Environment => !pinned.is_empty(),
        _ => false,
    };
    let all = all_actions(sequence).into_iter().filter(|numbered| stays(&numbered.action));
    let staying: HashSet<u32> = all.map(|numbered| numbered.id).collect();
    units.retain(|unit| !unit.iter().any(|id| staying.contains(id)));
    let mut size = units.len() / 2;
    while size > 0 {
        let mut end = units.len();
        let mut shorter = false;
        while end > 0 {
            let begin = end.saturating_sub(size);
            let tried = without(&best, &units[begin..end].iter().flatten().copied().collect());
            let keeps = !legal || first_illegal(description, &tried).is_none();
            if keeps && all_actions(&tried).len() < all_actions(&best).len() {
                match reproduces(&tried) {
                    None => return best,
                    Some(false) => {}
                    Some(true) => {
                        best = tried;
                        units.drain(begin..end);
                        shorter = true;
                    }
                }
            }
            end = begin;
        }
        if size > 1 || !shorter {
            size /= 2;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::shrink;
    use crate::call_sequence::{Action, CallSequence, Kind, Numbered, Values, all_actions};
    use crate::description::Description;
    use crate::legal::first_illegal;
    use crate::writer::Part::{Begin, Free, ReadAll, Run};
    use crate::writer::{Point, Trajectory, Writer};
    use fmi_abi::Interface;

    fn description() -> Description {
        let text = "<fmiModelDescription fmiVersion='2.0' guid='g' modelName='m'><CoSimulation modelIdentifier='m'/>\
            <ModelVariables><ScalarVariable name='u' valueReference='1' causality='input'><Real start='0'/>\
            </ScalarVariable></ModelVariables></fmiModelDescription>";
        Description::parse(text).expect("a model description")
    }

    fn trajectory() -> Trajectory {
        let point = |number: usize| {
            let inputs = vec![(0, Values::new(Kind::F64, [number as f64]))];
            Point { time: number as f64, size: 1.0, inputs, ..Point::default() }
        };
        let points = (0..6).map(point).collect();
        Trajectory { interface: Interface::CoSimulation, points, end: 6.0 }
    }

    const WHOLE: &[crate::writer::Part] = &[Begin, ReadAll, Run(0), Free];

    fn names(sequence: &[Numbered]) -> Vec<String> {
        all_actions(sequence)
            .into_iter()
            .map(|numbered| crate::call_sequence::action_name(&numbered.action))
            .collect()
    }

    fn count(sequence: &CallSequence, name: &str) -> usize {
        names(sequence).iter().filter(|other| *other == name).count()
    }

    #[test]
    fn the_remaining_calls_are_needed_and_legal() {
        let (description, trajectory) = (description(), trajectory());
        let mut writer = Writer::new(&description, &trajectory, &[0]);
        writer.write(0, WHOLE);
        let short =
            shrink(&description, &writer.sequence, &[], false, |tried| Some(count(tried, "fmi2DoStep") >= 2));
        let calls = ["the instantiation", "fmi2SetupExperiment", "fmi2EnterInitializationMode"];
        let rest = ["fmi2ExitInitializationMode", "fmi2DoStep", "fmi2DoStep"];
        assert_eq!(names(&short), [calls, rest].concat());
        assert_eq!(first_illegal(&description, &short), None);
    }

    #[test]
    fn pinned_calls_are_kept() {
        let (description, trajectory) = (description(), trajectory());
        let mut writer = Writer::new(&description, &trajectory, &[0]);
        writer.write(0, WHOLE);
        let short = shrink(&description, &writer.sequence, &["SetReal"], false, |_| Some(true));
        assert_eq!((count(&short, "fmi2SetReal"), count(&short, "fmi2DoStep")), (6, 0));
    }

    /// Checks that a call is removed from all compared simulations or from none.
    #[test]
    fn compared_simulations_keep_the_same_calls() {
        let (description, trajectory) = (description(), trajectory());
        let mut writer = Writer::new(&description, &trajectory, &[0]);
        writer.write(0, WHOLE);
        let mut thread = writer.thread();
        thread.write(1, WHOLE);
        writer.join(vec![thread]);
        let parallel = |sequence: &CallSequence| {
            matches!(sequence.last(), Some(Numbered { action: Action::Parallel(_), .. }))
        };
        let reproduces = |tried: &CallSequence| Some(parallel(tried) && count(tried, "fmi2DoStep") >= 4);
        let short = shrink(&description, &writer.sequence, &[], true, reproduces);
        let Some(Action::Parallel(threads)) = short.last().map(|numbered| &numbered.action) else {
            panic!("{short:?}")
        };
        let single = short[..short.len() - 1].to_vec();
        for name in ["fmi2DoStep", "fmi2SetReal"] {
            assert_eq!(count(&single, name), count(&threads[0], name), "{name}");
        }
        assert_eq!(count(&single, "fmi2DoStep"), 2);
    }
}

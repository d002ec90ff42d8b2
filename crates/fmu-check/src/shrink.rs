//! Shortens the call sequence of a finding.

use crate::call_sequence::{CallSequence, Numbered, Step, all_steps};
use crate::description::Description;
use crate::legal::first_illegal;
use std::collections::{HashMap, HashSet};

/// Returns the numbers of the steps, in groups. The steps of a group are only removed together, for example the calls of an
/// event.
fn units(sequence: &[Numbered]) -> Vec<Vec<u32>> {
    let (mut units, mut open, mut before) = (Vec::<Vec<u32>>::new(), false, "");
    for numbered in sequence {
        let name = match &numbered.step {
            Step::Call { function, .. } => function.get(4..).unwrap_or_default(),
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
/// calls that only read and for other steps.
fn content(step: &Step) -> Option<String> {
    match step {
        Step::Call { function, args, .. } => {
            let reads = function[4..].starts_with("Get") && !function.to_lowercase().ends_with("fmustate");
            (!reads).then(|| format!("{function} {args:?}"))
        }
        Step::Integrate(_, how) => Some(format!("{how:?}")),
        Step::Repeat(..) | Step::Parallel(_) | Step::Measure | Step::Version(_) => None,
        Step::Make(..) | Step::Free(_) | Step::FreshProcess => None,
        Step::Elsewhere(_) | Step::Environment | Step::Unload | Step::Quit | Step::Copies(..) => None,
    }
}

/// Returns the sequence without the steps with these numbers, some of which may be steps of its threads.
fn without(sequence: &[Numbered], ids: &HashSet<u32>) -> CallSequence {
    let kept = sequence.iter().filter(|numbered| !ids.contains(&numbered.id)).cloned();
    kept.map(|mut numbered| {
        if let Step::Parallel(sequences) = &mut numbered.step {
            sequences.iter_mut().for_each(|sequence| *sequence = without(sequence, ids));
        }
        numbered
    })
    .collect()
}

/// Joins the units that have the same calls, because these calls may belong to compared simulations, whose results would differ
/// if only one of them lacked a call.
fn together(sequence: &CallSequence, units: Vec<Vec<u32>>) -> Vec<Vec<u32>> {
    let contents: HashMap<u32, String> = all_steps(sequence)
        .into_iter()
        .filter_map(|numbered| Some((numbered.id, content(&numbered.step)?)))
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
/// allowed, too. Calls of `pinned` functions are not removed; if `pinned` is not empty, neither are the steps `FreshProcess`,
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
    let threads = sequence.iter().flat_map(|numbered| match &numbered.step {
        Step::Parallel(sequences) => sequences.iter().flat_map(|sequence| units(sequence)).collect(),
        _ => Vec::new(),
    });
    let all: Vec<Vec<u32>> = units(sequence).into_iter().chain(threads).collect();
    let mut units = if compared { together(sequence, all) } else { all };
    let stays = |step: &Step| match step {
        Step::Call { function, .. } => pinned.iter().any(|name| function[4..].eq_ignore_ascii_case(name)),
        Step::FreshProcess | Step::Elsewhere(_) | Step::Environment => !pinned.is_empty(),
        _ => false,
    };
    let all = all_steps(sequence).into_iter().filter(|numbered| stays(&numbered.step));
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
            if keeps && all_steps(&tried).len() < all_steps(&best).len() {
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
    use crate::call_sequence::{CallSequence, Kind, Numbered, Step, Values, all_steps};
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
        all_steps(sequence)
            .into_iter()
            .map(|numbered| crate::call_sequence::step_name(&numbered.step))
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
            matches!(sequence.last(), Some(Numbered { step: Step::Parallel(_), .. }))
        };
        let reproduces = |tried: &CallSequence| Some(parallel(tried) && count(tried, "fmi2DoStep") >= 4);
        let short = shrink(&description, &writer.sequence, &[], true, reproduces);
        let Some(Step::Parallel(threads)) = short.last().map(|numbered| &numbered.step) else {
            panic!("{short:?}")
        };
        let single = short[..short.len() - 1].to_vec();
        for name in ["fmi2DoStep", "fmi2SetReal"] {
            assert_eq!(count(&single, name), count(&threads[0], name), "{name}");
        }
        assert_eq!(count(&single, "fmi2DoStep"), 2);
    }
}

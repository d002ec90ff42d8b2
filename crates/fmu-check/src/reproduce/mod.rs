//! Call sequences as programs in C, which show a finding without this tool.

mod c;
mod evidence;

use crate::call_sequence::{CallSequence, Numbered, Run, Setting, Step};
use crate::description::Description;
use crate::finding::Finding;

/// Writes the program of a finding, which compares its results with those of the last run of the call sequence.
pub fn program(finding: &mut Finding, run: &Run, setting: &Setting, description: &Description) {
    let evidence = evidence::evidence(finding, run);
    let sequence = evidence::as_repeated(&finding.sequence, run);
    finding.c = c::program(finding, &sequence, &evidence, setting, description);
}

/// The comment at the top of a program, in lines.
fn head(finding: &Finding, description: &Description) -> Vec<String> {
    let mut lines = vec![
        format!(
            "{}: {} ({}, {})",
            description.model_name,
            finding.name,
            finding.severity.name(),
            if finding.section.is_empty() { "not in the standard" } else { &finding.section }
        ),
        String::new(),
        format!("Rule: {}", finding.requirement),
        format!("Observed: {}", finding.observed),
        String::new(),
    ];
    lines.iter_mut().for_each(|line| {
        *line = line.replace("*/", "* /").replace(['\n', '\r'], " ").replace('\\', "/");
    });
    lines
}

/// The library below the directory of the unpacked FMU.
fn library(setting: &Setting, sequence: &CallSequence) -> String {
    let model_exchange =
        sequence.iter().any(|numbered| matches!(&numbered.step, Step::Make(_, make) if !make.co_simulation));
    let index = usize::from(model_exchange || setting.libraries[0].is_none());
    let path = setting.libraries[index].clone().unwrap_or_default();
    let directory = setting.resources.parent().unwrap_or(&setting.resources);
    path.strip_prefix(directory).unwrap_or(&path).to_string_lossy().replace('\\', "/")
}

/// The parts of a sequence, a process for each.
fn phases(sequence: &CallSequence) -> Vec<&[Numbered]> {
    sequence.split(|numbered| numbered.step == Step::FreshProcess).collect()
}

/// All instances, states and bytes that a sequence names.
#[derive(Default)]
struct Names {
    instances: Vec<usize>,
    states: Vec<usize>,
    bytes: Vec<usize>,
}

impl Names {
    fn of(sequence: &[Numbered]) -> Self {
        let mut names = Self::default();
        names.look(sequence);
        for list in [&mut names.instances, &mut names.states, &mut names.bytes] {
            list.sort_unstable();
            list.dedup();
        }
        names
    }

    fn look(&mut self, sequence: &[Numbered]) {
        use crate::call_sequence::Arg;
        for numbered in sequence {
            match &numbered.step {
                Step::Make(index, _) | Step::Free(index) => self.instances.push(*index),
                Step::Call { of, args, .. } => {
                    self.instances.extend(of);
                    for arg in args {
                        match arg {
                            Arg::State(slot) | Arg::StateOut(slot) => self.states.push(*slot),
                            Arg::Saved(slot)
                            | Arg::SavedSize(slot)
                            | Arg::SizeOut(slot)
                            | Arg::SavedOut(slot) => self.bytes.push(*slot),
                            _ => {}
                        }
                    }
                }
                Step::Repeat(_, steps) => self.look(steps),
                Step::Parallel(sequences) => sequences.iter().for_each(|sequence| self.look(sequence)),
                _ => {}
            }
        }
    }
}

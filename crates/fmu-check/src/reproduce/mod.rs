//! Call sequences as programs in C, which show a finding without this tool.

mod c;
mod evidence;

use crate::description::Description;
use crate::finding::Finding;
use crate::script::{Numbered, Run, Script, Setting, Step};

/// Writes the program of a finding, which compares its results with those of the last run of the call sequence.
pub fn program(finding: &mut Finding, run: &Run, setting: &Setting, description: &Description) {
    let evidence = evidence::evidence(finding, run);
    let script = evidence::as_repeated(&finding.script, run);
    finding.c = c::program(finding, &script, &evidence, setting, description);
}

/// What a program says of itself, in lines.
fn head(finding: &Finding, description: &Description) -> Vec<String> {
    let mut lines = vec![
        format!(
            "{}: {} ({}, {})",
            description.model_name,
            finding.name,
            finding.grade.name(),
            if finding.section.is_empty() { "not in the standard" } else { &finding.section }
        ),
        String::new(),
        format!("Rule: {}", finding.promise),
        format!("Observed: {}", finding.seen),
        String::new(),
    ];
    lines.iter_mut().for_each(|line| {
        *line = line.replace("*/", "* /").replace(['\n', '\r'], " ").replace('\\', "/");
    });
    lines
}

/// The library below the folder of the unpacked FMU.
fn library(setting: &Setting, script: &Script) -> String {
    let model_exchange =
        script.iter().any(|numbered| matches!(&numbered.step, Step::Make(_, make) if !make.co_simulation));
    let place = usize::from(model_exchange || setting.libraries[0].is_none());
    let path = setting.libraries[place].clone().unwrap_or_default();
    let folder = setting.resources.parent().unwrap_or(&setting.resources);
    path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().replace('\\', "/")
}

/// The parts of a script, a process for each.
fn phases(script: &Script) -> Vec<&[Numbered]> {
    script.split(|numbered| numbered.step == Step::FreshProcess).collect()
}

/// All instances, states and bytes that a script names.
#[derive(Default)]
struct Names {
    instances: Vec<usize>,
    states: Vec<usize>,
    bytes: Vec<usize>,
}

impl Names {
    fn of(script: &[Numbered]) -> Self {
        let mut names = Self::default();
        names.look(script);
        for list in [&mut names.instances, &mut names.states, &mut names.bytes] {
            list.sort_unstable();
            list.dedup();
        }
        names
    }

    fn look(&mut self, script: &[Numbered]) {
        use crate::script::Arg;
        for numbered in script {
            match &numbered.step {
                Step::Make(place, _) | Step::Free(place) => self.instances.push(*place),
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
                Step::Parallel(scripts) => scripts.iter().for_each(|script| self.look(script)),
                _ => {}
            }
        }
    }
}

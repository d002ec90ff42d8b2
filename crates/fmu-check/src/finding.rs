//! What is found: graded, with the section of the standard and the shortest script that shows it.

use crate::script::{End, Run, Script, Step};
use serde::Serialize;
use std::sync::Arc;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// Good to know.
    Note,
    /// Nothing in the standard forbids it, but it hurts.
    Fragile,
    /// The standard says must.
    Violation,
}

impl Grade {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Fragile => "fragile",
            Self::Violation => "violation",
        }
    }
}

/// What must hold of a run; the sentence says what does not.
pub type Judge = Arc<dyn Fn(&Run) -> Option<String> + Send + Sync>;

/// A finding.
#[derive(Clone, Serialize)]
pub struct Finding {
    /// Its name: the topic, a dot, what is wrong.
    pub name: String,
    /// How bad it is.
    pub grade: Grade,
    /// The section of the standard that says so.
    pub section: String,
    /// What is promised.
    pub promise: String,
    /// What was seen.
    pub seen: String,
    /// What else of this name was found.
    pub more: Vec<String>,
    /// The calls that show it; none where the text alone does.
    #[serde(skip)]
    pub script: Script,
    /// The same as a program in C.
    pub c: String,
    /// The same as a program in Python.
    pub python: String,
    /// What is still wrong when it shows.
    #[serde(skip)]
    pub judge: Option<Judge>,
    /// The steps of the script, and what they were before it was shortened.
    pub steps: (usize, usize),
}

impl Finding {
    /// One that the files alone show.
    pub fn of_files(name: &str, grade: Grade, section: &str, promise: &str, seen: String) -> Self {
        Self {
            name: name.to_owned(),
            grade,
            section: section.to_owned(),
            promise: promise.to_owned(),
            seen,
            more: Vec::new(),
            script: Vec::new(),
            c: String::new(),
            python: String::new(),
            judge: None,
            steps: (0, 0),
        }
    }

    /// Its topic.
    pub fn topic(&self) -> &str {
        self.name.split('.').next().unwrap_or_default()
    }
}

/// How a run ended that was not to end so: a sentence with the function it ended in.
pub fn ending(run: &Run, script: &Script) -> Option<String> {
    let at = run.at.and_then(|id| script.iter().find(|numbered| numbered.id == id));
    let name = at.map_or("the end of the process".to_owned(), |numbered| step_name(&numbered.step));
    Some(match &run.end {
        End::Done => return None,
        End::Crash(why) => format!("{name} crashes ({why})"),
        End::Hang(seconds) => format!("{name} does not return within {seconds:.1} s"),
        End::Exit(code) => format!("{name} ends the whole process with exit status {code}"),
        End::Unloadable(why) => format!("the library cannot be loaded: {why}"),
        End::Flood(count) => format!("{name} leads to {count} processes at once, after which all were ended"),
    })
}

/// What a step does, in a few words.
pub fn step_name(step: &Step) -> String {
    match step {
        Step::Make(..) => "the instantiation".to_owned(),
        Step::Free(_) => "FreeInstance".to_owned(),
        Step::Call { function, .. } | Step::Version(function) => function.clone(),
        Step::Repeat(times, steps) => format!(
            "one of {times} repetitions of {}",
            steps.first().map_or("nothing".to_owned(), |numbered| step_name(&numbered.step))
        ),
        Step::Parallel(scripts) => format!("a call on one of {} threads", scripts.len()),
        Step::Measure => "a measurement".to_owned(),
        Step::FreshProcess => "a fresh process".to_owned(),
        Step::Unload => "unloading the library".to_owned(),
        Step::Quit => "the exit of the process".to_owned(),
    }
}

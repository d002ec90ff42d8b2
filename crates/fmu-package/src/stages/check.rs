//! Has the FMUs checked before they get their names.
//!
//! The checker is the program cargo-fmu, because programs that build FMUs should compile fast, and because a model may crash or never
//! return, which must not end the build without a message.

use super::Plan;
use super::describe::Described;
use crate::pack::{Files, Packed, Parts, pack};
use anyhow::{Context, Result, bail};
use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, SystemTime};

/// The environment variable in which `cargo fmu build` passes its own path to the build program of a package.
const PROGRAM: &str = "CARGO_FMU";

/// Returns the checker that `cargo fmu build` passes; `None` if another program started this one.
pub(crate) fn passed_checker() -> Option<PathBuf> {
    env::var_os(PROGRAM).map(PathBuf::from)
}

/// Makes a command pass on a checker.
pub fn pass_checker(command: &mut Command, program: &Path) {
    command.env(PROGRAM, program);
}

/// A model without a mistake that the checker finds.
pub(crate) struct Checked(pub Described);

/// Checks the model in an FMU for this machine, and prints warnings. Without a [checker](crate::Builder::checker), returns the model
/// unchecked.
///
/// # Errors
/// When the model has a mistake, or cannot be checked.
pub(crate) fn check(plan: &Plan, described: Described) -> Result<Checked> {
    let Some(checker) = &plan.builder.checker else { return Ok(Checked(described)) };
    let Described { compiled, descriptions, .. } = &described;
    let model = &compiled.model;
    // Both versions have the same model, so one is checked: FMI 3.0, whose description states more dependencies. If there are
    // arrays, both are, because FMI 2.0 has their elements as variables.
    let unchecked = if model.table.arrays { 0 } else { descriptions.len() - 1 };
    let content = plan.content_without_page();
    let mut printed: Vec<String> = Vec::new();
    for (fmi, description) in &descriptions[unchecked..] {
        let parts = Parts {
            fmi: *fmi,
            identifier: model.identifier(),
            description,
            terminals: None,
            libraries: std::slice::from_ref(&compiled.own),
            with_guid: &|_| Ok(Files::new()),
            content: &content,
        };
        let fmu = compiled.directory.path().join(format!("{}.fmu", model.identifier()));
        let Packed { guid, .. } = pack(&fmu, &parts)?;
        let record = plan.target.join(format!(".{}-fmi{}-checked", model.identifier(), *fmi as u32 + 2));
        let check = Check { checker, fmu: &fmu, guid: &guid, limit: plan.time_limit, record: &record };
        // Usually the warnings of both versions are the same.
        for line in check.run()?.lines() {
            if !printed.iter().any(|before| before == line) {
                eprintln!("{line}");
                printed.push(line.to_owned());
            }
        }
    }
    Ok(Checked(described))
}

/// The check of an FMU that is being built.
struct Check<'a> {
    /// The program cargo-fmu.
    checker: &'a Path,
    fmu: &'a Path,
    /// Hash of everything in the FMU.
    guid: &'a str,
    /// A call of the model that takes longer is an error.
    limit: Duration,
    /// File that contains the last FMU that has passed.
    record: &'a Path,
}

impl Check<'_> {
    /// Checks the FMU and returns the lines to print: its warnings. If it is the last one that has passed, they are the warnings of that
    /// check, because the same calls have the same results.
    ///
    /// # Errors
    /// When the FMU has a mistake, or cannot be checked.
    fn run(&self) -> Result<String> {
        let key = self.key()?;
        let record = fs::read_to_string(self.record).unwrap_or_default();
        if let Some(warnings) = record.strip_prefix(&key) {
            let name = self.fmu.file_name().unwrap_or_default().display();
            return Ok(format!(
                "{name} has passed this check in an earlier build, so it is not checked again\n{warnings}"
            ));
        }
        let warnings = self.warnings()?;
        // Without the record, the next build checks the FMU again.
        let _ = fs::write(self.record, key + &warnings);
        Ok(warnings)
    }

    /// Returns the line that identifies the FMU, the checker and the limit. An installation of another checker changes its size or time.
    fn key(&self) -> Result<String> {
        let Self { checker, guid, limit, .. } = self;
        let data = fs::metadata(checker).with_context(|| format!("cannot find {}", checker.display()))?;
        let modified = data.modified()?.duration_since(SystemTime::UNIX_EPOCH)?.as_nanos();
        Ok(format!("{guid} {limit:?} {} {modified}\n", data.len()))
    }

    /// Starts the checker and returns its warnings.
    fn warnings(&self) -> Result<String> {
        let Self { checker, fmu, limit, .. } = self;
        let seconds = limit.as_secs().to_string();
        let mut command = Command::new(checker);
        command.args(["fmu", "judge", "--time-limit", &seconds]).arg(fmu).stdin(Stdio::null());
        let output = command.stderr(Stdio::inherit()).output();
        let output = output.with_context(|| format!("cannot start {}", checker.display()))?;
        let text = String::from_utf8_lossy(&output.stdout);
        match output.status.code() {
            Some(0) => Ok(text.into_owned()),
            Some(1) => bail!("{}", text.trim_end()),
            _ => bail!("{} cannot be checked: {}, {text}", fmu.display(), output.status),
        }
    }
}

//! Has an FMU checked before it gets its name.
//!
//! The checker is the program cargo-fmu, because programs that build FMUs should compile fast, and because a model may crash or never
//! return, which must not end the build without a message.

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

/// The check of an FMU that is being built.
pub(crate) struct Check<'a> {
    /// The program cargo-fmu.
    pub checker: &'a Path,
    pub fmu: &'a Path,
    /// Hash of everything in the FMU.
    pub guid: &'a str,
    /// A call of the model that takes longer is an error.
    pub limit: Duration,
    /// File that contains the last FMU that has passed.
    pub record: &'a Path,
}

impl Check<'_> {
    /// Checks the FMU and returns the lines to print: its warnings. If it is the last one that has passed, they are the warnings of that
    /// check, because the same calls have the same results.
    ///
    /// # Errors
    /// When the FMU has a mistake, or cannot be checked.
    pub fn run(&self) -> Result<String> {
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

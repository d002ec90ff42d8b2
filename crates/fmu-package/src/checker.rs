//! Has an FMU checked before it gets its name.
//!
//! The checker is the program cargo-fmu, because programs that build FMUs should compile fast, and because a model may crash or never
//! return, which must not end the build without a message.

use anyhow::{Context, Result, bail};
use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

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

/// Checks an FMU with the program `checker`, and prints its warnings. A call of the model that takes longer than the limit is an error.
///
/// # Errors
/// When the FMU has a mistake, or cannot be checked.
pub(crate) fn check(checker: &Path, fmu: &Path, limit: Duration) -> Result<()> {
    let seconds = limit.as_secs().to_string();
    let mut command = Command::new(checker);
    command.args(["fmu", "judge", "--time-limit", &seconds]).arg(fmu).stdin(Stdio::null());
    let output = command.stderr(Stdio::inherit()).output();
    let output = output.with_context(|| format!("cannot start {}", checker.display()))?;
    let text = String::from_utf8_lossy(&output.stdout);
    match output.status.code() {
        Some(0) => {
            eprint!("{text}");
            Ok(())
        }
        Some(1) => bail!("{}", text.trim_end()),
        _ => bail!("{} cannot be checked: {}, {text}", fmu.display(), output.status),
    }
}

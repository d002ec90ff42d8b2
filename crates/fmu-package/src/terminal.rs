//! What programs like `build_fmu` say to their users.

use anyhow::Result;
use std::env;
use std::path::Path;
use std::process::ExitCode;

/// The path as seen from where the user is.
pub fn short(path: &Path) -> String {
    let here = env::current_dir().unwrap_or_default();
    path.strip_prefix(here).unwrap_or(path).display().to_string()
}

/// The end of `main`: an error becomes one line and the exit code of failure.
pub fn exit(result: Result<()>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

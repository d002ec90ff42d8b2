//! The arguments, messages and exit codes of programs like `build_fmu`.

use anyhow::Result;
use fmi_abi::Standard;
use std::env;
use std::path::Path;
use std::process::ExitCode;

/// Reads the version of FMI in an argument: 2 or 3.
///
/// # Errors
/// When it is another version.
pub fn fmi_version(argument: &str) -> Result<Standard, String> {
    match argument {
        "2" => Ok(Standard::Fmi2),
        "3" => Ok(Standard::Fmi3),
        _ => Err("versions are 2 and 3".to_owned()),
    }
}

/// Returns the path relative to the current directory, or the given path if it is not in the current directory.
pub fn short(path: &Path) -> String {
    let current = env::current_dir().unwrap_or_default();
    path.strip_prefix(current).unwrap_or(path).display().to_string()
}

/// Prints the error, if there is one, and returns the exit code.
pub fn exit(result: Result<()>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Messages contain names from files, whose control characters must not reach the terminal.
            let lines = format!("error: {error:#}");
            lines.lines().for_each(|line| eprintln!("{}", fmi_abi::one_line(line)));
            ExitCode::FAILURE
        }
    }
}

//! Jobs for the processes that execute call sequences, and the results of these processes.

use crate::call_sequence::{CallSequence, Setting};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::hash::{BuildHasher as _, Hasher as _, RandomState};
use std::process::ExitStatus;

/// Environment variable with the path of the job of a worker; empty for a server.
pub const VARIABLE: &str = "FMU_CHECK_JOB";

/// Environment variable with the path of the temporary directory of a check.
pub const SCRATCH: &str = "FMU_CHECK_SCRATCH";

/// Exit status of a worker that fails for a reason other than the FMU.
pub const OWN_FAULT: i32 = 97;

/// Exit status of a worker that has executed its call sequence, or has reported that it cannot load the library.
pub const EXECUTED: i32 = 96;

/// Least number of repetitions whose measurements are evaluated.
pub const EVALUATED: usize = 50;

/// Call sequence for a process.
#[derive(Serialize, Deserialize)]
pub struct Job {
    /// Parameters that all call sequences share.
    pub setting: Setting,
    pub sequence: CallSequence,
    /// Serialized states of earlier processes of the call sequence, by index.
    pub bytes: HashMap<usize, Vec<u8>>,
    /// Number of the action before which the process waits for a debugger.
    pub stop_before: Option<u32>,
    /// Random number with which each line of the outcomes begins, because the FMU could write to their file, too.
    pub stamp: u64,
}

impl Job {
    /// Returns a random number for a job.
    pub fn new_stamp() -> u64 {
        RandomState::new().build_hasher().finish()
    }
}

/// Results of a process. A process that was ended because it exceeded a limit has neither an exit status nor a signal.
#[derive(Default, Serialize, Deserialize)]
pub struct Ended {
    /// Exit status.
    pub code: Option<i32>,
    /// Signal that ended the process.
    pub signal: Option<i32>,
    /// Standard output and standard error.
    pub output: String,
    /// Outcomes of the actions, a line for each, which has the stamp of the job and JSON.
    pub outcomes: String,
    /// Names of the child processes that were alive after the process had ended.
    pub orphans: Vec<String>,
    /// Number of processes at a time, if it exceeded the maximum.
    pub flood: Option<usize>,
    /// Whether the process ended while it executed code of the FMU; on systems other than Linux always true.
    pub inside: bool,
}

impl From<ExitStatus> for Ended {
    fn from(status: ExitStatus) -> Self {
        #[cfg(unix)]
        let signal = std::os::unix::process::ExitStatusExt::signal(&status);
        #[cfg(not(unix))]
        let signal = None;
        Self { code: status.code(), signal, ..Self::default() }
    }
}

/// Last line that a worker writes, after all actions. It has the serialized states by index.
#[derive(Serialize, Deserialize)]
pub struct Last {
    pub bytes: HashMap<usize, Vec<u8>>,
}

/// Line that a worker writes if it cannot load the library, with the message of the loader.
#[derive(Serialize, Deserialize)]
pub struct Unloadable {
    pub unloadable: String,
}

//! Process that loads the library and executes a call sequence. The FMU may crash the process, so each result is written to a file
//! before the next call.

mod actions;
mod arrays;
mod contain;
mod executor;
mod integrate;
mod job;
mod logger;
mod measure;
mod memory;
#[cfg(target_os = "linux")]
mod server;
mod settings;
mod updates;
mod work;

#[cfg(not(target_os = "linux"))]
pub use contain::end_group;
#[cfg(target_os = "linux")]
pub use contain::readable;
pub use contain::{interrupted, interrupted_at, listen_for_interrupts};
pub use job::{EVALUATED, EXECUTED, Ended, Job, Last, OWN_FAULT, SCRATCH, Unloadable, VARIABLE};
pub use measure::{changed_setting, tolerated_growth};
pub use memory::FILL;
use std::fs::File;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
pub use updates::MOST_UPDATES;
use work::{end, work};

/// If this process was started as a worker, executes call sequences and ends the process. Otherwise returns immediately. A
/// program that offers checks must call this function first in `main`, because a check starts the same program again as a worker.
pub fn run_worker_if_requested() {
    let Some(job) = std::env::var_os(VARIABLE) else { return };
    contain::restore_signals();
    #[cfg(target_os = "linux")]
    if job.is_empty() {
        end(server::serve());
    }
    end(work_from_files(Path::new(&job)))
}

/// Executes the job in a file, and writes the outcomes to a file next to it.
fn work_from_files(job: &Path) -> Result<(), String> {
    let message = |error: std::io::Error| error.to_string();
    let read = std::fs::read(job).map_err(message)?;
    let outcomes = File::create(job.with_file_name("outcomes")).map_err(message)?;
    use_for_temporary_files(&job.with_file_name("temporary")).map_err(message)?;
    work(serde_json::from_slice(&read).map_err(|error| error.to_string())?, outcomes);
    Ok(())
}

/// Creates a directory, and makes this process and its children use it for temporary files, so that the files that an FMU leaves
/// there are removed with the directory.
fn use_for_temporary_files(directory: &Path) -> std::io::Result<()> {
    std::fs::create_dir(directory)?;
    for name in ["TMPDIR", "TMP", "TEMP"] {
        // SAFETY: this process has one thread.
        unsafe { std::env::set_var(name, directory) };
    }
    Ok(())
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

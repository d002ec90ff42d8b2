//! Executes a job in a process with limited resources.

use super::executor::{Executor, PROCESS};
use super::job::{EXECUTED, Job, Last, OWN_FAULT};
use super::{locked, memory};
use crate::call_sequence::{Action, Setting};
use std::fs::File;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::Ordering;

/// Writes the buffered output, and ends the process. On Unix, the exit handlers of the library do not run, because only
/// `Action::Quit` tests them.
pub fn end(result: Result<(), String>) -> ! {
    let status = match result {
        Ok(()) => EXECUTED,
        Err(error) => {
            eprintln!("{error}");
            OWN_FAULT
        }
    };
    #[cfg(unix)]
    // SAFETY: a null stream is allowed and stands for all streams; `_exit` takes only a number.
    unsafe {
        libc::fflush(std::ptr::null_mut());
        libc::_exit(status)
    }
    #[cfg(not(unix))]
    std::process::exit(status)
}

/// Executes a call sequence, and writes the outcome of each action to the file, as a line with the stamp of the job and JSON.
pub fn work(job: Job, file: File) {
    limit(job.setting.memory);
    PROCESS.store(std::process::id(), Ordering::Relaxed);
    if job.setting.soft {
        memory::AFTER.store(4096, std::sync::atomic::Ordering::Relaxed);
    }
    let setting = match job.sequence.first().map(|numbered| &numbered.action) {
        Some(Action::Elsewhere(name)) => elsewhere(&job.setting, name),
        Some(Action::Environment) => {
            change_environment();
            job.setting
        }
        _ => job.setting,
    };
    let executor = Executor {
        setting,
        libraries: Mutex::default(),
        instances: Mutex::default(),
        states: Mutex::default(),
        bytes: Mutex::new(job.bytes),
        sizes: Mutex::default(),
        file: Mutex::new(file),
        stop_before: job.stop_before,
        stamp: job.stamp,
    };
    executor.execute(&job.sequence, true);
    executor.write(&Last { bytes: std::mem::take(&mut locked(&executor.bytes)) });
}

/// Creates a symbolic link with this name in the working directory, which leads to the directory of the FMU, or on Windows, where links
/// need a privilege, a copy of that directory. Returns the setting with all paths changed to lead there.
fn elsewhere(setting: &Setting, name: &str) -> Setting {
    let directory = setting.resources.parent().unwrap_or(&setting.resources);
    let there = std::env::current_dir().unwrap_or_default().join(name);
    #[cfg(unix)]
    let created = std::os::unix::fs::symlink(directory, &there);
    #[cfg(not(unix))]
    let created = copy(directory, &there);
    if let Err(error) = created {
        fail(&there, &error);
    }
    let moved = |path: &Path| there.join(path.strip_prefix(directory).unwrap_or(path));
    Setting {
        libraries: setting.libraries.clone().map(|library| library.map(|library| moved(&library))),
        resources: moved(&setting.resources),
        ..setting.clone()
    }
}

/// Copies a directory.
#[cfg(not(unix))]
fn copy(directory: &Path, to: &Path) -> std::io::Result<()> {
    std::fs::create_dir(to)?;
    for entry in std::fs::read_dir(directory)? {
        let (from, name) = entry.map(|entry| (entry.path(), entry.file_name()))?;
        match from.is_dir() {
            true => copy(&from, &to.join(name))?,
            false => drop(std::fs::copy(&from, to.join(name))?),
        }
    }
    Ok(())
}

/// Ends the process because of a fault that is not the FMU's.
fn fail(path: &Path, error: &std::io::Error) -> ! {
    eprintln!("{}: {error}", path.display());
    std::process::exit(OWN_FAULT)
}

/// Creates a directory, in which the process continues, and which is its home directory. Changes the language and the time zone, too.
fn change_environment() {
    let directory = std::env::current_dir().unwrap_or_default().join("another directory");
    let created = std::fs::create_dir(&directory).and_then(|()| std::env::set_current_dir(&directory));
    if let Err(error) = created {
        fail(&directory, &error);
    }
    let directory = directory.to_string_lossy();
    let german = "de_DE.UTF-8";
    for (name, value) in [("HOME", &*directory), ("LANG", german), ("LC_ALL", german), ("TZ", "XYZ-7")] {
        // SAFETY: this process has one thread.
        unsafe { std::env::set_var(name, value) };
    }
}

/// Waits until a line is entered, so that a debugger can be attached to this process before its next call.
pub fn wait_for_debugger(next: &str) {
    // Some Linux systems allow only the ancestors of a process to debug it. SAFETY: the call takes only numbers.
    #[cfg(target_os = "linux")]
    unsafe {
        libc::prctl(libc::PR_SET_PTRACER, libc::PR_SET_PTRACER_ANY);
    }
    let (debugger, id) = (if cfg!(target_os = "macos") { "lldb" } else { "gdb" }, std::process::id());
    eprintln!("Process {id} waits before {next}. Attach a debugger: {debugger} -p {id}");
    eprintln!("Set breakpoints and continue in the debugger, then press Enter here.");
    // If the input is closed, the process continues at once.
    let _ = std::io::stdin().read_line(&mut String::new());
}

/// Limits the size of files of this process on Unix. On Linux, also limits its memory and makes the kernel end it
/// when its parent process ends.
fn limit(memory: u64) {
    #[cfg(unix)]
    {
        let set = |what, value| {
            let limit = libc::rlimit { rlim_cur: value, rlim_max: value };
            // SAFETY: `limit` is alive during the call, which only reads it.
            unsafe { libc::setrlimit(what, &limit) };
        };
        set(libc::RLIMIT_CORE, 0);
        set(libc::RLIMIT_FSIZE, 1 << 30);
        #[cfg(target_os = "linux")]
        {
            set(libc::RLIMIT_AS, memory as _);
            // The kernel kills this process when its parent process ends. SAFETY: the call takes only numbers.
            unsafe { libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL) };
        }
    }
    let _ = memory;
}

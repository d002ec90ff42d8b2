//! Executes call sequences in separate processes.

use crate::call_sequence::{Action, CallSequence, End, Outcome, Run, Setting};
use crate::worker::{EXECUTED, Ended, Job, Last, OWN_FAULT, SCRATCH, Unloadable, VARIABLE, interrupted};
use anyhow::{Context as _, bail};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::Command;
#[cfg(not(target_os = "linux"))]
use std::process::Stdio;
use std::sync::Arc;

/// Starts the processes that execute call sequences.
pub struct Workers {
    /// Temporary directory of the check, for the files of the processes.
    scratch: PathBuf,
    /// Servers that wait for a job.
    #[cfg(target_os = "linux")]
    idle: std::sync::Mutex<HashMap<WorkerKind, Vec<Server>>>,
}

/// Kind of worker: the number of earlier processes of the call sequence, and whether the loader resolves all symbols when it
/// loads a library. Both decide which environment variables the process is started with. The third is set for `Manner::Again`.
type WorkerKind = (usize, bool, bool);

/// Manner in which a call sequence is executed.
#[derive(Clone, Copy)]
pub enum Manner {
    Usual,
    /// In processes that do not have the addresses of the usual ones. On Linux, processes that the same server forks have the same
    /// addresses, so results that depend on addresses would be equal in a repetition, but not in a later replay.
    Again,
    /// The process with the action of this number waits for a debugger before this action, and then has no limit.
    Debugged(u32),
}

/// Reason why a check cannot continue.
#[derive(Debug)]
pub enum Stop {
    /// The deadline has passed.
    TimeOver,
    /// The memory that fmu-check itself needs in the process of the FMU exceeds the limit.
    OutOfMemory,
    /// The user has interrupted the check.
    Interrupted,
}

impl std::fmt::Display for Stop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::TimeOver => "the time was over",
            Self::OutOfMemory => "fmu-check itself needs more than the memory of --memory",
            Self::Interrupted => "interrupted",
        })
    }
}

impl std::error::Error for Stop {}

/// Returns the command that starts this program as a worker.
fn worker(job: &Path, scratch: &Path, (phase, now, _): WorkerKind) -> anyhow::Result<Command> {
    let mut command = Command::new(std::env::current_exe()?);
    command
        .env(VARIABLE, job)
        .env(SCRATCH, scratch)
        // Uninitialized memory differs between the processes of a call sequence, so that results that depend on it differ, too.
        .env("MALLOC_PERTURB_", (1 + phase * 90).to_string())
        // Switches off the cache of freed blocks that each thread has, because mallinfo2 of glibc counts these blocks as
        // allocated.
        .env("GLIBC_TUNABLES", "glibc.malloc.tcache_count=0")
        .envs(now.then_some(("LD_BIND_NOW", "1")));
    Ok(command)
}

impl Workers {
    /// On Linux, starts the first server, which removes the temporary directory if this process is killed. Other servers are
    /// started when they are needed.
    ///
    /// # Errors
    /// Fails if the server cannot be started.
    pub fn new(scratch: PathBuf) -> anyhow::Result<Self> {
        Ok(Self {
            #[cfg(target_os = "linux")]
            idle: std::sync::Mutex::new(HashMap::from([(
                (0, false, false),
                vec![Server::new((0, false, false), &scratch)?],
            )])),
            scratch,
        })
    }

    /// Executes a call sequence with a limit in seconds for each process. Each `FreshProcess` action starts another process.
    pub fn execute(&self, setting: &Setting, sequence: &CallSequence, limit: f64) -> anyhow::Result<Run> {
        self.execute_as(Manner::Usual, setting, sequence, limit)
    }

    /// Executes a call sequence, as `execute` does, in another manner.
    pub fn execute_as(
        &self,
        manner: Manner,
        setting: &Setting,
        sequence: &CallSequence,
        limit: f64,
    ) -> anyhow::Result<Run> {
        let mut run = Run::default();
        let mut bytes = HashMap::new();
        for (phase, part) in sequence.split(|numbered| numbered.action == Action::FreshProcess).enumerate() {
            let stop_before = match manner {
                Manner::Debugged(id) => part.iter().map(|numbered| numbered.id).find(|other| *other == id),
                Manner::Usual | Manner::Again => None,
            };
            let stamp = Job::new_stamp();
            let job = Job { setting: setting.clone(), sequence: part.to_vec(), bytes, stop_before, stamp };
            let kind = (phase, setting.now, matches!(manner, Manner::Again));
            let ended = match stop_before {
                None => self.process(&job, kind, limit)?,
                Some(_) => self.debugged(&job, kind)?,
            };
            bytes = add_outcomes(&job, ended, limit, &mut run)?;
            if run.end != End::Done {
                break;
            }
        }
        Ok(run)
    }

    /// Executes a job in a process that an idle server forks.
    #[cfg(target_os = "linux")]
    fn process(&self, job: &Job, kind: WorkerKind, limit: f64) -> anyhow::Result<Ended> {
        let idle = || self.idle.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let server = idle().get_mut(&kind).and_then(Vec::pop);
        let mut server = match server {
            Some(server) => server,
            None => Server::new(kind, &self.scratch)?,
        };
        let result = server.execute(&format!("{limit} {}\n", serde_json::to_string(job)?));
        match result {
            Ok(ended) => {
                idle().entry(kind).or_default().push(server);
                Ok(ended)
            }
            // There is no result, because the check was interrupted or the server has ended.
            Err(_) if interrupted() => Err(Stop::Interrupted.into()),
            Err(_) => Ok(Ended::from(server.0.wait()?)),
        }
    }

    /// Executes a job in a new process, because systems other than Linux cannot load every library after a fork.
    #[cfg(not(target_os = "linux"))]
    fn process(&self, job: &Job, kind: WorkerKind, limit: f64) -> anyhow::Result<Ended> {
        let (directory, mut command, output) = self.new_process(job, kind)?;
        command.stdin(Stdio::null()).stderr(output);
        let ended = self.wait(&mut command, limit)?;
        Ok(with_files(ended.map(Ended::from).unwrap_or_default(), directory.path()))
    }

    /// Executes a job in a new process that has the input and the standard error of this one, and no limit of time.
    fn debugged(&self, job: &Job, kind: WorkerKind) -> anyhow::Result<Ended> {
        let (directory, mut command, _) = self.new_process(job, kind)?;
        let status = command.status().context("a process for the FMU cannot be started")?;
        Ok(with_files(Ended::from(status), directory.path()))
    }

    /// Writes a job to a file. Returns the directory of its files, the command that starts a process for it, and the file for the
    /// output of the process.
    fn new_process(
        &self,
        job: &Job,
        kind: WorkerKind,
    ) -> anyhow::Result<(tempfile::TempDir, Command, std::fs::File)> {
        let directory = tempfile::Builder::new().prefix("run-").tempdir_in(&self.scratch)?;
        let at = |name: &str| directory.path().join(name);
        std::fs::write(at("job"), serde_json::to_vec(job)?)?;
        std::fs::create_dir(at("here"))?;
        let output = std::fs::File::create(at("output"))?;
        let mut command = worker(&at("job"), &self.scratch, kind)?;
        command.current_dir(at("here")).stdout(output.try_clone()?);
        Ok((directory, command, output))
    }

    /// Runs a command in a separate process group for at most `limit` seconds; returns its status, or `None` after the limit.
    #[cfg(not(target_os = "linux"))]
    #[allow(clippy::unused_self, reason = "the processes belong to the workers")]
    fn wait(&self, command: &mut Command, limit: f64) -> anyhow::Result<Option<std::process::ExitStatus>> {
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(command, 0);
        let mut child = command.spawn().context("a process for the FMU cannot be started")?;
        let begin = std::time::Instant::now();
        let ended = loop {
            if let Some(status) = child.try_wait()? {
                break Some(status);
            }
            if interrupted() || begin.elapsed().as_secs_f64() > limit {
                child.kill()?;
                child.wait()?;
                break None;
            }
            std::thread::sleep(std::time::Duration::from_micros(500));
        };
        crate::worker::end_group(child.id());
        if interrupted() {
            return Err(Stop::Interrupted.into());
        }
        Ok(ended)
    }
}

/// Adds the files of a process in this directory to its results.
fn with_files(ended: Ended, directory: &Path) -> Ended {
    let read = |name: &str| {
        String::from_utf8_lossy(&std::fs::read(directory.join(name)).unwrap_or_default()).into_owned()
    };
    Ended { output: read("output"), outcomes: read("outcomes"), inside: true, ..ended }
}

/// Process that forks a child process for each job.
#[cfg(target_os = "linux")]
struct Server(std::process::Child);

#[cfg(target_os = "linux")]
impl Server {
    fn new(kind: WorkerKind, scratch: &Path) -> anyhow::Result<Self> {
        use std::process::Stdio;
        let here = tempfile::tempdir_in(scratch)?.keep();
        let mut command = worker(Path::new(""), scratch, kind)?;
        command.current_dir(here).stdin(Stdio::piped()).stdout(Stdio::piped());
        Ok(Self(command.spawn().context("a process for the FMU cannot be started")?))
    }

    fn execute(&mut self, job: &str) -> anyhow::Result<Ended> {
        use std::io::{BufRead as _, Write as _};
        let (input, output) = self.0.stdin.as_mut().zip(self.0.stdout.as_mut()).context("no pipes")?;
        input.write_all(job.as_bytes())?;
        while !crate::worker::readable(output)? {
            if interrupted() {
                return Err(Stop::Interrupted.into());
            }
        }
        let mut line = String::new();
        std::io::BufReader::new(output).read_line(&mut line)?;
        Ok(serde_json::from_str(&line)?)
    }
}

#[cfg(target_os = "linux")]
impl Drop for Server {
    fn drop(&mut self) {
        // `wait` closes the input of the server, which makes the server end.
        let _ = self.0.wait();
    }
}

/// Adds the outcomes of a process to `run`, and returns the serialized states.
fn add_outcomes(
    job: &Job,
    ended: Ended,
    limit: f64,
    run: &mut Run,
) -> anyhow::Result<HashMap<usize, Vec<u8>>> {
    run.output.push_str(&ended.output);
    run.orphans.extend(ended.orphans);
    let mut last = None;
    let stamp = format!("{} ", job.stamp);
    for line in ended.outcomes.lines().filter_map(|line| line.strip_prefix(&stamp)) {
        if let Ok(outcome) = serde_json::from_str::<Outcome>(line) {
            run.outcomes.insert(outcome.id, Arc::new(outcome));
        } else if let Ok(end) = serde_json::from_str::<Last>(line) {
            last = Some(end.bytes);
        } else if let Ok(why) = serde_json::from_str::<Unloadable>(line) {
            run.end = End::Unloadable(why.unloadable);
            return Ok(HashMap::new());
        }
    }
    // The exit of the process has no outcome, because it does not return.
    let actions = job.sequence.iter().filter(|numbered| numbered.action != Action::Quit);
    run.at = actions.map(|numbered| numbered.id).find(|id| !run.outcomes.contains_key(id));
    if let Some(bytes) = last.filter(|_| ended.code == Some(EXECUTED) && run.at.is_none()) {
        return Ok(bytes);
    }
    // Rust and guarded arrays print these messages if an allocation fails.
    let no_memory = ["memory allocation of", "no memory for an array"];
    if !ended.inside && no_memory.iter().any(|text| run.output.contains(text)) {
        return Err(Stop::OutOfMemory.into());
    }
    run.at = job.sequence.iter().map(|numbered| numbered.id).find(|id| !run.outcomes.contains_key(id));
    run.end = match (ended.flood, ended.code, ended.signal) {
        (Some(count), ..) => End::Flood(count),
        (_, None, None) => End::Hang(limit),
        (_, Some(OWN_FAULT), _) => bail!("a process for the FMU failed: {}", run.output.trim()),
        (_, Some(101), _) if run.output.contains("panicked at") && run.output.contains("fmu-check") => {
            bail!("a process for the FMU failed: {}", run.output.trim())
        }
        (_, Some(code), _) if cfg!(unix) || (code as u32) < 0x8000_0000 => End::Exit(code),
        (_, code, signal) => End::Crash(crash(code, signal, &run.output)),
    };
    Ok(HashMap::new())
}

/// Returns a description of a crash.
fn crash(code: Option<i32>, signal: Option<i32>, output: &str) -> String {
    #[cfg(unix)]
    let signals = [
        (libc::SIGSEGV, "SIGSEGV: invalid memory access"),
        (libc::SIGBUS, "SIGBUS: misaligned access or access beyond the end of a mapped file"),
        (libc::SIGABRT, "SIGABRT: abort() was called"),
        (libc::SIGFPE, "SIGFPE: integer division by zero or overflow, or a trapped floating-point exception"),
        (libc::SIGILL, "SIGILL: illegal instruction"),
        (libc::SIGKILL, "SIGKILL: killed by the process itself or by the out-of-memory killer"),
        (
            libc::SIGSYS,
            "SIGSYS: it sent a signal to processes outside of its session, changed them, or made 32-bit system calls",
        ),
        (libc::SIGXFSZ, "SIGXFSZ: it wrote more than 1 GiB to a file"),
    ];
    #[cfg(not(unix))]
    let signals: [(i32, &str); 0] = [];
    let known = signals.iter().find(|(number, _)| Some(*number) == signal);
    let why = match (known, signal) {
        (Some((_, why)), _) => (*why).to_owned(),
        (None, Some(signal)) => format!("signal {signal}"),
        (None, None) => format!("exit code: {:#x}", code.unwrap_or_default()),
    };
    match output.lines().rev().find(|line| !line.trim().is_empty()) {
        Some(line) if why.starts_with("SIGABRT") => format!("{why} ({})", line.trim()),
        _ => why,
    }
}

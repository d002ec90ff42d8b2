//! Plays sequences in processes of their own.

use crate::call_sequence::{CallSequence, End, Numbered, Outcome, Run, Setting, Step};
#[cfg(target_os = "linux")]
use crate::worker::Answer;
use crate::worker::{Job, Last, OWN_FAULT, PLAYED, SCRATCH, Unloadable, VARIABLE, interrupted};
use anyhow::{Context as _, bail};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};

/// Processes that play call sequences.
pub struct Workers {
    /// The temporary directory of the check, for the files of processes.
    scratch: PathBuf,
    #[cfg(target_os = "linux")]
    idle: std::sync::Mutex<HashMap<Situation, Vec<Server>>>,
}

/// Conditions that a process is started with: how many processes of its call sequence come before it, and whether
/// libraries are bound at once.
type Situation = (usize, bool);

/// The results of a process.
#[derive(Default)]
struct Left {
    /// Its exit status; `None` if it did not end in time.
    ended: Option<ExitStatus>,
    said: Vec<u8>,
    outcomes: Vec<u8>,
    /// Names of the processes that it has left.
    left: Vec<String>,
    /// The number of its processes, if that is why it was ended.
    flood: Option<usize>,
    /// The process ended outside the functions of the FMU.
    outside: bool,
}

/// Reasons for which a check cannot go on.
#[derive(Debug)]
pub enum Stop {
    /// The time for all checks is over.
    TimeOver,
    /// This tool needs more memory than the FMU may use.
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

/// The command that starts this program as a worker.
fn worker(job: &Path, scratch: &Path, (phase, now): Situation) -> anyhow::Result<Command> {
    let mut command = Command::new(std::env::current_exe()?);
    command
        .env(VARIABLE, job)
        .env(SCRATCH, scratch)
        // Memory that was not written differs between the processes of a call sequence.
        .env("MALLOC_PERTURB_", (1 + phase * 90).to_string())
        // Freed blocks that each thread keeps would count as in use (mallinfo2 of glibc).
        .env("GLIBC_TUNABLES", "glibc.malloc.tcache_count=0")
        .envs(now.then_some(("LD_BIND_NOW", "1")));
    Ok(command)
}

impl Workers {
    /// Processes that are started when they are needed.
    ///
    /// # Errors
    /// When the first of them cannot be started. It removes the temporary directory if this process is killed.
    pub fn new(scratch: PathBuf) -> anyhow::Result<Self> {
        Ok(Self {
            #[cfg(target_os = "linux")]
            idle: std::sync::Mutex::new(HashMap::from([(
                (0, false),
                vec![Server::new((0, false), &scratch)?],
            )])),
            scratch,
        })
    }

    /// Plays a sequence: each part up to a fresh process in one of its own, `limit` seconds at most.
    pub fn play(&self, setting: &Setting, sequence: &CallSequence, limit: f64) -> anyhow::Result<Run> {
        let mut run = Run::default();
        let mut bytes = HashMap::new();
        for (phase, part) in sequence.split(|numbered| numbered.step == Step::FreshProcess).enumerate() {
            let job = Job { setting: setting.clone(), sequence: part.to_vec(), bytes };
            let left = self.process(&job, (phase, setting.now), limit)?;
            bytes = read(part, left, limit, &mut run)?;
            if run.end != End::Done {
                break;
            }
        }
        Ok(run)
    }

    /// Plays a job in a process that is forked for it.
    #[cfg(target_os = "linux")]
    fn process(&self, job: &Job, situation: Situation, limit: f64) -> anyhow::Result<Left> {
        let idle = || self.idle.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let server = idle().get_mut(&situation).and_then(Vec::pop);
        let mut server = match server {
            Some(server) => server,
            None => Server::new(situation, &self.scratch)?,
        };
        let asked = server.ask(&format!("{limit} {}\n", serde_json::to_string(job)?));
        match asked {
            Ok(left) => {
                idle().entry(situation).or_default().push(server);
                Ok(left)
            }
            // The library has ended the process that forks.
            Err(_) if interrupted() => Err(Stop::Interrupted.into()),
            Err(_) => Ok(Left { ended: Some(server.0.wait()?), ..Left::default() }),
        }
    }

    /// Plays a job in a process that is started for it: not every system can load every library after a fork.
    #[cfg(not(target_os = "linux"))]
    fn process(&self, job: &Job, situation: Situation, limit: f64) -> anyhow::Result<Left> {
        use std::process::Stdio;
        let directory = tempfile::Builder::new().prefix("run-").tempdir_in(&self.scratch)?;
        let at = |name: &str| directory.path().join(name);
        std::fs::write(at("job"), serde_json::to_vec(job)?)?;
        std::fs::create_dir(at("here"))?;
        let said = std::fs::File::create(at("said"))?;
        let mut command = worker(&at("job"), &self.scratch, situation)?;
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        command.current_dir(at("here")).stdin(Stdio::null()).stdout(said.try_clone()?).stderr(said);
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
        let [said, outcomes] = ["said", "outcomes"].map(|name| std::fs::read(at(name)).unwrap_or_default());
        Ok(Left { ended, said, outcomes, ..Left::default() })
    }
}

/// A process that forks one for each job.
#[cfg(target_os = "linux")]
struct Server(std::process::Child);

#[cfg(target_os = "linux")]
impl Server {
    fn new(situation: Situation, scratch: &Path) -> anyhow::Result<Self> {
        use std::process::Stdio;
        let here = tempfile::tempdir_in(scratch)?.keep();
        let mut command = worker(Path::new(""), scratch, situation)?;
        command.current_dir(here).stdin(Stdio::piped()).stdout(Stdio::piped());
        Ok(Self(command.spawn().context("a process for the FMU cannot be started")?))
    }

    fn ask(&mut self, job: &str) -> anyhow::Result<Left> {
        use std::io::{BufRead as _, Read as _, Write as _};
        use std::os::unix::process::ExitStatusExt as _;
        let (input, output) = self.0.stdin.as_mut().zip(self.0.stdout.as_mut()).context("no pipes")?;
        input.write_all(job.as_bytes())?;
        while !crate::worker::readable(output)? {
            if interrupted() {
                return Err(Stop::Interrupted.into());
            }
        }
        let mut output = std::io::BufReader::new(output);
        let mut line = String::new();
        output.read_line(&mut line)?;
        let Answer { ended, lengths, left, flood, inside } = serde_json::from_str(&line)?;
        let [mut said, mut outcomes] = lengths.map(|length| vec![0; length]);
        output.read_exact(&mut said)?;
        output.read_exact(&mut outcomes)?;
        let ended = ended.map(ExitStatus::from_raw);
        Ok(Left { ended, said, outcomes, left, flood, outside: !inside })
    }
}

#[cfg(target_os = "linux")]
impl Drop for Server {
    fn drop(&mut self) {
        // Waiting closes its input, which ends it.
        let _ = self.0.wait();
    }
}

/// Reads the outcomes of a process, and returns the bytes that it has serialized.
fn read(
    sequence: &[Numbered],
    Left { ended, said, outcomes, left, flood, outside }: Left,
    limit: f64,
    run: &mut Run,
) -> anyhow::Result<HashMap<usize, Vec<u8>>> {
    run.said.push_str(&String::from_utf8_lossy(&said));
    run.left.extend(left);
    let mut last = None;
    for line in outcomes.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()) {
        if let Ok(outcome) = serde_json::from_slice::<Outcome>(line) {
            run.outcomes.insert(outcome.id, outcome);
        } else if let Ok(end) = serde_json::from_slice::<Last>(line) {
            last = Some(end.bytes);
        } else if let Ok(why) = serde_json::from_slice::<Unloadable>(line) {
            run.end = End::Unloadable(why.unloadable);
            return Ok(HashMap::new());
        }
    }
    if let Some(bytes) = last
        && ended.is_some_and(|status| status.code() == Some(PLAYED))
    {
        return Ok(bytes);
    }
    // Abort messages of the Rust and C libraries, after a failure that is not in the FMU.
    if outside
        && ["memory allocation of", "no memory for an array"].iter().any(|text| run.said.contains(text))
    {
        return Err(Stop::OutOfMemory.into());
    }
    run.at = sequence.iter().map(|numbered| numbered.id).find(|id| !run.outcomes.contains_key(id));
    run.end = match ended {
        _ if flood.is_some() => End::Flood(flood.unwrap_or_default()),
        None => End::Hang(limit),
        Some(status) => match status.code() {
            Some(OWN_FAULT) => bail!("a process for the FMU failed: {}", run.said.trim()),
            Some(101) if run.said.contains("panicked at") && run.said.contains("fmu-check") => {
                bail!("a process for the FMU failed: {}", run.said.trim())
            }
            Some(code) if cfg!(unix) || (code as u32) < 0x8000_0000 => End::Exit(code),
            _ => End::Crash(crash(status, &run.said)),
        },
    };
    Ok(HashMap::new())
}

/// The system's description of a crash.
fn crash(status: ExitStatus, said: &str) -> String {
    #[cfg(unix)]
    let why = {
        use std::os::unix::process::ExitStatusExt as _;
        match status.signal() {
            Some(libc::SIGSEGV) => "SIGSEGV: it touched memory that is not its own".to_owned(),
            Some(libc::SIGBUS) => "SIGBUS: it touched memory that is not its own".to_owned(),
            Some(libc::SIGABRT) => "SIGABRT: it ended itself".to_owned(),
            Some(libc::SIGFPE) => "SIGFPE: a division by zero".to_owned(),
            Some(libc::SIGILL) => "SIGILL: no instruction".to_owned(),
            Some(libc::SIGKILL) => "SIGKILL: killed by itself, or for want of memory".to_owned(),
            Some(libc::SIGSYS) => "SIGSYS: it sent a signal to processes that are not its own".to_owned(),
            Some(libc::SIGXFSZ) => "SIGXFSZ: it wrote more than 1 GiB to a file".to_owned(),
            Some(other) => format!("signal {other}"),
            None => status.to_string(),
        }
    };
    #[cfg(not(unix))]
    let why = status.to_string();
    match said.lines().rev().find(|line| !line.trim().is_empty()) {
        Some(line) if why.starts_with("SIGABRT") => format!("{why} ({})", line.trim()),
        _ => why,
    }
}

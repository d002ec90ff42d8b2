//! Plays scripts in processes of their own.

use crate::script::{End, Outcome, Run, Script, Setting, Step};
use crate::worker::{Job, Last, OWN_FAULT, PLAYED, Unloadable, VARIABLE};
use anyhow::{Context as _, bail};
use std::collections::HashMap;
use std::fs::File;
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Plays a script: each part up to a fresh process in one of its own, `limit` seconds at most.
pub fn play(setting: &Setting, script: &Script, limit: f64, scratch: &TempDir) -> anyhow::Result<Run> {
    let mut run = Run::default();
    let mut bytes = HashMap::new();
    for (phase, part) in script.split(|numbered| numbered.step == Step::FreshProcess).enumerate() {
        bytes = one(setting, part, bytes, limit, scratch, phase, &mut run)?;
        if run.end != End::Done {
            break;
        }
    }
    Ok(run)
}

fn one(
    setting: &Setting,
    script: &[crate::script::Numbered],
    bytes: HashMap<usize, Vec<u8>>,
    limit: f64,
    scratch: &TempDir,
    phase: usize,
    run: &mut Run,
) -> anyhow::Result<HashMap<usize, Vec<u8>>> {
    let folder = tempfile::Builder::new().prefix("run-").tempdir_in(scratch.path())?;
    let at = |name: &str| folder.path().join(name);
    let job = Job { setting: setting.clone(), script: script.to_vec(), bytes, outcomes: at("outcomes") };
    std::fs::write(at("job"), serde_json::to_vec(&job)?)?;
    std::fs::create_dir(at("here"))?;
    let said = File::create(at("said"))?;
    let mut child = Command::new(std::env::current_exe()?)
        .env(VARIABLE, at("job"))
        // What was not written is something else in every process.
        .env("MALLOC_PERTURB_", (1 + phase * 90).to_string())
        // Freed blocks that each thread keeps would count as in use (mallinfo2 of glibc).
        .env("GLIBC_TUNABLES", "glibc.malloc.tcache_count=0")
        .envs(setting.now.then_some(("LD_BIND_NOW", "1")))
        .current_dir(at("here"))
        .stdin(Stdio::null())
        .stdout(said.try_clone()?)
        .stderr(said)
        .spawn()
        .context("a process for the FMU cannot be started")?;
    let begin = Instant::now();
    let ended = loop {
        if let Some(status) = child.try_wait()? {
            break Some(status);
        }
        if begin.elapsed().as_secs_f64() > limit {
            child.kill()?;
            child.wait()?;
            break None;
        }
        std::thread::sleep(Duration::from_micros(500));
    };
    let said = std::fs::read(at("said")).unwrap_or_default();
    run.said.push_str(&String::from_utf8_lossy(&said));
    let text = std::fs::read(at("outcomes")).unwrap_or_default();
    let mut last = None;
    for line in text.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()) {
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
    run.at = script.iter().map(|numbered| numbered.id).find(|id| !run.outcomes.contains_key(id));
    run.end = match ended {
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

/// What the system says of a process that crashed.
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
            Some(libc::SIGKILL) => "SIGKILL: killed, perhaps for want of memory".to_owned(),
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

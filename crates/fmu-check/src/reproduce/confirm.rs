//! Compiles and runs the program of a finding. A finding that its program does not show becomes a note.

use crate::finding::{Finding, Proof};
use crate::run::{Stop, Workers};
use crate::worker::interrupted;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Maximum number of runs of a program. One run that shows the finding is enough, because threads may lead to different results
/// in every run.
const RUNS: usize = 3;

/// Directories, and limits of memory and time, for the programs.
pub struct Proving<'a> {
    pub workers: &'a Workers,
    /// Directory of the unpacked FMU.
    pub fmu: &'a Path,
    /// Directory for the sources and the programs.
    pub scratch: &'a Path,
    /// Bytes of memory that a program may use.
    pub memory: u64,
    /// Maximum duration of a call sequence in seconds.
    pub limit: f64,
    pub deadline: Instant,
}

impl Proving<'_> {
    /// Compiles and runs the program of a finding.
    pub fn prove(&self, finding: &Finding) -> Proof {
        self.compile_and_run(finding).unwrap_or_else(|error| Proof::NotRun(error.to_string()))
    }

    fn compile_and_run(&self, finding: &Finding) -> anyhow::Result<Proof> {
        let directory = tempfile::tempdir_in(self.scratch)?;
        let (source, program) = (directory.path().join("repro.c"), directory.path().join("repro"));
        std::fs::write(&source, &finding.c)?;
        // A hang must last as long as in the check, but at most 10 s. Everything else may take longer, because the machine may be
        // busy.
        let ends = ["crash", "exit"].iter().any(|end| finding.name.ends_with(end));
        let patience = match finding.name.ends_with("hang") {
            true => self.limit.min(10.0),
            false if ends => 3.0 + 2.0 * self.limit,
            false => 20.0 + self.limit,
        };
        if let Some(why) = self.compile(&source, &program, patience.ceil())? {
            return Ok(why);
        }
        let mut last = String::new();
        for _ in 0..RUNS {
            let remaining = self.deadline.saturating_duration_since(Instant::now()).as_secs_f64();
            if remaining <= 0.0 {
                return Ok(Proof::NotRun("the time was over".to_owned()));
            }
            let patience = (2.0 * patience + 3.0).min(remaining);
            match self.workers.program(&program, self.fmu, self.memory, patience)? {
                Some(1) => return Ok(Proof::Shown),
                Some(code) => last = format!("its program ends with exit status {code}"),
                None if Instant::now() >= self.deadline => {
                    return Ok(Proof::NotRun("the time was over".to_owned()));
                }
                // The program sets an alarm that ends it, so only the FMU can have prevented its end.
                None if ends => return Ok(Proof::Shown),
                None => return Ok(Proof::NotShown("its program does not end".to_owned())),
            }
        }
        Ok(Proof::NotShown(last))
    }

    /// Compiles a program; returns the reason if that is not possible.
    fn compile(&self, source: &Path, program: &Path, patience: f64) -> anyhow::Result<Option<Proof>> {
        let compiler = std::env::var_os("CC").filter(|name| !name.is_empty()).unwrap_or_else(|| "cc".into());
        let mut command = Command::new(&compiler);
        command
            .args(["-w", "-ffp-contract=off", &format!("-DPATIENCE={patience}"), "-o"])
            .arg(program)
            .arg(source);
        command.args(["-ldl", "-lpthread", "-lm"]);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        let Ok(mut child) = command.spawn() else {
            let name = compiler.to_string_lossy().into_owned();
            return Ok(Some(Proof::NotRun(format!("there is no C compiler {name:?}"))));
        };
        loop {
            match child.try_wait()? {
                Some(status) if status.success() => return Ok(None),
                Some(_) => return Ok(Some(Proof::NotRun("its program cannot be compiled".to_owned()))),
                None if interrupted() || Instant::now() >= self.deadline => {
                    child.kill()?;
                    child.wait()?;
                    let why = if interrupted() { Stop::Interrupted } else { Stop::TimeOver };
                    return Ok(Some(Proof::NotRun(why.to_string())));
                }
                None => std::thread::sleep(Duration::from_millis(2)),
            }
        }
    }
}

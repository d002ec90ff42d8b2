//! Server process that forks a child process for every call sequence, because starting a program takes several times as long as a
//! fork. The server adopts and ends the orphaned processes of a call sequence.

use super::contain::{
    MOST_PROCESSES, abandoned, adopt_descendants, all_processes, descendants, end_descendants, isolate,
    wait_for_end,
};
use super::job::{Ended, SCRATCH};
use super::memory::calls_in_progress;
use super::use_for_temporary_files;
use super::work::{end, work};
use std::fs::File;
use std::io::{Read as _, Seek as _, Write as _};
use std::os::unix::process::ExitStatusExt as _;
use std::path::Path;
use std::process::ExitStatus;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Maximum number of bytes of the standard output and standard error of a process that are recorded.
const MOST_OUTPUT: u64 = 1 << 20;

/// How often the number of processes is compared with the limit, and the checker is looked for.
const LOOK: Duration = Duration::from_millis(20);

/// Executes jobs until the standard input ends. Each line of the input has the limit in seconds and a job.
pub fn serve() -> Result<(), String> {
    adopt_descendants();
    let result = jobs();
    if abandoned() {
        // The checker has ended. If it was killed, it has not removed its temporary directory.
        if let Some(scratch) = std::env::var_os(SCRATCH) {
            let _ = std::env::set_current_dir("/");
            let _ = std::fs::remove_dir_all(Path::new(&scratch));
        }
    }
    result.map_err(|error| error.to_string())
}

fn jobs() -> std::io::Result<()> {
    // Next to the working directory, which `pass_on` also empties.
    let temporary = std::env::current_dir()?.with_extension("temporary");
    use_for_temporary_files(&temporary)?;
    let mut files = [tempfile::tempfile()?, tempfile::tempfile()?];
    // SAFETY: only returns a number.
    let checker = unsafe { libc::getppid() };
    let mut sequences_with_orphans = 0;
    for line in std::io::stdin().lines() {
        let line = line?;
        let Some((limit, job)) = line.split_once(' ') else { continue };
        calls_in_progress().store(0, Ordering::Relaxed);
        // SAFETY: this process has one thread.
        match unsafe { libc::fork() } {
            -1 => return Err(std::io::Error::last_os_error()),
            0 => {
                isolate(checker);
                execute(job, files)
            }
            child => {
                let (ended, flood) = wait(child, limit.parse().unwrap_or_default());
                // Orphans that end within 300 ms are not a finding. After three call sequences with orphans, the server no longer
                // waits, to save time.
                let patient = ended.is_some() && sequences_with_orphans < 3;
                let orphans = end_descendants(child, Duration::from_millis(if patient { 300 } else { 0 }));
                sequences_with_orphans += usize::from(ended.is_some() && !orphans.is_empty());
                if abandoned() {
                    return Ok(());
                }
                let inside = calls_in_progress().load(Ordering::Relaxed) > 0;
                let ended = ended.map(Ended::from).unwrap_or_default();
                pass_on(Ended { orphans, flood, inside, ..ended }, &mut files, &temporary)?;
            }
        }
    }
    Ok(())
}

/// Executes a job in the process that was forked for it.
fn execute(job: &str, [output, outcomes]: [File; 2]) -> ! {
    use std::os::fd::AsRawFd as _;
    let nothing = File::open("/dev/null");
    for (file, number) in [(nothing.as_ref().unwrap_or(&output), 0), (&output, 1), (&output, 2)] {
        // SAFETY: `file` is open; the descriptor that is replaced stays open in the parent process.
        unsafe { libc::dup2(file.as_raw_fd(), number) };
    }
    drop((nothing, output));
    let read = serde_json::from_str(job).map_err(|error| error.to_string());
    end(read.map(|job| work(job, outcomes)))
}

/// Waits for a process for at most `limit` seconds. Returns its wait status if it ended, the number of processes if there were
/// too many, and neither if the limit was reached or the checker has ended.
fn wait(child: libc::pid_t, limit: f64) -> (Option<ExitStatus>, Option<usize>) {
    let (begin, before, mut status, mut looked) = (Instant::now(), all_processes(), 0, Instant::now());
    loop {
        // SAFETY: no other code waits for children of this process.
        match unsafe { libc::waitpid(-1, &raw mut status, libc::WNOHANG) } {
            -1 => return (None, None),
            pid if pid == child => return (Some(ExitStatus::from_raw(status)), None),
            0 => {}
            // The process that ended is an adopted orphan.
            _ => continue,
        }
        if looked.elapsed() >= LOOK {
            looked = Instant::now();
            // Only the descendants count, but finding them means reading a file of each process of the machine.
            let more = all_processes().wrapping_sub(before) as i16;
            if usize::try_from(more).is_ok_and(|more| more > MOST_PROCESSES) {
                let count = descendants().len();
                if count > MOST_PROCESSES {
                    return (None, Some(count));
                }
            }
            if abandoned() {
                return (None, None);
            }
        }
        if begin.elapsed().as_secs_f64() > limit {
            return (None, None);
        }
        wait_for_end(child, LOOK);
    }
}

/// Writes the results of a process to the standard output, as a line of JSON, and clears its files, the working directory and the
/// directory of temporary files for the next process.
fn pass_on(mut ended: Ended, files: &mut [File; 2], temporary: &Path) -> std::io::Result<()> {
    let results = [(&mut ended.output, MOST_OUTPUT), (&mut ended.outcomes, u64::MAX)];
    for (file, (text, max_bytes)) in files.iter_mut().zip(results) {
        let mut bytes = Vec::new();
        file.rewind()?;
        file.take(max_bytes).read_to_end(&mut bytes)?;
        *text = String::from_utf8_lossy(&bytes).into_owned();
        file.set_len(0)?;
        file.rewind()?;
    }
    let mut output = std::io::stdout().lock();
    serde_json::to_writer(&mut output, &ended)?;
    output.write_all(b"\n")?;
    for entry in std::fs::read_dir(".")?.chain(std::fs::read_dir(temporary)?).flatten() {
        let path = entry.path();
        let _ = if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
    }
    output.flush()
}

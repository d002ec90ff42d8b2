//! A process that is forked for every call sequence, because starting a program again takes several times as long.

use super::{File, work};
use serde::{Deserialize, Serialize};
use std::io::{Read as _, Seek as _, Write as _};
use std::time::{Duration, Instant};

/// Messages of a library on its standard output that are kept, in bytes.
const SAID: u64 = 1 << 20;

/// The answer to a job, a line of JSON; the messages and the outcomes follow it.
#[derive(Serialize, Deserialize)]
pub struct Answer {
    /// The wait status of the process; `None` if it did not end in time.
    pub ended: Option<i32>,
    /// The lengths of the messages and of the outcomes.
    pub lengths: [usize; 2],
}

/// Plays the jobs of the standard input, in lines with the limit of each in seconds, until it ends.
pub fn serve() -> Result<(), String> {
    jobs().map_err(|error| error.to_string())
}

fn jobs() -> std::io::Result<()> {
    let mut files = [tempfile::tempfile()?, tempfile::tempfile()?];
    for line in std::io::stdin().lines() {
        let line = line?;
        let Some((limit, job)) = line.split_once(' ') else { continue };
        // SAFETY: this process has one thread.
        match unsafe { libc::fork() } {
            -1 => return Err(std::io::Error::last_os_error()),
            0 => play(job, files),
            child => {
                let ended = wait(child, limit.parse().unwrap_or_default());
                answer(ended, &mut files)?;
            }
        }
    }
    Ok(())
}

/// Plays a job in the process that was forked for it.
fn play(job: &str, [said, outcomes]: [File; 2]) -> ! {
    use std::os::fd::AsRawFd as _;
    let nothing = File::open("/dev/null");
    for (file, number) in [(nothing.as_ref().unwrap_or(&said), 0), (&said, 1), (&said, 2)] {
        // SAFETY: `file` is open; the descriptor that is replaced stays open in the parent process.
        unsafe { libc::dup2(file.as_raw_fd(), number) };
    }
    drop((nothing, said));
    let read = serde_json::from_str(job).map_err(|error| error.to_string());
    super::end(read.map(|job| work(job, outcomes)))
}

/// The wait status of a process that ends within so many seconds; any other is killed.
fn wait(child: libc::pid_t, limit: f64) -> Option<i32> {
    let (begin, mut status) = (Instant::now(), 0);
    loop {
        // SAFETY: `child` is a process of this one that was not waited for.
        match unsafe { libc::waitpid(child, &raw mut status, libc::WNOHANG) } {
            0 if begin.elapsed().as_secs_f64() < limit => std::thread::sleep(Duration::from_micros(200)),
            0 => {
                // SAFETY: as above.
                unsafe {
                    libc::kill(child, libc::SIGKILL);
                    libc::waitpid(child, &raw mut status, 0);
                }
                return None;
            }
            _ => return Some(status),
        }
    }
}

/// Passes on the results of a process, and clears its files for the next one.
fn answer(ended: Option<i32>, files: &mut [File; 2]) -> std::io::Result<()> {
    let mut left = [Vec::new(), Vec::new()];
    for ((file, bytes), most) in files.iter_mut().zip(&mut left).zip([SAID, u64::MAX]) {
        file.rewind()?;
        file.take(most).read_to_end(bytes)?;
        file.set_len(0)?;
        file.rewind()?;
    }
    let line = serde_json::to_string(&Answer { ended, lengths: [left[0].len(), left[1].len()] })?;
    let mut output = std::io::stdout().lock();
    output.write_all(format!("{line}\n").as_bytes())?;
    left.iter().try_for_each(|bytes| output.write_all(bytes))?;
    for entry in std::fs::read_dir(".")?.flatten() {
        let path = entry.path();
        let _ = if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
    }
    output.flush()
}

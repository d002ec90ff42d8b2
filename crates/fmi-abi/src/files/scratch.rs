//! Temporary directories. If a process is killed, a later process removes its directories.

use std::fs::{self, File};
use std::io;
use std::path::Path;
use tempfile::TempDir;

/// Name of a file that is locked while its directory is in use.
const LOCK: &str = ".in-use";

/// A temporary directory, removed when dropped. A killed process leaves its directory behind, but the system releases
/// the lock, so the next process that creates a directory with this prefix removes the old one.
#[derive(Debug)]
pub struct Scratch {
    /// Declared before the lock, so that the directory is removed while it is still locked.
    directory: TempDir,
    _lock: File,
}

impl Scratch {
    /// Creates a directory whose name begins with `prefix`, and removes the directories with this prefix that ended
    /// processes have left behind.
    ///
    /// # Errors
    /// Fails if the directory or the lock file in it cannot be created.
    pub fn new(prefix: &str) -> io::Result<Self> {
        remove_abandoned(&std::env::temp_dir(), prefix);
        loop {
            let directory = tempfile::Builder::new().prefix(prefix).tempdir()?;
            let lock = File::create_new(directory.path().join(LOCK))?;
            lock.lock()?;
            // Another process may have locked the file first and removed the directory; then the loop creates another
            // one.
            if directory.path().join(LOCK).exists() {
                return Ok(Self { directory, _lock: lock });
            }
        }
    }

    /// Returns the path of the directory.
    pub fn path(&self) -> &Path {
        self.directory.path()
    }
}

/// Removes the directories with this prefix whose lock no process holds. Failures are ignored, because a directory that
/// remains does no harm.
fn remove_abandoned(parent: &Path, prefix: &str) {
    for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
        let is_directory = entry.file_type().is_ok_and(|of| of.is_dir());
        if !is_directory || !entry.file_name().to_string_lossy().starts_with(prefix) {
            continue;
        }
        // The directory of another user is skipped, because its lock file cannot be opened.
        let lock = File::options().write(true).open(entry.path().join(LOCK));
        if lock.is_ok_and(|lock| lock.metadata().is_ok_and(|of| of.is_file()) && lock.try_lock().is_ok()) {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{LOCK, Scratch};
    use std::fs;

    #[test]
    fn directories_of_ended_processes_are_removed() {
        let prefix = format!("fmi-abi-test-{}-", std::process::id());
        let in_use = Scratch::new(&prefix).unwrap();
        // The directory of a killed process: it contains a file that no process has locked.
        let abandoned = tempfile::Builder::new().prefix(&prefix).tempdir().unwrap().keep();
        fs::write(abandoned.join(LOCK), "").unwrap();
        // The directory of a process that has not created its lock file yet.
        let new = tempfile::Builder::new().prefix(&prefix).tempdir().unwrap();
        let other = Scratch::new(&prefix).unwrap();
        assert!(!abandoned.exists());
        assert!([in_use.path(), other.path(), new.path()].iter().all(|path| path.exists()));
        let path = other.path().to_owned();
        drop(other);
        assert!(!path.exists());
    }
}

//! Temporary directories that do not stay behind.

use std::fs::{self, File};
use std::io;
use std::path::Path;
use tempfile::TempDir;

/// File in the directory that is locked while it is in use.
const LOCK: &str = ".in-use";

/// A temporary directory, removed when dropped. A process that ends otherwise leaves it behind, but not its lock, so that the next
/// process removes it.
#[derive(Debug)]
pub struct Scratch {
    /// Before the lock, so that it is removed while it is locked.
    directory: TempDir,
    _lock: File,
}

impl Scratch {
    /// Creates a directory whose name begins with `prefix`, and removes those that ended processes have left behind.
    ///
    /// # Errors
    /// Fails if no directory can be created.
    pub fn new(prefix: &str) -> io::Result<Self> {
        remove_abandoned(&std::env::temp_dir(), prefix);
        loop {
            let directory = tempfile::Builder::new().prefix(prefix).tempdir()?;
            let lock = File::create_new(directory.path().join(LOCK))?;
            lock.lock()?;
            // Another process may have locked the file before, and removed the directory.
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

/// Removes the directories whose lock no process holds. Failures are ignored, because they only mean that a
/// directory stays.
fn remove_abandoned(parent: &Path, prefix: &str) {
    for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
        let is_directory = entry.file_type().is_ok_and(|of| of.is_dir());
        if !is_directory || !entry.file_name().to_string_lossy().starts_with(prefix) {
            continue;
        }
        // Other users' directories cannot be opened.
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
        // As a killed process leaves it: with a file that no process has locked.
        let abandoned = tempfile::Builder::new().prefix(&prefix).tempdir().unwrap().keep();
        fs::write(abandoned.join(LOCK), "").unwrap();
        // As it is before the process locks it.
        let new = tempfile::Builder::new().prefix(&prefix).tempdir().unwrap();
        let other = Scratch::new(&prefix).unwrap();
        assert!(!abandoned.exists());
        assert!([in_use.path(), other.path(), new.path()].iter().all(|path| path.exists()));
        let path = other.path().to_owned();
        drop(other);
        assert!(!path.exists());
    }
}

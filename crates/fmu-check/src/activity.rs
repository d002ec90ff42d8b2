//! Shows on the standard error what a check does.

use std::io::Write as _;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

/// How a check shows its progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// Not at all.
    None,
    /// In a line of a terminal that changes.
    Line,
    /// In a new line whenever this time has passed.
    Every(Duration),
}

/// The present activity of a check.
pub struct Activity {
    progress: Progress,
    now: Arc<Mutex<String>>,
}

/// Time between two looks at the activity.
const INTERVAL: Duration = Duration::from_millis(100);

impl Activity {
    /// Begins to show the activity of the check of this FMU, until the value is dropped.
    pub fn begin(progress: Progress, fmu: &Path) -> Self {
        let now = Arc::new(Mutex::new("opens the FMU".to_owned()));
        if let Progress::Every(interval) = progress {
            let name = fmu.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let watched = Arc::downgrade(&now);
            std::thread::spawn(move || {
                let mut shown = Instant::now();
                while let Some(now) = Weak::upgrade(&watched) {
                    if shown.elapsed() >= interval {
                        shown = Instant::now();
                        let now = now.lock().unwrap_or_else(PoisonError::into_inner);
                        eprintln!("note: {name}: {}", now.trim());
                    }
                    drop(now);
                    std::thread::sleep(INTERVAL);
                }
            });
        }
        Self { progress, now }
    }

    /// Sets the activity. An empty one clears the line of the terminal.
    pub fn set(&self, activity: &str) {
        match self.progress {
            Progress::None => {}
            Progress::Line => {
                eprint!("\r{activity:79}{}", if activity.is_empty() { "\r" } else { "" });
                let _ = std::io::stderr().flush();
            }
            Progress::Every(_) if activity.is_empty() => {}
            Progress::Every(_) => {
                activity.clone_into(&mut self.now.lock().unwrap_or_else(PoisonError::into_inner));
            }
        }
    }
}

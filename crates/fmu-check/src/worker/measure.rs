//! Measures the resources and settings of the process.

use super::settings::settings;
use crate::call_sequence::Measured;

/// Measures this process.
pub fn now() -> Measured {
    let (memory, exact) = memory();
    let entries = |directory: &str| std::fs::read_dir(directory).map_or(0, Iterator::count);
    Measured {
        memory,
        exact,
        threads: entries("/proc/self/task"),
        files: entries("/proc/self/fd"),
        settings: settings(),
        times: 0,
    }
}

/// Returns the allocated bytes and true with glibc 2.33 and later, otherwise the resident memory and false.
fn memory() -> (u64, bool) {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        type Info = unsafe extern "C" fn() -> libc::mallinfo2;
        let this = libloading::os::unix::Library::this();
        // SAFETY: the function of this name has this type.
        if let Ok(info) = unsafe { this.get::<Info>(b"mallinfo2") }.map(|info| unsafe { info() }) {
            return ((info.uordblks + info.hblkhd) as u64, true);
        }
    }
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages: u64 = statm.split_whitespace().nth(1).and_then(|pages| pages.parse().ok()).unwrap_or(0);
    (pages * 4096, false)
}

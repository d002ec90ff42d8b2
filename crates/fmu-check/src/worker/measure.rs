//! Measures the resources and settings of the process, and compares measurements.

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
        // SAFETY: the function of this name has this type, and `None` is a null pointer.
        let info = unsafe {
            let found = libc::dlsym(libc::RTLD_DEFAULT, c"mallinfo2".as_ptr());
            std::mem::transmute::<*mut libc::c_void, Option<Info>>(found).map(|info| info())
        };
        if let Some(info) = info {
            return ((info.uordblks + info.hblkhd) as u64, true);
        }
    }
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages: u64 = statm.split_whitespace().nth(1).and_then(|pages| pages.parse().ok()).unwrap_or(0);
    (pages * 4096, false)
}

/// Returns the number of bytes by which the memory may grow during these repetitions. The smallest block of glibc is 32 bytes, and
/// glibc may keep a few blocks. If the C library does not report the allocated memory, the resident memory is measured, which
/// consists of pages.
pub fn tolerated_growth(before: &Measured, times: usize) -> u64 {
    if before.exact { 16 * times as u64 + 4096 } else { 64 * times as u64 + (4 << 20) }
}

/// Setting that may differ while an instance exists, because the instance may have files in the working directory.
const FILES: &str = "files in the working directory";

/// Describes the first setting that differs between two measurements; the files in the working directory are compared only if
/// `files` is set.
pub fn changed_setting(before: &Measured, after: &Measured, files: bool) -> Option<String> {
    let only_in = |one: &Measured, other: &Measured| {
        let is_other =
            |setting: &&String| !other.settings.contains(setting) && (files || !setting.starts_with(FILES));
        one.settings.iter().find(is_other).cloned()
    };
    // A setting may be missing in one measurement, because the number of environment variables may change.
    match (only_in(before, after), only_in(after, before)) {
        (None, None) => None,
        (Some(was), Some(is)) => Some(format!("{was} has become {is}")),
        (Some(was), None) => Some(format!("{was} is gone")),
        (None, Some(is)) => Some(format!("{is} is new")),
    }
}

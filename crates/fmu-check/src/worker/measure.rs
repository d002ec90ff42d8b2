//! Measures the resources and settings of the process.

use crate::call_sequence::Measured;

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

/// Returns the settings of the process that an FMU must not change: working directory and its files, floating-point control word,
/// locale, signal handlers, environment, file mode creation mask, limits and periodic timers.
fn settings() -> Vec<String> {
    let mut found = Vec::new();
    found.push(format!("working directory {}", std::env::current_dir().unwrap_or_default().display()));
    #[cfg(target_arch = "x86_64")]
    {
        let mut word = 0_u32;
        // SAFETY: stores the control word of SSE, which every x86-64 has.
        unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut word, options(nostack)) };
        // The status flags are masked.
        found.push(format!("floating-point control word {:#x}", word & !0x3f));
    }
    #[cfg(unix)]
    {
        found.extend(unix());
        // SAFETY: only returns the name.
        let locale = unsafe { super::text_at(libc::setlocale(libc::LC_ALL, std::ptr::null())) };
        found.push(format!("locale {}", String::from_utf8_lossy(&locale.unwrap_or_default())));
        for (name, signal) in [
            ("SIGSEGV", libc::SIGSEGV),
            ("SIGFPE", libc::SIGFPE),
            ("SIGINT", libc::SIGINT),
            ("SIGABRT", libc::SIGABRT),
        ] {
            // SAFETY: only returns the current handler.
            let handler = unsafe {
                let mut action: libc::sigaction = std::mem::zeroed();
                libc::sigaction(signal, std::ptr::null(), &mut action);
                action.sa_sigaction
            };
            found.push(format!("handler of {name} {handler:#x}"));
        }
    }
    found
}

/// Returns the settings that only Unix has.
#[cfg(unix)]
fn unix() -> Vec<String> {
    let mut found = Vec::new();
    // SAFETY: sets the mask and sets it back; the process has no other thread that creates files.
    let mask = unsafe {
        let mask = libc::umask(0);
        libc::umask(mask);
        mask
    };
    found.push(format!("file mode creation mask {mask:#o}"));
    for (name, resource) in [
        ("open files", libc::RLIMIT_NOFILE),
        ("stack", libc::RLIMIT_STACK),
        ("processor time", libc::RLIMIT_CPU),
        ("core files", libc::RLIMIT_CORE),
    ] {
        let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
        // SAFETY: writes the limit.
        unsafe { libc::getrlimit(resource, &raw mut limit) };
        found.push(format!("limit of {name} {}", limit.rlim_cur));
    }
    let timers =
        [("real", libc::ITIMER_REAL), ("virtual", libc::ITIMER_VIRTUAL), ("profiling", libc::ITIMER_PROF)];
    for (name, timer) in timers {
        // SAFETY: writes the timer.
        let timer = unsafe {
            let mut now: libc::itimerval = std::mem::zeroed();
            libc::getitimer(timer, &raw mut now);
            now.it_interval
        };
        found.push(format!("period of the {name} timer {}.{:06} s", timer.tv_sec, timer.tv_usec));
    }
    let entries = std::fs::read_dir(".").into_iter().flatten().flatten();
    let mut files: Vec<String> =
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    files.sort_unstable();
    found.push(format!("files in the working directory [{}]", files.join(", ")));
    let variable = |(name, value): (std::ffi::OsString, std::ffi::OsString)| {
        format!("environment variable {}={}", name.to_string_lossy(), value.to_string_lossy())
    };
    let mut variables: Vec<String> = std::env::vars_os().map(variable).collect();
    variables.sort_unstable();
    found.extend(variables);
    found
}

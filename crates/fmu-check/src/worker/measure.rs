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

/// Returns the settings of the process that an FMU must not change: working directory, floating-point control word, locale and
/// signal handlers.
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

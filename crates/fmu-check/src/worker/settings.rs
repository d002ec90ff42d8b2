//! Settings of the process that an FMU must not change.

/// Returns the settings, each with its value: the working directory and its files, the environment, and the control words of the
/// floating-point units. On Unix also the locale, signals, limits, timers, standard streams, the umask, the priority
/// and the seed of random numbers; on Linux also POSIX timers, scheduling and the name of the thread.
pub fn settings() -> Vec<String> {
    let mut found = Vec::new();
    found.push(format!("working directory {}", std::env::current_dir().unwrap_or_default().display()));
    found.extend(floating_point());
    #[cfg(unix)]
    found.extend(unix::settings());
    #[cfg(target_os = "linux")]
    found.extend(linux());
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

/// Returns the control words of the floating-point units, without their status flags.
fn floating_point() -> Vec<String> {
    #[cfg(target_arch = "x86_64")]
    {
        let (mut sse, mut x87) = (0_u32, 0_u16);
        // SAFETY: stores the control words of SSE and of the x87 unit, which every x86-64 has.
        unsafe {
            std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut sse, options(nostack));
            std::arch::asm!("fnstcw [{}]", in(reg) &raw mut x87, options(nostack));
        }
        vec![
            format!("floating-point control word {:#x}", sse & !0x3f),
            format!("control word of the x87 unit {x87:#x}"),
        ]
    }
    #[cfg(target_arch = "aarch64")]
    {
        let word: u64;
        // SAFETY: reads the control register, which every AArch64 has.
        unsafe { std::arch::asm!("mrs {}, fpcr", out(reg) word, options(nostack, nomem)) };
        vec![format!("floating-point control word {word:#x}")]
    }
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    Vec::new()
}

/// Returns the settings that only Linux has.
#[cfg(target_os = "linux")]
fn linux() -> Vec<String> {
    let timers = std::fs::read_to_string("/proc/self/timers").unwrap_or_default();
    let timers = timers.lines().filter(|line| line.starts_with("ID:")).count();
    // SAFETY: only copies the set of processor cores to `set`, and returns a number.
    let (policy, cores) = unsafe {
        let mut set: libc::cpu_set_t = std::mem::zeroed();
        libc::sched_getaffinity(0, size_of_val(&set), &raw mut set);
        (libc::sched_getscheduler(0), libc::CPU_COUNT(&set))
    };
    let thread = std::fs::read_to_string("/proc/thread-self/comm").unwrap_or_default();
    vec![
        format!("number of POSIX timers {timers}"),
        format!("scheduling policy {policy}"),
        format!("number of processor cores {cores}"),
        format!("name of the thread {}", thread.trim()),
    ]
}

#[cfg(unix)]
mod unix {
    use crate::worker::logger::text_at;
    use fmi_abi::c_types::{c_char, c_int, c_uint};
    use std::sync::atomic::{AtomicPtr, Ordering};

    /// Signals whose handlers importers may need.
    const SIGNALS: [(&str, c_int); 17] = [
        ("SIGSEGV", libc::SIGSEGV),
        ("SIGFPE", libc::SIGFPE),
        ("SIGINT", libc::SIGINT),
        ("SIGABRT", libc::SIGABRT),
        ("SIGTERM", libc::SIGTERM),
        ("SIGHUP", libc::SIGHUP),
        ("SIGQUIT", libc::SIGQUIT),
        ("SIGILL", libc::SIGILL),
        ("SIGBUS", libc::SIGBUS),
        ("SIGPIPE", libc::SIGPIPE),
        ("SIGALRM", libc::SIGALRM),
        ("SIGCHLD", libc::SIGCHLD),
        ("SIGUSR1", libc::SIGUSR1),
        ("SIGUSR2", libc::SIGUSR2),
        ("SIGXCPU", libc::SIGXCPU),
        ("SIGVTALRM", libc::SIGVTALRM),
        ("SIGPROF", libc::SIGPROF),
    ];

    pub fn settings() -> Vec<String> {
        // SAFETY: sets the mask and sets it back; the process has no other thread that creates files. The other functions only
        // return values.
        let (mask, priority, locale, of_thread) = unsafe {
            let mask = libc::umask(0);
            libc::umask(mask);
            let locale = text_at(libc::setlocale(libc::LC_ALL, std::ptr::null()));
            let of_thread = libc::uselocale(std::ptr::null_mut()) as usize;
            (mask, libc::getpriority(libc::PRIO_PROCESS, 0), locale, of_thread)
        };
        let mut found = vec![
            format!("file mode creation mask {mask:#o}"),
            format!("priority of the process {priority}"),
            format!("locale {}", String::from_utf8_lossy(&locale.unwrap_or_default())),
            format!("locale of the thread {of_thread:#x}"),
            format!("seed of random numbers {}", seed()),
        ];
        found.extend(signals());
        found.extend(limits());
        found.extend(timers());
        found.extend(streams());
        found
    }

    /// Returns the handlers of signals, and the signals that are blocked.
    fn signals() -> Vec<String> {
        let handlers = SIGNALS.iter().map(|(name, signal)| {
            // SAFETY: only returns the current handler.
            let handler = unsafe {
                let mut action: libc::sigaction = std::mem::zeroed();
                libc::sigaction(*signal, std::ptr::null(), &raw mut action);
                action.sa_sigaction
            };
            format!("handler of {name} {handler:#x}")
        });
        let mut found: Vec<String> = handlers.collect();
        // SAFETY: only copies the set of blocked signals to `set`.
        let blocked = unsafe {
            let mut set: libc::sigset_t = std::mem::zeroed();
            libc::pthread_sigmask(libc::SIG_BLOCK, std::ptr::null(), &raw mut set);
            (1..32).filter(|signal| libc::sigismember(&raw const set, *signal) == 1).collect::<Vec<c_int>>()
        };
        found.push(format!("blocked signals {blocked:?}"));
        found
    }

    fn limits() -> Vec<String> {
        let limits = [
            ("open files", libc::RLIMIT_NOFILE),
            ("stack", libc::RLIMIT_STACK),
            ("processor time", libc::RLIMIT_CPU),
            ("core files", libc::RLIMIT_CORE),
            ("memory", libc::RLIMIT_AS),
            ("data", libc::RLIMIT_DATA),
            ("file size", libc::RLIMIT_FSIZE),
            ("processes", libc::RLIMIT_NPROC),
            ("locked memory", libc::RLIMIT_MEMLOCK),
        ];
        let limit = |(name, resource)| {
            let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
            // SAFETY: only copies the limit of the process to `limit`.
            unsafe { libc::getrlimit(resource, &raw mut limit) };
            format!("limit of {name} {} of {}", limit.rlim_cur, limit.rlim_max)
        };
        limits.into_iter().map(limit).collect()
    }

    fn timers() -> Vec<String> {
        let timers = [
            ("real", libc::ITIMER_REAL),
            ("virtual", libc::ITIMER_VIRTUAL),
            ("profiling", libc::ITIMER_PROF),
        ];
        let timer = |(name, timer)| {
            // SAFETY: only copies the state of the timer to `now`.
            let timer = unsafe {
                let mut now: libc::itimerval = std::mem::zeroed();
                libc::getitimer(timer, &raw mut now);
                now
            };
            let (period, rest) = (timer.it_interval, timer.it_value);
            let running = if rest.tv_sec == 0 && rest.tv_usec == 0 { "off" } else { "running" };
            format!("{name} timer {running}, period {}.{:06} s", period.tv_sec, period.tv_usec)
        };
        timers.into_iter().map(timer).collect()
    }

    /// Returns the files that the standard streams are connected with, and their flags.
    fn streams() -> Vec<String> {
        let stream = |(name, number): (&str, c_int)| {
            // SAFETY: only copies the status of the file to `file`, and returns its flags.
            let (file, flags) = unsafe {
                let mut file: libc::stat = std::mem::zeroed();
                libc::fstat(number, &raw mut file);
                (file, libc::fcntl(number, libc::F_GETFL))
            };
            format!("{name} is file {}:{} with flags {flags:#x}", file.st_dev, file.st_ino)
        };
        [("standard input", 0), ("standard output", 1), ("standard error", 2)].map(stream).into()
    }

    unsafe extern "C" {
        fn initstate(seed: c_uint, state: *mut c_char, size: usize) -> *mut c_char;
        fn setstate(state: *mut c_char) -> *mut c_char;
        fn random() -> std::ffi::c_long;
    }

    /// Seed that the importer has set.
    const SEED: c_uint = 4711;

    /// The next random numbers are sought among this many numbers that follow from the importer's seed, because an FMU may have used
    /// some of them.
    const SEARCHED: usize = 5_000_000;

    /// State of the generator; NULL before the first measurement, which sets the importer's seed.
    static OWN: AtomicPtr<c_char> = AtomicPtr::new(std::ptr::null_mut());

    /// Returns whether the next random numbers follow from the seed of the importer or from another one, which the FMU has set.
    fn seed() -> &'static str {
        let (importers, fmus) = ("of the importer", "of the FMU");
        // The state of the generator has 31 numbers and a header.
        let mut reference = [0_u64; 16];
        let reference = reference.as_mut_ptr().cast::<c_char>();
        // SAFETY: the memory is large enough. Afterwards the generator does not use `reference`, and the state at `OWN` is never
        // freed.
        unsafe {
            let own = OWN.load(Ordering::Relaxed);
            if own.is_null() {
                let own = Box::leak(Box::new([0_u64; 16])).as_mut_ptr().cast();
                OWN.store(own, Ordering::Relaxed);
                initstate(SEED, own, 128);
                return importers;
            }
            let current = initstate(SEED, reference, 128);
            setstate(current);
            if current != own {
                return fmus;
            }
            let next = [random(), random(), random()];
            setstate(reference);
            let mut last = [random(), random(), random()];
            let mut remaining = SEARCHED;
            while last != next && remaining > 0 {
                last = [last[1], last[2], random()];
                remaining -= 1;
            }
            setstate(own);
            if remaining > 0 { importers } else { fmus }
        }
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::settings;

    /// Calls `change`, and returns the settings that differ afterwards.
    fn changed(change: fn()) -> String {
        let before = settings();
        change();
        let new = settings().into_iter().filter(|setting| !before.contains(setting));
        new.collect::<Vec<_>>().join("; ")
    }

    /// Blocks a signal.
    fn block_signal() {
        // SAFETY: the set is initialized; the process ends after the test.
        unsafe {
            let mut set: libc::sigset_t = std::mem::zeroed();
            libc::sigaddset(&raw mut set, libc::SIGUSR1);
            libc::pthread_sigmask(libc::SIG_BLOCK, &raw const set, std::ptr::null_mut());
        }
    }

    /// Changes other settings: a signal handler, a timer, a standard stream and the priority.
    fn change_others() {
        // SAFETY: these functions change settings of this process, which ends after the test.
        unsafe {
            libc::signal(libc::SIGTERM, libc::SIG_IGN);
            libc::alarm(3600);
            libc::dup2(2, 0);
            libc::nice(1);
        }
    }

    /// Checks that the use of random numbers does not count as a change, and that changes of the seed and of other settings are
    /// found.
    #[test]
    fn changes_are_in_the_settings() {
        settings();
        // SAFETY: returns a number.
        let used = || drop(unsafe { libc::rand() }.to_string());
        assert_eq!(changed(used), "");
        // SAFETY: sets the seed.
        let seeded = || unsafe { libc::srand(1) };
        assert_eq!(changed(seeded), "seed of random numbers of the FMU");
        assert_eq!(changed(block_signal), format!("blocked signals [{}]", libc::SIGUSR1));
        let found = changed(change_others);
        let expected = ["SIGTERM 0x1", "real timer running", "standard input", "priority"];
        assert!(expected.iter().all(|part| found.contains(part)), "{found}");
    }
}

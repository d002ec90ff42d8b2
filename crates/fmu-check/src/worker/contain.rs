//! Handles interrupts, and confines the processes of an FMU. On Linux, each call sequence runs in a separate session and cannot
//! send signals to the processes of the checker, and its descendants are ended after it.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Returns whether the user has interrupted the check.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Returns the instant at which this function first noticed that the user has interrupted the check.
pub fn interrupted_at() -> Option<Instant> {
    static AT: OnceLock<Instant> = OnceLock::new();
    interrupted().then(|| *AT.get_or_init(Instant::now))
}

/// Handles SIGINT, SIGTERM and SIGHUP: the first signal stops the check, which still writes its report; the same signal again
/// ends the process. Ignores SIGXFSZ, so that a file that exceeds a limit is an error.
#[cfg(unix)]
pub fn listen_for_interrupts() {
    extern "C" fn interrupt(_: libc::c_int) {
        INTERRUPTED.store(true, Ordering::Relaxed);
    }
    for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP] {
        // SAFETY: the handler only stores a flag. A signal that is ignored, for example under nohup, stays ignored.
        unsafe {
            let mut before: libc::sigaction = std::mem::zeroed();
            libc::sigaction(signal, std::ptr::null(), &mut before);
            if before.sa_sigaction != libc::SIG_IGN {
                let mut action: libc::sigaction = std::mem::zeroed();
                action.sa_sigaction = interrupt as *const () as usize;
                action.sa_flags = libc::SA_RESETHAND | libc::SA_RESTART;
                libc::sigaction(signal, &action, std::ptr::null_mut());
            }
        }
    }
    // SAFETY: ignores a signal.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
}

/// Restores the signal that `listen_for_interrupts` ignores, in the processes of the FMU.
#[cfg(unix)]
pub fn restore_signals() {
    // SAFETY: the default action ends the process.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_DFL) };
}

/// Does nothing: Windows does not have this signal.
#[cfg(not(unix))]
pub fn restore_signals() {}

/// Does nothing: on Windows, an interrupt ends the process.
#[cfg(not(unix))]
pub fn listen_for_interrupts() {}

/// Ends the process group of a worker that has ended.
#[cfg(all(unix, not(target_os = "linux")))]
pub fn end_group(leader: u32) {
    // SAFETY: sends a signal to a group that this process has made.
    unsafe { libc::kill(-(leader as libc::pid_t), libc::SIGKILL) };
}

/// Does nothing: Windows has no function that ends a process group.
#[cfg(not(unix))]
pub fn end_group(_: u32) {}

#[cfg(target_os = "linux")]
pub use linux::*;

#[cfg(target_os = "linux")]
mod linux {
    use std::collections::HashMap;
    use std::os::fd::AsRawFd;
    use std::time::{Duration, Instant};

    /// Maximum number of processes of a call sequence at a time; more are a finding.
    pub const MOST_PROCESSES: usize = 64;

    /// Starts a session, and makes this process adopt the orphans among its descendants.
    pub fn adopt_descendants() {
        // SAFETY: both calls concern only this process.
        unsafe {
            libc::setsid();
            libc::prctl(libc::PR_SET_CHILD_SUBREAPER, 1);
        }
    }

    /// Waits at most 50 ms for data or the end of the file; returns whether one of them has arrived.
    pub fn readable(file: &impl AsRawFd) -> std::io::Result<bool> {
        let mut poll = libc::pollfd { fd: file.as_raw_fd(), events: libc::POLLIN, revents: 0 };
        // SAFETY: one descriptor, which is open.
        match unsafe { libc::poll(&raw mut poll, 1, 50) } {
            -1 if std::io::Error::last_os_error().kind() != std::io::ErrorKind::Interrupted => {
                Err(std::io::Error::last_os_error())
            }
            count => Ok(count > 0),
        }
    }

    /// Returns whether the other end of the standard input is closed, because the checker has ended or no longer needs this
    /// server.
    pub fn abandoned() -> bool {
        let mut poll = libc::pollfd { fd: 0, events: 0, revents: 0 };
        // SAFETY: one descriptor.
        unsafe { libc::poll(&raw mut poll, 1, 0) > 0 && poll.revents & libc::POLLHUP != 0 }
    }

    /// Waits until a child ends, at most for `limit`. The child may then still have to be reaped.
    pub fn wait_for_end(child: libc::pid_t, limit: Duration) {
        // SAFETY: returns a descriptor of the child, which has not been reaped, or -1.
        let file = unsafe { libc::syscall(libc::SYS_pidfd_open, child, 0) } as libc::c_int;
        if file < 0 {
            // The kernel is older than Linux 5.3.
            return std::thread::sleep(Duration::from_micros(200));
        }
        let mut poll = libc::pollfd { fd: file, events: libc::POLLIN, revents: 0 };
        // SAFETY: one descriptor, which is open and then closed.
        unsafe {
            libc::poll(&raw mut poll, 1, limit.as_millis() as libc::c_int);
            libc::close(file);
        }
    }

    /// Returns the number of processes and threads of the machine, modulo 65,536.
    pub fn all_processes() -> u16 {
        // SAFETY: fills the structure, for which zeros are valid.
        unsafe {
            let mut info: libc::sysinfo = std::mem::zeroed();
            libc::sysinfo(&raw mut info);
            info.procs
        }
    }

    /// Returns the descendants that are alive, with their names.
    pub fn descendants() -> Vec<(libc::pid_t, String)> {
        let mut children: HashMap<libc::pid_t, Vec<(libc::pid_t, String)>> = HashMap::new();
        for entry in std::fs::read_dir("/proc").into_iter().flatten().flatten() {
            let Some(pid) = entry.file_name().to_str().and_then(|name| name.parse().ok()) else { continue };
            let stat = std::fs::read_to_string(entry.path().join("stat")).unwrap_or_default();
            // The name is in parentheses and may contain parentheses.
            let Some((name, rest)) = stat.split_once('(').and_then(|(_, rest)| rest.rsplit_once(") ")) else {
                continue;
            };
            let mut fields = rest.split(' ');
            let state = fields.next().unwrap_or_default();
            if let Some(parent) = fields.next().and_then(|field| field.parse().ok())
                && !["Z", "X"].contains(&state)
            {
                children.entry(parent).or_default().push((pid, name.to_owned()));
            }
        }
        let mut found: Vec<(libc::pid_t, String)> = Vec::new();
        // SAFETY: only returns a number.
        let mut next = vec![unsafe { libc::getpid() }];
        while let Some(parent) = next.pop() {
            for child in children.remove(&parent).into_iter().flatten() {
                next.push(child.0);
                found.push(child);
            }
        }
        found
    }

    /// Reaps the children that have ended; returns whether other children are alive.
    fn reap() -> bool {
        loop {
            // SAFETY: no other code waits for children of this process.
            match unsafe { libc::waitpid(-1, std::ptr::null_mut(), libc::WNOHANG) } {
                0 => return true,
                -1 => return false,
                _ => {}
            }
        }
    }

    /// Ends all descendants, first the process group of `leader`. Returns the names of the descendants that were alive after `grace`.
    pub fn end_descendants(leader: libc::pid_t, grace: Duration) -> Vec<String> {
        let begin = Instant::now();
        while reap() {
            if begin.elapsed() >= grace {
                break;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        if !reap() {
            return Vec::new();
        }
        let orphans = descendants().into_iter().map(|(_, name)| name).collect();
        let begin = Instant::now();
        while reap() && begin.elapsed() < Duration::from_secs(10) {
            // SAFETY: the processes descend from this one. Each group is ended by one signal, so that none of its processes can
            // escape by starting another one.
            unsafe {
                libc::kill(-leader, libc::SIGKILL);
                for (pid, _) in descendants() {
                    let group = libc::getpgid(pid);
                    if group > 1 && group != libc::getpgid(0) {
                        libc::kill(-group, libc::SIGKILL);
                    }
                    libc::kill(pid, libc::SIGKILL);
                }
            }
            std::thread::sleep(Duration::from_micros(200));
        }
        orphans
    }

    /// System calls whose first argument is a process or a process group to which they send a signal, whose limits or scheduling
    /// they change, or whose memory they access.
    const BY_FIRST: [libc::c_long; 15] = [
        libc::SYS_kill,
        libc::SYS_tkill,
        libc::SYS_tgkill,
        libc::SYS_rt_sigqueueinfo,
        libc::SYS_rt_tgsigqueueinfo,
        libc::SYS_pidfd_open,
        libc::SYS_prlimit64,
        libc::SYS_sched_setaffinity,
        libc::SYS_sched_setattr,
        libc::SYS_sched_setparam,
        libc::SYS_sched_setscheduler,
        libc::SYS_process_vm_readv,
        libc::SYS_process_vm_writev,
        libc::SYS_migrate_pages,
        libc::SYS_move_pages,
    ];
    /// System calls of this kind whose second argument is the process.
    const BY_SECOND: [libc::c_long; 3] = [libc::SYS_ptrace, libc::SYS_setpriority, libc::SYS_ioprio_set];

    /// Commands of fcntl and ioctl that choose the process or process group to which the kernel sends a signal when a file is ready.
    const F_SETOWN_EX: i32 = 15;
    const FIOSETOWN: i32 = 0x8901;
    const SIOCSPGRP: i32 = 0x8902;

    /// Architecture of this program in system calls. The same system calls have other numbers in other architectures, so a process that
    /// uses them is ended.
    const ARCHITECTURE: Option<u32> = if cfg!(target_arch = "x86_64") {
        Some(0xc000_003e)
    } else if cfg!(target_arch = "aarch64") {
        Some(0xc000_00b7)
    } else {
        None
    };

    /// On x86-64, the kernel accepts each system call under a second number, which is larger by this one (x32). The filter rejects these
    /// numbers, because it compares only with the first ones.
    const X32: i32 = 0x4000_0000;

    /// Starts a session, and installs a filter for system calls. The filter ends this process with SIGSYS if it sends a signal to
    /// a process of the checker or to all processes, or changes such a process.
    pub fn isolate(checker: libc::pid_t) {
        // SAFETY: starts a session; the other calls only return numbers.
        let (server, group, caller) = unsafe {
            libc::setsid();
            let server = libc::getppid();
            (server, libc::getpgid(checker), parent_of(checker))
        };
        let mut targets = vec![-1, server, -server, checker, -checker, group, -group, caller];
        targets.retain(|target| *target != 0);
        let mut program = filter(&targets);
        let filter = libc::sock_fprog { len: program.len() as u16, filter: program.as_mut_ptr() };
        // SAFETY: the filter is for this process and its descendants. If the kernel does not support filters, all system calls
        // are allowed.
        unsafe {
            libc::prctl(libc::PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
            libc::prctl(libc::PR_SET_SECCOMP, libc::SECCOMP_MODE_FILTER, &raw const filter);
        }
    }

    /// Returns the filter that protects these processes and process groups.
    fn filter(targets: &[i32]) -> Vec<libc::sock_filter> {
        let step = |code: u32, jt, jf, k: i32| libc::sock_filter { code: code as u16, jt, jf, k: k as u32 };
        let load = |offset| step(libc::BPF_LD | libc::BPF_W | libc::BPF_ABS, 0, 0, offset);
        let end = |action: u32| step(libc::BPF_RET | libc::BPF_K, 0, 0, action as i32);
        let jump = |test: u32, number, jt, jf| step(libc::BPF_JMP | test | libc::BPF_K, jt, jf, number);
        // Executes `body` if the word at this offset is one of these numbers.
        let when = |offset, numbers: &[i32], body: Vec<libc::sock_filter>| {
            let mut all = vec![load(offset)];
            for (number, rest) in numbers.iter().zip((0..numbers.len() as u8).rev()) {
                let otherwise = if rest == 0 { body.len() as u8 } else { 0 };
                all.push(jump(libc::BPF_JEQ, *number, rest, otherwise));
            }
            all.extend(body);
            all
        };
        let call = |calls: &[libc::c_long], body| {
            when(NUMBER, &calls.iter().map(|call| *call as i32).collect::<Vec<_>>(), body)
        };
        let ends = || vec![end(libc::SECCOMP_RET_KILL_PROCESS)];
        let fails = |error: i32| vec![end(libc::SECCOMP_RET_ERRNO | error as u32)];
        let mut program = Vec::new();
        if let Some(architecture) = ARCHITECTURE {
            program.extend([load(ARCH), jump(libc::BPF_JEQ, architecture as i32, 1, 0)]);
            program.extend(ends());
        }
        if cfg!(target_arch = "x86_64") {
            program.extend([load(NUMBER), jump(libc::BPF_JGE, X32, 0, 1)]);
            program.extend(fails(libc::ENOSYS));
        }
        // A program that gets these errors uses the older call, which has the process as a number.
        let owners = [FIOSETOWN, SIOCSPGRP];
        for part in [
            call(&BY_FIRST, when(FIRST, targets, ends())),
            call(&BY_SECOND, when(SECOND, targets, ends())),
            call(&[libc::SYS_fcntl], when(SECOND, &[libc::F_SETOWN], when(THIRD, targets, ends()))),
            call(&[libc::SYS_fcntl], when(SECOND, &[F_SETOWN_EX], fails(libc::EINVAL))),
            call(&[libc::SYS_ioctl], when(SECOND, &owners, fails(libc::EINVAL))),
            call(&[libc::SYS_pidfd_send_signal], fails(libc::ENOSYS)),
            vec![end(libc::SECCOMP_RET_ALLOW)],
        ] {
            program.extend(part);
        }
        program
    }

    /// Offsets in seccomp_data: of the number of the system call, the architecture, and the lower words of the arguments.
    const NUMBER: i32 = 0;
    const ARCH: i32 = 4;
    const FIRST: i32 = 16;
    const SECOND: i32 = 24;
    const THIRD: i32 = 32;

    fn parent_of(pid: libc::pid_t) -> libc::pid_t {
        let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
        status.lines().find_map(|line| line.strip_prefix("PPid:")?.trim().parse().ok()).unwrap_or(0)
    }
}

//! Counts the instructions of some work. Unlike a duration, the count of the same program is the same in every run, even on
//! a busy machine.

/// Returns the number of instructions that the work executes; a thousand take some milliseconds to count. The work runs in
/// a copy of this process, so it leaves this process unchanged. The kernel stops the copy after each instruction. Returns
/// `None` if this process may not trace another, as in some containers.
///
/// # Panics
/// Panics if the process cannot be copied, or if the work ends it.
#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
pub fn instructions(work: &mut dyn FnMut()) -> Option<u64> {
    let own = counted(&mut || ())?;
    Some(counted(work)?.saturating_sub(own))
}

#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
fn counted(work: &mut dyn FnMut()) -> Option<u64> {
    use std::ptr::null_mut;
    // SAFETY: the child stops, does the work, stops again and is then ended. It would wait for ever for a lock that another
    // thread held during the fork, but glibc prevents this for the lock of its allocator.
    let child = unsafe { libc::fork() };
    assert!(child >= 0, "fork: {}", std::io::Error::last_os_error());
    if child == 0 {
        // SAFETY: only affects this process, which never returns.
        unsafe {
            if libc::ptrace(libc::PTRACE_TRACEME, 0, null_mut::<()>(), null_mut::<()>()) != 0 {
                libc::_exit(1);
            }
            libc::raise(libc::SIGSTOP);
            work();
            libc::raise(libc::SIGSTOP);
            libc::_exit(0)
        }
    }
    let wait = || {
        let mut status = 0;
        // SAFETY: waits for the child; the pointer is a live reference.
        assert_eq!(unsafe { libc::waitpid(child, &raw mut status, 0) }, child);
        status
    };
    if libc::WIFEXITED(wait()) {
        return None;
    }
    for count in 0.. {
        // SAFETY: the child is stopped and traced by this process.
        let stepped =
            unsafe { libc::ptrace(libc::PTRACE_SINGLESTEP, child, null_mut::<()>(), null_mut::<()>()) };
        assert_eq!(stepped, 0, "PTRACE_SINGLESTEP: {}", std::io::Error::last_os_error());
        let status = wait();
        assert!(libc::WIFSTOPPED(status), "the work has ended its process");
        match libc::WSTOPSIG(status) {
            libc::SIGTRAP => {}
            libc::SIGSTOP => {
                // SAFETY: the child of this process.
                unsafe { libc::kill(child, libc::SIGKILL) };
                wait();
                return Some(count);
            }
            signal => panic!("the work got signal {signal}"),
        }
    }
    None
}

/// Returns `None`, because counting is only implemented for Linux on x86-64 and 64-bit ARM.
#[cfg(not(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64"))))]
pub fn instructions(_: &mut dyn FnMut()) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::instructions;

    #[test]
    fn the_count_is_proportional_to_the_work() {
        let sum = |numbers: u64| {
            instructions(&mut || _ = (0..numbers).fold(0, |sum, number| std::hint::black_box(sum + number)))
        };
        let counts = [100, 200, 300].map(sum);
        if let [Some(one), Some(two), Some(three)] = counts {
            assert!(one > 100 && three - two == two - one, "{counts:?}");
        }
    }
}

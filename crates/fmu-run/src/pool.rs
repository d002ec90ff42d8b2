//! Instances and threads that a system reuses in later runs.

use crate::error::{Error, lock};
use crate::instance::Instance;
use crate::threads::Threads;
use fmi_abi::Interface;
use std::sync::Mutex;

/// Idle instances and threads of a system.
#[derive(Debug, Default)]
pub(crate) struct Pool {
    /// Instances of all components after a complete run, with their interface type.
    idle: Mutex<Vec<(Interface, Vec<Instance>)>>,
    threads: Mutex<Option<Threads>>,
}

/// Maximum number of idle entries of a system.
const MOST_IDLE: usize = 256;

impl Pool {
    /// Returns instances of this interface type that [`put`](Self::put) has stored, if there are any.
    pub fn take(&self, interface: Interface) -> Option<Vec<Instance>> {
        let mut idle = lock(&self.idle);
        let index = idle.iter().rposition(|(own, _)| *own == interface)?;
        Some(idle.swap_remove(index).1)
    }

    pub fn put(&self, interface: Interface, components: Vec<Instance>) {
        let mut idle = lock(&self.idle);
        if idle.len() < MOST_IDLE {
            idle.push((interface, components));
        }
    }

    /// Returns the idle threads if they belong to this process and there are this many, otherwise new ones. The caller returns them
    /// with [`put_threads`](Self::put_threads). Concurrent calls get different threads, so that they do not wait for each other.
    pub fn take_threads(&self, count: usize) -> Result<Threads, Error> {
        let threads = lock(&self.threads).take();
        threads
            .filter(|threads| threads.are_here() && threads.count() == count)
            .map_or_else(|| Threads::new(count), Ok)
    }

    pub fn put_threads(&self, threads: Threads) {
        *lock(&self.threads) = Some(threads);
    }

    /// Frees all idle instances and threads.
    pub fn clear(&self) {
        let (idle, threads) = (std::mem::take(&mut *lock(&self.idle)), lock(&self.threads).take());
        drop((idle, threads));
    }
}

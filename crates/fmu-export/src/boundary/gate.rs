//! The gate of an instance, which rejects a call while another call runs: from the log callback, or from another thread.

use fmi_abi::{AllowedStates, FmiState};
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicBool, AtomicU64};

const CLOSED: u64 = FmiState::NONE.bits();

/// The state of an instance in FMI, which is [`FmiState::NONE`] while a call runs, so that the check of allowed calls
/// also rejects overlapping calls.
///
/// A call that takes the general path closes the gate by an atomic exchange, so two such calls never overlap. In the fast
/// paths, the atomic exchanges of the three calls of a step would make the step take 80 % longer. So fast steps only load and
/// store `is_stepping`, which overlapping calls observe unless both begin within nanoseconds. Fast paths that get and set
/// Reals do not close the gate, because they only read and write numbers of the instance, and take a few nanoseconds.
pub(crate) struct Gate {
    state: AtomicU64,
    /// Whether a fast step runs.
    is_stepping: AtomicBool,
    /// Whether the importer's log callback runs.
    is_delivering: AtomicBool,
}

impl Gate {
    pub const fn new(state: FmiState) -> Self {
        let [is_stepping, is_delivering] = [const { AtomicBool::new(false) }; 2];
        Self { state: AtomicU64::new(state.bits()), is_stepping, is_delivering }
    }

    /// Closes the gate and returns the state of the instance; `NONE` if another call runs. In the first case the caller
    /// must call [`open`](Self::open), also if the state does not allow its call.
    #[inline]
    pub fn close(&self) -> FmiState {
        let state = FmiState::from_bits(self.state.swap(CLOSED, Acquire));
        if self.is_stepping.load(Relaxed) && state != FmiState::NONE {
            self.open(state);
            return FmiState::NONE;
        }
        state
    }

    /// Opens the gate that this call has closed.
    #[inline]
    pub fn open(&self, state: FmiState) {
        self.state.store(state.bits(), Release);
    }

    /// Returns whether no other call runs, except fast paths that get or set Reals, and the state is among the accepted ones.
    #[inline(always)]
    pub fn is_open(&self, accepted: AllowedStates) -> bool {
        FmiState::from_bits(self.state.load(Relaxed)).is_in(accepted)
    }

    /// Begins a fast step, after [`is_open`](Self::is_open). Returns false if another one runs; otherwise the caller must
    /// call [`end_step`](Self::end_step).
    #[inline(always)]
    pub fn begin_step(&self) -> bool {
        let is_free = !self.is_stepping.load(Relaxed);
        if is_free {
            self.is_stepping.store(true, Relaxed);
        }
        is_free
    }

    #[inline(always)]
    pub fn end_step(&self) {
        self.is_stepping.store(false, Relaxed);
    }

    pub fn is_delivering(&self) -> bool {
        self.is_delivering.load(Relaxed)
    }

    pub fn set_delivering(&self, is_delivering: bool) {
        self.is_delivering.store(is_delivering, Relaxed);
    }
}

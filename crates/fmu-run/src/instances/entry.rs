//! One of many instances, and functions that process all of them in several threads.

use super::Mask;
use crate::error::{Error, caught};
use crate::instance::Instance;
use crate::system_instance::SystemInstance;
use crate::threads::Threads;
use fmi_abi::client::{Event, Rejection};
use fmi_abi::shown_number;

#[derive(Debug)]
/// An instance with its state.
pub(super) struct Entry {
    /// The instance; `None` before it is created, or if it could not be created.
    pub instance: Option<SystemInstance>,
    /// Reason why the instance has failed, if it has.
    pub error: Option<String>,
    /// Time and last event.
    pub progress: Progress,
}

/// Time and last event of an instance.
#[derive(Debug, Default)]
pub(super) struct Progress {
    pub time: f64,
    /// Size of the first step since the initialization, s, if an FMU needs steps of equal size.
    pub first_step: Option<f64>,
    pub event: Event,
}

impl Progress {
    /// Performs a step of this size, s, or of the size of the first step, from which it may differ by a rounding error, if the FMU needs
    /// steps of equal size.
    #[inline]
    pub fn step(&self, instance: &mut SystemInstance, size: f64) -> Result<(), Rejection> {
        instance.step(self.time, self.first_step.unwrap_or(size))
    }
}

impl Entry {
    /// Returns whether a call acts on this instance, which has this index.
    pub fn acts(&self, index: usize, mask: Mask) -> bool {
        self.error.is_none() && mask.is_none_or(|mask| mask[index])
    }

    /// Calls `body` if the instance has not failed. Returns whether the instance is usable afterwards.
    #[inline]
    pub fn with(
        &mut self,
        body: impl FnOnce(&mut Progress, &mut SystemInstance) -> Result<(), Rejection>,
    ) -> bool {
        let Self { instance: Some(instance), error: error @ None, progress } = self else { return false };
        let why = match caught(|| body(progress, instance)) {
            Ok(Ok(())) => return true,
            Ok(Err(rejection)) => rejection.to_string(),
            Err(panic) => panic,
        };
        *error = Some(format!("at {} s: {why}", shown_number(progress.time)));
        false
    }
}

/// Allocates entries for the instances of a system. Fails if memory does not suffice for them and for their data.
pub(super) fn empty(count: usize, components: usize) -> Result<Vec<Entry>, Error> {
    /// Minimum memory for allocations of a component's FMU and of its log, in bytes.
    const COMPONENT: usize = 256;
    let too_many = || Error::Memory(format!("{count} instances need more memory than there is"));
    let mut all = Vec::new();
    all.try_reserve_exact(count).map_err(|_| too_many())?;
    let each = size_of::<SystemInstance>() + components * (size_of::<Instance>() + COMPONENT);
    let needed = count.checked_mul(each).ok_or_else(too_many)?;
    // The memory is freed immediately, because this only tests whether so much is available.
    Vec::<u8>::new().try_reserve_exact(needed).map_err(|_| too_many())?;
    all.resize_with(count, || Entry { instance: None, error: None, progress: Progress::default() });
    Ok(all)
}

/// Calls `body` with the index of each instance in the mask, and the instance.
pub(super) fn each(
    threads: &mut Option<Threads>,
    all: &mut [Entry],
    mask: Mask,
    body: impl Fn(usize, &mut Entry) + Sync,
) {
    if let Some(mask) = mask {
        assert_eq!(mask.len(), all.len(), "the mask must have a Boolean for each instance");
    }
    in_parts(threads, all, 0, &mut [], |index, one, _| {
        if mask.is_none_or(|mask| mask[index]) {
            body(index, one);
        }
    });
}

/// Calls `body` with the index of each instance, the instance, and its row of `length` values. This thread and each thread of the
/// pool process a part of the instances.
pub(super) fn in_parts(
    threads: &mut Option<Threads>,
    all: &mut [Entry],
    length: usize,
    values: &mut [f64],
    body: impl Fn(usize, &mut Entry, &mut [f64]) + Sync,
) {
    let work = |first: usize, all: &mut [Entry], values: &mut [f64]| {
        let mut rows = values.chunks_exact_mut(length.max(1));
        for (k, one) in all.iter_mut().enumerate() {
            body(first + k, one, rows.next().unwrap_or_default());
        }
    };
    if let Some(of_parent) = threads.take_if(|threads| !threads.are_here()) {
        // If threads cannot be created, this one does all the work.
        *threads = Threads::new(of_parent.count()).ok();
    }
    let Some(threads) = threads else { return work(0, all, values) };
    let part = all.len().div_ceil(threads.count() + 1);
    let (own, others) = all.split_at_mut(part);
    let (own_values, mut rest) = values.split_at_mut(part * length);
    let others = others.chunks_mut(part).enumerate().map(|(number, others)| {
        let (now, after) = std::mem::take(&mut rest).split_at_mut(others.len() * length);
        rest = after;
        let work = &work;
        move || work((number + 1) * part, others, now)
    });
    threads.share(|| work(0, own, own_values), others);
}

/// Returns a function that returns the row of an instance. `values` contains one row for all instances or a row for each.
pub(super) fn rows<'v>(values: &'v [f64], length: usize, instances: usize) -> impl Fn(usize) -> &'v [f64] {
    let each = values.len() == length * instances;
    assert!(
        each || values.len() == length,
        "{} values are not a row of {length} for one or {instances} instances",
        values.len()
    );
    move |index| &values[if each { index * length } else { 0 }..][..length]
}

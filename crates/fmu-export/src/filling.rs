//! Arrays that are filled at compile time.

use std::mem::MaybeUninit;

/// An array that starts uninitialized and is filled from its beginning, at compile time. If it started with other
/// values, the compiler would need quadratic time to overwrite elements that contain references.
pub(crate) struct Filling<T, const N: usize> {
    items: [MaybeUninit<T>; N],
    count: usize,
}

impl<T: Copy, const N: usize> Filling<T, N> {
    pub const fn new() -> Self {
        Self { items: [const { MaybeUninit::uninit() }; N], count: 0 }
    }

    pub const fn push(&mut self, item: T) {
        self.items[self.count] = MaybeUninit::new(item);
        self.count += 1;
    }

    /// Returns the array.
    ///
    /// # Panics
    /// Panics if an element is missing.
    pub const fn filled(self) -> [T; N] {
        assert!(self.count == N, "an element is missing");
        // SAFETY: all elements are initialized, and `MaybeUninit<T>` has the layout of `T`.
        unsafe { (&raw const self.items).cast::<[T; N]>().read() }
    }
}

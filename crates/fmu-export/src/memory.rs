//! Allocations that fail with an error instead of ending the importer.

use crate::model::Error;

/// A value on the heap. It is an array of one element, because stable Rust can only reserve memory for arrays fallibly.
pub(crate) type Boxed<T> = Box<[T; 1]>;

/// Reserves memory for a value.
///
/// # Errors
/// Fails if there is not enough memory.
pub(crate) fn reserve_box<T>() -> Result<Reserved<T>, Error> {
    let mut memory = Vec::new();
    match memory.try_reserve_exact(1) {
        Ok(()) => Ok(Reserved(memory)),
        Err(_) => Err(Error::new("there is not enough memory")),
    }
}

/// Memory for one value.
pub(crate) struct Reserved<T>(Vec<T>);

impl<T> Reserved<T> {
    /// Moves the value into the memory.
    pub fn fill(mut self, value: T) -> Boxed<T> {
        self.0.push(value);
        let Ok(filled) = self.0.try_into() else { unreachable!("it has one element") };
        filled
    }
}

/// Moves a value to the heap.
///
/// # Errors
/// Fails if there is not enough memory.
pub(crate) fn try_box<T>(value: T) -> Result<Boxed<T>, Error> {
    Ok(reserve_box()?.fill(value))
}

//! Access to Reals of a model by offsets. This module contains the pointer arithmetic of this crate.
//!
//! The functions that [`variables!`](crate::variables) generates compute the offset of a field from a reference to
//! it. For paths of fields and array elements the offsets are constants, so the compiler replaces the functions by
//! tables of offsets.

use crate::table::Variables;
use crate::value::Place;
use crate::variable::Index;
use std::mem::offset_of;
use std::ops::{Deref, DerefMut};

/// A model, followed by dummy values for variables without a field in the model.
#[repr(C)]
pub(crate) struct Placed<M> {
    model: M,
    /// Read instead of the value of a variable without a field. It is NaN, which the check for finite values detects.
    no_number: f64,
    /// Written instead of a variable without a field. `is_missed` then becomes true.
    nowhere: f64,
    is_missed: bool,
    /// Written for a variable whose line has no `bool` after `then`.
    no_mark: bool,
}

impl<M> Placed<M> {
    pub fn new(model: M) -> Self {
        Self { model, no_number: f64::NAN, nowhere: 0.0, is_missed: false, no_mark: false }
    }
}

impl<M: Clone> Clone for Placed<M> {
    fn clone(&self) -> Self {
        Self::new(self.model.clone())
    }

    /// Calls `clone_from` of the model, which may reuse its allocations.
    fn clone_from(&mut self, source: &Self) {
        self.model.clone_from(source);
    }
}

impl<M: Variables> Placed<M> {
    /// Returns the Real of a line; NaN if its value is not a field of the model.
    #[inline(always)]
    pub fn real_in_place(&self, line: u32) -> f64 {
        let offset = self.model.offset_to_read(Index(line), offset_of!(Self, no_number));
        // SAFETY: by the contract of `Variables`, `offset` is the offset of an `f64` in the model, or else the offset
        // of `no_number`.
        unsafe { (&raw const *self).byte_add(offset).cast::<f64>().read() }
    }

    /// Sets the Real of a line, and the `bool` after `then` if the line has one. If either is not inside the model,
    /// sets neither, and [`missed`](Self::missed) returns true.
    #[inline(always)]
    pub fn set_in_place(&mut self, line: u32, value: f64) {
        let without = const { both_offsets(offset_of!(Self, nowhere), offset_of!(Self, is_missed)).unwrap() };
        let offsets = self.model.offsets_to_set(Index(line), offset_of!(Self, no_mark), without);
        let [value_offset, mark] = [offsets as u32, (offsets >> 32) as u32].map(|offset| offset as usize);
        // SAFETY: by the contract of `Variables`, these are the offsets of an `f64` and a `bool` in the model, or
        // else of fields of `Self`.
        unsafe {
            (&raw mut *self).byte_add(value_offset).cast::<f64>().write(value);
            (&raw mut *self).byte_add(mark).cast::<bool>().write(true);
        }
    }

    /// Returns whether [`set_in_place`](Self::set_in_place) has failed since the last call of this function.
    #[inline(always)]
    pub fn missed(&mut self) -> bool {
        self.is_missed && std::mem::take(&mut self.is_missed)
    }
}

impl<M> Deref for Placed<M> {
    type Target = M;

    #[inline(always)]
    fn deref(&self) -> &M {
        &self.model
    }
}

impl<M> DerefMut for Placed<M> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut M {
        &mut self.model
    }
}

/// Returns the offset of a field in the model, in bytes; `otherwise` if it is not an `f64` inside the model.
#[doc(hidden)]
#[inline(always)]
pub fn offset_of_real<M>(model: *const M, field: &impl Place, otherwise: usize) -> usize {
    field.as_real().map_or(otherwise, |real| offset_in(model, real, otherwise))
}

/// Returns both offsets as one number, because the compiler would create two tables for two numbers. Returns `None`
/// if one of the offsets is missing (`usize::MAX`) or too large.
#[doc(hidden)]
#[inline(always)]
pub const fn both_offsets(value: usize, mark: usize) -> Option<u64> {
    let largest = u32::MAX as usize;
    if value < largest && mark < largest { Some(value as u64 | (mark as u64) << 32) } else { None }
}

/// Returns the offset of a field in the model, in bytes; `otherwise` if it is outside of the model, for example on
/// the heap.
#[doc(hidden)]
#[inline(always)]
pub fn offset_in<M, T>(model: *const M, field: *const T, otherwise: usize) -> usize {
    let offset = field.addr().wrapping_sub(model.addr());
    if offset < size_of::<M>() { offset } else { otherwise }
}

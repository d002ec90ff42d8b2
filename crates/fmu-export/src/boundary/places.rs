//! Reals of a model by their offsets: the pointer arithmetic of this crate.
//!
//! The functions that [`variables!`](crate::variables) implements take a reference to a place in the model and return its
//! offset. For paths of fields and elements of arrays the offsets are constants, and the compiler puts them into a table.

use crate::table::Variables;
use crate::value::Place;
use crate::variable::Index;
use std::mem::offset_of;
use std::ops::{Deref, DerefMut};

/// A model, and behind it what is used for a variable without a place in the model.
#[repr(C)]
pub(crate) struct Placed<M> {
    model: M,
    /// Read for a variable that has no place to read. Values are tested for numbers anyway.
    no_number: f64,
    /// Written for a variable that has no place to set, together with `is_missed`.
    nowhere: f64,
    is_missed: bool,
    /// Written for a variable without a mark.
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

    /// Passes on to the model, which may have a way to clone into what is there already.
    fn clone_from(&mut self, source: &Self) {
        self.model.clone_from(source);
    }
}

impl<M: Variables> Placed<M> {
    /// The Real of a line; NaN if it has no place in the model.
    #[inline(always)]
    pub fn real_in_place(&self, line: u32) -> f64 {
        let offset = self.model.offset_to_read(Index(line), offset_of!(Self, no_number));
        // SAFETY: by the contract of `Variables` the offset of an `f64` in the model, or that of `no_number`.
        unsafe { (&raw const *self).byte_add(offset).cast::<f64>().read() }
    }

    /// Sets the Real of a line and its mark, if it has a place in the model; see [`missed`](Self::missed).
    #[inline(always)]
    pub fn set_in_place(&mut self, line: u32, value: f64) {
        let without = const { both_offsets(offset_of!(Self, nowhere), offset_of!(Self, is_missed)).unwrap() };
        let offsets = self.model.offsets_to_set(Index(line), offset_of!(Self, no_mark), without);
        let [place, mark] = [offsets as u32, (offsets >> 32) as u32].map(|offset| offset as usize);
        // SAFETY: by the contract of `Variables` the offsets of an `f64` and a `bool` in the model, or these behind it.
        unsafe {
            (&raw mut *self).byte_add(place).cast::<f64>().write(value);
            (&raw mut *self).byte_add(mark).cast::<bool>().write(true);
        }
    }

    /// Whether a variable that was to be set in its place has none. Asked once.
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

/// The offset of a place in the model, if it is one of an `f64` that is part of the model itself.
#[doc(hidden)]
#[inline(always)]
pub fn offset_of_real<M>(model: *const M, place: &impl Place, otherwise: usize) -> usize {
    place.as_real().map_or(otherwise, |real| offset_in(model, real, otherwise))
}

/// Both as one number: as two they would make two tables. None if there is one of them only.
#[doc(hidden)]
#[inline(always)]
pub const fn both_offsets(place: usize, mark: usize) -> Option<u64> {
    let largest = u32::MAX as usize;
    if place < largest && mark < largest { Some(place as u64 | (mark as u64) << 32) } else { None }
}

/// The offset of a mark in the model, likewise.
#[doc(hidden)]
#[inline(always)]
pub fn offset_in<M, T>(model: *const M, place: *const T, otherwise: usize) -> usize {
    let offset = place.addr().wrapping_sub(model.addr());
    if offset < size_of::<M>() { offset } else { otherwise }
}

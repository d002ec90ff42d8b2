//! The importer's arrays, places and strings.

use crate::export::Exported;
use crate::instance::{Instance, Outcome, Reference, elements_of, refuse};
use fmi_abi::c_types::c_char;
use std::ffi::CStr;
use std::mem::MaybeUninit;

/// The importer's array of `length` values, to be read.
///
/// # Safety
/// `pointer` is NULL or points to `length` values that stay as they are for `'a`.
#[inline]
pub(crate) unsafe fn array<'a, T>(pointer: *const T, length: usize, argument: &str) -> Outcome<&'a [T]> {
    if length == 0 {
        return Ok(&[]);
    }
    check(pointer, length, argument)?;
    // SAFETY: not NULL, aligned, of a possible size; the length is the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts(pointer, length) })
}

/// The importer's array of `length` values, to be written. What is in it before may be anything.
///
/// # Safety
/// `pointer` is NULL or points to `length` values that nobody else uses for `'a`.
#[inline]
pub(crate) unsafe fn output<'a, T>(
    pointer: *mut T,
    length: usize,
    argument: &str,
) -> Outcome<&'a mut [MaybeUninit<T>]> {
    if length == 0 {
        return Ok(&mut []);
    }
    check(pointer, length, argument)?;
    // SAFETY: not NULL, aligned, of a possible size; the length is the caller's promise, and `MaybeUninit` asks for
    // no initialized values.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer.cast(), length) })
}

/// As many values as variables have.
#[inline]
pub(crate) fn same(what: &str, needed: usize, count: usize) -> Outcome {
    if count == needed {
        return Ok(());
    }
    refuse(format!("there are {needed} {what}, the array has {count} elements"))
}

/// Does something with variables that an importer of FMI 3.0 names, in a model with arrays: by the value reference of its
/// first element it means the whole array, of which the values follow each other (section 2.2.7.2).
///
/// # Safety
/// The value references are NULL or an array of this length, which stays as it is.
pub(crate) unsafe fn of_elements<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    vr: *const u32,
    count: usize,
    value_count: usize,
    body: impl FnOnce(&mut Instance<M>, &[u32]) -> Outcome,
) -> Outcome {
    // SAFETY: the caller's promise.
    let vr: &[R] = unsafe { array(R::cast(vr), count, R::REFERENCES) }?;
    same("values", instance.count_elements(vr)?, value_count)?;
    // Out of the instance for as long as it is needed, which gets it back with its memory.
    let mut elements = std::mem::take(&mut instance.elements);
    elements.clear();
    elements.extend(vr.iter().flat_map(|vr| elements_of::<M>(vr.place())));
    let outcome = body(instance, &elements);
    instance.elements = elements;
    outcome
}

/// The importer's place for one value.
///
/// # Safety
/// `pointer` is NULL or points to a value that nobody else uses for `'a`.
pub(crate) unsafe fn place<'a, T>(pointer: *mut T, argument: &str) -> Outcome<&'a mut MaybeUninit<T>> {
    if pointer.is_null() || !pointer.is_aligned() {
        return refuse(format!("the pointer {argument} is NULL or not aligned"));
    }
    // SAFETY: not NULL and aligned; that it points to a value is the caller's promise.
    Ok(unsafe { &mut *pointer.cast() })
}

/// The importer's string.
///
/// # Safety
/// `pointer` is NULL or a string with a zero byte at its end that stays as it is for `'a`.
pub(crate) unsafe fn string<'a>(pointer: *const c_char) -> Option<&'a CStr> {
    // SAFETY: the caller's promise.
    (!pointer.is_null()).then(|| unsafe { CStr::from_ptr(pointer) })
}

#[inline]
fn check<T>(pointer: *const T, length: usize, argument: &str) -> Outcome {
    // In one test: not aligned, or so long that its bytes cannot be counted.
    let odd = pointer.addr() & (align_of::<T>() - 1) | length >> (isize::BITS - 1 - size_of::<T>().ilog2());
    if pointer.is_null() || odd != 0 {
        return refuse_array(pointer, length, argument);
    }
    Ok(())
}

#[cold]
#[inline(never)]
fn refuse_array<T>(pointer: *const T, length: usize, argument: &str) -> Outcome {
    if length >> (isize::BITS - 1 - size_of::<T>().ilog2()) != 0 {
        return refuse(format!("the array {argument} is larger than memory"));
    }
    let fault = if pointer.is_null() { "is NULL" } else { "is not aligned" };
    refuse(format!("the array {argument} {fault}, its length is {length}"))
}

//! Conversion of the importer's pointers to slices, references and strings.

use crate::export::Exported;
use crate::instance::{Instance, Outcome, Reference, elements_of, reject};
use fmi_abi::c_types::c_char;
use std::ffi::CStr;
use std::mem::MaybeUninit;

/// Returns the importer's array of `length` values as a slice to read. Fails if the array is not empty and the pointer
/// is NULL or not aligned, or if the array would be larger than memory; `argument` is the name of the array in the
/// message.
///
/// # Safety
/// `pointer` is NULL or points to `length` values that do not change during `'a`.
#[inline]
pub(crate) unsafe fn in_slice<'a, T>(pointer: *const T, length: usize, argument: &str) -> Outcome<&'a [T]> {
    if length == 0 {
        return Ok(&[]);
    }
    check(pointer, length, argument)?;
    // SAFETY: the pointer is not NULL and is aligned, and the size is possible; the caller guarantees the
    // length.
    Ok(unsafe { std::slice::from_raw_parts(pointer, length) })
}

/// Returns the importer's array of `length` values as a slice to write; see [`in_slice`]. The previous content of the
/// array may be uninitialized.
///
/// # Safety
/// `pointer` is NULL or points to `length` values that no other code uses during `'a`.
#[inline]
pub(crate) unsafe fn out_slice<'a, T>(
    pointer: *mut T,
    length: usize,
    argument: &str,
) -> Outcome<&'a mut [MaybeUninit<T>]> {
    if length == 0 {
        return Ok(&mut []);
    }
    check(pointer, length, argument)?;
    // SAFETY: the pointer is not NULL and is aligned, and the size is possible; the caller guarantees the
    // length. `MaybeUninit` requires no initialized values.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer.cast(), length) })
}

/// Fails if the importer's array of values overlaps another one, because the values would be written over references or seeds that
/// are still needed. Each array is its address, its length and its name for the message.
#[inline]
pub(crate) fn apart<T, U>(
    (pointer, length, name): (*const T, usize, &str),
    (values, count, argument): (*const U, usize, &str),
) -> Outcome {
    // An array does not begin inside of the other one if the distance is at least the size.
    let [begin, other] = [pointer.addr(), values.addr()];
    let [size, written] = [length.wrapping_mul(size_of::<T>()), count.wrapping_mul(size_of::<U>())];
    match other.wrapping_sub(begin) >= size && begin.wrapping_sub(other) >= written {
        true => Ok(()),
        false => {
            let exist = size != 0 && written != 0 && !is_odd(pointer, length) && !is_odd(values, count);
            reject_overlap(exist, name, argument)
        }
    }
}

/// Fails if both arrays exist. One that is not empty and cannot exist has another error, which the caller finds afterwards.
#[cold]
#[inline(never)]
fn reject_overlap(exist: bool, name: &str, argument: &str) -> Outcome {
    if exist { reject(format!("the arrays {name} and {argument} overlap")) } else { Ok(()) }
}

/// Checks that an array of `count` elements has the `needed` length; `what` describes the elements in the message.
#[inline]
pub(crate) fn same(what: &str, needed: usize, count: usize) -> Outcome {
    if count == needed { Ok(()) } else { reject_length(what, needed, count) }
}

#[cold]
#[inline(never)]
fn reject_length(what: &str, needed: usize, count: usize) -> Outcome {
    reject(format!("there are {needed} {what}, the array has {count} elements"))
}

/// Reserves memory for `count` more elements. Because the length comes from the importer, missing memory is an error of
/// the call. Call this only after the references have been checked: a wrong length then costs no memory.
pub(crate) fn reserve<T>(elements: &mut Vec<T>, count: usize) -> Outcome {
    match elements.try_reserve(count) {
        Ok(()) => Ok(()),
        Err(_) => reject(format!("there is no memory for {count} values")),
    }
}

/// Calls `body` with the indices of all elements of variables of FMI 3.0. The value reference of the first element
/// denotes the whole array, and the values of an array are contiguous (section 2.2.7.2 of FMI 3.0).
///
/// # Safety
/// `vr` is NULL or points to `count` value references, which do not change during the call.
pub(crate) unsafe fn of_elements<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    vr: *const u32,
    count: usize,
    value_count: usize,
    body: impl FnOnce(&mut Instance<M>, &[u32]) -> Outcome,
) -> Outcome {
    // SAFETY: the caller guarantees the array and its length.
    let vr: &[R] = unsafe { in_slice(R::cast(vr), count, R::REFERENCES) }?;
    instance.check_references(vr)?;
    same("values", instance.count_elements(vr)?, value_count)?;
    // Moved out so that `body` can borrow the instance; moved back to reuse the allocation.
    let mut elements = std::mem::take(&mut instance.elements);
    elements.clear();
    reserve(&mut elements, value_count)?;
    elements.extend(vr.iter().flat_map(|vr| elements_of::<M>(vr.index())));
    let outcome = body(instance, &elements);
    instance.elements = elements;
    outcome
}

/// Returns the importer's memory for one value. Fails if the pointer is NULL or not aligned; `argument` is the name of
/// the pointer in the message.
///
/// # Safety
/// `pointer` is NULL or points to a value that no other code uses during `'a`.
pub(crate) unsafe fn out_value<'a, T>(pointer: *mut T, argument: &str) -> Outcome<&'a mut MaybeUninit<T>> {
    if pointer.is_null() || !pointer.is_aligned() {
        return reject(format!("the pointer {argument} is NULL or not aligned"));
    }
    // SAFETY: the pointer is not NULL and is aligned; the caller guarantees that it points to a value.
    Ok(unsafe { &mut *pointer.cast() })
}

/// Returns the importer's string; `None` for NULL.
///
/// # Safety
/// `pointer` is NULL or a NUL-terminated string that does not change during `'a`.
pub(crate) unsafe fn string<'a>(pointer: *const c_char) -> Option<&'a CStr> {
    // SAFETY: the caller guarantees a string if the pointer is not NULL.
    (!pointer.is_null()).then(|| unsafe { CStr::from_ptr(pointer) })
}

#[inline]
fn check<T>(pointer: *const T, length: usize, argument: &str) -> Outcome {
    if pointer.is_null() || is_odd(pointer, length) {
        return reject_array(pointer, length, argument);
    }
    Ok(())
}

/// Returns whether the pointer is not aligned, or the size in bytes overflows `isize`.
#[inline]
fn is_odd<T>(pointer: *const T, length: usize) -> bool {
    pointer.addr() & (align_of::<T>() - 1) | length >> (isize::BITS - 1 - size_of::<T>().ilog2()) != 0
}

#[cold]
#[inline(never)]
fn reject_array<T>(pointer: *const T, length: usize, argument: &str) -> Outcome {
    if length >> (isize::BITS - 1 - size_of::<T>().ilog2()) != 0 {
        return reject(format!("the array {argument} is larger than memory"));
    }
    let fault = if pointer.is_null() { "is NULL" } else { "is not aligned" };
    reject(format!("the array {argument} {fault}, its length is {length}"))
}

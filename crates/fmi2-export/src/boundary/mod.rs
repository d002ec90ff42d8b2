//! The C boundary: the only place with pointers and `unsafe`.
//!
//! Each function of the C interface exists here once, generic over the model and under its C name;
//! [`export_fmi2!`](crate::export_fmi2) gives them their symbols. All do the same: check the pointers,
//! ask the table of allowed calls, run the method of `Instance`, and turn a refusal or a panic into a
//! status and a log message. No panic leaves this module.
//!
//! # Safety
//!
//! All functions share one contract with the importer, the standard's:
//! * a component is NULL or comes from `fmi2Instantiate` of this library, with the same model, and has
//!   not been freed; it is not used by two threads at once;
//! * a saved state is NULL or comes from `fmi2GetFMUstate` or `fmi2DeSerializeFMUstate` of this
//!   library, with the same model, and has not been freed;
//! * a pointer with a length is NULL or points to that many values; a pointer to one value is NULL or
//!   points to one; strings end with a zero byte; arrays that are written do not overlap others, and hold
//!   whatever the importer's memory holds before (numbers, for which any bits will do);
//! * the callbacks work until the instance is freed.
#![allow(non_snake_case)]
#![allow(clippy::missing_safety_doc, reason = "the contract above is that of every function")]

mod co_simulation;
mod common;
mod model_exchange;

pub use co_simulation::*;
pub use common::*;
pub use model_exchange::*;

use crate::call_table::Function;
use crate::logger::Sink;
use crate::model::Model;
use crate::refusal::{Outcome, Refusal, refuse};
use crate::types::*;
use std::any::Any;
use std::ffi::CStr;
use std::panic::{AssertUnwindSafe, catch_unwind};

#[cfg(panic = "abort")]
compile_error!("an FMU must not end the importer's process: build with panic = \"unwind\"");

pub(crate) type Instance<M> = crate::instance::Instance<M, ImporterLog>;

/// The importer's log callback and what it wants back with every call. Copied, because the callbacks
/// structure may go after `fmi2Instantiate`.
pub(crate) struct ImporterLog {
    logger: Option<fmi2CallbackLogger>,
    environment: fmi2ComponentEnvironment,
}

impl Sink for ImporterLog {
    fn deliver(&self, instance_name: &CStr, status: Status, category: &CStr, message: &CStr) {
        if let Some(logger) = self.logger {
            // SAFETY: the importer's promise that the logger works until the instance is freed; all
            // strings end with a zero byte, and the message holds no format directive that would ask
            // for further arguments.
            unsafe {
                logger(self.environment, instance_name.as_ptr(), status, category.as_ptr(), message.as_ptr())
            }
        }
    }
}

/// Runs a function's body on the instance behind `c` if the table of allowed calls has it.
///
/// # Safety
/// `c` as in the module's contract.
#[inline]
unsafe fn call<M: Model>(
    c: fmi2Component,
    function: Function,
    body: impl FnOnce(&mut Instance<M>) -> Outcome,
) -> Status {
    // SAFETY: by contract NULL or a living instance of this model that no one else uses now.
    let Some(instance) = (unsafe { c.cast::<Instance<M>>().as_mut() }) else {
        return Status::Error;
    };
    let outcome = catch_unwind(AssertUnwindSafe(|| {
        instance.check_call(function)?;
        body(&mut *instance)
    }));
    match outcome {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(refusal)) => refused(instance, function, &refusal),
        Err(panic) => broke_down(instance, function, &*panic),
    }
}

#[cold]
#[inline(never)]
fn refused<M: Model>(instance: &Instance<M>, function: Function, refusal: &Refusal) -> Status {
    let _ = catch_unwind(AssertUnwindSafe(|| instance.log_refusal(function, refusal)));
    refusal.status
}

#[cold]
#[inline(never)]
fn broke_down<M: Model>(instance: &mut Instance<M>, function: Function, panic: &(dyn Any + Send)) -> Status {
    let _ = catch_unwind(AssertUnwindSafe(|| instance.break_down(function, panic_message(panic))));
    Status::Fatal
}

fn panic_message(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}

/// The importer's array of `length` values.
///
/// # Safety
/// `pointer` is NULL or points to `length` values that stay as they are for `'a`.
#[inline]
unsafe fn slice<'a, T>(pointer: *const T, length: usize, argument: &str) -> Outcome<&'a [T]> {
    if length == 0 {
        return Ok(&[]);
    }
    check_array(pointer, length, argument)?;
    // SAFETY: not NULL, aligned, of a possible size; the length is the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts(pointer, length) })
}

/// The importer's array of `length` values, to be written.
///
/// # Safety
/// `pointer` is NULL or points to `length` values that nobody else uses for `'a`.
#[inline]
unsafe fn slice_mut<'a, T>(pointer: *mut T, length: usize, argument: &str) -> Outcome<&'a mut [T]> {
    if length == 0 {
        return Ok(&mut []);
    }
    check_array(pointer, length, argument)?;
    // SAFETY: not NULL, aligned, of a possible size; the length is the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, length) })
}

#[inline]
fn check_array<T>(pointer: *const T, length: usize, argument: &str) -> Outcome {
    if pointer.is_null() || !pointer.is_aligned() || length > isize::MAX as usize / size_of::<T>() {
        return refuse_array(pointer, length, argument);
    }
    Ok(())
}

#[cold]
fn refuse_array<T>(pointer: *const T, length: usize, argument: &str) -> Outcome {
    let fault = if pointer.is_null() {
        "is NULL"
    } else if !pointer.is_aligned() {
        "is not aligned"
    } else {
        "is larger than memory"
    };
    refuse(format!("the array {argument} {fault}, its length is {length}"))
}

/// Writes one value where the importer wants it.
///
/// # Safety
/// `pointer` is NULL or points to a value.
#[inline]
unsafe fn write<T>(pointer: *mut T, value: T, argument: &str) -> Outcome {
    if pointer.is_null() || !pointer.is_aligned() {
        return refuse(format!("the pointer {argument} is NULL or not aligned"));
    }
    // SAFETY: not NULL and aligned; that it points to a value is the caller's promise.
    unsafe { pointer.write(value) };
    Ok(())
}

/// The importer's string.
///
/// # Safety
/// `pointer` is NULL or a string with a zero byte at its end that stays as it is for `'a`.
unsafe fn string<'a>(pointer: fmi2String) -> Option<&'a CStr> {
    // SAFETY: the caller's promise.
    (!pointer.is_null()).then(|| unsafe { CStr::from_ptr(pointer) })
}

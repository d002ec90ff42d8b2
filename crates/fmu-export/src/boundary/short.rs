//! Fast paths of the C functions that an importer calls for every step. They have the arguments of the C functions; the
//! macro [`call`] lists which functions have which fast paths.
//!
//! Each function either does all the work and returns true, or writes nothing into the importer's memory and returns
//! false. In the latter case, the general path handles the call and reports errors. Both paths make equivalent
//! checks.
//!
//! Because this code is unsafe and hard to read, each part must save at least 15 of the about 360 instructions that a
//! step takes. The savings were counted on the testbed with `make instructions`, by removing one part at a time:
//!
//! | part | use | instructions saved |
//! |---|---|---|
//! | get Reals | four outputs in one call; one output per call | 80; 176 |
//! | set Reals | two angles in one call; one angle per call | 61; 90 |
//! | step of the last size | a step | 34 |
//! | step of any size | a step of one of four alternating sizes | 31 |
//! | other array lengths: 1 and 2 for getting, 1 for setting | one scalar per call | 216 for outputs, 112 for angles |
//!
//! Getting and setting access fields by the offsets of [`offsets`](crate::offsets). Two more parts stored results in
//! additional fields: the allowed state once the model has started, and the latest end of a step. They saved only 6
//! instructions, so they were removed.
//!
//! # Safety
//! The contract of the C functions also applies to these functions.
#![allow(clippy::missing_safety_doc, reason = "every function has the contract above")]
#![allow(clippy::too_many_arguments, reason = "the FMI standard defines the arguments")]

use crate::export::Exported;
use crate::instance::{FromOne, Instance, Reference};
use fmi_abi::fmi3::types::fmi3Boolean;
use std::mem::MaybeUninit;

/// Returns whether the pointers can be arrays of `count` elements: they are not NULL and are aligned, and the arrays
/// are neither empty nor larger than memory.
#[inline(always)]
fn are_arrays(vr: *const u32, values: *const f64, count: usize) -> bool {
    // The subtraction turns NULL and a length of 0 into -1, so that their highest bits are set, as in the address or
    // length of an array that cannot exist. References have half the size of values, so their address is doubled for
    // the test of alignment.
    let highest = vr.addr().wrapping_sub(1) | values.addr().wrapping_sub(1) | count.wrapping_sub(1);
    let lowest = (vr.addr() << 1 | values.addr()) & (size_of::<f64>() - 1);
    highest >> (usize::BITS - 5) | lowest == 0
}

#[inline(always)]
unsafe fn get<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    vr: *const u32,
    values: *mut f64,
    count: usize,
) -> bool {
    let (references, indices): (_, *mut MaybeUninit<f64>) = (R::cast(vr), values.cast());
    // SAFETY: both arrays are not NULL, are aligned, and have `count` elements by contract. `MaybeUninit`
    // requires no initialized values.
    unsafe {
        match count {
            _ if !are_arrays(vr, values, count) => false,
            4 => instance.get_reals_fast::<R, 4>(&*references.cast(), &mut *indices.cast()),
            1 => instance.get_reals_fast::<R, 1>(&*references.cast(), &mut *indices.cast()),
            2 => instance.get_reals_fast::<R, 2>(&*references.cast(), &mut *indices.cast()),
            _ => false,
        }
    }
}

#[inline(always)]
unsafe fn set<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    vr: *const u32,
    values: *const f64,
    count: usize,
) -> bool {
    let references = R::cast(vr);
    // SAFETY: both arrays are not NULL, are aligned, and have `count` elements by contract.
    unsafe {
        match count {
            _ if !are_arrays(vr, values, count) => false,
            2 => instance.set_reals_fast::<R, 2>(&*references.cast(), &*values.cast()),
            1 => instance.set_reals_fast::<R, 1>(&*references.cast(), &*values.cast()),
            _ => false,
        }
    }
}

#[inline(always)]
pub(crate) unsafe fn get_reals<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const u32,
    count: usize,
    values: *mut f64,
) -> bool {
    // SAFETY: the caller guarantees the contract.
    unsafe { get::<M, u32>(instance, vr, values, count) }
}

#[inline(always)]
pub(crate) unsafe fn set_reals<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const u32,
    count: usize,
    values: *const f64,
) -> bool {
    // SAFETY: the caller guarantees the contract.
    unsafe { set::<M, u32>(instance, vr, values, count) }
}

#[inline(always)]
pub(crate) unsafe fn get_float64s<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const u32,
    count: usize,
    values: *mut f64,
    value_count: usize,
) -> bool {
    // SAFETY: the caller guarantees the contract.
    value_count == count && unsafe { get::<M, FromOne>(instance, vr, values, count) }
}

#[inline(always)]
pub(crate) unsafe fn set_float64s<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const u32,
    count: usize,
    values: *const f64,
    value_count: usize,
) -> bool {
    // SAFETY: the caller guarantees the contract.
    value_count == count && unsafe { set::<M, FromOne>(instance, vr, values, count) }
}

/// A step of the last size in FMI 2.0.
#[inline(always)]
pub(crate) unsafe fn step<M: Exported>(
    instance: &mut Instance<M>,
    point: f64,
    size: f64,
    _no_set_fmu_state_prior_to_current_point: i32,
) -> bool {
    instance.step_fast(point, size)
}

/// A step of any size in FMI 2.0. It is separate, because it calls a function that is not inlined, for which the fast path of
/// a step of the last size would have to save registers.
#[inline(always)]
pub(crate) unsafe fn step_any_size<M: Exported>(
    instance: &mut Instance<M>,
    point: f64,
    size: f64,
    _no_set_fmu_state_prior_to_current_point: i32,
) -> bool {
    instance.step_any_size(point, size)
}

/// A step of the last size in FMI 3.0.
#[inline(always)]
pub(crate) unsafe fn fmi3_step<M: Exported>(
    instance: &mut Instance<M>,
    point: f64,
    size: f64,
    _no_set_fmu_state_prior_to_current_point: fmi3Boolean,
    event_handling_needed: *mut fmi3Boolean,
    terminate_simulation: *mut fmi3Boolean,
    early_return: *mut fmi3Boolean,
    last_successful_time: *mut f64,
) -> bool {
    let flags = [event_handling_needed, terminate_simulation, early_return];
    // SAFETY: the caller guarantees the contract.
    unsafe { step_to(flags, last_successful_time, point + size, || instance.step_fast(point, size)) }
}

/// A step of any size in FMI 3.0.
#[inline(always)]
pub(crate) unsafe fn fmi3_step_any_size<M: Exported>(
    instance: &mut Instance<M>,
    point: f64,
    size: f64,
    _no_set_fmu_state_prior_to_current_point: fmi3Boolean,
    event_handling_needed: *mut fmi3Boolean,
    terminate_simulation: *mut fmi3Boolean,
    early_return: *mut fmi3Boolean,
    last_successful_time: *mut f64,
) -> bool {
    let flags = [event_handling_needed, terminate_simulation, early_return];
    // SAFETY: the caller guarantees the contract.
    unsafe { step_to(flags, last_successful_time, point + size, || instance.step_any_size(point, size)) }
}

/// Makes a step, if no pointer is NULL and all are aligned. If `step` succeeds, it has reached its end without an
/// event, so all flags are false and the last successful time is `end`.
#[inline(always)]
unsafe fn step_to(
    flags: [*mut fmi3Boolean; 3],
    last_successful_time: *mut f64,
    end: f64,
    step: impl FnOnce() -> bool,
) -> bool {
    // The tests are the same as in `are_arrays`.
    let [highest1, highest2, highest3] = flags.map(|flag| flag.addr().wrapping_sub(1));
    let highest = highest1 | highest2 | highest3 | last_successful_time.addr().wrapping_sub(1);
    let lowest = last_successful_time.addr() & (align_of::<f64>() - 1);
    if highest >> (usize::BITS - 5) | lowest != 0 || !step() {
        return false;
    }
    // SAFETY: the pointers are not NULL and are aligned; by contract, they point to values.
    unsafe {
        for flag in flags {
            flag.write(false.into());
        }
        last_successful_time.write(end);
    }
    true
}

/// Calls the body of a function for model `M`. If the function has fast paths, tries them first: the names in
/// brackets, in this order, after whether they call the model to make a step.
macro_rules! call {
    (fmi2GetReal $arguments:tt) => { $crate::boundary::short::call!(@fast false [get_reals] fmi2GetReal $arguments) };
    (fmi2SetReal $arguments:tt) => { $crate::boundary::short::call!(@fast false [set_reals] fmi2SetReal $arguments) };
    (fmi2DoStep $arguments:tt) => { $crate::boundary::short::call!(@fast true [step step_any_size] fmi2DoStep $arguments) };
    (fmi3GetFloat64 $arguments:tt) => { $crate::boundary::short::call!(@fast false [get_float64s] fmi3GetFloat64 $arguments) };
    (fmi3SetFloat64 $arguments:tt) => { $crate::boundary::short::call!(@fast false [set_float64s] fmi3SetFloat64 $arguments) };
    (fmi3DoStep $arguments:tt) => { $crate::boundary::short::call!(@fast true [fmi3_step fmi3_step_any_size] fmi3DoStep $arguments) };
    (@fast $steps:literal [] $function:ident ($c:ident $(, $argument:ident: $type:ty)*)) => {
        $crate::boundary::call::<M>($c, Function::$function.rule(), |instance| {
            bodies::$function(instance $(, $argument)*)
        })
    };
    (@fast $steps:literal [$path:ident $($rest:ident)*] $function:ident ($c:ident $(, $argument:ident: $type:ty)*)) => {{
        // The rest is a separate function, so that the fast path needs no stack space for it.
        #[inline(never)]
        unsafe fn otherwise<M: $crate::Exported>(
            $c: *mut fmi_abi::c_types::c_void
            $(, $argument: $type)*
        ) -> fmi_abi::Status {
            // SAFETY: the caller guarantees the contract.
            unsafe {
                $crate::boundary::short::call!(@fast $steps [$($rest)*] $function($c $(, $argument: $type)*))
            }
        }
        let fast_path = move |instance: *mut $crate::instance::Instance<M>| {
            $crate::boundary::short::$path(&mut *instance $(, $argument)*)
        };
        match $crate::boundary::call_fast::<M, $steps>($c, Function::$function.rule(), fast_path) {
            Some(status) => status,
            None => otherwise::<M>($c $(, $argument)*),
        }
    }};
    ($function:ident $arguments:tt) => { $crate::boundary::short::call!(@fast false [] $function $arguments) };
}
pub(crate) use call;

/// Defines the C functions of an FMI version, generic over the model and under their C names, and `functions`, which
/// returns pointers to all of them.
macro_rules! c_functions {
    (
        $standard:ident $handle:ident
        without an instance { $($free:ident($($free_argument:ident: $free_type:ty),*) -> $result:ty;)+ }
        with an instance {
            $($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+
        }
    ) => {
        $(
            #[doc = concat!("`", stringify!($function), "`, for model `M`.")]
            #[inline]
            pub unsafe extern "C" fn $function<M: $crate::Exported>(
                c: $handle
                $(, $argument: $type)*
            ) -> fmi_abi::c_types::c_int {
                // SAFETY: the importer guarantees the contract of this module for the instance and all
                // arguments.
                let status = unsafe { $crate::boundary::short::call!($function(c $(, $argument: $type)*)) };
                status as _
            }
        )+

        /// Returns the functions of a model in this program, as an importer loads them from a library.
        pub fn functions<M: $crate::Exported>() -> Functions {
            Functions { $($free: $free::<M>,)+ $($function: $function::<M>,)+ }
        }
    };
}
pub(crate) use c_functions;

//! FMI 3.0: C types, allowed calls, C functions, in the same form as [`fmi2`](crate::fmi2).
//!
//! A model needs nothing for it: the variables are those of FMI 2.0, the instantiation token is the guid. What FMI 3.0
//! has more is refused, with the reason: arrays, clocks, structural parameters, intermediate update and Scheduled
//! Execution.
//!
//! Every model has a time, as the standard asks for: the independent variable of the table, or one behind all others
//! ([`independent`]). Behind it there is a local variable for each event indicator ([`indicator`]).
//!
//! [Value references](reference()) count from 1 in the order of the variables: OMSimulator 3.0.0 takes those of
//! dependencies for places in the list, which count from 1 in FMI 2.0, and both readings lead to the same variable.
//!
//! # Safety
//!
//! The contract with the importer is that of [`fmi2`](crate::fmi2), with an instance in place of a component. Bytes of
//! an `fmi3Binary` are NULL or as many as their size says. Truth values are bytes here: C callers may pass any.
#![allow(non_snake_case)]
#![allow(clippy::missing_safety_doc, reason = "the contract above is that of every function")]
#![allow(clippy::too_many_arguments, reason = "as many as the standard has")]

// Before those that use its list.
#[macro_use]
mod functions;

mod absent;
mod co_simulation;
mod common;
mod instances;
mod model_exchange;
mod pointers;
pub mod types;
mod values;

pub use functions::{ALLOWED, Function};
pub use instances::{
    fmi3FreeInstance, fmi3GetVersion, fmi3InstantiateCoSimulation, fmi3InstantiateModelExchange,
    fmi3InstantiateScheduledExecution,
};
pub use pointers::Functions;

use crate::boundary::call;
use crate::export::Exported;
use crate::instance::Reference;
use crate::mode::Standard;
use crate::table::Variables;
use crate::variable::Variable;
use types::*;

/// The value reference of the variable at this place of the table, or behind it.
pub const fn reference(place: u32) -> fmi3ValueReference {
    Standard::Fmi3.reference(place)
}

/// A [value reference](reference()) as an importer passes it.
#[derive(Clone, Copy)]
#[repr(transparent)]
struct FromOne(fmi3ValueReference);

impl Reference for FromOne {
    #[inline]
    fn place(self) -> u32 {
        self.0.wrapping_sub(reference(0))
    }
}

/// The independent variable with its place: that in the table, or that of `time`, the first behind it.
pub fn independent<M: Variables>() -> (u32, &'static Variable<M>) {
    crate::instance::independent::<M>()
}

/// The place of an event indicator, counted from 0: behind the table and the time.
pub fn indicator<M: Variables>(number: usize) -> u32 {
    crate::instance::first_indicator::<M>() + number as u32
}

/// The C functions: what every call has in common, around the bodies in the files of this folder.
macro_rules! c_functions {
    ($($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+) => {
        $(
            #[doc = concat!("`", stringify!($function), "`, for model `M`.")]
            #[inline]
            pub unsafe extern "C" fn $function<M: Exported>(c: fmi3Instance $(, $argument: $type)*) -> Status {
                // SAFETY: the importer keeps the contract of this module, for the component and all arguments.
                unsafe {
                    call::<M>(c, Function::$function.rule(), |instance| bodies::$function(instance $(, $argument)*))
                }
            }
        )+
    };
}

fmi3_functions!(c_functions);

/// What the functions do, each under its C name.
mod bodies {
    pub(super) use super::absent::*;
    pub(super) use super::co_simulation::*;
    pub(super) use super::common::*;
    pub(super) use super::model_exchange::*;
    pub(super) use super::values::*;
}

/// The symbols of the library for a model.
#[doc(hidden)]
#[macro_export]
macro_rules! fmi3_symbols {
    ($model:ty) => {
        // All that the module below knows of the author's crate, where anything may be called like FMI's types.
        #[doc(hidden)]
        #[allow(non_camel_case_types)]
        type __fmi3_model = $model;

        /// The C functions of FMI 3.0.
        #[doc(hidden)]
        #[allow(unsafe_code, non_snake_case, missing_docs, clippy::missing_safety_doc)]
        pub mod fmi3_functions {
            use super::__fmi3_model;
            use $crate::fmi3::types::*;

            #[unsafe(no_mangle)]
            pub extern "C" fn fmi3GetVersion() -> fmi3String {
                $crate::fmi3::fmi3GetVersion()
            }

            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmi3FreeInstance(c: fmi3Instance) {
                // SAFETY: the importer keeps the contract of fmu_export::fmi3.
                unsafe { $crate::fmi3::fmi3FreeInstance::<__fmi3_model>(c) }
            }

            $crate::fmi3_symbols!(@make __fmi3_model;
                fmi3InstantiateModelExchange(
                    instance_name: fmi3String, token: fmi3String, resources: fmi3String, visible: fmi3Boolean,
                    logging_on: fmi3Boolean, environment: fmi3InstanceEnvironment,
                    log: Option<fmi3LogMessageCallback>
                );
                fmi3InstantiateCoSimulation(
                    instance_name: fmi3String, token: fmi3String, resources: fmi3String, visible: fmi3Boolean,
                    logging_on: fmi3Boolean, event_mode: fmi3Boolean, early_return: fmi3Boolean,
                    required: *const fmi3ValueReference, n: usize, environment: fmi3InstanceEnvironment,
                    log: Option<fmi3LogMessageCallback>, update: Option<fmi3IntermediateUpdateCallback>
                );
                fmi3InstantiateScheduledExecution(
                    instance_name: fmi3String, token: fmi3String, resources: fmi3String, visible: fmi3Boolean,
                    logging_on: fmi3Boolean, environment: fmi3InstanceEnvironment,
                    log: Option<fmi3LogMessageCallback>, update: Option<fmi3ClockUpdateCallback>,
                    lock: Option<fmi3LockPreemptionCallback>, unlock: Option<fmi3UnlockPreemptionCallback>
                );
            );

            $crate::fmi3_functions!($crate::fmi3_symbols, @each __fmi3_model;);
        }
    };
    (@make $model:ty; $($function:ident($($argument:ident: $type:ty),*);)+) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $function($($argument: $type),*) -> fmi3Instance {
                // SAFETY: the importer keeps the contract of fmu_export::fmi3.
                unsafe { $crate::fmi3::$function::<$model>($($argument),*) }
            }
        )+
    };
    (
        @each $model:ty;
        $($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+
    ) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $function(c: fmi3Instance $(, $argument: $type)*) -> Status {
                // SAFETY: the importer keeps the contract of fmu_export::fmi3.
                unsafe { $crate::fmi3::$function::<$model>(c $(, $argument)*) }
            }
        )+
    };
}

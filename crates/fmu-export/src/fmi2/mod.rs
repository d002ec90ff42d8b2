//! FMI 2.0: C types, allowed calls, C functions. The only place with pointers and `unsafe`.
//!
//! Each C function exists once, generic over the model and under its C name. Those that work on an instance are all
//! called in the same way (`boundary`): find the instance, ask the table of allowed calls, run the function's body,
//! turn a refusal or a panic into a status, deliver what is to be logged. No panic leaves this module.
//!
//! # Safety
//!
//! All functions share one contract with the importer, the standard's:
//! * a component is NULL or comes from `fmi2Instantiate` of this library, with the same model, and has not been freed;
//!   it is not used by two threads at once (the log callback may try: it is refused);
//! * the handle that `fmi2GetFMUstate`, `fmi2DeSerializeFMUstate` and `fmi2FreeFMUstate` are given a pointer to is
//!   initialized: NULL before it is used first (section 2.1.8). What it points to does not matter: a handle that is none
//!   of a state of this instance is refused, not followed;
//! * a pointer with a length is NULL or points to that many values; a pointer to one value is NULL or points to one;
//!   strings end with a zero byte; arrays that are written do not overlap others; they may hold anything before, memory
//!   that was never written as well;
//! * the callbacks work until the instance is freed.
#![allow(non_snake_case)]
#![allow(clippy::missing_safety_doc, reason = "the contract above is that of every function")]

// Before those that use its list.
#[macro_use]
mod functions;

mod co_simulation;
mod common;
mod instances;
mod model_exchange;
mod pointers;
pub mod types;

pub use functions::{ALLOWED, Function};
pub use instances::{fmi2FreeInstance, fmi2GetTypesPlatform, fmi2GetVersion, fmi2Instantiate};
pub use pointers::Functions;

#[cfg(target_family = "wasm")]
pub use crate::boundary::webassembly::{broken, room};

use crate::boundary::call;
use crate::export::Exported;
use types::*;

/// The C functions: what every call has in common, around the bodies in the files of this folder.
macro_rules! c_functions {
    ($($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+) => {
        $(
            #[doc = concat!("`", stringify!($function), "`, for model `M`.")]
            #[inline]
            pub unsafe extern "C" fn $function<M: Exported>(c: fmi2Component $(, $argument: $type)*) -> Status {
                // SAFETY: the importer keeps the contract of this module, for the component and all arguments.
                unsafe {
                    call::<M>(c, Function::$function.rule(), |instance| bodies::$function(instance $(, $argument)*))
                }
            }
        )+
    };
}

fmi2_functions!(c_functions);

/// What the functions do, each under its C name.
mod bodies {
    pub(super) use super::co_simulation::*;
    pub(super) use super::common::*;
    pub(super) use super::model_exchange::*;
}

/// The symbols of the library for a model.
#[doc(hidden)]
#[macro_export]
macro_rules! fmi2_symbols {
    ($model:ty) => {
        // All that the module below knows of the author's crate, where anything may be called like FMI's types.
        #[doc(hidden)]
        #[allow(non_camel_case_types)]
        type __fmi2_model = $model;

        /// The C functions of FMI 2.0.
        #[doc(hidden)]
        #[allow(unsafe_code, non_snake_case, missing_docs, clippy::missing_safety_doc)]
        pub mod fmi2_functions {
            use super::__fmi2_model;
            use $crate::fmi2::types::*;

            #[unsafe(no_mangle)]
            pub extern "C" fn fmi2GetTypesPlatform() -> fmi2String {
                $crate::fmi2::fmi2GetTypesPlatform()
            }

            #[unsafe(no_mangle)]
            pub extern "C" fn fmi2GetVersion() -> fmi2String {
                $crate::fmi2::fmi2GetVersion()
            }

            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmi2Instantiate(
                instance_name: fmi2String,
                fmu_type: fmi2Type,
                guid: fmi2String,
                resource_location: fmi2String,
                functions: *const fmi2CallbackFunctions,
                visible: fmi2Boolean,
                logging_on: fmi2Boolean,
            ) -> fmi2Component {
                // SAFETY: the importer keeps the contract of fmu_export::fmi2.
                unsafe {
                    $crate::fmi2::fmi2Instantiate::<__fmi2_model>(
                        instance_name,
                        fmu_type,
                        guid,
                        resource_location,
                        functions,
                        visible,
                        logging_on,
                    )
                }
            }

            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmi2FreeInstance(c: fmi2Component) {
                // SAFETY: the importer keeps the contract of fmu_export::fmi2.
                unsafe { $crate::fmi2::fmi2FreeInstance::<__fmi2_model>(c) }
            }

            $crate::fmi2_functions!($crate::fmi2_symbols, @each __fmi2_model;);

            /// See `fmu_export::fmi2::room`.
            #[cfg(target_family = "wasm")]
            #[unsafe(no_mangle)]
            pub extern "C" fn fmu_room(size: usize) -> fmi2Component {
                $crate::fmi2::room(size)
            }

            /// See `fmu_export::fmi2::broken`.
            #[cfg(target_family = "wasm")]
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmu_broken(c: fmi2Component, function: fmi2String, reason: fmi2String) -> Status {
                // SAFETY: the C around the module keeps the contract of this function.
                unsafe { $crate::fmi2::broken::<__fmi2_model>(c, function, reason) }
            }
        }
    };
    (
        @each $model:ty;
        $($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+
    ) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $function(c: fmi2Component $(, $argument: $type)*) -> Status {
                // SAFETY: the importer keeps the contract of fmu_export::fmi2.
                unsafe { $crate::fmi2::$function::<$model>(c $(, $argument)*) }
            }
        )+
    };
}

//! The C functions of both standards: what every call has in common around their bodies, and the symbols of a library.

/// The C functions of a standard, generic over the model and under their C names, and pointers to all of them.
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
                // SAFETY: the importer keeps the contract of this module, for the instance and all arguments.
                let status = unsafe { $crate::boundary::short::call!($function(c $(, $argument: $type)*)) };
                status as _
            }
        )+

        /// The functions of a model in this program, as an importer has those of a library.
        pub fn functions<M: $crate::Exported>() -> Functions {
            Functions { $($free: $free::<M>,)+ $($function: $function::<M>,)+ }
        }
    };
}
pub(crate) use c_functions;

/// The symbols of the library for a model: the functions of both standards, and one that describes the model to the program
/// that makes its FMU.
#[doc(hidden)]
#[macro_export]
macro_rules! symbols {
    ($model:ty) => {
        // All that the modules below know of the author's crate, where anything may be called like FMI's types.
        #[doc(hidden)]
        #[allow(non_camel_case_types)]
        type __fmu_model = $model;

        /// The C functions of FMI 2.0.
        #[doc(hidden)]
        #[allow(unsafe_code, non_snake_case, missing_docs, clippy::missing_safety_doc)]
        pub mod fmi2_functions {
            use super::__fmu_model;
            use $crate::fmi2::types::*;

            $crate::fmi2_functions!($crate::symbols, @each fmi2 __fmu_model;);

            /// See `fmu_export::fmi2::room`.
            #[cfg(target_family = "wasm")]
            #[unsafe(no_mangle)]
            pub extern "C" fn fmu_room(size: usize) -> fmi2Component {
                $crate::fmi2::room(size)
            }

            /// See `fmu_export::fmi2::broken`.
            #[cfg(target_family = "wasm")]
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmu_broken(
                c: fmi2Component,
                function: fmi2String,
                reason: fmi2String,
            ) -> fmi2Status {
                // SAFETY: the C around the module keeps the contract of this function.
                unsafe { $crate::fmi2::broken::<__fmu_model>(c, function, reason) as _ }
            }
        }

        /// The C functions of FMI 3.0. C sources are made of FMI 2.0 alone.
        #[doc(hidden)]
        #[cfg(not(target_family = "wasm"))]
        #[allow(unsafe_code, non_snake_case, missing_docs, clippy::missing_safety_doc)]
        pub mod fmi3_functions {
            use super::__fmu_model;
            use $crate::fmi3::types::*;

            $crate::fmi3_functions!($crate::symbols, @each fmi3 __fmu_model;);

            /// See `fmu_export::pass_description`.
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmu_export_description(
                receive: $crate::Receive,
                context: *mut ::core::ffi::c_void,
            ) {
                // SAFETY: the caller keeps the contract of this function.
                unsafe { $crate::pass_description::<__fmu_model>(receive, context) }
            }
        }
    };
    (
        @each $module:ident $model:ty;
        $standard:ident $handle:ident
        without an instance { $($free:ident($($free_argument:ident: $free_type:ty),*) -> $result:ty;)+ }
        with an instance {
            $($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+
        }
    ) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $free($($free_argument: $free_type),*) -> $result {
                // SAFETY: the importer keeps the contract of the standard's module in fmu_export.
                unsafe { $crate::$module::$free::<$model>($($free_argument),*) }
            }
        )+
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $function(c: $handle $(, $argument: $type)*) -> ::core::ffi::c_int {
                // SAFETY: see above.
                unsafe { $crate::$module::$function::<$model>(c $(, $argument)*) }
            }
        )+
    };
}

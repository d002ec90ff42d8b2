//! [`export_fmu!`](crate::export_fmu), which defines the C symbols of a library.

/// Exports a [`Model`](crate::Model) with its capabilities as an FMU. The library then contains the functions of FMI 2.0
/// and of FMI 3.0.
///
/// Call it once in `src/lib.rs` of an FMU's crate, which must be a `cdylib`. The symbols belong to the crate
/// that calls the macro, so several FMU crates can share a workspace. A crate that contains further models, for example
/// for tests, calls [`offer!`](crate::offer) for them.
///
/// ```text
/// export_fmu!(Lag: CoSimulation + ModelExchange);
/// ```
#[macro_export]
macro_rules! export_fmu {
    ($model:ty : $first:ident $(+ $next:ident)*) => {
        $crate::offer!($model: $first $(+ $next)*);
        $crate::symbols!($model);
    };
}

/// Defines the symbols of the library for a model: the functions of both FMI versions, and the functions that
/// fmu-package and the code around a WebAssembly module call.
#[doc(hidden)]
#[macro_export]
macro_rules! symbols {
    ($model:ty) => {
        // The modules below use only this item of the author's crate, because other items of the crate may have the
        // names of FMI types.
        #[doc(hidden)]
        #[allow(non_camel_case_types)]
        type __fmu_model = $model;

        // Exported macros are items of the crate. So a second export_fmu!, in whichever module, is an error that states the
        // reason, instead of an error for each symbol.
        #[doc(hidden)]
        #[macro_export]
        macro_rules! a_crate_can_export_only_one_fmu {
            () => {};
        }

        /// The C functions of FMI 2.0.
        #[doc(hidden)]
        #[allow(unsafe_code, non_snake_case, missing_docs, clippy::missing_safety_doc)]
        pub mod fmi2_functions {
            use super::__fmu_model;
            use $crate::fmi2::types::*;

            $crate::fmi2_functions!($crate::symbols, @each fmi2 __fmu_model;);

            /// See `fmu_export::fmi2::argument_buffer`.
            #[cfg(target_family = "wasm")]
            #[unsafe(no_mangle)]
            pub extern "C" fn fmu_argument_buffer(size: usize) -> fmi2Component {
                $crate::fmi2::argument_buffer(size)
            }

            /// See `fmu_export::fmi2::add_file`.
            #[cfg(target_family = "wasm")]
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmu_file(path: fmi2String, content: fmi2Component, size: usize) {
                // SAFETY: the code around the module guarantees the contract of this function.
                unsafe { $crate::fmi2::add_file(path, content, size) }
            }

            /// See `fmu_export::fmi2::broken`.
            #[cfg(target_family = "wasm")]
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmu_broken(
                c: fmi2Component,
                function: fmi2String,
                reason: fmi2String,
            ) -> fmi2Status {
                // SAFETY: the code around the module guarantees the contract of this function, as above.
                unsafe { $crate::fmi2::broken::<__fmu_model>(c, function, reason) as _ }
            }
        }

        /// The C functions of FMI 3.0. They are absent in WebAssembly, which is used only for FMI 2.0: in FMUs with C
        /// sources and in pages.
        #[doc(hidden)]
        #[cfg(not(target_family = "wasm"))]
        #[allow(unsafe_code, non_snake_case, missing_docs, clippy::missing_safety_doc)]
        pub mod fmi3_functions {
            use super::__fmu_model;
            use $crate::fmi3::types::*;

            $crate::fmi3_functions!($crate::symbols, @each fmi3 __fmu_model;);

            /// See `fmu_export::pass_description`.
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmu_export_describe(
                resources: *const ::core::ffi::c_char,
                receive: $crate::Receive,
                context: *mut ::core::ffi::c_void,
            ) {
                // SAFETY: the caller guarantees the contract of this function.
                unsafe { $crate::pass_description::<__fmu_model>(resources, receive, context) }
            }

            /// See `fmu_export::pass_panics`.
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmu_export_report_panics(
                receive: $crate::Receive,
                context: *mut ::core::ffi::c_void,
            ) {
                // SAFETY: the caller guarantees the contract of this function.
                unsafe { $crate::pass_panics(receive, context) }
            }
        }
    };
    // Each row of `fmi2_functions!` and `fmi3_functions!` in fmi-abi becomes an exported function. For example, the row
    // `fmi2DoStep "C" ...` becomes the symbol `fmi2DoStep`, which calls `fmu_export::fmi2::fmi2DoStep` for this model. That
    // function is generated from the same row, by `c_functions!`; its body is the `fmi2DoStep` of fmi2/co_simulation.rs, and
    // `fmi3DoStep` is found in the same way.
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
                // SAFETY: the importer guarantees the contract of the FMI version's module in fmu_export.
                unsafe { $crate::$module::$free::<$model>($($free_argument),*) }
            }
        )+
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $function(c: $handle $(, $argument: $type)*) -> ::core::ffi::c_int {
                // SAFETY: the importer guarantees the contract, as above.
                unsafe { $crate::$module::$function::<$model>(c $(, $argument)*) }
            }
        )+
    };
}

//! [`export_fmi2!`](crate::export_fmi2): the symbols of the shared library.

/// Exports a [`Model`](crate::Model) as the 44 functions of FMI 2.0.
///
/// Goes once into the library crate of an FMU, which must be a `cdylib`. The symbols live in the crate
/// that calls the macro, so several FMU crates can share a workspace.
#[macro_export]
macro_rules! export_fmi2 {
    ($model:ty) => {
        // All that the module below knows of the author's crate, where anything may be called like FMI's types.
        #[doc(hidden)]
        #[allow(non_camel_case_types)]
        type __fmi2_model = $model;

        /// The C interface of the FMU.
        #[doc(hidden)]
        #[allow(unsafe_code, non_snake_case, missing_docs, clippy::missing_safety_doc)]
        pub mod fmi2_functions {
            use super::__fmi2_model;
            use $crate::types::{
                Status, fmi2Boolean, fmi2Byte, fmi2CallbackFunctions, fmi2Component, fmi2EventInfo, fmi2FMUstate,
                fmi2Integer, fmi2Real, fmi2StatusKind, fmi2String, fmi2Type, fmi2ValueReference,
            };

            #[unsafe(no_mangle)]
            pub extern "C" fn fmi2GetTypesPlatform() -> fmi2String {
                $crate::boundary::fmi2GetTypesPlatform()
            }

            #[unsafe(no_mangle)]
            pub extern "C" fn fmi2GetVersion() -> fmi2String {
                $crate::boundary::fmi2GetVersion()
            }

            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmi2FreeInstance(c: fmi2Component) {
                // SAFETY: the importer keeps the contract of fmi2_export::boundary.
                unsafe { $crate::boundary::fmi2FreeInstance::<__fmi2_model>(c) }
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
                // SAFETY: the importer keeps the contract of fmi2_export::boundary.
                unsafe {
                    $crate::boundary::fmi2Instantiate::<__fmi2_model>(
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

            $crate::export_functions! { __fmi2_model;
                fmi2SetDebugLogging(logging_on: fmi2Boolean, n: usize, categories: *const fmi2String);
                fmi2SetupExperiment(
                    tolerance_defined: fmi2Boolean, tolerance: fmi2Real, start_time: fmi2Real,
                    stop_time_defined: fmi2Boolean, stop_time: fmi2Real
                );
                fmi2EnterInitializationMode();
                fmi2ExitInitializationMode();
                fmi2Terminate();
                fmi2Reset();
                fmi2GetReal(vr: *const fmi2ValueReference, nvr: usize, value: *mut fmi2Real);
                fmi2GetInteger(vr: *const fmi2ValueReference, nvr: usize, value: *mut fmi2Integer);
                fmi2GetBoolean(vr: *const fmi2ValueReference, nvr: usize, value: *mut fmi2Boolean);
                fmi2GetString(vr: *const fmi2ValueReference, nvr: usize, value: *mut fmi2String);
                fmi2SetReal(vr: *const fmi2ValueReference, nvr: usize, value: *const fmi2Real);
                fmi2SetInteger(vr: *const fmi2ValueReference, nvr: usize, value: *const fmi2Integer);
                fmi2SetBoolean(vr: *const fmi2ValueReference, nvr: usize, value: *const fmi2Boolean);
                fmi2SetString(vr: *const fmi2ValueReference, nvr: usize, value: *const fmi2String);
                fmi2GetFMUstate(state: *mut fmi2FMUstate);
                fmi2SetFMUstate(state: fmi2FMUstate);
                fmi2FreeFMUstate(state: *mut fmi2FMUstate);
                fmi2SerializedFMUstateSize(state: fmi2FMUstate, size: *mut usize);
                fmi2SerializeFMUstate(state: fmi2FMUstate, bytes: *mut fmi2Byte, size: usize);
                fmi2DeSerializeFMUstate(bytes: *const fmi2Byte, size: usize, state: *mut fmi2FMUstate);
                fmi2GetDirectionalDerivative(
                    unknown: *const fmi2ValueReference, n_unknown: usize,
                    known: *const fmi2ValueReference, n_known: usize,
                    dv_known: *const fmi2Real, dv_unknown: *mut fmi2Real
                );
                fmi2SetRealInputDerivatives(
                    vr: *const fmi2ValueReference, nvr: usize, order: *const fmi2Integer, value: *const fmi2Real
                );
                fmi2GetRealOutputDerivatives(
                    vr: *const fmi2ValueReference, nvr: usize, order: *const fmi2Integer, value: *mut fmi2Real
                );
                fmi2DoStep(point: fmi2Real, step_size: fmi2Real, no_set_state_prior: fmi2Boolean);
                fmi2CancelStep();
                fmi2GetStatus(kind: fmi2StatusKind, value: *mut Status);
                fmi2GetRealStatus(kind: fmi2StatusKind, value: *mut fmi2Real);
                fmi2GetIntegerStatus(kind: fmi2StatusKind, value: *mut fmi2Integer);
                fmi2GetBooleanStatus(kind: fmi2StatusKind, value: *mut fmi2Boolean);
                fmi2GetStringStatus(kind: fmi2StatusKind, value: *mut fmi2String);
                fmi2EnterEventMode();
                fmi2NewDiscreteStates(info: *mut fmi2EventInfo);
                fmi2EnterContinuousTimeMode();
                fmi2CompletedIntegratorStep(
                    no_set_state_prior: fmi2Boolean,
                    enter_event_mode: *mut fmi2Boolean, terminate_simulation: *mut fmi2Boolean
                );
                fmi2SetTime(time: fmi2Real);
                fmi2SetContinuousStates(x: *const fmi2Real, nx: usize);
                fmi2GetDerivatives(derivatives: *mut fmi2Real, nx: usize);
                fmi2GetEventIndicators(event_indicators: *mut fmi2Real, ni: usize);
                fmi2GetContinuousStates(x: *mut fmi2Real, nx: usize);
                fmi2GetNominalsOfContinuousStates(x_nominal: *mut fmi2Real, nx: usize);
            }
        }
    };
}

/// The guid for [`ModelInfo`](crate::ModelInfo), as fmi2-package's `build_script` has made it: a hash of the model's sources.
///
/// Without that build script it is all zeros; fmi2-package does not pack such a library.
#[macro_export]
macro_rules! guid {
    () => {
        match ::core::option_env!("FMU_GUID") {
            ::core::option::Option::Some(guid) => guid,
            ::core::option::Option::None => "{00000000-0000-0000-0000-000000000000}",
        }
    };
}

/// The functions that take a component and answer a status.
#[doc(hidden)]
#[macro_export]
macro_rules! export_functions {
    ($model:ty; $($name:ident($($argument:ident: $type:ty),*);)+) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $name(c: fmi2Component $(, $argument: $type)*) -> Status {
                // SAFETY: the importer keeps the contract of fmi2_export::boundary.
                unsafe { $crate::boundary::$name::<$model>(c $(, $argument)*) }
            }
        )+
    };
}

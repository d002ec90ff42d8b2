//! FMI 2.0: its C types, and one list of its functions with arguments and allowed states.

pub mod types;

use types::*;

/// Passes the list of functions to the macro at the path `with`. Tokens after the path are passed on before the list.
/// The list begins with the functions that do not return a status: versions, creation and release of instances, with
/// their arguments and results. The functions on an instance follow as `name CS ME tolerated (arguments);`, where `CS`
/// and `ME` are the states in which the standard allows the call in Co-Simulation and Model Exchange.
///
/// The exporter generates each C function from its row (`symbols!` and `c_functions!` of fmu-export).
///
/// Each letter is a column of the tables in sections 4.2.4 and 3.2.3 of FMI 2.0: I instantiated, N initialization, C
/// step complete, F step failed, M event, K continuous time, T terminated, E error. Fatal has no letter, because no
/// call is allowed in it. For `fmi2Set...`, the list contains all columns in which any variable can be set;
/// fmu-export also checks each variable. No state allows `fmi2CancelStep`, because fmu-export has no asynchronous
/// steps.
///
/// Tolerated calls, for interface types that have the function:
/// * fmi2Terminate after an error (FMI Library calls it when it destroys an instance);
/// * fmi2EnterInitializationMode without fmi2SetupExperiment before it: the start time is then 0;
/// * fmi2SetInteger, fmi2SetBoolean and fmi2SetString in Continuous-Time Mode, if each input already has the value that
///   is set (FMPy);
/// * fmi2DoStep with a step of size 0, which changes nothing (syssimx);
/// * fmi2SetTime in Initialization Mode and Event Mode, fmi2SetContinuousStates in Event Mode (OpenModelica makes
///   these calls in every run).
#[doc(hidden)]
#[macro_export]
#[rustfmt::skip]
macro_rules! fmi2_functions {
    ($with:path $(, $($before:tt)*)?) => { $with! { $($($before)*)?
        Fmi2 fmi2Component
        without an instance {
        fmi2GetTypesPlatform() -> fmi2String;
        fmi2GetVersion() -> fmi2String;
        fmi2Instantiate(instance_name: fmi2String, fmu_type: fmi2Type, guid: fmi2String, resource_location: fmi2String,
            functions: *const fmi2CallbackFunctions, visible: fmi2Boolean, logging_on: fmi2Boolean) -> fmi2Component;
        fmi2FreeInstance(c: fmi2Component) -> ();
        } with an instance {
        // function                         CS        ME        tolerated
        fmi2SetDebugLogging                 "INCFTE"  "INMKTE"  ""
            (logging_on: fmi2Boolean, n: usize, categories: *const fmi2String);
        fmi2SetupExperiment                 "I"       "I"       ""
            (tolerance_defined: fmi2Boolean, tolerance: fmi2Real, start_time: fmi2Real,
             stop_time_defined: fmi2Boolean, stop_time: fmi2Real);
        fmi2EnterInitializationMode         "I"       "I"       "" ();
        fmi2ExitInitializationMode          "N"       "N"       "" ();
        fmi2Terminate                       "CF"      "MK"      "E" ();
        fmi2Reset                           "INCFTE"  "INMKTE"  "" ();
        fmi2GetReal                         "NCFTE"   "NMKTE"   ""
            (vr: *const fmi2ValueReference, n: usize, value: *mut fmi2Real);
        fmi2GetInteger                      "NCFTE"   "NMKTE"   ""
            (vr: *const fmi2ValueReference, n: usize, value: *mut fmi2Integer);
        fmi2GetBoolean                      "NCFTE"   "NMKTE"   ""
            (vr: *const fmi2ValueReference, n: usize, value: *mut fmi2Boolean);
        fmi2GetString                       "NCFTE"   "NMKTE"   ""
            (vr: *const fmi2ValueReference, n: usize, value: *mut fmi2String);
        fmi2SetReal                         "INC"     "INMK"    ""
            (vr: *const fmi2ValueReference, n: usize, value: *const fmi2Real);
        fmi2SetInteger                      "INC"     "INM"     "K"
            (vr: *const fmi2ValueReference, n: usize, value: *const fmi2Integer);
        fmi2SetBoolean                      "INC"     "INM"     "K"
            (vr: *const fmi2ValueReference, n: usize, value: *const fmi2Boolean);
        fmi2SetString                       "INC"     "INM"     "K"
            (vr: *const fmi2ValueReference, n: usize, value: *const fmi2String);
        fmi2GetFMUstate                     "INCFTE"  "INMKTE"  "" (state: *mut fmi2FMUstate);
        fmi2SetFMUstate                     "INCFTE"  "INMKTE"  "" (state: fmi2FMUstate);
        fmi2FreeFMUstate                    "INCFTE"  "INMKTE"  "" (state: *mut fmi2FMUstate);
        fmi2SerializedFMUstateSize          "INCFTE"  "INMKTE"  "" (state: fmi2FMUstate, size: *mut usize);
        fmi2SerializeFMUstate               "INCFTE"  "INMKTE"  ""
            (state: fmi2FMUstate, bytes: *mut fmi2Byte, size: usize);
        fmi2DeSerializeFMUstate             "INCFTE"  "INMKTE"  ""
            (bytes: *const fmi2Byte, size: usize, state: *mut fmi2FMUstate);
        fmi2GetDirectionalDerivative        "NCFTE"   "NMKTE"   ""
            (unknown: *const fmi2ValueReference, n_unknown: usize, known: *const fmi2ValueReference, n_known: usize,
             dv_known: *const fmi2Real, dv_unknown: *mut fmi2Real);
        fmi2SetRealInputDerivatives         "INC"     ""        ""
            (vr: *const fmi2ValueReference, n: usize, order: *const fmi2Integer, value: *const fmi2Real);
        fmi2GetRealOutputDerivatives        "CFTE"    ""        ""
            (vr: *const fmi2ValueReference, n: usize, order: *const fmi2Integer, value: *mut fmi2Real);
        fmi2DoStep                          "C"       ""        ""
            (point: fmi2Real, step_size: fmi2Real, no_set_state_prior: fmi2Boolean);
        fmi2CancelStep                      ""        ""        "" ();
        fmi2GetStatus                       "CFT"     ""        "" (kind: fmi2StatusKind, value: *mut fmi2Status);
        fmi2GetRealStatus                   "CFT"     ""        "" (kind: fmi2StatusKind, value: *mut fmi2Real);
        fmi2GetIntegerStatus                "CFT"     ""        "" (kind: fmi2StatusKind, value: *mut fmi2Integer);
        fmi2GetBooleanStatus                "CFT"     ""        "" (kind: fmi2StatusKind, value: *mut fmi2Boolean);
        fmi2GetStringStatus                 "CFT"     ""        "" (kind: fmi2StatusKind, value: *mut fmi2String);
        fmi2EnterEventMode                  ""        "MK"      "" ();
        fmi2NewDiscreteStates               ""        "M"       "" (info: *mut fmi2EventInfo);
        fmi2EnterContinuousTimeMode         ""        "M"       "" ();
        fmi2CompletedIntegratorStep         ""        "K"       ""
            (no_set_state_prior: fmi2Boolean, enter_event_mode: *mut fmi2Boolean, terminate: *mut fmi2Boolean);
        fmi2SetTime                         ""        "K"       "NM" (time: fmi2Real);
        fmi2SetContinuousStates             ""        "K"       "M" (x: *const fmi2Real, nx: usize);
        fmi2GetDerivatives                  ""        "NMKTE"   "" (derivatives: *mut fmi2Real, nx: usize);
        fmi2GetEventIndicators              ""        "NMKTE"   "" (indicators: *mut fmi2Real, ni: usize);
        fmi2GetContinuousStates             ""        "NMKTE"   "" (x: *mut fmi2Real, nx: usize);
        fmi2GetNominalsOfContinuousStates   ""        "INMKTE"  "" (nominals: *mut fmi2Real, nx: usize);
        }
    } };
}

fmi2_functions!(crate::table);
#[cfg(feature = "calls")]
pub(crate) use fmi2_functions as functions;

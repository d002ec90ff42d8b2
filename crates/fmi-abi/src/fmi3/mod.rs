//! FMI 3.0: its C types, and one list of its functions with arguments and allowed states.

pub mod types;

use types::*;

/// Passes the list of functions to the macro at the path `with`. Tokens after the path are passed on before the list.
/// The list begins with the functions that do not return a status: versions, creation and release of instances, with
/// their arguments and results. The functions on an instance follow as `name CS ME tolerated (arguments);`, where `CS`
/// and `ME` are the states in which the standard allows the call in Co-Simulation and Model Exchange.
///
/// Each letter is a state of sections 2.3, 3.2 and 4.2 of FMI 3.0: I instantiated, N Initialization Mode, C Step
/// Mode, M Event Mode, K Continuous-Time Mode, T terminated. Fatal has no letter, because no call is allowed in it.
/// For `fmi3Set...`, the list contains all states in which any variable can be set; fmu-export also checks each
/// variable.
///
/// In fmu-export, a call that returns an error changes nothing, so the importer may continue, although by section
/// 2.3.1 of FMI 3.0 the instance would be terminated.
///
/// No state allows fmi3ActivateModelPartition, because it belongs to Scheduled Execution, which is not supported. Some
/// functions are allowed, but fmu-export always returns an error with the reason: the functions of clocks,
/// fmi3EvaluateDiscreteStates, fmi3GetNumberOfVariableDependencies and fmi3GetVariableDependencies. After the
/// initialization, fmi3EnterConfigurationMode also returns an error, because there are no structural parameters.
///
/// Tolerated calls, for interface types that have the function:
/// * fmi3SetTime in Initialization Mode and Event Mode, fmi3SetContinuousStates in Event Mode, as in FMI 2.0;
/// * fmi3DoStep with a step of size 0, as in FMI 2.0;
/// * the functions that return the number of states, the number of event indicators and the nominal values, in every
///   state, because the numbers never change and nominal values exist from the start;
/// * functions that set discrete inputs in Continuous-Time Mode, if each input already has the value that is set
///   (FMPy);
/// * fmi3EnterEventMode in Event Mode, as in FMI 2.0 (OpenModelica);
/// * fmi3EnterConfigurationMode and fmi3ExitConfigurationMode in instantiated, although there are no structural
///   parameters (FMIKit). Nothing changes, so the instance stays in instantiated.
#[doc(hidden)]
#[macro_export]
#[rustfmt::skip]
macro_rules! fmi3_functions {
    ($with:path $(, $($before:tt)*)?) => { $with! { $($($before)*)?
        Fmi3 fmi3Instance
        without an instance {
        fmi3GetVersion() -> fmi3String;
        fmi3InstantiateModelExchange(instance_name: fmi3String, token: fmi3String, resources: fmi3String,
            visible: fmi3Boolean, logging_on: fmi3Boolean, environment: fmi3InstanceEnvironment,
            log: Option<fmi3LogMessageCallback>) -> fmi3Instance;
        fmi3InstantiateCoSimulation(instance_name: fmi3String, token: fmi3String, resources: fmi3String,
            visible: fmi3Boolean, logging_on: fmi3Boolean, event_mode: fmi3Boolean, early_return: fmi3Boolean,
            required: *const fmi3ValueReference, n: usize, environment: fmi3InstanceEnvironment,
            log: Option<fmi3LogMessageCallback>, update: Option<fmi3IntermediateUpdateCallback>) -> fmi3Instance;
        fmi3InstantiateScheduledExecution(instance_name: fmi3String, token: fmi3String, resources: fmi3String,
            visible: fmi3Boolean, logging_on: fmi3Boolean, environment: fmi3InstanceEnvironment,
            log: Option<fmi3LogMessageCallback>, update: Option<fmi3ClockUpdateCallback>,
            lock: Option<fmi3LockPreemptionCallback>, unlock: Option<fmi3UnlockPreemptionCallback>) -> fmi3Instance;
        fmi3FreeInstance(c: fmi3Instance) -> ();
        } with an instance {
        // function                            CS       ME       tolerated
        fmi3SetDebugLogging                    "INCMT"  "INMKT"  ""
            (logging_on: fmi3Boolean, n: usize, categories: *const fmi3String);
        fmi3EnterInitializationMode            "I"      "I"      ""
            (tolerance_defined: fmi3Boolean, tolerance: fmi3Float64, start_time: fmi3Float64,
             stop_time_defined: fmi3Boolean, stop_time: fmi3Float64);
        fmi3ExitInitializationMode             "N"      "N"      "" ();
        fmi3EnterEventMode                     "C"      "K"      "M" ();
        fmi3Terminate                          "CM"     "MK"     "" ();
        fmi3Reset                              "INCMT"  "INMKT"  "" ();
        fmi3GetFloat32                         "INCMT"  "INMKT"  ""
            (vr: *const fmi3ValueReference, n: usize, value: *mut fmi3Float32, n_value: usize);
        fmi3GetFloat64                         "INCMT"  "INMKT"  ""
            (vr: *const fmi3ValueReference, n: usize, value: *mut fmi3Float64, n_value: usize);
        fmi3GetInt8                            "INCMT"  "INMKT"  ""
            (vr: *const fmi3ValueReference, n: usize, value: *mut fmi3Int8, n_value: usize);
        fmi3GetUInt8                           "INCMT"  "INMKT"  ""
            (vr: *const fmi3ValueReference, n: usize, value: *mut fmi3UInt8, n_value: usize);
        fmi3GetInt16                           "INCMT"  "INMKT"  ""
            (vr: *const fmi3ValueReference, n: usize, value: *mut fmi3Int16, n_value: usize);
        fmi3GetUInt16                          "INCMT"  "INMKT"  ""
            (vr: *const fmi3ValueReference, n: usize, value: *mut fmi3UInt16, n_value: usize);
        fmi3GetInt32                           "INCMT"  "INMKT"  ""
            (vr: *const fmi3ValueReference, n: usize, value: *mut fmi3Int32, n_value: usize);
        fmi3GetUInt32                          "INCMT"  "INMKT"  ""
            (vr: *const fmi3ValueReference, n: usize, value: *mut fmi3UInt32, n_value: usize);
        fmi3GetInt64                           "INCMT"  "INMKT"  ""
            (vr: *const fmi3ValueReference, n: usize, value: *mut fmi3Int64, n_value: usize);
        fmi3GetUInt64                          "INCMT"  "INMKT"  ""
            (vr: *const fmi3ValueReference, n: usize, value: *mut fmi3UInt64, n_value: usize);
        fmi3GetBoolean                         "INCMT"  "INMKT"  ""
            (vr: *const fmi3ValueReference, n: usize, value: *mut fmi3Boolean, n_value: usize);
        fmi3GetString                          "INCMT"  "INMKT"  ""
            (vr: *const fmi3ValueReference, n: usize, value: *mut fmi3String, n_value: usize);
        fmi3GetBinary                          "INCMT"  "INMKT"  ""
            (vr: *const fmi3ValueReference, n: usize, size: *mut usize, value: *mut fmi3Binary, n_value: usize);
        fmi3GetClock                           "M"      "M"      ""
            (vr: *const fmi3ValueReference, n: usize, value: *mut fmi3Clock);
        fmi3SetFloat32                         "INCM"   "INMK"   ""
            (vr: *const fmi3ValueReference, n: usize, value: *const fmi3Float32, n_value: usize);
        fmi3SetFloat64                         "INCM"   "INMK"   ""
            (vr: *const fmi3ValueReference, n: usize, value: *const fmi3Float64, n_value: usize);
        fmi3SetInt8                            "INCM"   "INM"    "K"
            (vr: *const fmi3ValueReference, n: usize, value: *const fmi3Int8, n_value: usize);
        fmi3SetUInt8                           "INCM"   "INM"    "K"
            (vr: *const fmi3ValueReference, n: usize, value: *const fmi3UInt8, n_value: usize);
        fmi3SetInt16                           "INCM"   "INM"    "K"
            (vr: *const fmi3ValueReference, n: usize, value: *const fmi3Int16, n_value: usize);
        fmi3SetUInt16                          "INCM"   "INM"    "K"
            (vr: *const fmi3ValueReference, n: usize, value: *const fmi3UInt16, n_value: usize);
        fmi3SetInt32                           "INCM"   "INM"    "K"
            (vr: *const fmi3ValueReference, n: usize, value: *const fmi3Int32, n_value: usize);
        fmi3SetUInt32                          "INCM"   "INM"    "K"
            (vr: *const fmi3ValueReference, n: usize, value: *const fmi3UInt32, n_value: usize);
        fmi3SetInt64                           "INCM"   "INM"    "K"
            (vr: *const fmi3ValueReference, n: usize, value: *const fmi3Int64, n_value: usize);
        fmi3SetUInt64                          "INCM"   "INM"    "K"
            (vr: *const fmi3ValueReference, n: usize, value: *const fmi3UInt64, n_value: usize);
        fmi3SetBoolean                         "INCM"   "INM"    "K"
            (vr: *const fmi3ValueReference, n: usize, value: *const fmi3Boolean, n_value: usize);
        fmi3SetString                          "INCM"   "INM"    "K"
            (vr: *const fmi3ValueReference, n: usize, value: *const fmi3String, n_value: usize);
        fmi3SetBinary                          "INCM"   "INM"    "K"
            (vr: *const fmi3ValueReference, n: usize, size: *const usize, value: *const fmi3Binary, n_value: usize);
        fmi3SetClock                           "M"      "M"      ""
            (vr: *const fmi3ValueReference, n: usize, value: *const fmi3Clock);
        fmi3GetNumberOfVariableDependencies    "INCMT"  "INMKT"  "" (vr: fmi3ValueReference, n: *mut usize);
        fmi3GetVariableDependencies            "INCMT"  "INMKT"  ""
            (dependent: fmi3ValueReference, elements: *mut usize, independents: *mut fmi3ValueReference,
             elements_of_independents: *mut usize, kinds: *mut fmi3DependencyKind, n: usize);
        fmi3GetFMUState                        "INCMT"  "INMKT"  "" (state: *mut fmi3FMUState);
        fmi3SetFMUState                        "INCMT"  "INMKT"  "" (state: fmi3FMUState);
        fmi3FreeFMUState                       "INCMT"  "INMKT"  "" (state: *mut fmi3FMUState);
        fmi3SerializedFMUStateSize             "INCMT"  "INMKT"  "" (state: fmi3FMUState, size: *mut usize);
        fmi3SerializeFMUState                  "INCMT"  "INMKT"  ""
            (state: fmi3FMUState, bytes: *mut fmi3Byte, size: usize);
        fmi3DeserializeFMUState                "INCMT"  "INMKT"  ""
            (bytes: *const fmi3Byte, size: usize, state: *mut fmi3FMUState);
        fmi3GetDirectionalDerivative           "NCMT"   "NMKT"   ""
            (unknown: *const fmi3ValueReference, n_unknown: usize, known: *const fmi3ValueReference, n_known: usize,
             seed: *const fmi3Float64, n_seed: usize, sensitivity: *mut fmi3Float64, n_sensitivity: usize);
        fmi3GetAdjointDerivative               "NCMT"   "NMKT"   ""
            (unknown: *const fmi3ValueReference, n_unknown: usize, known: *const fmi3ValueReference, n_known: usize,
             seed: *const fmi3Float64, n_seed: usize, sensitivity: *mut fmi3Float64, n_sensitivity: usize);
        fmi3EnterConfigurationMode             "IC"     "IM"     "" ();
        fmi3ExitConfigurationMode              ""       ""       "I" ();
        fmi3GetIntervalDecimal                 "NM"     "NM"     ""
            (vr: *const fmi3ValueReference, n: usize, interval: *mut fmi3Float64,
             qualifier: *mut fmi3IntervalQualifier);
        fmi3GetIntervalFraction                "NM"     "NM"     ""
            (vr: *const fmi3ValueReference, n: usize, counter: *mut fmi3UInt64, resolution: *mut fmi3UInt64,
             qualifier: *mut fmi3IntervalQualifier);
        fmi3GetShiftDecimal                    "N"      "N"      ""
            (vr: *const fmi3ValueReference, n: usize, shift: *mut fmi3Float64);
        fmi3GetShiftFraction                   "N"      "N"      ""
            (vr: *const fmi3ValueReference, n: usize, counter: *mut fmi3UInt64, resolution: *mut fmi3UInt64);
        fmi3SetIntervalDecimal                 "N"      "N"      ""
            (vr: *const fmi3ValueReference, n: usize, interval: *const fmi3Float64);
        fmi3SetIntervalFraction                "N"      "N"      ""
            (vr: *const fmi3ValueReference, n: usize, counter: *const fmi3UInt64, resolution: *const fmi3UInt64);
        fmi3SetShiftDecimal                    "N"      "N"      ""
            (vr: *const fmi3ValueReference, n: usize, shift: *const fmi3Float64);
        fmi3SetShiftFraction                   "N"      "N"      ""
            (vr: *const fmi3ValueReference, n: usize, counter: *const fmi3UInt64, resolution: *const fmi3UInt64);
        fmi3EvaluateDiscreteStates             "M"      "M"      "" ();
        fmi3UpdateDiscreteStates               "M"      "M"      ""
            (again: *mut fmi3Boolean, terminate: *mut fmi3Boolean, nominals_changed: *mut fmi3Boolean,
             states_changed: *mut fmi3Boolean, next_defined: *mut fmi3Boolean, next: *mut fmi3Float64);
        fmi3EnterContinuousTimeMode            ""       "M"      "" ();
        fmi3CompletedIntegratorStep            ""       "K"      ""
            (no_set_state_prior: fmi3Boolean, enter_event_mode: *mut fmi3Boolean, terminate: *mut fmi3Boolean);
        fmi3SetTime                            ""       "K"      "NM" (time: fmi3Float64);
        fmi3SetContinuousStates                ""       "K"      "M" (x: *const fmi3Float64, nx: usize);
        fmi3GetContinuousStateDerivatives      ""       "NMKT"   "" (derivatives: *mut fmi3Float64, nx: usize);
        fmi3GetEventIndicators                 ""       "NMKT"   "" (indicators: *mut fmi3Float64, ni: usize);
        fmi3GetContinuousStates                ""       "NMKT"   "" (x: *mut fmi3Float64, nx: usize);
        fmi3GetNominalsOfContinuousStates      ""       "NMKT"   "I" (nominals: *mut fmi3Float64, nx: usize);
        fmi3GetNumberOfEventIndicators         ""       "IM"     "NKT" (n: *mut usize);
        fmi3GetNumberOfContinuousStates        ""       "IM"     "NKT" (n: *mut usize);
        fmi3EnterStepMode                      "M"      ""       "" ();
        fmi3GetOutputDerivatives               "CT"     ""       ""
            (vr: *const fmi3ValueReference, n: usize, order: *const fmi3Int32, value: *mut fmi3Float64,
             n_value: usize);
        fmi3DoStep                             "C"      ""       ""
            (point: fmi3Float64, step_size: fmi3Float64, no_set_state_prior: fmi3Boolean,
             event_handling_needed: *mut fmi3Boolean, terminate: *mut fmi3Boolean, early_return: *mut fmi3Boolean,
             last_successful_time: *mut fmi3Float64);
        fmi3ActivateModelPartition             ""       ""       ""
            (clock: fmi3ValueReference, activation_time: fmi3Float64);
        }
    } };
}

fmi3_functions!(crate::table);
#[cfg(feature = "calls")]
pub(crate) use fmi3_functions as functions;

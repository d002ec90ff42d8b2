/* The same for FMI 3.0, beside FMI 2.0: one library has both. */
#ifndef FMU3_H
#define FMU3_H

#include "fmi3FunctionTypes.h"
#include "fmu.h"

/* All 75 functions; each has a type fmi3...TYPE in the headers. */
#define FMI3_FUNCTIONS(F) \
    F(GetVersion) F(SetDebugLogging) F(InstantiateModelExchange) F(InstantiateCoSimulation) \
    F(InstantiateScheduledExecution) F(FreeInstance) F(EnterInitializationMode) F(ExitInitializationMode) \
    F(EnterEventMode) F(Terminate) F(Reset) \
    F(GetFloat32) F(GetFloat64) F(GetInt8) F(GetUInt8) F(GetInt16) F(GetUInt16) F(GetInt32) F(GetUInt32) \
    F(GetInt64) F(GetUInt64) F(GetBoolean) F(GetString) F(GetBinary) F(GetClock) \
    F(SetFloat32) F(SetFloat64) F(SetInt8) F(SetUInt8) F(SetInt16) F(SetUInt16) F(SetInt32) F(SetUInt32) \
    F(SetInt64) F(SetUInt64) F(SetBoolean) F(SetString) F(SetBinary) F(SetClock) \
    F(GetNumberOfVariableDependencies) F(GetVariableDependencies) \
    F(GetFMUState) F(SetFMUState) F(FreeFMUState) F(SerializedFMUStateSize) F(SerializeFMUState) \
    F(DeserializeFMUState) F(GetDirectionalDerivative) F(GetAdjointDerivative) \
    F(EnterConfigurationMode) F(ExitConfigurationMode) \
    F(GetIntervalDecimal) F(GetIntervalFraction) F(GetShiftDecimal) F(GetShiftFraction) \
    F(SetIntervalDecimal) F(SetIntervalFraction) F(SetShiftDecimal) F(SetShiftFraction) \
    F(EvaluateDiscreteStates) F(UpdateDiscreteStates) F(EnterContinuousTimeMode) F(CompletedIntegratorStep) \
    F(SetTime) F(SetContinuousStates) F(GetContinuousStateDerivatives) F(GetEventIndicators) \
    F(GetContinuousStates) F(GetNominalsOfContinuousStates) F(GetNumberOfEventIndicators) \
    F(GetNumberOfContinuousStates) F(EnterStepMode) F(GetOutputDerivatives) F(DoStep) F(ActivateModelPartition)

#define DEFINE(name) static fmi3##name##TYPE *fmi3##name;
FMI3_FUNCTIONS(DEFINE)
#undef DEFINE

/* Loads the library and all functions of both standards. */
static void *load_both(const char *path) {
    void *library = load(path);
#define LOAD(name) *(void **)&fmi3##name = symbol(library, "fmi3" #name);
    FMI3_FUNCTIONS(LOAD)
#undef LOAD
    return library;
}

#endif

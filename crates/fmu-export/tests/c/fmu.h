/* Loads the functions of an FMU's shared library, with their types from the headers of the FMI standards. */
#ifndef FMU_H
#define FMU_H

#include <dlfcn.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"
#include "fmi3FunctionTypes.h"

/* All 44 functions of FMI 2.0; each has a type fmi2...TYPE in the headers. */
#define FMI2_FUNCTIONS(F) \
    F(GetTypesPlatform) F(GetVersion) F(SetDebugLogging) F(Instantiate) F(FreeInstance) F(SetupExperiment) \
    F(EnterInitializationMode) F(ExitInitializationMode) F(Terminate) F(Reset) \
    F(GetReal) F(GetInteger) F(GetBoolean) F(GetString) F(SetReal) F(SetInteger) F(SetBoolean) F(SetString) \
    F(GetFMUstate) F(SetFMUstate) F(FreeFMUstate) F(SerializedFMUstateSize) F(SerializeFMUstate) \
    F(DeSerializeFMUstate) F(GetDirectionalDerivative) F(EnterEventMode) F(NewDiscreteStates) \
    F(EnterContinuousTimeMode) F(CompletedIntegratorStep) F(SetTime) F(SetContinuousStates) F(GetDerivatives) \
    F(GetEventIndicators) F(GetContinuousStates) F(GetNominalsOfContinuousStates) F(SetRealInputDerivatives) \
    F(GetRealOutputDerivatives) F(DoStep) F(CancelStep) F(GetStatus) F(GetRealStatus) F(GetIntegerStatus) \
    F(GetBooleanStatus) F(GetStringStatus)

#define DEFINE(name) static fmi2##name##TYPE *fmi2##name;
FMI2_FUNCTIONS(DEFINE)
#undef DEFINE

/* All 75 functions of FMI 3.0; each has a type fmi3...TYPE in the headers. */
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

#define CHECK(condition) \
    do { \
        if (!(condition)) { \
            fprintf(stderr, "%s:%d: not true: %s\n", __FILE__, __LINE__, #condition); \
            exit(1); \
        } \
    } while (0)

static void *symbol(void *library, const char *name) {
    void *address = dlsym(library, name);
    if (!address) fprintf(stderr, "the library has no %s\n", name);
    CHECK(address);
    return address;
}

/* Loads the library and all functions of FMI 2.0. */
static inline void *load(const char *path) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library) fprintf(stderr, "%s\n", dlerror());
    CHECK(library);
    /* ISO C cannot cast a data pointer to a function pointer; POSIX recommends this assignment for dlsym. */
#define LOAD(name) *(void **)&fmi2##name = symbol(library, "fmi2" #name);
    FMI2_FUNCTIONS(LOAD)
#undef LOAD
    return library;
}

/* Loads the library and all functions of both FMI versions. */
static inline void *load_both(const char *path) {
    void *library = load(path);
#define LOAD(name) *(void **)&fmi3##name = symbol(library, "fmi3" #name);
    FMI3_FUNCTIONS(LOAD)
#undef LOAD
    return library;
}

#endif

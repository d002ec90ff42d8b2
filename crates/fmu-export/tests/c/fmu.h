/* A loader for the shared library of an FMU, with the types of the standard's own headers. */
#ifndef FMU_H
#define FMU_H

#include <dlfcn.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

/* All 44 functions; each has a type fmi2...TYPE in the headers. */
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

/* Loads the library and all 44 functions. */
static void *load(const char *path) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library) fprintf(stderr, "%s\n", dlerror());
    CHECK(library);
    /* ISO C has no cast from data pointers to function pointers, POSIX wants this. */
#define LOAD(name) *(void **)&fmi2##name = symbol(library, "fmi2" #name);
    FMI2_FUNCTIONS(LOAD)
#undef LOAD
    return library;
}

#endif

/* FMI 2.0 for the C programs of the tests, declared from sections 2.1, 3.2 and 4.2 of the standard, and
   a loader for the shared library of an FMU. */
#ifndef PRW_TEST_FMI2_H
#define PRW_TEST_FMI2_H

#include <dlfcn.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* section 2.1.2 */
typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Char;
typedef const fmi2Char *fmi2String;
typedef char fmi2Byte;

/* sections 2.1.3, 2.1.5, 3.2.2 and 4.2.3 */
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;

typedef struct {
    void (*logger)(fmi2ComponentEnvironment environment, fmi2String instance_name, fmi2Status status,
                   fmi2String category, fmi2String message, ...);
    void *(*allocateMemory)(size_t count, size_t size);
    void (*freeMemory)(void *memory);
    void (*stepFinished)(fmi2ComponentEnvironment environment, fmi2Status status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

typedef struct {
    fmi2Boolean newDiscreteStatesNeeded;
    fmi2Boolean terminateSimulation;
    fmi2Boolean nominalsOfContinuousStatesChanged;
    fmi2Boolean valuesOfContinuousStatesChanged;
    fmi2Boolean nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;

typedef const fmi2ValueReference *Vr;

/* All 44 functions: result, name, arguments. */
#define FMI2_FUNCTIONS(F) \
    F(fmi2String, fmi2GetTypesPlatform, (void)) \
    F(fmi2String, fmi2GetVersion, (void)) \
    F(fmi2Status, fmi2SetDebugLogging, (fmi2Component, fmi2Boolean, size_t, const fmi2String *)) \
    F(fmi2Component, fmi2Instantiate, (fmi2String, fmi2Type, fmi2String, fmi2String, \
                                       const fmi2CallbackFunctions *, fmi2Boolean, fmi2Boolean)) \
    F(void, fmi2FreeInstance, (fmi2Component)) \
    F(fmi2Status, fmi2SetupExperiment, (fmi2Component, fmi2Boolean, fmi2Real, fmi2Real, fmi2Boolean, fmi2Real)) \
    F(fmi2Status, fmi2EnterInitializationMode, (fmi2Component)) \
    F(fmi2Status, fmi2ExitInitializationMode, (fmi2Component)) \
    F(fmi2Status, fmi2Terminate, (fmi2Component)) \
    F(fmi2Status, fmi2Reset, (fmi2Component)) \
    F(fmi2Status, fmi2GetReal, (fmi2Component, Vr, size_t, fmi2Real *)) \
    F(fmi2Status, fmi2GetInteger, (fmi2Component, Vr, size_t, fmi2Integer *)) \
    F(fmi2Status, fmi2GetBoolean, (fmi2Component, Vr, size_t, fmi2Boolean *)) \
    F(fmi2Status, fmi2GetString, (fmi2Component, Vr, size_t, fmi2String *)) \
    F(fmi2Status, fmi2SetReal, (fmi2Component, Vr, size_t, const fmi2Real *)) \
    F(fmi2Status, fmi2SetInteger, (fmi2Component, Vr, size_t, const fmi2Integer *)) \
    F(fmi2Status, fmi2SetBoolean, (fmi2Component, Vr, size_t, const fmi2Boolean *)) \
    F(fmi2Status, fmi2SetString, (fmi2Component, Vr, size_t, const fmi2String *)) \
    F(fmi2Status, fmi2GetFMUstate, (fmi2Component, fmi2FMUstate *)) \
    F(fmi2Status, fmi2SetFMUstate, (fmi2Component, fmi2FMUstate)) \
    F(fmi2Status, fmi2FreeFMUstate, (fmi2Component, fmi2FMUstate *)) \
    F(fmi2Status, fmi2SerializedFMUstateSize, (fmi2Component, fmi2FMUstate, size_t *)) \
    F(fmi2Status, fmi2SerializeFMUstate, (fmi2Component, fmi2FMUstate, fmi2Byte *, size_t)) \
    F(fmi2Status, fmi2DeSerializeFMUstate, (fmi2Component, const fmi2Byte *, size_t, fmi2FMUstate *)) \
    F(fmi2Status, fmi2GetDirectionalDerivative, (fmi2Component, Vr, size_t, Vr, size_t, const fmi2Real *, fmi2Real *)) \
    F(fmi2Status, fmi2EnterEventMode, (fmi2Component)) \
    F(fmi2Status, fmi2NewDiscreteStates, (fmi2Component, fmi2EventInfo *)) \
    F(fmi2Status, fmi2EnterContinuousTimeMode, (fmi2Component)) \
    F(fmi2Status, fmi2CompletedIntegratorStep, (fmi2Component, fmi2Boolean, fmi2Boolean *, fmi2Boolean *)) \
    F(fmi2Status, fmi2SetTime, (fmi2Component, fmi2Real)) \
    F(fmi2Status, fmi2SetContinuousStates, (fmi2Component, const fmi2Real *, size_t)) \
    F(fmi2Status, fmi2GetDerivatives, (fmi2Component, fmi2Real *, size_t)) \
    F(fmi2Status, fmi2GetEventIndicators, (fmi2Component, fmi2Real *, size_t)) \
    F(fmi2Status, fmi2GetContinuousStates, (fmi2Component, fmi2Real *, size_t)) \
    F(fmi2Status, fmi2GetNominalsOfContinuousStates, (fmi2Component, fmi2Real *, size_t)) \
    F(fmi2Status, fmi2SetRealInputDerivatives, (fmi2Component, Vr, size_t, const fmi2Integer *, const fmi2Real *)) \
    F(fmi2Status, fmi2GetRealOutputDerivatives, (fmi2Component, Vr, size_t, const fmi2Integer *, fmi2Real *)) \
    F(fmi2Status, fmi2DoStep, (fmi2Component, fmi2Real, fmi2Real, fmi2Boolean)) \
    F(fmi2Status, fmi2CancelStep, (fmi2Component)) \
    F(fmi2Status, fmi2GetStatus, (fmi2Component, fmi2StatusKind, fmi2Status *)) \
    F(fmi2Status, fmi2GetRealStatus, (fmi2Component, fmi2StatusKind, fmi2Real *)) \
    F(fmi2Status, fmi2GetIntegerStatus, (fmi2Component, fmi2StatusKind, fmi2Integer *)) \
    F(fmi2Status, fmi2GetBooleanStatus, (fmi2Component, fmi2StatusKind, fmi2Boolean *)) \
    F(fmi2Status, fmi2GetStringStatus, (fmi2Component, fmi2StatusKind, fmi2String *))

#define DEFINE(result, name, arguments) static result(*name) arguments;
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
#define LOAD(result, name, arguments) *(void **)&name = symbol(library, #name);
    FMI2_FUNCTIONS(LOAD)
#undef LOAD
    return library;
}

#endif

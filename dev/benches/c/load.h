/* Loads an FMU for FMI 2.0, for the benchmarks. A function that the library lacks stays NULL: for example, bare_exact.c and
 * euler.c have no fmi2Terminate, fmi2Reset and Model Exchange. */
#pragma once
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi2FunctionTypes.h"

#define FUNCTIONS(F) \
    F(Instantiate) F(SetupExperiment) F(EnterInitializationMode) F(ExitInitializationMode) F(SetReal) F(GetReal) \
    F(SetBoolean) F(SetRealInputDerivatives) F(DoStep) F(GetFMUstate) F(SetFMUstate) F(FreeFMUstate) \
    F(GetDirectionalDerivative) F(FreeInstance) F(Terminate) F(Reset) F(SerializedFMUstateSize) F(SerializeFMUstate) \
    F(DeSerializeFMUstate) F(NewDiscreteStates) F(EnterContinuousTimeMode) F(SetTime) F(SetContinuousStates) \
    F(GetDerivatives) F(CompletedIntegratorStep)
#define DEFINE(name) static fmi2##name##TYPE *fmi2##name __attribute__((unused));
FUNCTIONS(DEFINE)

static void need(int holds, const char *message) {
    if (holds) return;
    fprintf(stderr, "error: %s\n", message);
    exit(1);
}

static void load(const char *path) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    need(library != NULL, "the library cannot be loaded");
#define LOAD(name) fmi2##name = (fmi2##name##TYPE *)dlsym(library, "fmi2" #name);
    FUNCTIONS(LOAD)
}

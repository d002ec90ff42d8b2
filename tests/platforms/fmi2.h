/* What scenario.c calls, in FMI 2.0; fmi3.h has the same in FMI 3.0. */
#ifndef FMI2_H
#define FMI2_H

#include "fmu.h"

#define fmi(name) fmi2##name

/* As FMI 3.0 spells them. */
#define fmi2DeserializeFMUState fmi2DeSerializeFMUstate
#define fmi2FreeFMUState fmi2FreeFMUstate
#define fmi2GetFMUState fmi2GetFMUstate
#define fmi2SerializeFMUState fmi2SerializeFMUstate
#define fmi2SerializedFMUStateSize fmi2SerializedFMUstateSize
#define fmi2SetFMUState fmi2SetFMUstate

typedef fmi2Component Instance;
typedef fmi2FMUstate State;
typedef fmi2Byte Byte;

static void logger(fmi2ComponentEnvironment environment, fmi2String instance_name, fmi2Status status,
                   fmi2String category, fmi2String message, ...) {
    CHECK(environment == (void *)&logger && strcmp(instance_name, "Fig. 4") == 0 && !strchr(message, '%'));
    printf("log %d %s: %s\n", status, category, message);
}

static void *load_fmu(const char *path) {
    void *library = load(path);
    printf("version %s, platform %s\n", fmi2GetVersion(), fmi2GetTypesPlatform());
    return library;
}

static Instance instantiate(int co_simulation, const char *guid) {
    static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, (void *)&logger};
    return fmi2Instantiate("Fig. 4", co_simulation ? fmi2CoSimulation : fmi2ModelExchange, guid, "", &callbacks, 0, 1);
}

static int enter_initialization_mode(Instance c, double tolerance, double stop) {
    CHECK(fmi2SetupExperiment(c, 1, tolerance, 0, 1, stop) == fmi2OK);
    return fmi2EnterInitializationMode(c);
}

static int set_reals(Instance c, const unsigned *references, size_t n, const double *values) {
    return fmi2SetReal(c, references, n, values);
}

static int get_reals(Instance c, const unsigned *references, size_t n, double *values) {
    return fmi2GetReal(c, references, n, values);
}

static int set_integers(Instance c, const unsigned *references, size_t n, const int *values) {
    return fmi2SetInteger(c, references, n, values);
}

static int set_boolean(Instance c, unsigned reference, int value) {
    const fmi2Boolean boolean = value;
    return fmi2SetBoolean(c, &reference, 1, &boolean);
}

static int do_step(Instance c, double t, double h) { return fmi2DoStep(c, t, h, 1); }

static int directional_derivative(Instance c, const unsigned *unknowns, size_t n, unsigned known, double *column) {
    const fmi2Real one = 1;
    return fmi2GetDirectionalDerivative(c, unknowns, n, &known, 1, &one, column);
}

static int output_derivatives(Instance c, const unsigned *references, size_t n, const int *orders, double *values) {
    return fmi2GetRealOutputDerivatives(c, references, n, orders, values);
}

static int update_discrete_states(Instance c) {
    fmi2EventInfo info;
    memset(&info, 0x55, sizeof info);
    if (fmi2NewDiscreteStates(c, &info) != fmi2OK) return fmi2Error;
    CHECK(!info.newDiscreteStatesNeeded && !info.terminateSimulation && !info.nominalsOfContinuousStatesChanged);
    CHECK(!info.valuesOfContinuousStatesChanged && !info.nextEventTimeDefined);
    return fmi2OK;
}

static int state_derivatives(Instance c, double *derivatives, size_t n) {
    return fmi2GetDerivatives(c, derivatives, n);
}

static int completed_integrator_step(Instance c) {
    fmi2Boolean event = -1, terminate = -1;
    if (fmi2CompletedIntegratorStep(c, 1, &event, &terminate) != fmi2OK) return fmi2Error;
    CHECK(event == 0 && terminate == 0);
    return fmi2OK;
}

/* FMI 2.0 has no adjoint derivatives. */
static int adjoint_derivative(Instance c, unsigned unknown, const unsigned *knowns, size_t n, double *row) {
    (void)c, (void)unknown, (void)knowns, (void)n, (void)row;
    return 0;
}

#endif

/* What scenario.c calls, in FMI 3.0; fmi2.h has the same in FMI 2.0. */
#ifndef FMI3_H
#define FMI3_H

#include "fmu.h"

#include "fmi3FunctionTypes.h"

#define fmi(name) fmi3##name

/* Those called here; what the library exports, test_libraries.py reads from its header. */
#define CALLED(F) \
    F(GetVersion) F(InstantiateCoSimulation) F(InstantiateModelExchange) F(FreeInstance) F(EnterInitializationMode) \
    F(ExitInitializationMode) F(EnterEventMode) F(Terminate) F(GetFloat64) F(SetFloat64) F(SetInt32) F(SetBoolean) \
    F(GetBoolean) F(GetFMUState) F(SetFMUState) F(FreeFMUState) F(SerializedFMUStateSize) F(SerializeFMUState) \
    F(DeserializeFMUState) F(GetDirectionalDerivative) F(GetAdjointDerivative) F(UpdateDiscreteStates) \
    F(EnterContinuousTimeMode) F(CompletedIntegratorStep) F(SetTime) F(SetContinuousStates) \
    F(GetContinuousStateDerivatives) F(GetContinuousStates) F(GetOutputDerivatives) F(DoStep)

#define DEFINE(name) static fmi3##name##TYPE *fmi3##name;
CALLED(DEFINE)
#undef DEFINE

typedef fmi3Instance Instance;
typedef fmi3FMUState State;
typedef fmi3Byte Byte;

static void logger(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message) {
    CHECK(environment == (void *)&logger);
    printf("log %d %s: %s\n", status, category, message);
}

/* Both versions are in one library. */
static void *load_fmu(const char *path) {
    void *library = load(path);
#define LOAD(name) *(void **)&fmi3##name = symbol(library, "fmi3" #name);
    CALLED(LOAD)
#undef LOAD
    printf("version %s of FMI\n", fmi3GetVersion());
    return library;
}

static Instance instantiate(int co_simulation, const char *token) {
    void *self = (void *)&logger;
    if (!co_simulation) return fmi3InstantiateModelExchange("Fig. 4", token, "", false, true, self, logger);
    return fmi3InstantiateCoSimulation("Fig. 4", token, "", false, true, false, false, NULL, 0, self, logger, NULL);
}

static int enter_initialization_mode(Instance c, double tolerance, double stop) {
    return fmi3EnterInitializationMode(c, true, tolerance, 0, true, stop);
}

static int set_reals(Instance c, const unsigned *references, size_t n, const double *values) {
    return fmi3SetFloat64(c, references, n, values, n);
}

static int get_reals(Instance c, const unsigned *references, size_t n, double *values) {
    return fmi3GetFloat64(c, references, n, values, n);
}

static int set_integers(Instance c, const unsigned *references, size_t n, const int *values) {
    return fmi3SetInt32(c, references, n, values, n);
}

/* A Boolean is one byte, and no more than that is read and written. */
static int set_boolean(Instance c, unsigned reference, int value) {
    unsigned char bytes[3] = {0x55, value, 0x55};
    if (fmi3SetBoolean(c, &reference, 1, (fmi3Boolean *)bytes + 1, 1) != fmi3OK) return fmi3Error;
    bytes[1] = 0x55;
    if (fmi3GetBoolean(c, &reference, 1, (fmi3Boolean *)bytes + 1, 1) != fmi3OK) return fmi3Error;
    CHECK(bytes[0] == 0x55 && bytes[1] == value && bytes[2] == 0x55);
    return fmi3OK;
}

static int do_step(Instance c, double t, double h) {
    fmi3Boolean event = true, terminate = true, early = true;
    double reached = -1;
    if (fmi3DoStep(c, t, h, true, &event, &terminate, &early, &reached) != fmi3OK) return fmi3Error;
    CHECK(!event && !terminate && !early && reached == t + h);
    return fmi3OK;
}

static int directional_derivative(Instance c, const unsigned *unknowns, size_t n, unsigned known, double *column) {
    const double one = 1;
    return fmi3GetDirectionalDerivative(c, unknowns, n, &known, 1, &one, 1, column, n);
}

static int output_derivatives(Instance c, const unsigned *references, size_t n, const int *orders, double *values) {
    return fmi3GetOutputDerivatives(c, references, n, orders, values, n);
}

static int update_discrete_states(Instance c) {
    unsigned char bytes[11];
    fmi3Boolean *flags = (fmi3Boolean *)bytes;
    double next;
    int i;
    memset(bytes, 0x55, sizeof bytes);
    if (fmi3UpdateDiscreteStates(c, flags + 1, flags + 3, flags + 5, flags + 7, flags + 9, &next) != fmi3OK) {
        return fmi3Error;
    }
    for (i = 0; i < 11; ++i) CHECK(bytes[i] == (i % 2 ? 0 : 0x55));
    return fmi3OK;
}

static int state_derivatives(Instance c, double *derivatives, size_t n) {
    return fmi3GetContinuousStateDerivatives(c, derivatives, n);
}

static int completed_integrator_step(Instance c) {
    fmi3Boolean event = true, terminate = true;
    if (fmi3CompletedIntegratorStep(c, true, &event, &terminate) != fmi3OK) return fmi3Error;
    CHECK(!event && !terminate);
    return fmi3OK;
}

static int adjoint_derivative(Instance c, unsigned unknown, const unsigned *knowns, size_t n, double *row) {
    const double one = 1;
    CHECK(fmi3GetAdjointDerivative(c, &unknown, 1, knowns, n, &one, 1, row, n) == fmi3OK);
    return 1;
}

#endif

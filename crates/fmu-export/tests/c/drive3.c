/* Drives the FMU as a C importer of FMI 3.0 does: drive3 LIBRARY TOKEN.
   Prints "name value" for what the Rust side of the test compares. */
#include "fmu3.h"

enum { FORCE = 1, POSITION, VELOCITY, DER_POSITION, DER_VELOCITY, SPRING_FORCE, ENERGY, DAMPED = 12 };

static const char *token;
static int messages;

static void count(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message) {
    CHECK(environment == (void *)&messages);
    CHECK(strcmp(category, status == fmi3Error ? "logStatusError" : "logEvents") == 0 && message[0]);
    ++messages;
}

static void no_update(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean set, fmi3Boolean get,
                      fmi3Boolean finished, fmi3Boolean early, fmi3Boolean *requested, fmi3Float64 *early_time) {
    (void)environment, (void)time, (void)set, (void)get, (void)finished, (void)early, (void)requested;
    (void)early_time;
    CHECK(!"nothing is updated within a step (providesIntermediateUpdate is false)");
}

/* Model Exchange or Co-Simulation; with a callback or without any. */
static fmi3Instance instantiate(int steps, int callbacks) {
    char name[] = "from C";
    fmi3LogMessageCallback log = callbacks ? count : NULL;
    fmi3InstanceEnvironment environment = callbacks ? &messages : NULL;
    fmi3Instance instance =
        steps ? fmi3InstantiateCoSimulation(name, token, "", false, false, false, false, NULL, 0, environment, log,
                                            callbacks ? no_update : NULL)
              : fmi3InstantiateModelExchange(name, token, "", false, false, environment, log);
    memset(name, 'x', sizeof name - 1);
    CHECK(instance);
    return instance;
}

static void initialize(fmi3Instance instance) {
    CHECK(fmi3EnterInitializationMode(instance, true, 1e-6, 0, true, 1) == fmi3OK);
    CHECK(fmi3ExitInitializationMode(instance) == fmi3OK);
}

/* A Boolean is one byte, and no more than that is written; C has no other values of it than these two. */
static void booleans(unsigned damped) {
    fmi3Instance instance = instantiate(1, 1);
    fmi3Boolean yes = true;
    unsigned char two = 2, bytes[] = {0x55, 0x55};
    CHECK(sizeof(fmi3Boolean) == 1);
    CHECK(fmi3SetBoolean(instance, &damped, 1, &yes, 1) == fmi3OK);
    CHECK(fmi3SetBoolean(instance, &damped, 1, (fmi3Boolean *)&two, 1) == fmi3Error && messages == 1);
    CHECK(fmi3GetBoolean(instance, &damped, 1, (fmi3Boolean *)bytes, 1) == fmi3OK);
    CHECK(bytes[0] == 1 && bytes[1] == 0x55);
    fmi3FreeInstance(instance);
}

static void co_simulation(int callbacks) {
    const unsigned force = FORCE, outputs[] = {POSITION, VELOCITY, SPRING_FORCE, ENERGY};
    fmi3Float64 push, values[5] = {0, 0, 0, 0, 77}, last = 0;
    /* The flags of a step have neighbours that it leaves alone. */
    struct { char before[8]; fmi3Boolean event, terminate, early; char after[8]; } step;
    fmi3Instance instance = instantiate(1, callbacks);
    int i, k;
    initialize(instance);
    for (i = 0; i < 64; ++i) {
        push = i / 64.0;
        memset(&step, 0x55, sizeof step);
        CHECK(fmi3SetFloat64(instance, &force, 1, &push, 1) == fmi3OK);
        CHECK(fmi3DoStep(instance, i / 64.0, 1 / 64.0, true, &step.event, &step.terminate, &step.early, &last) ==
              fmi3OK);
        CHECK(!step.event && !step.terminate && !step.early && last == (i + 1) / 64.0);
        for (k = 0; k < 8; ++k) CHECK(step.before[k] == 0x55 && step.after[k] == 0x55);
        CHECK(fmi3GetFloat64(instance, outputs, 4, values, 4) == fmi3OK);
    }
    CHECK(values[4] == 77);
    CHECK(fmi3Terminate(instance) == fmi3OK);
    fmi3FreeInstance(instance);
    if (callbacks)
        for (i = 0; i < 4; ++i) printf("cs%d %.17g\n", i, values[i]);
}

/* Forward Euler is enough to see that everything arrives. */
static void model_exchange(int callbacks) {
    const unsigned force = FORCE, outputs[] = {POSITION, VELOCITY, SPRING_FORCE, ENERGY};
    fmi3Float64 push, x[3] = {0}, der[3] = {0}, nominals[2], values[4], next = 77;
    fmi3Boolean again = true, terminate = true, nominals_changed = true, states_changed = true, defined = true;
    fmi3Boolean enter_event_mode = true;
    size_t states = 0, indicators = 77;
    fmi3Instance instance = instantiate(0, callbacks);
    int i, j;
    initialize(instance);
    CHECK(fmi3UpdateDiscreteStates(instance, &again, &terminate, &nominals_changed, &states_changed, &defined,
                                   &next) == fmi3OK);
    CHECK(!again && !terminate && !nominals_changed && !states_changed && !defined);
    CHECK(fmi3GetNumberOfContinuousStates(instance, &states) == fmi3OK && states == 2);
    CHECK(fmi3GetNumberOfEventIndicators(instance, &indicators) == fmi3OK && indicators == 0);
    CHECK(fmi3EnterContinuousTimeMode(instance) == fmi3OK);
    CHECK(fmi3GetNominalsOfContinuousStates(instance, nominals, 2) == fmi3OK);
    CHECK(fmi3GetEventIndicators(instance, NULL, 0) == fmi3OK);
    x[2] = der[2] = 77;
    CHECK(fmi3GetContinuousStates(instance, x, 2) == fmi3OK);
    for (i = 0; i < 1024; ++i) {
        CHECK(fmi3SetTime(instance, i / 1024.0) == fmi3OK);
        push = i / 1024.0;
        CHECK(fmi3SetFloat64(instance, &force, 1, &push, 1) == fmi3OK);
        CHECK(fmi3GetContinuousStateDerivatives(instance, der, 2) == fmi3OK);
        for (j = 0; j < 2; ++j) x[j] += der[j] / 1024;
        CHECK(fmi3SetContinuousStates(instance, x, 2) == fmi3OK);
        enter_event_mode = terminate = true;
        CHECK(fmi3CompletedIntegratorStep(instance, true, &enter_event_mode, &terminate) == fmi3OK);
        CHECK(!enter_event_mode && !terminate);
    }
    CHECK(x[2] == 77 && der[2] == 77);
    CHECK(fmi3GetFloat64(instance, outputs, 4, values, 4) == fmi3OK);
    CHECK(fmi3Terminate(instance) == fmi3OK);
    fmi3FreeInstance(instance);
    if (callbacks)
        for (i = 0; i < 4; ++i) printf("me%d %.17g\n", i, values[i]);
}

/* A NULL instance is an error, never a crash; so are NULL arrays with a length, and so is it all without a logger. */
static void nulls(int callbacks) {
    fmi3Instance instance = instantiate(1, callbacks);
    fmi3FMUState state = NULL;
    size_t size = 0;
    int before = messages;
    CHECK(fmi3SetFloat64(instance, NULL, 3, NULL, 3) == fmi3Error);
    CHECK(fmi3SetDebugLogging(instance, true, 2, NULL) == fmi3Error);
    CHECK(fmi3GetFMUState(instance, NULL) == fmi3Error);
    CHECK(fmi3FreeFMUState(instance, NULL) == fmi3OK && fmi3FreeFMUState(instance, &state) == fmi3OK);
    CHECK(fmi3SerializedFMUStateSize(instance, NULL, &size) == fmi3Error && size == 0);
    CHECK(fmi3DeserializeFMUState(instance, NULL, 100, &state) == fmi3Error && state == NULL);
    CHECK(fmi3DoStep(instance, 0, 1, true, NULL, NULL, NULL, NULL) == fmi3Error);
    CHECK(messages - before == (callbacks ? 6 : 0));
    fmi3FreeInstance(instance);
    fmi3FreeInstance(NULL);
    CHECK(fmi3Terminate(NULL) == fmi3Error && fmi3Reset(NULL) == fmi3Error);
    CHECK(fmi3GetFloat64(NULL, NULL, 0, NULL, 0) == fmi3Error);
    CHECK(fmi3DoStep(NULL, 0, 1, true, NULL, NULL, NULL, NULL) == fmi3Error);
    CHECK(!fmi3InstantiateModelExchange(NULL, NULL, NULL, false, false, NULL, NULL));
    CHECK(!fmi3InstantiateCoSimulation("C", "{}", NULL, false, true, false, false, NULL, 0, NULL, NULL, NULL));
    CHECK(!fmi3InstantiateScheduledExecution("C", token, NULL, false, true, NULL, NULL, NULL, NULL, NULL));
}

/* With every message, and unloaded after every run. */
static void load_and_unload(const char *path) {
    int i;
    for (i = 0; i < 100; ++i) {
        void *library = load_both(path);
        fmi3Instance instance = instantiate(i % 2, 1);
        messages = 0;
        CHECK(fmi3SetDebugLogging(instance, true, 0, NULL) == fmi3OK);
        initialize(instance);
        CHECK(messages == 1);
        CHECK(fmi3EnterInitializationMode(instance, false, 0, 0, false, 0) == fmi3Error && messages == 2);
        fmi3FreeInstance(instance);
        CHECK(dlclose(library) == 0);
        CHECK(!dlopen(path, RTLD_NOW | RTLD_NOLOAD)); /* it is really gone */
    }
}

int main(int argc, char **argv) {
    int callbacks;
    CHECK(argc == 3);
    token = argv[2];
    void *library = load_both(argv[1]);
    CHECK(strcmp(fmi3GetVersion(), "3.0") == 0);
    booleans(DAMPED);
    for (callbacks = 0; callbacks < 2; ++callbacks) {
        co_simulation(callbacks);
        model_exchange(callbacks);
        nulls(callbacks);
    }
    CHECK(dlclose(library) == 0);
    load_and_unload(argv[1]);
    return 0;
}

/* Counts the instructions of uses of the testbed FMU (FMI 2.0), under callgrind:
 *   valgrind --tool=callgrind --collect-atstart=no uses LIBRARY GUID
 * Each use prints its name and the number of its repetitions, and makes callgrind write the instructions of all of them. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <valgrind/callgrind.h>

#include "load.h"

/* Value references of modelDescription.xml. */
static const fmi2ValueReference MOTORS[4] = {0, 1, 2, 3}, OUTPUTS[4] = {4, 5, 6, 7}, K1 = 25, USE_OMEGA = 33;
static const fmi2ValueReference KNOWN[10] = {0, 1, 2, 3, 10, 11, 12, 13, 14, 15}, UNKNOWN[8] = {4, 5, 6, 7, 8, 9, 10, 11};

static const char *guid;
static fmi2Component c;
static double t, y[8];

static void discard(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                    fmi2String message, ...) {
    (void)environment, (void)name, (void)status, (void)category, (void)message;
}

static void instantiate(fmi2Type type) {
    static const fmi2CallbackFunctions callbacks = {discard, calloc, free, NULL, NULL};
    c = fmi2Instantiate("uses", type, guid, "", &callbacks, fmi2False, fmi2False);
    need(c != NULL, "fmi2Instantiate returns NULL");
}

static void initialize(void) {
    int failed = fmi2SetupExperiment(c, fmi2False, 0, 0, fmi2False, 0);
    failed |= fmi2EnterInitializationMode(c) | fmi2ExitInitializationMode(c);
    need(!failed, "the initialization failed");
    t = 0;
}

static void step(long k, double h) {
    const double angle[2] = {1e-3 * sin(0.03 * (double)k), -1e-3 * sin(0.02 * (double)k)};
    CALLGRIND_TOGGLE_COLLECT;
    const int failed = fmi2SetReal(c, MOTORS, 2, angle) | fmi2DoStep(c, t, h, fmi2True) | fmi2GetReal(c, OUTPUTS, 4, y);
    CALLGRIND_TOGGLE_COLLECT;
    need(!failed, "a step failed");
    t += h;
}

/* The grid np.arange(n) * 1e-3, whose differences vary in their last digits, from 5 s on. */
static void step_on_grid(long k) {
    const double begin = (double)(5000 + k) * 1e-3;
    step(k, (double)(5001 + k) * 1e-3 - begin);
}

static void step_of_four_sizes(long k) {
    static const double sizes[4] = {1e-3, 5e-4, 2e-3, 1.5e-3};
    step(k, sizes[k & 3]);
}

static void set_k1(double value, int accepted) {
    need((fmi2SetReal(c, &K1, 1, &value) == fmi2OK) == accepted, "k1 is not checked");
}

static void report(const char *use, long count) {
    printf("%ld %s\n", count, use);
    CALLGRIND_DUMP_STATS_AT(use);
}

static const long MANY = 1000;

/* Before the counted steps, a use may do something that must not make these steps slower. */
typedef void Preparation(void);

static void nothing(void) {}
static void changed_parameter(void) { set_k1(100, 1); }
static void rejected_parameter(void) { set_k1(-1, 0); }
static void restored(void) {
    fmi2FMUstate state = NULL;
    need(!(fmi2GetFMUstate(c, &state) | fmi2SetFMUstate(c, state) | fmi2FreeFMUstate(c, &state)), "the state is lost");
}
static void deserialized(void) {
    static fmi2Byte bytes[65536];
    size_t size = 0;
    fmi2FMUstate state = NULL, copy = NULL;
    int failed = fmi2GetFMUstate(c, &state) | fmi2SerializedFMUstateSize(c, state, &size);
    need(size <= sizeof bytes, "the state is large");
    failed |= fmi2SerializeFMUstate(c, state, bytes, size) | fmi2DeSerializeFMUstate(c, bytes, size, &copy);
    failed |= fmi2SetFMUstate(c, copy) | fmi2FreeFMUstate(c, &state) | fmi2FreeFMUstate(c, &copy);
    need(!failed, "the state is lost");
}
static void reset(void) {
    need(!fmi2Reset(c), "the reset failed");
    initialize();
}
static void failed_step(void) {
    const double large[2] = {1e308, -1e308}, small[2] = {0, 0};
    fmi2SetReal(c, MOTORS, 2, large);
    need(fmi2DoStep(c, t, 1e-3, fmi2True) == fmi2Error, "an overflow is not found");
    fmi2SetReal(c, MOTORS, 2, small);
}

static void steps(const char *use, Preparation *prepare, void (*one)(long)) {
    instantiate(fmi2CoSimulation);
    initialize();
    for (long k = 0; k < 8; k++) one(k);
    prepare();
    /* A reset begins again at 0. */
    const long first = prepare == reset ? 0 : 8;
    CALLGRIND_ZERO_STATS;
    for (long k = first; k < first + MANY; k++) one(k);
    report(use, MANY);
    fmi2FreeInstance(c);
}

static void step_steady(long k) { step(k, 1e-3); }
static void step_new_size(long k) { step(k, 1e-3 + 1e-10 * (double)k); }

static void step_by_scalars(long k) {
    const double angle[2] = {1e-3 * sin(0.03 * (double)k), -1e-3 * sin(0.02 * (double)k)};
    CALLGRIND_TOGGLE_COLLECT;
    fmi2SetReal(c, MOTORS, 1, angle), fmi2SetReal(c, MOTORS + 1, 1, angle + 1);
    const int failed = fmi2DoStep(c, t, 1e-3, fmi2True);
    for (int j = 0; j < 4; j++) fmi2GetReal(c, OUTPUTS + j, 1, y + j);
    CALLGRIND_TOGGLE_COLLECT;
    need(!failed, "a step failed");
    t += 1e-3;
}

static void step_with_derivatives(long k) {
    static const fmi2Integer orders[2] = {1, 1};
    const double rate[2] = {0.03 * cos(0.03 * (double)k), 0.02};
    CALLGRIND_TOGGLE_COLLECT;
    fmi2SetRealInputDerivatives(c, MOTORS, 2, orders, rate);
    CALLGRIND_TOGGLE_COLLECT;
    step(k, 1e-3);
}

static void step_with_omega(long k) {
    static const fmi2Boolean yes = fmi2True;
    if (k == 0) fmi2SetBoolean(c, &USE_OMEGA, 1, &yes);
    const double rate[2] = {0.03 * cos(0.03 * (double)k), 0.02};
    CALLGRIND_TOGGLE_COLLECT;
    fmi2SetReal(c, MOTORS + 2, 2, rate);
    CALLGRIND_TOGGLE_COLLECT;
    step(k, 1e-3);
}

static fmi2FMUstate saved;
static void step_with_state(long k) {
    CALLGRIND_TOGGLE_COLLECT;
    const int failed = fmi2GetFMUstate(c, &saved) | fmi2SetFMUstate(c, saved);
    CALLGRIND_TOGGLE_COLLECT;
    need(!failed, "the state is lost");
    step(k, 1e-3);
}

static void change_of_k1(long k) {
    CALLGRIND_TOGGLE_COLLECT;
    set_k1(100.0 + (double)(k & 7), 1);
    CALLGRIND_TOGGLE_COLLECT;
}

static void rejection_of_k1(long k) {
    (void)k;
    CALLGRIND_TOGGLE_COLLECT;
    set_k1(-1, 0);
    CALLGRIND_TOGGLE_COLLECT;
}

static void directional_derivatives(long k) {
    static const double one = 1;
    (void)k;
    CALLGRIND_TOGGLE_COLLECT;
    for (int j = 0; j < 10; j++) fmi2GetDirectionalDerivative(c, UNKNOWN, 8, KNOWN + j, 1, &one, y);
    CALLGRIND_TOGGLE_COLLECT;
}

static void lives(void) {
    CALLGRIND_ZERO_STATS;
    for (int k = 0; k < 100; k++) {
        CALLGRIND_TOGGLE_COLLECT;
        instantiate(fmi2CoSimulation);
        initialize();
        fmi2FreeInstance(c);
        CALLGRIND_TOGGLE_COLLECT;
    }
    report("instantiate, initialize, free", 100);
    instantiate(fmi2CoSimulation);
    initialize();
    CALLGRIND_ZERO_STATS;
    for (int k = 0; k < 100; k++) {
        step(k, 1e-3), step(k, 1e-3), step(k, 1e-3);
        CALLGRIND_TOGGLE_COLLECT;
        reset();
        CALLGRIND_TOGGLE_COLLECT;
    }
    report("reset, initialize, three steps", 100);
    fmi2FreeInstance(c);
}

static void model_exchange(void) {
    double x[6] = {0}, der[6], u[4] = {0};
    fmi2EventInfo info;
    fmi2Boolean event, end;
    instantiate(fmi2ModelExchange);
    initialize();
    fmi2NewDiscreteStates(c, &info);
    fmi2EnterContinuousTimeMode(c);
    CALLGRIND_ZERO_STATS;
    CALLGRIND_TOGGLE_COLLECT;
    for (long k = 0; k < MANY; k++) {
        u[0] = x[0] = 1e-6 * (double)k;
        int failed = fmi2SetTime(c, 1e-3 * (double)k) | fmi2SetContinuousStates(c, x, 6) | fmi2SetReal(c, MOTORS, 4, u);
        failed |= fmi2GetDerivatives(c, der, 6) | fmi2CompletedIntegratorStep(c, fmi2True, &event, &end);
        need(!failed, "Model Exchange failed");
    }
    CALLGRIND_TOGGLE_COLLECT;
    report("Model Exchange: set time, states and inputs, get derivatives", MANY);
    fmi2FreeInstance(c);
}

int main(int argc, char **argv) {
    need(argc == 3, "the arguments are LIBRARY and GUID");
    load(argv[1]);
    guid = argv[2];
    steps("step", nothing, step_steady);
    steps("step, one scalar per call", nothing, step_by_scalars);
    steps("step with input derivatives", nothing, step_with_derivatives);
    steps("step with use_omega and rates", nothing, step_with_omega);
    steps("step, four alternating sizes", nothing, step_of_four_sizes);
    steps("step on np.arange(n) * 1e-3", nothing, step_on_grid);
    steps("step, a new size each time", nothing, step_new_size);
    steps("step after a parameter change", changed_parameter, step_steady);
    steps("step on a grid after a parameter change", changed_parameter, step_on_grid);
    steps("step, four sizes after a rejected parameter", rejected_parameter, step_of_four_sizes);
    steps("step, four sizes after a failed step", failed_step, step_of_four_sizes);
    steps("step, four sizes after a restored state", restored, step_of_four_sizes);
    steps("step, four sizes after a de-serialized state", deserialized, step_of_four_sizes);
    steps("step, four sizes after a reset", reset, step_of_four_sizes);
    steps("get and set the state, step", nothing, step_with_state);
    steps("set a parameter", nothing, change_of_k1);
    steps("set a parameter to an invalid value", nothing, rejection_of_k1);
    steps("8 x 10 directional derivatives", nothing, directional_derivatives);
    lives();
    model_exchange();
    return 0;
}

/* The experiment of Fig. 4 as an importer in C runs it: scenario LIBRARY.
   Prints a "name value..." for every number that the FMU calculates, and what it logs; the same on all platforms.
   Compiled with the standard's headers and variables.h, which conftest.py makes from the model description. */
#include "fmu.h"
#include "variables.h"

#include <math.h>

static const unsigned outputs[] = OUTPUTS, unknowns[] = UNKNOWNS, knowns[] = KNOWNS;

#define LENGTH(array) (sizeof array / sizeof *array)
enum { STEPS = 2000, SAVED = 700, N_OUTPUTS = LENGTH(outputs) };

static const double h = 1e-3, pi = 3.14159265358979323846;

static void logger(fmi2ComponentEnvironment environment, fmi2String instance_name, fmi2Status status,
                   fmi2String category, fmi2String message, ...) {
    CHECK(environment == (void *)&logger && strcmp(instance_name, "Fig. 4") == 0 && !strchr(message, '%'));
    printf("log %d %s: %s\n", status, category, message);
}

static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, (void *)&logger};

static void print(const char *name, const fmi2Real *values, size_t n) {
    size_t i;
    fputs(name, stdout);
    for (i = 0; i < n; ++i) printf(" %.17g", values[i]);
    putchar('\n');
}

/* theta1' = sin(10 pi t), theta2' its negative. */
static void set_motors(fmi2Component c, double t) {
    const unsigned motors[] = {VR_theta1, VR_theta2, VR_omega1, VR_omega2};
    const double angle = (1 - cos(10 * pi * t)) / (10 * pi), rate = sin(10 * pi * t);
    const fmi2Real values[] = {angle, -angle, rate, -rate};
    CHECK(fmi2SetReal(c, motors, 4, values) == fmi2OK);
}

static void run(fmi2Component c, int from, int to, fmi2Real (*trajectory)[N_OUTPUTS]) {
    int i;
    for (i = from; i < to; ++i) {
        set_motors(c, i * h);
        CHECK(fmi2DoStep(c, i * h, h, 1) == fmi2OK);
        CHECK(fmi2GetReal(c, outputs, N_OUTPUTS, trajectory[i]) == fmi2OK);
    }
}

static fmi2Component start(void) {
    const unsigned reals[] = {VR_k1, VR_c3, VR_J3}, integers[] = {VR_M, VR_N}, boolean = VR_use_omega;
    const fmi2Real values[] = {250, 0.02, 0.01};
    const fmi2Integer numbers[] = {4, 7};
    const fmi2Boolean yes = 1;
    fmi2Component c = fmi2Instantiate("Fig. 4", fmi2CoSimulation, GUID, "", &callbacks, 0, 1);
    CHECK(c);
    CHECK(fmi2SetReal(c, reals, 3, values) == fmi2OK);
    CHECK(fmi2SetInteger(c, integers, 2, numbers) == fmi2OK);
    CHECK(fmi2SetBoolean(c, &boolean, 1, &yes) == fmi2OK);
    CHECK(fmi2SetupExperiment(c, 1, 1e-6, 0, 1, STEPS * h) == fmi2OK);
    CHECK(fmi2EnterInitializationMode(c) == fmi2OK);
    set_motors(c, 0);
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    return c;
}

/* A saved state replays to the bit, also from bytes and in another instance. */
static void save_and_replay(fmi2Component c, fmi2FMUstate saved, fmi2Real (*trajectory)[N_OUTPUTS]) {
    static fmi2Real replayed[STEPS][N_OUTPUTS];
    const size_t rest = sizeof *trajectory * (STEPS - SAVED);
    fmi2FMUstate copy = NULL;
    size_t size = 0;
    fmi2Byte *bytes;
    fmi2Component other = start();

    CHECK(fmi2SetFMUstate(c, saved) == fmi2OK);
    run(c, SAVED, STEPS, replayed);
    CHECK(memcmp(replayed[SAVED], trajectory[SAVED], rest) == 0);

    CHECK(fmi2SerializedFMUstateSize(c, saved, &size) == fmi2OK && size > 0);
    bytes = malloc(size);
    CHECK(bytes && fmi2SerializeFMUstate(c, saved, bytes, size) == fmi2OK);
    CHECK(fmi2DeSerializeFMUstate(other, bytes, size, &copy) == fmi2OK);
    CHECK(fmi2SetFMUstate(other, copy) == fmi2OK);
    memset(replayed, 0, sizeof replayed);
    run(other, SAVED, STEPS, replayed);
    CHECK(memcmp(replayed[SAVED], trajectory[SAVED], rest) == 0);
    printf("serialized %u\n", (unsigned)size);

    bytes[size / 2] ^= 1;
    CHECK(fmi2FreeFMUstate(other, &copy) == fmi2OK && !copy);
    CHECK(fmi2DeSerializeFMUstate(other, bytes, size, &copy) == fmi2Error && !copy);
    free(bytes);
    fmi2FreeInstance(other);
}

static void derivatives(fmi2Component c) {
    const fmi2Real one = 1;
    fmi2Real column[LENGTH(unknowns)], slopes[N_OUTPUTS];
    fmi2Integer orders[N_OUTPUTS];
    size_t i;
    for (i = 0; i < LENGTH(knowns); ++i) {
        CHECK(fmi2GetDirectionalDerivative(c, unknowns, LENGTH(unknowns), knowns + i, 1, &one, column) == fmi2OK);
        print("derivatives", column, LENGTH(unknowns));
    }
    for (i = 0; i < N_OUTPUTS; ++i) orders[i] = 1;
    CHECK(fmi2GetRealOutputDerivatives(c, outputs, N_OUTPUTS, orders, slopes) == fmi2OK);
    print("slopes", slopes, N_OUTPUTS);
}

/* What is refused is logged and changes nothing. */
static void refusals(fmi2Component c) {
    const unsigned stiffness = VR_k1, nobody = 9999;
    const fmi2Real bad[] = {NAN, -1};
    fmi2Real before = 0, after = 0;
    CHECK(fmi2GetReal(c, &stiffness, 1, &before) == fmi2OK);
    CHECK(fmi2SetReal(c, &stiffness, 1, bad) == fmi2Error && fmi2SetReal(c, &stiffness, 1, bad + 1) == fmi2Error);
    CHECK(fmi2SetReal(c, &nobody, 1, bad + 1) == fmi2Error && fmi2GetReal(c, &nobody, 1, &after) == fmi2Error);
    CHECK(fmi2GetReal(c, &stiffness, 1, &after) == fmi2OK && before == after);
    CHECK(fmi2EnterEventMode(c) == fmi2Error);
    CHECK(!fmi2Instantiate("Fig. 4", fmi2CoSimulation, "another guid", "", &callbacks, 0, 1));
}

static void experiment(void) {
    static fmi2Real trajectory[STEPS][N_OUTPUTS], again[STEPS][N_OUTPUTS];
    fmi2FMUstate saved = NULL;
    fmi2Component c = start();
    int i;
    run(c, 0, SAVED, trajectory);
    CHECK(fmi2GetFMUstate(c, &saved) == fmi2OK && saved);
    run(c, SAVED, STEPS, trajectory);
    for (i = 0; i < STEPS; ++i) print("outputs", trajectory[i], N_OUTPUTS);
    save_and_replay(c, saved, trajectory);
    derivatives(c);
    refusals(c);
    CHECK(fmi2FreeFMUstate(c, &saved) == fmi2OK && !saved);
    CHECK(fmi2Terminate(c) == fmi2OK);
    fmi2FreeInstance(c);

    c = start();
    run(c, 0, STEPS, again);
    CHECK(memcmp(again, trajectory, sizeof trajectory) == 0);
    fmi2FreeInstance(c);
}

int main(int argc, char **argv) {
    int times;
    CHECK(argc == 2);
    for (times = 0; times < 2; ++times) {
        void *library = load(argv[1]);
        printf("version %s, platform %s\n", fmi2GetVersion(), fmi2GetTypesPlatform());
        experiment();
        CHECK(dlclose(library) == 0);
    }
    return 0;
}

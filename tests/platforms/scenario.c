/* The experiment of Fig. 4 as an importer in C runs it: scenario LIBRARY.
   Prints a "name value..." for every number that the FMU calculates, and what it logs; the same on all platforms.
   With FMI3 defined by the functions of FMI 3.0, else by those of FMI 2.0; the numbers are the same.
   Compiled with the standard's headers and variables.h, which conftest.py makes from the model description. */
#ifdef FMI3
#include "fmi3.h"
#else
#include "fmi2.h"
#endif
#include "variables.h"

#include <math.h>

static const unsigned outputs[] = OUTPUTS, unknowns[] = UNKNOWNS, knowns[] = KNOWNS;

#define LENGTH(array) (sizeof array / sizeof *array)
enum { STEPS = 2000, SAVED = 700, N_OUTPUTS = LENGTH(outputs), N_STATES = LENGTH(unknowns) - N_OUTPUTS };

static const double h = 1e-3, pi = 3.14159265358979323846;

static void print(const char *name, const double *values, size_t n) {
    size_t i;
    fputs(name, stdout);
    for (i = 0; i < n; ++i) printf(" %.17g", values[i]);
    putchar('\n');
}

/* theta1' = sin(10 pi t), theta2' its negative. */
static void set_motors(Instance c, double t) {
    const unsigned motors[] = {VR_theta1, VR_theta2, VR_omega1, VR_omega2};
    const double angle = (1 - cos(10 * pi * t)) / (10 * pi), rate = sin(10 * pi * t);
    const double values[] = {angle, -angle, rate, -rate};
    CHECK(set_reals(c, motors, 4, values) == fmi(OK));
}

static void run(Instance c, int from, int to, double (*trajectory)[N_OUTPUTS]) {
    int i;
    for (i = from; i < to; ++i) {
        set_motors(c, i * h);
        CHECK(do_step(c, i * h, h) == fmi(OK));
        CHECK(get_reals(c, outputs, N_OUTPUTS, trajectory[i]) == fmi(OK));
    }
}

static Instance start(int co_simulation) {
    const unsigned reals[] = {VR_k1, VR_c3, VR_J3}, integers[] = {VR_M, VR_N};
    const double values[] = {250, 0.02, 0.01};
    const int numbers[] = {4, 7};
    Instance c = instantiate(co_simulation, GUID);
    CHECK(c);
    CHECK(set_reals(c, reals, 3, values) == fmi(OK));
    CHECK(set_integers(c, integers, 2, numbers) == fmi(OK));
    CHECK(set_boolean(c, VR_use_omega, 1) == fmi(OK));
    CHECK(enter_initialization_mode(c, 1e-6, STEPS * h) == fmi(OK));
    set_motors(c, 0);
    CHECK(fmi(ExitInitializationMode)(c) == fmi(OK));
    return c;
}

/* A saved state replays to the bit, also from bytes and in another instance. */
static void save_and_replay(Instance c, State saved, double (*trajectory)[N_OUTPUTS]) {
    static double replayed[STEPS][N_OUTPUTS];
    const size_t rest = sizeof *trajectory * (STEPS - SAVED);
    State copy = NULL;
    size_t size = 0;
    Byte *bytes;
    Instance other = start(1);

    CHECK(fmi(SetFMUState)(c, saved) == fmi(OK));
    run(c, SAVED, STEPS, replayed);
    CHECK(memcmp(replayed[SAVED], trajectory[SAVED], rest) == 0);

    CHECK(fmi(SerializedFMUStateSize)(c, saved, &size) == fmi(OK) && size > 0);
    bytes = malloc(size);
    CHECK(bytes && fmi(SerializeFMUState)(c, saved, bytes, size) == fmi(OK));
    CHECK(fmi(DeserializeFMUState)(other, bytes, size, &copy) == fmi(OK));
    CHECK(fmi(SetFMUState)(other, copy) == fmi(OK));
    memset(replayed, 0, sizeof replayed);
    run(other, SAVED, STEPS, replayed);
    CHECK(memcmp(replayed[SAVED], trajectory[SAVED], rest) == 0);
    printf("serialized %u\n", (unsigned)size);

    bytes[size / 2] ^= 1;
    CHECK(fmi(FreeFMUState)(other, &copy) == fmi(OK) && !copy);
    CHECK(fmi(DeserializeFMUState)(other, bytes, size, &copy) == fmi(Error) && !copy);
    free(bytes);
    fmi(FreeInstance)(other);
}

static void derivatives(Instance c) {
    double columns[LENGTH(knowns)][LENGTH(unknowns)], row[LENGTH(knowns)], slopes[N_OUTPUTS];
    int orders[N_OUTPUTS];
    size_t i, j;
    for (i = 0; i < LENGTH(knowns); ++i) {
        CHECK(directional_derivative(c, unknowns, LENGTH(unknowns), knowns[i], columns[i]) == fmi(OK));
        print("derivatives", columns[i], LENGTH(unknowns));
    }
    for (j = 0; j < LENGTH(unknowns) && adjoint_derivative(c, unknowns[j], knowns, LENGTH(knowns), row); ++j) {
        for (i = 0; i < LENGTH(knowns); ++i) CHECK(row[i] == columns[i][j]);
    }
    for (i = 0; i < N_OUTPUTS; ++i) orders[i] = 1;
    CHECK(output_derivatives(c, outputs, N_OUTPUTS, orders, slopes) == fmi(OK));
    print("slopes", slopes, N_OUTPUTS);
}

/* What is refused is logged and changes nothing. */
static void refusals(Instance c) {
    const unsigned stiffness = VR_k1, nobody = 9999;
    const double bad[] = {NAN, -1};
    double before = 0, after = 0;
    CHECK(get_reals(c, &stiffness, 1, &before) == fmi(OK));
    CHECK(set_reals(c, &stiffness, 1, bad) == fmi(Error) && set_reals(c, &stiffness, 1, bad + 1) == fmi(Error));
    CHECK(set_reals(c, &nobody, 1, bad + 1) == fmi(Error) && get_reals(c, &nobody, 1, &after) == fmi(Error));
    CHECK(get_reals(c, &stiffness, 1, &after) == fmi(OK) && before == after);
    CHECK(fmi(EnterEventMode)(c) == fmi(Error));
    CHECK(!instantiate(1, "another guid"));
}

static void experiment(void) {
    static double trajectory[STEPS][N_OUTPUTS], again[STEPS][N_OUTPUTS];
    State saved = NULL;
    Instance c = start(1);
    int i;
    run(c, 0, SAVED, trajectory);
    CHECK(fmi(GetFMUState)(c, &saved) == fmi(OK) && saved);
    run(c, SAVED, STEPS, trajectory);
    for (i = 0; i < STEPS; ++i) print("outputs", trajectory[i], N_OUTPUTS);
    save_and_replay(c, saved, trajectory);
    derivatives(c);
    refusals(c);
    CHECK(fmi(FreeFMUState)(c, &saved) == fmi(OK) && !saved);
    CHECK(fmi(Terminate)(c) == fmi(OK));
    fmi(FreeInstance)(c);

    c = start(1);
    run(c, 0, STEPS, again);
    CHECK(memcmp(again, trajectory, sizeof trajectory) == 0);
    fmi(FreeInstance)(c);
}

/* Forward Euler is enough to see that everything arrives. */
static void model_exchange(void) {
    const double dt = h / 8;
    double x[N_STATES], der[N_STATES], values[N_OUTPUTS];
    Instance c = start(0);
    int i, j;
    CHECK(update_discrete_states(c) == fmi(OK));
    CHECK(fmi(EnterContinuousTimeMode)(c) == fmi(OK));
    CHECK(fmi(GetContinuousStates)(c, x, N_STATES) == fmi(OK));
    for (i = 0; i < STEPS; ++i) {
        CHECK(fmi(SetTime)(c, i * dt) == fmi(OK));
        set_motors(c, i * dt);
        CHECK(state_derivatives(c, der, N_STATES) == fmi(OK));
        for (j = 0; j < N_STATES; ++j) x[j] += der[j] * dt;
        CHECK(fmi(SetContinuousStates)(c, x, N_STATES) == fmi(OK));
        CHECK(completed_integrator_step(c) == fmi(OK));
        CHECK(get_reals(c, outputs, N_OUTPUTS, values) == fmi(OK));
        if (i % 10 == 9) print("integrated", values, N_OUTPUTS);
    }
    CHECK(fmi(Terminate)(c) == fmi(OK));
    fmi(FreeInstance)(c);
}

int main(int argc, char **argv) {
    int times;
    CHECK(argc == 2);
    for (times = 0; times < 2; ++times) {
        void *library = load_fmu(argv[1]);
        experiment();
        model_exchange();
        CHECK(dlclose(library) == 0);
        CHECK(!dlopen(argv[1], RTLD_NOW | RTLD_NOLOAD)); /* it is really gone */
    }
    return 0;
}

/* Times a Co-Simulation FMU of FMI 2.0 through its C interface. Prints seconds to stderr and outputs to stdout.
 *   bench LIBRARY GUID memory                       bytes of an instance instead of seconds
 *   bench LIBRARY GUID WAY STEPS THREADS            seconds per step; with 0 threads also the outputs of every step
 *   bench LIBRARY GUID RUNS SAMPLES STEP INPUTS OUTPUTS INSTANCES
 * The last form times RUNS runs of INSTANCES instances with the inputs in stdin, SAMPLES rows of doubles. It stores all
 * outputs, and prints those of the last instance in the last run. INPUTS and OUTPUTS are value references, separated by commas. */
#define _GNU_SOURCE
#include <malloc.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "load.h"

static const char *guid;

static void print_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                          fmi2String message, ...) {
    (void)environment, (void)name, (void)status, (void)category;
    fprintf(stderr, "%s\n", message);
}

static fmi2Component instantiate(void) {
    static const fmi2CallbackFunctions callbacks = {print_message, calloc, free, NULL, NULL};
    fmi2Component c = fmi2Instantiate("bench", fmi2CoSimulation, guid, "", &callbacks, fmi2False, fmi2False);
    need(c != NULL, "fmi2Instantiate returns NULL");
    return c;
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static fmi2Component start(fmi2Boolean use_omega) {
    static const fmi2ValueReference USE_OMEGA = 33;
    fmi2Component c = instantiate();
    fmi2SetBoolean(c, &USE_OMEGA, 1, &use_omega);
    fmi2SetupExperiment(c, fmi2False, 0, 0, fmi2False, 0);
    fmi2EnterInitializationMode(c);
    fmi2ExitInitializationMode(c);
    return c;
}

/* Angles, rates, and slopes to the next angles. The table keeps their calculation out of the measured time. */
enum { PERIOD = 200 };
static double motion[PERIOD][6];

static void make_motion(void) {
    const double pi = 3.14159265358979323846;
    for (int k = 0; k < PERIOD; k++) {
        double t = 1e-3 * k, angle = (1 - cos(10 * pi * t)) / (10 * pi), rate = sin(10 * pi * t);
        motion[k][0] = angle, motion[k][1] = -angle, motion[k][2] = rate, motion[k][3] = -rate;
    }
    for (int k = 0; k < PERIOD; k++)
        for (int m = 0; m < 2; m++) motion[k][4 + m] = (motion[(k + 1) % PERIOD][m] - motion[k][m]) / 1e-3;
}

/* Writes the inputs one by one right before they are set, as a master does. A library that reads two inputs at once must
 * wait until the processor has stored both. */
static inline void write_inputs(double *inputs, const double *u, int count) {
    for (int k = 0; k < count; k++) {
        inputs[k] = u[k];
        __asm__ volatile("" ::: "memory"); /* prevents one store of two inputs */
    }
}

/* WAYS in bench.py has this order. */
typedef enum { VECTORS, SCALARS, RATES, OMEGA, ALTERNATING, GRID, NEW_SIZES, STATES, DERIVATIVES } Way;

typedef struct {
    Way way;
    long steps;
    int print;
} Job;

static void *run(void *argument) {
    static const fmi2ValueReference inputs_of[4] = {0, 1, 2, 3}, outputs_of[4] = {4, 5, 6, 7};
    static const fmi2ValueReference known[10] = {0, 1, 2, 3, 10, 11, 12, 13, 14, 15};
    static const fmi2ValueReference unknown[8] = {4, 5, 6, 7, 8, 9, 10, 11};
    static const fmi2Integer orders[2] = {1, 1};
    static const double sizes[4] = {1e-3, 5e-4, 2e-3, 1.5e-3}, one = 1;
    const Job job = *(Job *)argument;
    const Way way = job.way;
    const int count = way == OMEGA ? 4 : 2;
    fmi2Component c = start(way == OMEGA);
    fmi2FMUstate state = NULL;
    double t = 0, y[8] = {0}, inputs[4], sum = 0;
    for (long k = 0; k < job.steps; k++) {
        const double *u = motion[k % PERIOD];
        double h = way == ALTERNATING ? sizes[k & 3] : way == NEW_SIZES ? 1e-3 + 1e-10 * (double)k : 1e-3;
        if (way == GRID) t = (double)k * 1e-3, h = (double)(k + 1) * 1e-3 - t;
        if (way == DERIVATIVES) {
            for (int j = 0; j < 10; j++) fmi2GetDirectionalDerivative(c, unknown, 8, known + j, 1, &one, y);
            sum += y[0];
            continue;
        }
        write_inputs(inputs, u, count);
        if (way == SCALARS) {
            fmi2SetReal(c, inputs_of, 1, inputs);
            fmi2SetReal(c, inputs_of + 1, 1, inputs + 1);
        } else {
            fmi2SetReal(c, inputs_of, (size_t)count, inputs);
        }
        if (way == RATES) fmi2SetRealInputDerivatives(c, inputs_of, 2, orders, u + 4);
        if (way == STATES) fmi2GetFMUstate(c, &state), fmi2SetFMUstate(c, state);
        need(fmi2DoStep(c, t, h, fmi2True) == fmi2OK, "fmi2DoStep failed");
        t += h;
        if (way == SCALARS)
            for (int j = 0; j < 4; j++) fmi2GetReal(c, outputs_of + j, 1, y + j);
        else
            fmi2GetReal(c, outputs_of, 4, y);
        if (job.print) fwrite(y, sizeof *y, 4, stdout);
        sum += y[0];
    }
    need(isfinite(sum), "the outputs are not finite");
    if (state) fmi2FreeFMUstate(c, &state);
    fmi2FreeInstance(c);
    return NULL;
}

static double steps(Way way, long count, int threads) {
    pthread_t ids[8];
    Job job = {way, count, threads == 0};
    need(threads <= 8, "there are at most 8 threads");
    const double begin = now();
    if (threads <= 1) run(&job);
    for (int k = 0; k < threads && threads > 1; k++) pthread_create(ids + k, NULL, run, &job);
    for (int k = 0; k < threads && threads > 1; k++) pthread_join(ids[k], NULL);
    return (now() - begin) / (double)(count * (threads ? threads : 1));
}

static double memory(void) {
    enum { COUNT = 1000 };
    static fmi2Component c[COUNT];
    const size_t before = mallinfo2().uordblks;
    for (int j = 0; j < COUNT; j++) c[j] = start(fmi2False);
    const size_t after = mallinfo2().uordblks;
    for (int j = 0; j < COUNT; j++) fmi2FreeInstance(c[j]);
    return (double)(after - before) / COUNT;
}

static size_t references(const char *list, fmi2ValueReference *vr) {
    size_t n = 0;
    for (char *end; *list != '\0'; list = *end == ',' ? end + 1 : end) vr[n++] = (fmi2ValueReference)strtoul(list, &end, 10);
    return n;
}

static double runs(char **argv) {
    const size_t count = strtoul(argv[0], NULL, 10), samples = strtoul(argv[1], NULL, 10), n = strtoul(argv[5], NULL, 10);
    const double h = atof(argv[2]);
    fmi2ValueReference in[64], out[64];
    const size_t n_in = references(argv[3], in), n_out = references(argv[4], out), row = n * n_out;
    double *inputs = malloc(samples * n_in * sizeof *inputs), *outputs = malloc(count * samples * row * sizeof *outputs);
    fmi2Component *c = malloc(n * sizeof *c);
    need(inputs && outputs && c, "there is not enough memory");
    need(fread(inputs, sizeof *inputs, samples * n_in, stdin) == samples * n_in, "inputs are missing");
    for (size_t i = 0; i < n; i++) c[i] = instantiate();
    const double begin = now();
    double *next = outputs;
    for (size_t r = 0; r < count; r++) {
        int failed = 0;
        for (size_t i = 0; i < n; i++) {
            failed |= r > 0 && fmi2Reset(c[i]) > fmi2Warning;
            failed |= fmi2SetupExperiment(c[i], fmi2False, 0.0, 0.0, fmi2False, 0.0) > fmi2Warning;
            failed |= fmi2EnterInitializationMode(c[i]) > fmi2Warning;
            failed |= fmi2SetReal(c[i], in, n_in, inputs) > fmi2Warning;
            failed |= fmi2ExitInitializationMode(c[i]) > fmi2Warning;
        }
        for (size_t k = 0; k < samples; k++)
            for (size_t i = 0; i < n; i++, next += n_out) {
                failed |= fmi2SetReal(c[i], in, n_in, inputs + k * n_in) > fmi2Warning;
                failed |= fmi2GetReal(c[i], out, n_out, next) > fmi2Warning;
                if (k + 1 < samples) failed |= fmi2DoStep(c[i], (double)k * h, h, fmi2True) > fmi2Warning;
            }
        for (size_t i = 0; i < n; i++) failed |= fmi2Terminate(c[i]) > fmi2Warning;
        need(!failed, "a call failed");
    }
    const double seconds = now() - begin;
    for (size_t k = samples; k > 0; k--) fwrite(next - (k - 1) * row - n_out, sizeof *next, n_out, stdout);
    for (size_t i = 0; i < n; i++) fmi2FreeInstance(c[i]);
    return seconds;
}

int main(int argc, char **argv) {
    need(argc == 4 || argc == 6 || argc == 9, "wrong number of arguments; the head of bench.c lists them");
    load(argv[1]);
    guid = argv[2];
    make_motion();
    const double found = argc == 4   ? memory()
                         : argc == 6 ? steps((Way)atoi(argv[3]), atol(argv[4]), atoi(argv[5]))
                                     : runs(argv + 3);
    fprintf(stderr, "%.12g\n", found);
    return 0;
}

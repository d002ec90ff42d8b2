/* The bare loop over any Co-Simulation FMU of FMI 2.0, outputs stored: what running it from C costs at least.
 *
 *   loop LIBRARY GUID RUNS SAMPLES STEP INPUTS OUTPUTS INSTANCES
 *
 * INSTANCES go side by side, each as one alone. INPUTS and OUTPUTS are value references with commas. Reads the inputs, SAMPLES rows, from stdin as doubles; writes the
 * outputs of the last run's last instance to stdout likewise, and the seconds that all runs took to stderr. Between runs the instance is
 * reset. */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "fmi2FunctionTypes.h"

static void log_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String message, ...) {
    (void)environment, (void)name, (void)status, (void)category;
    fprintf(stderr, "%s\n", message);
}

static size_t references(const char *text, fmi2ValueReference *vr) {
    size_t n = 0;
    for (char *end; *text != '\0'; text = *end == ',' ? end + 1 : end) vr[n++] = (fmi2ValueReference)strtoul(text, &end, 10);
    return n;
}

static void need(int holds, const char *what) {
    if (holds) return;
    fprintf(stderr, "%s\n", what);
    exit(1);
}

#define FIND(name) name##TYPE *name = (name##TYPE *)dlsym(library, #name); need(name != NULL, #name)

int main(int argc, char **argv) {
    need(argc == 9, "loop LIBRARY GUID RUNS SAMPLES STEP INPUTS OUTPUTS INSTANCES");
    void *library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    need(library != NULL, "the library cannot be loaded");
    FIND(fmi2Instantiate);
    FIND(fmi2SetupExperiment);
    FIND(fmi2EnterInitializationMode);
    FIND(fmi2ExitInitializationMode);
    FIND(fmi2SetReal);
    FIND(fmi2GetReal);
    FIND(fmi2DoStep);
    FIND(fmi2Terminate);
    FIND(fmi2Reset);
    FIND(fmi2FreeInstance);
    const size_t runs = strtoul(argv[3], NULL, 10), samples = strtoul(argv[4], NULL, 10), n = strtoul(argv[8], NULL, 10);
    const double h = atof(argv[5]);
    fmi2ValueReference in[64], out[64];
    const size_t n_in = references(argv[6], in), n_out = references(argv[7], out);
    double *inputs = malloc(samples * n_in * sizeof *inputs), *outputs = malloc(runs * n * samples * n_out * sizeof *outputs);
    fmi2Component *all = malloc(n * sizeof *all);
    need(inputs != NULL && outputs != NULL && all != NULL, "there is not enough memory");
    need(fread(inputs, sizeof *inputs, samples * n_in, stdin) == samples * n_in, "inputs are missing");

    const fmi2CallbackFunctions callbacks = {log_message, calloc, free, NULL, NULL};
    for (size_t i = 0; i < n; i++) {
        all[i] = fmi2Instantiate("loop", fmi2CoSimulation, argv[2], "", &callbacks, fmi2False, fmi2False);
        need(all[i] != NULL, "there is no instance");
    }
    struct timespec begin, end;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (size_t run = 0; run < runs; run++) {
        int failed = 0;
        for (size_t i = 0; i < n; i++) {
            failed |= run > 0 && fmi2Reset(all[i]) > fmi2Warning;
            failed |= fmi2SetupExperiment(all[i], fmi2False, 0.0, 0.0, fmi2False, 0.0) > fmi2Warning;
            failed |= fmi2EnterInitializationMode(all[i]) > fmi2Warning;
            failed |= fmi2SetReal(all[i], in, n_in, inputs) > fmi2Warning;
            failed |= fmi2ExitInitializationMode(all[i]) > fmi2Warning;
        }
        double *row = outputs + run * n * samples * n_out;
        for (size_t k = 0; k < samples; k++)
            for (size_t i = 0; i < n; i++, row += n_out) {
                failed |= fmi2SetReal(all[i], in, n_in, inputs + k * n_in) > fmi2Warning;
                failed |= fmi2GetReal(all[i], out, n_out, row) > fmi2Warning;
                if (k + 1 < samples) failed |= fmi2DoStep(all[i], (double)k * h, h, fmi2True) > fmi2Warning;
            }
        for (size_t i = 0; i < n; i++) failed |= fmi2Terminate(all[i]) > fmi2Warning;
        need(!failed, "a call was refused");
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    fprintf(stderr, "%.9f\n", (double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec));
    const double *last = outputs + (runs - 1) * n * samples * n_out + (n - 1) * n_out;
    for (size_t k = 0; k < samples; k++) fwrite(last + k * n * n_out, sizeof *last, n_out, stdout);
    for (size_t i = 0; i < n; i++) fmi2FreeInstance(all[i]);
    return 0;
}

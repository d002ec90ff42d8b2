/* The bare loop over any Co-Simulation FMU of FMI 2.0, outputs stored: what running it from C costs at least.
 *
 *   loop LIBRARY GUID RUNS SAMPLES STEP INPUTS OUTPUTS
 *
 * INPUTS and OUTPUTS are value references with commas. Reads the inputs, SAMPLES rows, from stdin as doubles; writes the
 * outputs of the last run to stdout likewise, and the seconds that all runs took to stderr. Between runs the instance is
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
    need(argc == 8, "loop LIBRARY GUID RUNS SAMPLES STEP INPUTS OUTPUTS");
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
    const size_t runs = strtoul(argv[3], NULL, 10), samples = strtoul(argv[4], NULL, 10);
    const double h = atof(argv[5]);
    fmi2ValueReference in[64], out[64];
    const size_t n_in = references(argv[6], in), n_out = references(argv[7], out);
    double *inputs = malloc(samples * n_in * sizeof *inputs), *outputs = malloc(runs * samples * n_out * sizeof *outputs);
    need(inputs != NULL && outputs != NULL, "there is not enough memory");
    need(fread(inputs, sizeof *inputs, samples * n_in, stdin) == samples * n_in, "inputs are missing");

    const fmi2CallbackFunctions callbacks = {log_message, calloc, free, NULL, NULL};
    fmi2Component c = fmi2Instantiate("loop", fmi2CoSimulation, argv[2], "", &callbacks, fmi2False, fmi2False);
    need(c != NULL, "there is no instance");
    struct timespec begin, end;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (size_t run = 0; run < runs; run++) {
        int failed = run > 0 && fmi2Reset(c) > fmi2Warning;
        failed |= fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) > fmi2Warning;
        failed |= fmi2EnterInitializationMode(c) > fmi2Warning;
        failed |= fmi2SetReal(c, in, n_in, inputs) > fmi2Warning;
        failed |= fmi2ExitInitializationMode(c) > fmi2Warning;
        double *row = outputs + run * samples * n_out;
        for (size_t k = 0; k < samples; k++, row += n_out) {
            failed |= fmi2SetReal(c, in, n_in, inputs + k * n_in) > fmi2Warning;
            failed |= fmi2GetReal(c, out, n_out, row) > fmi2Warning;
            if (k + 1 < samples) failed |= fmi2DoStep(c, (double)k * h, h, fmi2True) > fmi2Warning;
        }
        failed |= fmi2Terminate(c) > fmi2Warning;
        need(!failed, "a call was refused");
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    fprintf(stderr, "%.9f\n", (double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec));
    fwrite(outputs + (runs - 1) * samples * n_out, sizeof *outputs, samples * n_out, stdout);
    fmi2FreeInstance(c);
    return 0;
}

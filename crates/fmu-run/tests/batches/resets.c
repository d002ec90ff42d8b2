/* An FMU for Co-Simulation, y' = gain * u + bias. Its guid {MANNER:FILE} selects what survives a reset, and whether a reset
 * fails. For each new instance (+), reset (r) and freed instance (-), the FMU writes a character to FILE. */
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi2Functions.h"

typedef struct {
    char manner[32];
    int file;
    double u, y, factor, bias, gain, fails;
    int steps;
} Instance;

static void record(const Instance *i, const char *character) {
    if (write(i->file, character, 1) != 1) abort();
}

static int has_manner(const Instance *i, const char *manner) { return strstr(i->manner, manner) != NULL; }

static void set_defaults(Instance *i) {
    i->u = i->y = i->bias = i->gain = 0, i->factor = 1, i->fails = -1, i->steps = 0;
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    (void)name, (void)type, (void)resources, (void)callbacks, (void)visible, (void)logging;
    const char *end = strchr(guid, ':');
    Instance *i = calloc(1, sizeof *i);
    if (i == NULL || end == NULL || end - guid > 31) return NULL;
    memcpy(i->manner, guid + 1, (size_t)(end - guid - 1));
    char path[4096] = "";
    strncpy(path, end + 1, sizeof path - 1);
    path[strlen(path) - 1] = 0;
    i->file = open(path, O_WRONLY | O_CREAT | O_APPEND, 0600);
    if (i->file < 0) return NULL;
    set_defaults(i);
    record(i, "+");
    return i;
}

void fmi2FreeInstance(fmi2Component c) {
    Instance *i = c;
    record(i, "-");
    close(i->file);
    free(i);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start, fmi2Boolean has_stop,
                               fmi2Real stop) {
    (void)c, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c != NULL ? fmi2OK : fmi2Error; }

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *i = c;
    /* With "derived", the gain is calculated from the parameter only once, so that the first gain survives a reset. */
    if (!has_manner(i, "derived") || i->gain == 0) i->gain = 2 * i->factor;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) { return c != NULL ? fmi2OK : fmi2Error; }

fmi2Status fmi2Reset(fmi2Component c) {
    Instance *i = c, old = *i;
    record(i, "r");
    if (has_manner(i, "no reset")) return fmi2Error;
    set_defaults(i);
    if (has_manner(i, "state")) i->y = old.y;
    if (has_manner(i, "parameter")) i->bias = old.bias;
    if (has_manner(i, "derived")) i->gain = old.gain;
    return fmi2OK;
}

static double *variable(Instance *i, fmi2ValueReference vr) {
    double *all[] = {&i->u, &i->y, &i->factor, &i->bias, &i->fails};
    return all[vr];
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    for (size_t k = 0; k < n; k++) *variable(c, vr[k]) = value[k];
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    for (size_t k = 0; k < n; k++) value[k] = *variable(c, vr[k]);
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean no_set_state) {
    (void)time, (void)no_set_state;
    Instance *i = c;
    if (i->steps++ == (int)i->fails) return fmi2Error;
    i->y += size * (i->gain * i->u + i->bias);
    return fmi2OK;
}

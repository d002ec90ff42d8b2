/* An FMU for Co-Simulation whose parameter `behaviour` selects how it misbehaves. It lacks the optional functions. COMPLETE adds
 * them for FMPy, which only loads FMUs with all functions; they return errors. Some behaviours log the reason of an error only if
 * logging is on. */
#define _POSIX_C_SOURCE 199309L
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2Functions.h"

enum { BEHAVIOUR, COUNT, FLAG, SLOPE, Y, INSTANCES, LABEL, LOGGED };
enum { GOOD, SILENT_ERROR, PENDING, FATAL, DISCARD, NO_STATUS, NO_RESET, WARNING,
       ENDS_BETWEEN, ENDS_AT_POINT, NO_TERMINATE, NO_START, ERROR_IF_LOGGING, FATAL_IF_LOGGING, SLOW_IF_LOGGING };

typedef struct {
    fmi2CallbackFunctions callbacks;
    int behaviour, count, flag, logging;
    double slope, y, time;
    char label[64];
} Instance;

/* The number of instances now, the largest number until now, and the number of steps with logging on. */
static int alive, most, logged_steps;

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

static void set_defaults(Instance *i) {
    i->behaviour = GOOD, i->count = 3, i->flag = 0, i->slope = 1.0, i->y = 0.0;
    strcpy(i->label, "none");
}

static void log_message(const Instance *i, fmi2Status status, const char *text) {
#ifdef COMPLETE
    if (status == fmi2OK) return; /* FMPy would print it. */
#endif
    i->callbacks.logger(i->callbacks.componentEnvironment, "faulty_fmu", status, "logAll", text, "half");
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    (void)name, (void)resources, (void)visible;
    if (type != fmi2CoSimulation || strcmp(guid, "{faulty_fmu}") != 0) {
        if (logging && guid[1] != 'm')
            callbacks->logger(callbacks->componentEnvironment, "x", fmi2Error, "e", "the guid is of another FMU");
        return NULL;
    }
    Instance *i = calloc(1, sizeof *i);
    if (i == NULL) return NULL;
    i->callbacks = *callbacks, i->logging = logging;
    set_defaults(i);
    log_message(i, fmi2OK, "here I am");
    if (++alive > most) most = alive;
    return i;
}

void fmi2FreeInstance(fmi2Component c) {
    if (c != NULL) alive--;
    free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop) {
    (void)c, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c != NULL ? fmi2OK : fmi2Error; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *i = c;
    if (i->behaviour == NO_START) return fmi2Error;
    log_message(i, fmi2OK, "ready");
    return fmi2OK;
}
fmi2Status fmi2Terminate(fmi2Component c) { return ((Instance *)c)->behaviour != NO_TERMINATE ? fmi2OK : fmi2Error; }

fmi2Status fmi2Reset(fmi2Component c) {
    Instance *i = c;
    if (i->behaviour == NO_RESET) return fmi2Error;
    set_defaults(i);
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) *(vr[k] == BEHAVIOUR ? &i->behaviour : &i->count) = value[k];
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) {
    (void)vr;
    for (size_t k = 0; k < n; k++) ((Instance *)c)->flag = value[k];
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    (void)vr;
    for (size_t k = 0; k < n; k++) ((Instance *)c)->slope = value[k];
    return fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) {
    (void)vr;
    for (size_t k = 0; k < n; k++) strncpy(((Instance *)c)->label, value[k], 63);
    return fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
    (void)vr;
    for (size_t k = 0; k < n; k++) value[k] = ((Instance *)c)->label;
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) value[k] = vr[k] == Y ? i->y + (double)strlen(i->label) : i->slope;
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++)
        value[k] = vr[k] == INSTANCES ? most : vr[k] == LOGGED ? logged_steps : vr[k] == BEHAVIOUR ? i->behaviour : i->count;
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) {
    (void)vr;
    for (size_t k = 0; k < n; k++) value[k] = ((Instance *)c)->flag;
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean no_set_state) {
    (void)no_set_state;
    Instance *i = c;
    logged_steps += i->logging;
    if (i->logging && i->behaviour >= ERROR_IF_LOGGING) {
        if (time < 0.45) log_message(i, fmi2Error, "not the reason");
        else log_message(i, fmi2OK, "the pump ran dry");
    }
    if (i->behaviour == SLOW_IF_LOGGING && i->logging) nanosleep(&(struct timespec){.tv_nsec = 300000000}, NULL);
    double reached = time + (i->behaviour == ENDS_BETWEEN && time > 0.45 ? 0.25 * size : size);
    i->y += i->slope * (reached - time);
    i->time = reached;
    if (time < 0.45 && i->behaviour == PENDING) {
        log_message(i, fmi2Warning, "not the reason");
        return fmi2Warning;
    }
    if (time < 0.45) return fmi2OK;
    switch (i->behaviour) {
    case SILENT_ERROR: return fmi2Error;
    case PENDING: return fmi2Pending;
    case FATAL: return fmi2Fatal;
    case NO_STATUS: return (fmi2Status)77;
    case WARNING: log_message(i, fmi2Warning, "a warning"); return fmi2Warning;
    case DISCARD: log_message(i, fmi2Discard, "no more of this after %s"); return fmi2Discard;
    case ENDS_BETWEEN: log_message(i, fmi2Discard, "the tank is empty"); return fmi2Discard;
    case ENDS_AT_POINT: return fmi2Discard;
    case ERROR_IF_LOGGING:
    case SLOW_IF_LOGGING: return fmi2Error;
    case FATAL_IF_LOGGING: return fmi2Fatal;
    }
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    int behaviour = ((Instance *)c)->behaviour;
    *value = behaviour == ENDS_BETWEEN || behaviour == ENDS_AT_POINT;
    return kind == fmi2Terminated ? fmi2OK : fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    *value = ((Instance *)c)->time;
    return kind == fmi2LastSuccessfulTime ? fmi2OK : fmi2Discard;
}

#ifdef COMPLETE
#define REJECTED(function, ...) \
    fmi2Status function(__VA_ARGS__) { return fmi2Error; }
#pragma GCC diagnostic ignored "-Wunused-parameter"
REJECTED(fmi2SetDebugLogging, fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
REJECTED(fmi2GetFMUstate, fmi2Component c, fmi2FMUstate *state)
REJECTED(fmi2SetFMUstate, fmi2Component c, fmi2FMUstate state)
REJECTED(fmi2FreeFMUstate, fmi2Component c, fmi2FMUstate *state)
REJECTED(fmi2SerializedFMUstateSize, fmi2Component c, fmi2FMUstate state, size_t *size)
REJECTED(fmi2SerializeFMUstate, fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
REJECTED(fmi2DeSerializeFMUstate, fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
REJECTED(fmi2GetDirectionalDerivative, fmi2Component c, const fmi2ValueReference unknown[], size_t n_unknown,
        const fmi2ValueReference known[], size_t n_known, const fmi2Real seed[], fmi2Real value[])
REJECTED(fmi2SetRealInputDerivatives, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
        const fmi2Real value[])
REJECTED(fmi2GetRealOutputDerivatives, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
        fmi2Real value[])
REJECTED(fmi2CancelStep, fmi2Component c)
REJECTED(fmi2GetStatus, fmi2Component c, const fmi2StatusKind kind, fmi2Status *value)
REJECTED(fmi2GetIntegerStatus, fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
REJECTED(fmi2GetStringStatus, fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
#endif

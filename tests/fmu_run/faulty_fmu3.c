/* An FMU for FMI 3.0 whose parameter selects how its steps from 0.5 s on end, or that fmi3Terminate fails. */
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

enum { GOOD, ENDS_BETWEEN, ENDS_AT_POINT, RETURNS_EARLY, NO_TERMINATE, ERROR_IF_LOGGING };

typedef struct {
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3Boolean logging;
    int behaviour;
    double y;
} Instance;

const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    (void)name, (void)token, (void)resources, (void)visible, (void)events, (void)early, (void)required, (void)n, (void)update;
    Instance *i = calloc(1, sizeof *i);
    if (i != NULL) i->environment = environment, i->log = log, i->logging = logging;
    return i;
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean has_stop, fmi3Float64 stop) {
    (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return c != NULL ? fmi3OK : fmi3Error;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return c != NULL ? fmi3OK : fmi3Error; }
fmi3Status fmi3Terminate(fmi3Instance c) { return ((Instance *)c)->behaviour != NO_TERMINATE ? fmi3OK : fmi3Fatal; }

fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int32 value[], size_t nv) {
    (void)vr, (void)n, (void)nv;
    ((Instance *)c)->behaviour = value[0];
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 value[], size_t nv) {
    (void)vr, (void)n, (void)nv;
    value[0] = ((Instance *)c)->y;
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 size, fmi3Boolean no_set_state, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
    (void)no_set_state;
    Instance *i = c;
    int late = time > 0.45, behaviour = late ? i->behaviour : GOOD;
    *event = fmi3False;
    *terminate = behaviour == ENDS_BETWEEN || behaviour == ENDS_AT_POINT;
    *early = behaviour == ENDS_BETWEEN || behaviour == RETURNS_EARLY;
    *reached = time + (*early ? 0.25 * size : size);
    i->y = *reached;
    if (behaviour != ERROR_IF_LOGGING) return fmi3OK;
    if (i->logging) i->log(i->environment, fmi3Error, "logStatusError", "the pump ran dry");
    return fmi3Error;
}
